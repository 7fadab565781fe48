"""Modified anomalous diffraction of Mitchell (2000), particle by particle, averaged numerically.

The efficiencies are those of one diameter, as the paper writes them (doi:10.1175/1520-0469(2000)057
<1311:POTMEA>2.0.CO;2); the means over gamma distributions are sums over diameters and not the
closed forms of the package. Refractive indices, and the asymmetry factors of Mie theory, which the
package keeps to five digits, are read from it as data; so is its table for droplets by Mie theory.
"""

import independent_mie_tables as mie_tables
import numpy as np
from scipy.interpolate import CubicHermiteSpline

from abi_operator.bands import BANDS
from abi_operator.optics import water

NU = 7.0
WATER_DENSITY = 1000.0
# Logarithms of Lam D over which distributions are summed: equidistant, so that sums over smooth
# functions that vanish at both ends converge exponentially. Few of the smallest have area.
STEP = 0.002
LOG_DIAMETER = STEP * np.arange(-18000, 2251)
LOG_OF_AREA = STEP * np.arange(-6000, 2251)


def gamma_mean(function, nu, power=0, log_diameter=LOG_DIAMETER):
    """Mean of a function of Lam D, weighted by (Lam D)^(nu + power) exp(-Lam D)."""
    log_weight = (nu + power + 1) * log_diameter - np.exp(log_diameter)
    weight = np.exp(log_weight - log_weight.max())
    return function(np.exp(log_diameter)) @ weight / weight.sum()


def sphere_efficiencies(diameter_um, wavelength_um, index, reflection=None, tunnelling=1.0):
    """Q_ext and Q_abs of spheres of refractive index n - ik. [-]

    `reflection` replaces the coefficient a1, `tunnelling` multiplies a2.
    """
    n, k = index.real, -index.imag
    size = diameter_um / wavelength_um
    # Anomalous diffraction: rays that lose what they lose on 2/3 of the diameter, the mean chord.
    absorbed = -np.expm1(-4 * np.pi * k * (2 / 3 * diameter_um) / wavelength_um)
    a1 = 0.25 + 0.25 * np.exp(-1167 * k) if reflection is None else reflection
    reflected = a1 * (1 - absorbed)
    decay = 0.25 + 0.6 * (-np.expm1(-8 * np.pi * k / 3)) ** 2
    most = 0.5 / decay  # size at which size^0.5 exp(-decay size) is largest
    a2 = (0.7393 * n - 0.6069) / (np.sqrt(most) * np.exp(-decay * most))
    tunnelled = tunnelling * a2 * np.sqrt(size) * np.exp(-decay * size)
    x = np.pi * size
    lag = 2 * x * (n - 1)
    w = 1j * lag * (1 - 1j * k / (n - 1))
    # By its power series where w is small: the closed form loses all digits there.
    small = abs(w) < 0.03
    z = np.where(small, 1.0, w)
    closed = 0.5 + np.exp(-z) / z + np.expm1(-z) / z**2
    power_series = w / 3 - w**2 / 8 + w**3 / 30 - w**4 / 144 + w**5 / 840 - w**6 / 5760
    diffracted = 4 * np.where(small, power_series, closed).real
    edge = 2 * -np.expm1(-0.06 * x) * x ** (-2 / 3)
    return (1 + tunnelled / 2) * diffracted + edge, (1 + reflected + tunnelled) * absorbed


def mean_efficiencies(effective_radius_um, nu, band, index, **options):
    """Q_ext and Q_abs weighted by area over a gamma distribution. [-]"""
    unit, wavelength = 2 * effective_radius_um / (nu + 3), BANDS[band].wavelength_um

    def efficiencies(diameter):
        return np.array(sphere_efficiencies(unit * diameter, wavelength, index, **options))

    return gamma_mean(efficiencies, nu, 2, LOG_OF_AREA)


def table(x, nodes, values):
    """Cubics in log x with the parabolas' slopes at the nodes and zero at both ends."""
    at = np.log(nodes)
    slopes = np.gradient(values, at)  # of the parabola through three neighbours
    slopes[[0, -1]] = 0.0
    return CubicHermiteSpline(at, values, slopes)(np.log(np.clip(x, nodes[0], nodes[-1])))


def effective_radius(mass_path, number_path):
    """Of a gamma distribution of droplets, from mass and number. [m]"""
    cubes = gamma_mean(lambda d: d**3, NU)
    inverse_slope = np.cbrt(mass_path / number_path / (np.pi / 6 * WATER_DENSITY * cubes))
    return (NU + 3) / 2 * inverse_slope


def mitchell(mass_path, number_path, band):
    """Extinction and scattering depth and asymmetry factor of a layer of droplets. [-]

    Parameters
    ----------
    mass_path, number_path
        Of the layer. [kg m-2], [m-2]
    band
        Name of the band.
    """
    radius = effective_radius(mass_path, number_path)
    q_ext, q_abs = mean_efficiencies(1e6 * radius, NU, band, water.REFRACTIVE_INDEX[band])
    area = mass_path * 3 / (4 * WATER_DENSITY * radius)  # of spheres, projected
    nodes, values = water.EFFECTIVE_RADIUS_UM, water.ASYMMETRY[band]
    return area * q_ext, area * (q_ext - q_abs), float(table(1e6 * radius, nodes, values))


def mie(mass_path, number_path, band):
    """Extinction and scattering depth, moments and phase function, by the package's table. [-]

    Parameters are those of `mitchell`.
    """
    radius = effective_radius(mass_path, number_path)
    q_ext, coalbedo, *phase = mie_tables.between("droplets", 1e6 * radius, band)
    extinction = mass_path * 3 / (4 * WATER_DENSITY * radius) * q_ext
    return extinction, extinction * (1 - coalbedo), *phase
