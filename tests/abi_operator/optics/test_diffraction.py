"""The lobe of diffracted light, and what is left to geometric optics."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import eval_legendre, j1

from abi_operator.bands import BANDS
from abi_operator.optics.diffraction import (
    diffracted_share,
    diffraction_asymmetry,
    geometric_asymmetry,
)
from abi_operator.optics.ice import SIZE_PER_PATH, ice_geometric_asymmetry
from abi_operator.optics.ice_tables import FU
from abi_operator.optics.phase import HenyeyGreenstein, TwoTermHenyeyGreenstein
from abi_operator.optics.rough_ice import EFFECTIVE_RADIUS_UM, rough_ice_geometric_asymmetry


def test_the_lobe_has_the_first_moments_of_a_disc():
    """Two discs of radius x, l apart, overlap by 1 - 2 l / (pi x) of their area, to first order."""
    size_parameter = 60.0
    g = float(diffraction_asymmetry(jnp.asarray(size_parameter / (2 * np.pi)), 1.0))
    degree = np.arange(13)
    u = degree / (2 * size_parameter)
    overlap = 2 / np.pi * (np.arccos(u) - u * np.sqrt(1 - u**2))
    # Second order: of 1 - overlap = 0.13 at the 12th, (2 l / (pi x))^2 / 2.
    np.testing.assert_allclose(g**degree, overlap, rtol=0, atol=0.009)


def test_the_lobe_falls_as_the_rings_of_a_disc_do():
    """Fraunhofer's pattern x^2 (2 J1(z) / z)^2, z = x sin(theta), in the mean over its rings."""
    size_parameter = 300.0
    g = diffraction_asymmetry(jnp.asarray([size_parameter / (2 * np.pi)]), 1.0)
    theta = np.linspace(0.2, 0.4, 20_001)
    z = size_parameter * theta
    rings = np.mean(size_parameter**2 * (2 * j1(z) / z) ** 2 * theta**3)
    lobe = np.asarray(HenyeyGreenstein(g)(jnp.cos(jnp.asarray(0.3))))[0] * 0.3**3
    # The chord 2 sin(theta / 2) for theta: 1 % at 0.3.
    np.testing.assert_allclose(lobe, rings, rtol=0.02)


def test_parts_make_up_the_whole():
    ssa, whole, lobe = jnp.asarray([1.0, 0.8, 0.55]), jnp.asarray([0.78, 0.86, 0.95]), 0.99
    share = diffracted_share(ssa)
    np.testing.assert_allclose(share, 0.5 / ssa, rtol=1e-14)
    rest = geometric_asymmetry(whole, ssa, jnp.full(3, lobe))
    phase = TwoTermHenyeyGreenstein(jnp.full(3, lobe), rest, share)
    np.testing.assert_allclose(phase.moments(40)[:, 1], whole, rtol=1e-12)
    np.testing.assert_array_equal(diffracted_share(jnp.asarray([0.5, 0.2])), 1.0)


def test_two_lobes_are_the_sum_of_their_moments():
    first, second, share = jnp.asarray([0.8]), jnp.asarray([-0.3]), jnp.asarray([0.6])
    phase = TwoTermHenyeyGreenstein(first, second, share)
    degree, cosine = np.arange(150), 0.35
    moments = np.asarray(phase.moments(150)[0])
    series = np.sum((2 * degree + 1) * moments * eval_legendre(degree, cosine))
    np.testing.assert_allclose(phase(jnp.asarray(cosine))[0], series, rtol=1e-12)


@pytest.mark.parametrize("band", BANDS)
def test_geometric_optics_of_crystals_is_alike_in_all_bands(band):
    """Two sources, taken apart by their own absorption: 0.52 to 0.76 where g is 0.77 to 0.95."""
    radius = jnp.asarray(EFFECTIVE_RADIUS_UM, float)
    size = radius * (4 / 3 * SIZE_PER_PATH)
    fu = np.asarray(ice_geometric_asymmetry(size, FU[band], BANDS[band].wavelength_um))
    rough = np.asarray(rough_ice_geometric_asymmetry(radius, band))
    for found in (fu, rough):
        assert found.min() > 0.52 and found.max() < 0.77
    # Where they are 0.17 apart crystals absorb nine tenths of what meets them.
    assert np.abs(fu - rough)[2:].max() < (0.18 if band == "C07" else 0.06)
