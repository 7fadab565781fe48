"""The independent path's own parts: against what they are replaced by, or a closed form."""

from math import gamma

import independent_droplets as droplets
import independent_ice as ice
import independent_mie as mie
import independent_single_scattering as single
import miepython
import numpy as np
import pytest
from cdisort import cdisort_brf
from independent_plumes import index

from abi_operator.bands import BANDS
from abi_operator.optics import water


@pytest.mark.parametrize("species", ["smoke", "ash", "dust"])
def test_mie_theory_is_miepythons(species):
    """Sphere by sphere; below a size parameter of 0.1 miepython has an approximation."""
    radius, wavelength = np.geomspace(0.02, 20.0, 25), BANDS["C02"].wavelength_um
    x = 2 * np.pi * radius / wavelength
    of_band = index(species, "C02")
    q_ext, q_sca, _, asymmetry = miepython.efficiencies_mx(of_band, x)
    found = mie.sphere_efficiencies(of_band, radius, wavelength)
    np.testing.assert_allclose(found, [q_ext, q_sca, q_sca * asymmetry], rtol=1e-10)


def test_phase_functions_are_miepythons():
    cosine, wavelength = np.linspace(-1.0, 1.0, 9), 2 * np.pi
    for x in (0.5, 5.0, 60.0):
        spheres = 1.5 - 0.01j, np.array([x]), wavelength, np.ones((1, 1))
        moments, phase = mie.phase_functions(*spheres, cosine, 20)
        expected = miepython.i_unpolarized(spheres[0], x, cosine, norm="4pi")
        np.testing.assert_allclose(phase[0], expected, rtol=1e-10)
        _, _, _, asymmetry = miepython.efficiencies_mx(spheres[0], x)
        np.testing.assert_allclose(moments[0, 1], asymmetry, rtol=1e-10)


def test_asymmetry_of_droplets_is_that_of_mie_theory():
    """Numbers read from the package, to the five digits that they have, at three sizes.

    On its spheres, as any fewer move them by 6e-5: resonances of water are narrow.
    """
    spheres = np.geomspace(0.05, 500.0, 40000) / 2
    spheres = spheres[spheres < 110]
    for band in BANDS:
        of_band, wavelength = water.REFRACTIVE_INDEX[band], BANDS[band].wavelength_um
        _, q_sca, directed = mie.sphere_efficiencies(of_band, spheres, wavelength)
        for radius in (5.0, 10.0, 20.0):
            slope = (droplets.NU + 3) / radius  # of radii
            area = np.exp((droplets.NU + 3) * np.log(spheres) - slope * spheres)
            expected = (area @ directed) / (area @ q_sca)
            listed = water.ASYMMETRY[band][water.EFFECTIVE_RADIUS_UM.index(radius)]
            np.testing.assert_allclose(listed, expected, atol=6e-6, rtol=0, err_msg=band)


def test_sums_over_sizes_have_converged():
    """Means of powers of diameter are ratios of gamma functions."""
    for nu, power, expected in ((7.0, 3, 8 * 9 * 10), (0.0, 2, 2), (6.4, 1, 7.4)):
        found = droplets.gamma_mean(lambda d, power=power: d**power, nu)
        np.testing.assert_allclose(found, expected, rtol=1e-13)


def test_photon_path_of_columns_in_closed_form():
    """Of an exponential distribution, by gamma functions, in centimetres and grams."""
    (alpha, beta), (area, sigma) = ice.COLUMNS
    slope = 1 / 100e-4
    path = alpha * gamma(1 + beta) * slope ** (sigma - beta) / (0.917 * area * gamma(1 + sigma))
    found, shape = ice.photon_paths(100.0)
    np.testing.assert_allclose(found, 1e4 * path, rtol=1e-12)
    k, p = 1 + sigma, beta - sigma
    variance = gamma(k + 2 * p) * gamma(k) / gamma(k + p) ** 2 - 1
    np.testing.assert_allclose(shape, 1 / variance - 3, rtol=1e-11)


def test_correction_is_that_of_cdisort():
    rng = np.random.default_rng(1988)
    tau, ssa, g = rng.uniform(0.01, 2, 6), rng.uniform(0.5, 0.99, 6), rng.uniform(0.2, 0.85, 6)
    moments, angles = g[:, None] ** np.arange(300), (0.6, 0.75, 1.0)
    cosine = single.cos_scattering(*angles)
    phase = (1 - g**2) / (1 + g**2 - 2 * g * cosine) ** 1.5
    plain = cdisort_brf(tau, ssa, moments, 0.2, *angles, 8, False)
    more = single.correction(tau, ssa, moments, phase, *angles, 8)
    corrected = cdisort_brf(tau, ssa, moments, 0.2, *angles, 8, True)
    np.testing.assert_allclose(plain + more, corrected, rtol=1e-12)
