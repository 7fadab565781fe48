"""Which pictures a scene has, and what they show."""

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from abi_operator.constants import STANDARD_PRESSURE
from abi_operator.drawing import Painter, draw
from abi_operator.optics.rayleigh import STANDARD_DEPTH
from abi_operator.pictures import grey
from abi_operator.products import air_response, natural_color

SHAPE = (4, 3)
SUN, VIEW, AZIMUTH = 40.0, 55.0, 70.0


def scene(bands, albedo, *, pressure=STANDARD_PRESSURE, sun=SUN, **fields):
    """Lambertian ground under pure air, seen as `rayleigh_air` has it."""
    mu0, mu, phi = np.cos(np.radians(sun)), np.cos(np.radians(VIEW)), np.radians(AZIMUTH)
    beneath = [np.full(SHAPE, albedo) for _ in bands]
    safe = max(mu0, 0.1)
    brf = [
        air_response(band, safe, mu, phi, pressure=pressure).brf(ground)
        for band, ground in zip(bands, beneath, strict=True)
    ]
    depth = [np.full(SHAPE, STANDARD_DEPTH[b] * pressure / STANDARD_PRESSURE) for b in bands]
    angles = {"solar_zenith": sun, "view_zenith": VIEW, "relative_azimuth": AZIMUTH}
    variables = {"brf": ("band", "y", "x"), "rayleigh_optical_depth": ("band", "y", "x")}
    values = {"brf": np.stack(brf), "rayleigh_optical_depth": np.stack(depth)}
    dataset = xr.Dataset({n: (dims, values[n]) for n, dims in variables.items()})
    for name, angle in angles.items():
        dataset[f"{name}_angle"] = ("y", "x"), np.full(SHAPE, angle)
    for name, values in fields.items():
        dataset[name] = ("y", "x"), values
    return dataset.assign_coords(band=list(bands))


@pytest.mark.parametrize("pressure", [STANDARD_PRESSURE, 60000.0])
def test_natural_colours_are_those_of_the_ground(pressure):
    """Over mountains, too, where there is less air above."""
    image = scene(("C01", "C02", "C03", "C06"), 0.2, pressure=pressure)
    pictures = draw(image)
    assert list(pictures) == ["natural_color"]
    ground = natural_color(dict.fromkeys(("C01", "C02", "C03"), np.full(SHAPE, 0.2)))
    np.testing.assert_allclose(pictures["natural_color"], ground, atol=1e-9)
    hazy = draw(image, rayleigh_correction=False)["natural_color"]
    brf = {band: image["brf"].sel(band=band).values for band in ("C01", "C02", "C03")}
    np.testing.assert_array_equal(hazy, natural_color(brf))
    assert (hazy[..., 2] > pictures["natural_color"][..., 2] + 0.03).all()  # blue haze


def test_what_is_seen_at_sunrise_is_drawn_and_what_is_missing_is_not():
    image = scene(("C01", "C02", "C03"), 0.2, sun=88.0)
    image["brf"][:, 0, 0] = np.nan
    picture = draw(image)["natural_color"]
    assert np.isnan(picture[0, 0]).all() and np.isfinite(picture[1:]).all()


def test_a_band_alone_is_grey_and_c07_beside_it():
    image = scene(("C02",), 0.2, brightness_temperature=np.full(SHAPE, 270.0))
    image["brf"][0, 0, :2] = [np.nan, -0.01]
    pictures = draw(image)
    assert list(pictures) == ["C02", "C07"]
    assert np.isnan(pictures["C02"][0, 0]).all() and (pictures["C02"][0, 1] == 0).all()
    shade = np.sqrt(image["brf"].values[0, 1, 1])
    np.testing.assert_allclose(pictures["C02"][1:], shade)
    np.testing.assert_array_equal(pictures["C07"], grey(np.full(SHAPE, 270.0), 320.0, 220.0))


def test_two_bands_of_three_are_grey_each():
    assert list(draw(scene(("C01", "C03"), 0.2))) == ["C01", "C03"]


def test_a_time_is_drawn_when_its_last_rows_have_come(tmp_path):
    times = np.array(["2007-10-23T18:00:00", "2007-10-23T18:30:00"], "datetime64[ns]")
    painter = Painter(tmp_path, times, SHAPE[0])
    dark, bright = scene(("C02",), 0.0), scene(("C02",), 0.5)
    dark["brf"][:, 3] = np.nan  # the northernmost row
    for time, image in enumerate((dark, bright)):
        for rows in (slice(2, 4), slice(0, 2)):
            assert len(painter.names) == time
            painter.add(time, rows, image.isel(y=rows))
    assert painter.names == ["C02_2007-10-23T180000.png", "C02_2007-10-23T183000.png"]
    first, second = (np.asarray(Image.open(tmp_path / name)) for name in painter.names)
    assert (first[:128, :, 3] == 0).all() and (first[128:, :, 3] == 255).all()
    assert (second[200] > first[200, :, :3]).all()


def test_a_picture_of_nothing_is_warned_of(tmp_path):
    painter = Painter(tmp_path, np.array(["2007-10-23T06:00"], "datetime64[ns]"), SHAPE[0])
    image = scene(("C02",), 0.2)
    image["brf"][:] = np.nan  # by night
    with pytest.warns(UserWarning, match="C02_2007-10-23T060000.png is empty: it shows"):
        painter.add(0, slice(0, 4), image)
