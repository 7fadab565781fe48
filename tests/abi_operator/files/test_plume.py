"""The reader of plume pictures: orientation, depths of grey and what is refused."""

import numpy as np
import pytest
from PIL import Image

from abi_operator.files import InputError, read_plume

GREY = np.array([[0, 51, 102], [153, 204, 255]], np.uint8)
SOUTH_FIRST = np.array([[0.6, 0.8, 1.0], [0.0, 0.2, 0.4]])


@pytest.fixture
def save(tmp_path):
    def save(picture, name="plume.png", **options):
        path = tmp_path / name
        image = picture if isinstance(picture, Image.Image) else Image.fromarray(picture)
        image.save(path, **options)
        return path

    return save


def test_top_of_the_picture_is_north(save):
    brightness = read_plume(save(GREY), (2, 3))
    assert brightness.dtype == np.float64
    np.testing.assert_array_equal(brightness, SOUTH_FIRST)


def test_sixteen_bits_are_kept(save):
    fine = GREY.astype(np.uint16) * 257
    fine[0, 0] = 1
    brightness = read_plume(save(fine), (2, 3))
    assert brightness[1, 0] == 1 / 65535
    np.testing.assert_allclose(brightness[0], SOUTH_FIRST[0])


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "LA", "P"])
def test_colour_that_is_grey_and_alpha_that_is_opaque_are_accepted(save, mode):
    path = save(Image.fromarray(GREY).convert(mode))
    np.testing.assert_array_equal(read_plume(path, (2, 3)), SOUTH_FIRST)


def test_colour_is_refused(save):
    coloured = np.stack([GREY, GREY, GREY // 2], axis=-1)
    with pytest.raises(InputError, match="plume.png is coloured; save it as greyscale PNG"):
        read_plume(save(coloured), (2, 3))


def test_transparency_is_refused(save):
    image = Image.fromarray(GREY).convert("RGBA")
    image.putalpha(200)
    with pytest.raises(InputError, match="plume.png is partly transparent"):
        read_plume(save(image), (2, 3))


def test_one_transparent_grey_value_is_refused(save):
    with pytest.raises(InputError, match="plume.png is partly transparent"):
        read_plume(save(GREY, transparency=51), (2, 3))
    with pytest.raises(InputError, match="plume.png is partly transparent"):
        read_plume(save(GREY.astype(np.uint16), transparency=51), (2, 3))


def test_wrong_shape_names_both_shapes(save):
    with pytest.raises(InputError, match="is 3 x 2 pixels where the model's grid is 64 x 48; res"):
        read_plume(save(GREY), (48, 64))


def test_other_formats_are_refused(save):
    with pytest.raises(InputError, match="is a JPEG picture; save it as greyscale PNG"):
        read_plume(save(GREY, "plume.jpg"), (2, 3))


def test_what_is_no_picture_is_refused(tmp_path):
    with pytest.raises(InputError, match="absent.png does not exist"):
        read_plume(tmp_path / "absent.png", (2, 3))
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(InputError, match="text.png cannot be read as a picture"):
        read_plume(tmp_path / "text.png", (2, 3))


def test_half_a_picture_is_refused(save):
    path = save(np.random.default_rng(0).integers(0, 256, (64, 64), np.uint8))
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(InputError, match="plume.png cannot be read as a picture .*; copy it again"):
        read_plume(path, (64, 64))
