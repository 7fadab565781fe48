"""Ice crystals in NumPy: power laws of Mitchell (1996), efficiencies by MADA, two lobes after Fu.

Means over the sizes of crystals are sums and not gamma functions. Photon paths of crystals are
given to the theory of spheres by the gamma distribution of the same mean and variance, weighted by
area, which is the package's own closure. Its indices and Fu's coefficients are read as data.
"""

import numpy as np
from independent_droplets import gamma_mean, mean_efficiencies

from abi_operator.bands import BANDS
from abi_operator.optics.ice_tables import FU, ICE_INDEX

ICE_DENSITY = 0.917  # [g cm-3]
# Coefficient and power of mass [g] and projected area [cm2] by the longest dimension in cm.
COLUMNS = (0.00166, 1.91), (0.0459, 1.415)
NU = 0.0
TUNNELLING = 0.7  # of crystals, relative to spheres


def mean_mass(inverse_slope_um):
    """Mean mass of columns of an exponential distribution. [kg]"""
    (alpha, beta), _ = COLUMNS
    return 1e-3 * gamma_mean(lambda d: alpha * (1e-4 * inverse_slope_um * d) ** beta, NU)


def photon_paths(inverse_slope_um):
    """Mean photon path, volume over area, and the shape of the spheres that share it. [um], [-]

    Spheres of shape nu have the relative variance 1 / (nu + 3) of path, weighted by area.
    """
    (alpha, beta), (gamma, sigma) = COLUMNS

    def path(diameter):
        dimension = 1e-4 * inverse_slope_um * diameter
        return alpha * dimension**beta / (ICE_DENSITY * gamma * dimension**sigma)

    mean = gamma_mean(path, NU, sigma)
    square = gamma_mean(lambda d: path(d) ** 2, NU, sigma)
    return 1e4 * mean, 1 / (square / mean**2 - 1) - 3


def crystals(mass_path, inverse_slope_um, band):
    """Extinction and scattering depth of a layer of columns, and lobes of scattering. [-]

    Half the extinction is diffracted, into a lobe of asymmetry 1 - lambda / (pi^2 r); the rest has
    an asymmetry that with Fu's own single-scattering albedo makes Fu's asymmetry factor. Lobes are
    pairs of a weight and an asymmetry factor.

    Parameters
    ----------
    mass_path
        Of the layer. [kg m-2]
    inverse_slope_um
        1 / Lam of the exponential distribution of the longest dimension. [um]
    band
        Name of the band.
    """
    path, shape = photon_paths(inverse_slope_um)
    radius = 3 / 4 * path
    index = ICE_INDEX[band]
    q_ext, q_abs = mean_efficiencies(radius, shape, band, index, tunnelling=TUNNELLING)
    area = mass_path / (1e3 * ICE_DENSITY * 1e-6 * path)
    size = 2 / np.sqrt(3) * path  # generalized effective size of Fu (1996)
    if not 25 <= size <= 125:
        raise ValueError(f"Fu's fit is bent at the ends of its range; got {size:.1f} um.")
    whole, coalbedo = (
        np.polynomial.polynomial.polyval(size, c) for c in (FU[band].asymmetry, FU[band].coalbedo)
    )
    diffracted = 1 - BANDS[band].wavelength_um / (np.pi**2 * radius)
    # With Q = 2 scattered are 2 (1 - coalbedo), of which 1 is diffracted.
    rest = (2 * (1 - coalbedo) * whole - diffracted) / (2 * (1 - coalbedo) - 1)
    share = 0.5 * q_ext / (q_ext - q_abs)
    lobes = (share, diffracted), (1 - share, rest)
    return area * q_ext, area * (q_ext - q_abs), lobes
