r"""Scattering by ice crystals, in the fits of Fu (1996), and what to make of them.

The fits are in the generalized effective size of hexagonal columns with smooth faces, random in
their orientation. Two choices stand behind the classes of `hydrometeor`.

*Absorption* is not Fu's. His coefficients are means over intervals of the spectrum, of which those
with C05 and C06 reach far into stronger absorption: at effective radii of 10-50 um the co-albedo
they give is 1.2 to 2.3 times that of crystals at the bands' centroids (Baum et al. [2]_).
Extinction and absorption are modified anomalous diffraction of the crystals' habit at the centroid,
within 7 % of Baum et al. and, in C04-C07, 17 % (tests/abi_operator/optics/test_rough_ice.py).

*The asymmetry factor* is Fu's by default. Real crystals are rough, and the literature has two
answers: the general habit mixture of Baum et al., severely roughened, which agrees best with in
situ microphysics and with polarised reflectances, has 0.78-0.81 in the visible, and Fu's columns
are within 0.012 of it in C01-C06 at 10-50 um (0.022 in C07), because what smooth columns have too
much compact habits lack. Severely roughened aggregates of columns, the ice of MODIS collection 6
chosen for agreement of solar with infrared optical depths, have 0.75 in the visible at nearly any
size (Yang et al. [1]_), `ROUGHENED_ASYMMETRY`. Between two sound answers on either side the default
has stayed where it was; ``Hydrometeor(optics="rough")`` and ``--ice-optics rough`` take Baum's
mixture, band by band and by size (`rough_ice`), and an `optics.ClassOptics` any number.

*The phase function* has two lobes, of what is diffracted and of geometric optics (`diffraction`):
rough crystals have no halo. Asymmetry factors, Fu's and Baum's, are each taken apart by the
single-scattering albedo that belongs to it, which leaves 0.54 to 0.76 for geometric optics in all
bands and sizes, and put together by the one that is used. A single lobe of the same asymmetry
factor, as before, took diffracted light for scattered sideways, and needed more than 16 streams
where crystals absorb: `benchmarks/truth.py`.

References
----------
.. [1] P. Yang et al., "Spectrally consistent scattering, absorption, and polarization properties of
   atmospheric ice crystals at wavelengths from 0.2 to 100 um", J. Atmos. Sci., 70, 330-347, 2013,
   doi:10.1175/JAS-D-12-039.1
.. [2] B. A. Baum et al., "Ice cloud single-scattering property models with the full phase matrix at
   wavelengths from 0.2 to 100 um", J. Quant. Spectrosc. Radiat. Transfer, 146, 123-139, 2014,
   doi:10.1016/j.jqsrt.2014.02.029
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, Float

from .diffraction import diffraction_asymmetry, geometric_asymmetry
from .ice_tables import FU_RANGE_UM, Fu
from .pointwise import choose

# Asymmetry factor of severely roughened aggregates of columns, in the visible. [-]
ROUGHENED_ASYMMETRY = 0.75
# The same of what they do not diffract, half of it. [-]
ROUGHENED_GEOMETRIC = 2 * ROUGHENED_ASYMMETRY - 1
# Generalized effective size over mean photon path. [-] (Fu 1996: D = 2 IWC / (sqrt 3 rho A))
SIZE_PER_PATH = 2 / math.sqrt(3)
# Sizes within which the fit is bent towards its end. [um]
_BEND_UM = 5.0


def fitted_size(size_um: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Size at which the fits are read: the size itself, tending to the ends of their range. [um]

    Within 5 um of an end of 20-130 um, and beyond it, the distance to the end decays exponentially,
    with a slope that is continuous.

    Parameters
    ----------
    size_um
        Generalized effective size. [um]
    """
    lower, upper = FU_RANGE_UM[0] + _BEND_UM, FU_RANGE_UM[1] - _BEND_UM
    small, large = size_um < lower, size_um > upper
    # Each exponential sees only the sizes that it is for.
    below = jnp.exp((choose(small, size_um, lower) - lower) / _BEND_UM)
    above = jnp.exp((upper - choose(large, size_um, upper)) / _BEND_UM)
    ends = choose(small, lower - _BEND_UM * (1 - below), upper + _BEND_UM * (1 - above))
    return choose(small | large, ends, size_um)


def ice_asymmetry(size_um: Float[Array, "*n"], fits: Fu) -> Float[Array, "*n"]:
    """Asymmetry factor of smooth hexagonal columns. [-]

    Parameters
    ----------
    size_um
        Generalized effective size, above 0. [um]
    fits
        Those of the band, of `ice_tables.FU`.
    """
    return _cubic(fits.asymmetry, fitted_size(size_um))


def ice_geometric_asymmetry(
    size_um: Float[Array, "*n"], fits: Fu, wavelength_um: float | Float[Array, ""]
) -> Float[Array, "*n"]:
    """The same of what is not diffracted, by Fu's own single-scattering albedo. [-]

    Parameters
    ----------
    size_um, fits
        As in `ice_asymmetry`.
    wavelength_um
        Of the band. [um]
    """
    radius_um = fitted_size(size_um) * (0.75 / SIZE_PER_PATH)
    diffracted = diffraction_asymmetry(radius_um, wavelength_um)
    ssa = 1 - ice_coalbedo(size_um, fits)
    return geometric_asymmetry(ice_asymmetry(size_um, fits), ssa, diffracted)


def ice_coalbedo(size_um: Float[Array, "*n"], fits: Fu) -> Float[Array, "*n"]:
    """1 - ssa of smooth hexagonal columns; parameters as in `ice_asymmetry`. [-]"""
    return _cubic(fits.coalbedo, fitted_size(size_um))


def ice_mass_extinction(size_um: Float[Array, "*n"], fits: Fu) -> Float[Array, "*n"]:
    """Extinction cross-section per mass of ice; parameters as in `ice_asymmetry`. [m2 kg-1]"""
    a0, a1 = fits.extinction
    return 1e3 * (a0 + a1 / fitted_size(size_um))


def _cubic(c: tuple[float | Array, ...], x: Array) -> Array:
    return c[0] + x * (c[1] + x * (c[2] + x * c[3]))
