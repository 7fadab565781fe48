"""The fits of Fu (1996), and their ends."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.bands import BANDS
from abi_operator.optics.ice import (
    ROUGHENED_ASYMMETRY,
    fitted_size,
    ice_asymmetry,
    ice_coalbedo,
    ice_mass_extinction,
)
from abi_operator.optics.ice_tables import FU, FU_RANGE_UM, ICE_INDEX

# At a generalized effective size of 60 um, by hand from the coefficients; last digits as printed.
ASYMMETRY_60 = {
    "C01": (0.798, 5e-4),
    "C02": (0.803, 5e-4),
    "C03": (0.806, 5e-4),
    "C04": (0.813, 5e-4),
    "C05": (0.841, 5e-4),
    "C06": (0.852, 5e-4),
}
COALBEDO_60 = {
    "C03": (1.0e-4, 5e-6),
    "C04": (5.4e-3, 5e-5),
    "C05": (0.091, 5e-4),
    "C06": (0.061, 5e-4),
}


@pytest.mark.parametrize("band", ASYMMETRY_60)
def test_asymmetry_at_60_um(band):
    value, digit = ASYMMETRY_60[band]
    np.testing.assert_allclose(
        ice_asymmetry(jnp.asarray(60.0), FU[band]), value, rtol=0, atol=digit
    )


@pytest.mark.parametrize("band", COALBEDO_60)
def test_coalbedo_at_60_um(band):
    value, digit = COALBEDO_60[band]
    np.testing.assert_allclose(ice_coalbedo(jnp.asarray(60.0), FU[band]), value, rtol=0, atol=digit)


@pytest.mark.parametrize("band", BANDS)
def test_extinction_is_that_of_large_particles(band):
    """Q = 2 makes the mass extinction 2 A / M = 4 / (sqrt 3 rho D), 42 m2 kg-1 at 60 um."""
    np.testing.assert_allclose(
        ice_mass_extinction(jnp.asarray(60.0), FU[band]), 4 / (3**0.5 * 917 * 60e-6), rtol=0.005
    )


@pytest.mark.parametrize("band", BANDS)
def test_fits_are_cubics_inside_and_tend_to_their_ends(band):
    size = np.array([25.0, 40.0, 125.0])
    np.testing.assert_allclose(
        ice_asymmetry(jnp.asarray(size), FU[band]),
        np.polynomial.polynomial.polyval(size, FU[band].asymmetry),
        rtol=1e-13,
    )
    ends = np.polynomial.polynomial.polyval(np.array(FU_RANGE_UM), FU[band].asymmetry)
    beyond = ice_asymmetry(jnp.asarray([1e-3, 1e4]), FU[band])
    np.testing.assert_allclose(beyond, ends, rtol=0, atol=5e-4)
    assert np.all(ice_coalbedo(jnp.geomspace(1.0, 1e4, 60), FU[band]) > 0)


def test_bend_is_smooth_and_monotone():
    slope_of = jax.jit(jax.vmap(jax.grad(fitted_size)))
    nearby = [node + side for node in (25.0, 125.0) for side in (-1e-7, 1e-7)]
    slope = slope_of(jnp.asarray([*nearby, *np.linspace(1.0, 300.0, 3000)]))
    assert np.all(np.isfinite(slope)) and np.all(slope >= 0) and np.all(slope <= 1)
    np.testing.assert_allclose(slope[:4], 1.0, rtol=0, atol=1e-7)
    # The end is approached from inside: at it the bend is 5 um / e away.
    np.testing.assert_allclose(fitted_size(jnp.asarray(20.0)), 20 + 5 / np.e, rtol=1e-12)


def test_index_is_given_in_every_band():
    assert set(ICE_INDEX) == set(FU) == set(BANDS)
    # Ice absorbs most in C07 and, of all bands, least in the blue.
    absorption = {band: -index.imag for band, index in ICE_INDEX.items()}
    assert max(absorption, key=lambda band: absorption[band]) == "C07"
    assert min(absorption, key=lambda band: absorption[band]) == "C01"


def test_rough_crystals_scatter_less_forwards():
    smooth = [float(ice_asymmetry(jnp.asarray(size), FU["C02"])) for size in (25.0, 60.0, 120.0)]
    assert all(ROUGHENED_ASYMMETRY < g for g in smooth)


@pytest.mark.float32
@pytest.mark.parametrize("function", [ice_asymmetry, ice_coalbedo, ice_mass_extinction])
def test_float32_stays(function):
    size = np.array([5.0, 22.0, 60.0, 128.0, 400.0])
    value = function(jnp.asarray(size, jnp.float32), FU["C05"])
    assert value.dtype == jnp.float32
    np.testing.assert_allclose(value, function(jnp.asarray(size), FU["C05"]), rtol=2e-6)
