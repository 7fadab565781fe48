"""Albedo of ABI's bands from that of MODIS's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.bands import BANDS
from abi_operator.surface import MODIS_TO_ABI, modis_to_abi

NAMES = [f"Band{i}" for i in range(1, 8)]
# Vegetation and bare soil: rounded MCD43 white-sky albedos of bands 1 to 7.
GRASS = dict(zip(NAMES, [0.05, 0.30, 0.03, 0.07, 0.33, 0.22, 0.10], strict=True))
SOIL = dict(zip(NAMES, [0.22, 0.30, 0.11, 0.17, 0.38, 0.42, 0.36], strict=True))


def arrays(values, dtype=float):
    return {name: jnp.asarray(value, dtype) for name, value in values.items()}


@pytest.mark.parametrize("band", list(MODIS_TO_ABI))
def test_it_is_linear(band):
    """Mixing two grounds before or after the regression gives the same, to rounding."""
    mixed = {name: 0.3 * GRASS[name] + 0.7 * SOIL[name] for name in NAMES}
    apart = 0.3 * modis_to_abi(arrays(GRASS), band) + 0.7 * modis_to_abi(arrays(SOIL), band)
    np.testing.assert_allclose(modis_to_abi(arrays(mixed), band), apart, rtol=1e-15)


@pytest.mark.parametrize("band", list(MODIS_TO_ABI))
def test_slopes_are_the_weights_and_a_black_ground_leaves_the_constant(band):
    black = arrays(dict.fromkeys(NAMES, 0.0))
    weights, offset = MODIS_TO_ABI[band]
    assert modis_to_abi(black, band) == offset
    slopes = jax.grad(modis_to_abi)(black, band)
    assert {name: float(x) for name, x in slopes.items() if x != 0} == weights


def test_figures_of_the_regressions():
    """Worked out by hand."""
    expected = {
        "C01": 1.0057 * 0.03,
        "green": 0.07,
        "C02": 0.983 * 0.05 + 0.0018,
        "C03": 1.003 * 0.30 + 0.0009,
        "C05": 1.043 * 0.22 - 0.045 * 0.33 - 0.0021,
        "C06": 0.897 * 0.10 + 0.0745 * 0.22 + 0.0033,
    }
    for band, value in expected.items():
        np.testing.assert_allclose(modis_to_abi(arrays(GRASS), band), value, rtol=1e-14)


def test_c04_lies_on_the_line_between_its_neighbours():
    centre = (BANDS["C04"].wavelength_um - 1.24) / (1.64 - 1.24)
    line = 0.33 + centre * (0.22 - 0.33)
    np.testing.assert_allclose(modis_to_abi(arrays(GRASS), "C04"), line, rtol=1e-14)
    grey = arrays(dict.fromkeys(NAMES, 0.4))
    np.testing.assert_allclose(modis_to_abi(grey, "C04"), 0.4, rtol=1e-15)


def test_every_band_of_reflected_light_alone_has_one():
    assert list(MODIS_TO_ABI) == [name for name in BANDS if name != "C07"]


def test_type_and_shape_are_those_of_the_input():
    image = {name: jnp.full((2, 3), value, jnp.float32) for name, value in SOIL.items()}
    result = modis_to_abi(image, "C06")
    assert result.dtype == jnp.float32 and result.shape == (2, 3)


def test_missing_bands_are_named():
    with pytest.raises(ValueError, match=r"missing \['Band7'\]"):
        modis_to_abi(arrays({"Band6": 0.2}), "C06")
    with pytest.raises(ValueError, match="no regression on MODIS for band 'C07'"):
        modis_to_abi(arrays(SOIL), "C07")
