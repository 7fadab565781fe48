"""CDISORT as a radiance with thermal sources, and the temperatures that it has to be given.

CDISORT knows Planck's function integrated over wavenumbers and not over the response of a band. It
is given an interval of 1 cm-1 at the centroid of the band and, in place of each temperature, the
one at which its Planck function there equals the in-band one, in units of `UNIT`.
"""

import nanodisort
import numpy as np

# In-band Planck function: fk1 [mW m-2 sr-1 (cm-1)-1], fk2 [K], bc1 [K], bc2, radiance in
# W m-2 sr-1 um-1 that makes 1 mW m-2 sr-1 (cm-1)-1: GOES-16, of its L1b files in C07 and fitted to
# the response in C05 and C06.
PLANCK = {
    "C05": (2859506.5, 8942.2746, 0.407319, 0.9998055, 3.861254),
    "C06": (1056397.9, 6416.4303, 0.132564, 0.9999200, 1.988416),
    "C07": (202263.0, 3698.19, 0.43361, 0.99939, 0.660195),
}
# Solar irradiance of GOES-16 at 1 AU. [W m-2 um-1]
IRRADIANCE = {"C05": 242.54037, "C06": 76.8999, "C07": 9.69}
# Middle of CDISORT's interval of 1 cm-1: near the band, so that temperatures stay what they are.
WAVENUMBER = {"C05": 6213.0, "C06": 4459.0, "C07": 2568.0}
# Constants of CDISORT: Stefan and Boltzmann's [W m-2 K-4], second radiation constant [cm K].
SIGMA, SECOND = 5.67032e-8, 1.438786
# In CDISORT radiances are per wavenumber. [W m-2 sr-1 um-1 for 1 W m-2 sr-1 (cm-1)-1]
UNIT = {band: 1e3 * numbers[-1] for band, numbers in PLANCK.items()}


def in_band(temperature, band):
    """In-band Planck function. [K], [W m-2 sr-1 um-1]"""
    fk1, fk2, bc1, bc2, factor = PLANCK[band]
    return factor * fk1 / np.expm1(fk2 / (bc1 + bc2 * np.asarray(temperature)))


def cdisort_planck(temperature, band):
    """Planck function of CDISORT over its interval, in closed form. [K], [W m-2 sr-1 (cm-1)-1]"""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    nu = WAVENUMBER[band] + 0.5 * nodes
    x = SECOND * nu / np.asarray(temperature)[..., None]
    each = 15 / np.pi**5 * SIGMA * SECOND**4 * nu**3 / np.expm1(x)
    return each @ weights / 2


def cdisort_temperature(radiance, band):
    """Temperature whose `cdisort_planck` is a radiance. [W m-2 sr-1 um-1], [K]

    Steps of Newton in the logarithm against the inverse temperature, in which it is all but linear.
    """
    wanted = np.log(np.asarray(radiance) / UNIT[band])
    inverse = np.full(wanted.shape, 1 / 500.0)
    for _ in range(8):
        value, slope = (np.log(cdisort_planck(1 / x, band)) for x in (inverse, inverse * 1.0001))
        inverse = inverse - (value - wanted) * 1e-4 * inverse / (slope - value)
    return 1 / inverse


def cdisort_radiance(layers, band, planck_levels, ground, num_streams, sunlight, corrected):
    """Radiance of one column at the top. [W m-2 sr-1 um-1]

    Parameters
    ----------
    layers
        tau, ssa, moments, albedo, mu0, mu, relative azimuth, as `cdisort_brf` has them.
    band
        Name of the band.
    planck_levels
        Planck function at the levels, top first. [W m-2 sr-1 um-1]
    ground
        Planck function of a ground that emits 1 - albedo of it. [W m-2 sr-1 um-1]
    num_streams, corrected
        As `cdisort_brf` has them.
    sunlight
        Irradiance on a plane across the beam. [W m-2 um-1]
    """
    tau, ssa, moments, albedo, mu0, mu, relative_azimuth = layers
    state = nanodisort.DisortState()
    state.nstr, state.nlyr, state.nmom = num_streams, len(tau), moments.shape[1] - 1
    state.ntau = state.numu = state.nphi = 1
    state.usrtau = state.usrang = state.lamber = state.quiet = state.planck = True
    state.intensity_correction = state.old_intensity_correction = corrected
    state.allocate()
    state.dtauc, state.ssalb = np.ascontiguousarray(tau), np.ascontiguousarray(ssa)
    state.pmom = np.ascontiguousarray(moments.T)
    state.temper = cdisort_temperature(planck_levels, band)
    state.btemp = float(cdisort_temperature(ground, band))
    state.ttemp, state.temis = 0.0, 0.0
    state.wvnmlo, state.wvnmhi = WAVENUMBER[band] - 0.5, WAVENUMBER[band] + 0.5
    state.utau, state.umu = np.zeros(1), np.array([mu])
    state.phi = np.array([180 - np.degrees(relative_azimuth)])
    state.fbeam, state.umu0, state.phi0 = sunlight / UNIT[band], mu0, 0.0
    state.albedo, state.accur = albedo, 0.0
    state.solve()
    return UNIT[band] * state.uu[0, 0, 0]
