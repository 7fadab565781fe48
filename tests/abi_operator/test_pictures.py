"""Pictures on disk."""

import numpy as np
import pytest
from PIL import Image

from abi_operator.pictures import grey, write_png


def test_small_pictures_are_enlarged_with_north_at_the_top(tmp_path):
    rgb = np.zeros((2, 3, 3))
    rgb[0, 0] = [1.0, 0.5, 0.0]  # south west
    rgb[1, 2] = np.nan
    write_png(tmp_path / "a.png", rgb)
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (513, 342)
        assert image.text == {
            "Scale": "171 x 171 pixels per column of the scene, nearest neighbour"
        }
        pixels = np.asarray(image)
    assert (pixels[171:, :171] == [255, 128, 0, 255]).all()
    assert (pixels[:171, 342:] == 0).all()  # transparent, and no grey as of clouds
    assert (pixels[:171, :342] == [0, 0, 0, 255]).all()


def test_large_pictures_keep_their_size(tmp_path):
    write_png(tmp_path / "a.png", np.full((4, 600, 3), 2.0))
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (600, 4)
        assert image.mode == "RGB" and (np.asarray(image) == 255).all()


def test_a_picture_has_three_colours(tmp_path):
    with pytest.raises(ValueError, match=r"three colours, \(y, x, 3\); got rgb.shape=\(4, 6\)"):
        write_png(tmp_path / "a.png", np.zeros((4, 6)))
    assert not list(tmp_path.iterdir())


def test_grey_is_linear_and_the_cold_is_white():
    shades = grey(np.array([[330.0, 320.0, 270.0, 220.0, np.nan]]), black=320.0, white=220.0)
    assert shades.shape == (1, 5, 3)
    np.testing.assert_array_equal(shades[0, :, 1], [0, 0, 0.5, 1, np.nan])
