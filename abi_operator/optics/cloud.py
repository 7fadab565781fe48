"""Scattering and absorption by the droplets of liquid cloud."""

import jax.numpy as jnp
from jaxtyping import Array

from ..atmosphere import Atmosphere, LiquidCloud
from ..bands import AnyBand, OneOf, constants, first_missing, one_of
from ..constants import WATER_DENSITY
from ..optical_properties import OpticalProperties, Scatterer
from .anomalous_diffraction import Matter, matter, mean_efficiencies
from .droplets import NU, effective_radius, is_cloudy
from .mie_aerosol import mie_optics
from .mie_phase import MiePhase
from .mie_table import DROPLETS, mie_table
from .phase import HenyeyGreenstein
from .pointwise import where_occupied
from .water import EFFECTIVE_RADIUS_UM, REFRACTIVE_INDEX, droplet_asymmetry

# Radius at which the formulas are evaluated, to no effect, where there is no cloud. [m]
_IDLE_RADIUS = 1e-5


def liquid_cloud(atmosphere: Atmosphere, band: AnyBand) -> OpticalProperties:
    r"""Optical properties of liquid cloud, from mass and number of its droplets.

    .. math:: \tau = \frac{3\, m\, \bar Q_\mathrm{ext}}{4\, \rho_w\, r_\mathrm{eff}}

    By default, ``optics="mie"`` of the cloud, efficiencies and phase function are Mie theory by
    table (`MiePhase`). By ``"mitchell"`` efficiencies are by modified anomalous diffraction
    (`mean_efficiencies`), and the phase function is that of Henyey and Greenstein with the
    asymmetry factor of Mie theory (`droplet_asymmetry`), which has no rainbow and no glory.

    The table is for effective radii of 1.74-59 um (`fitted_radii_um`). Beyond, efficiencies and
    phase function stay what they are at its ends, where their slopes have faded to 0: the optical
    depth goes on as mass over radius does, all of it continuous with its derivative, and
    `outside_fitted_range` tells how much of the optical depth is there. A layer without mass or
    without number is empty, with derivative 0.

    Parameters
    ----------
    atmosphere
        One column, of which the liquid cloud is read.
    band
        Band for which the refractive index of water is tabulated.
    """
    if missing := first_missing(band.name, REFRACTIVE_INDEX):
        raise ValueError(f"no water index for band {missing!r}; have {list(REFRACTIVE_INDEX)}.")
    cloudy = is_cloudy(atmosphere.liquid)
    radius = effective_radius(atmosphere.liquid, cloudy)
    radius = jnp.where(cloudy, radius, radius.dtype.type(_IDLE_RADIUS))
    radius_um = 1e6 * radius
    if atmosphere.liquid.optics == "mie":
        droplets = mie_optics(DROPLETS, radius_um, band.name, cloudy)
        q_ext = droplets.relative_extinction
        q_abs = q_ext * droplets.coalbedo
        phase = MiePhase(radius_um, DROPLETS, band.name)
    else:
        water = constants(lambda x: matter(REFRACTIVE_INDEX[x]), band.name, radius.dtype)
        name = one_of(band.name)
        own = band.wavelength_um, water, name
        q_ext, q_abs, asymmetry = _mitchell(cloudy, (radius_um,), *own)
        phase = HenyeyGreenstein(asymmetry)
    mass = jnp.where(cloudy, atmosphere.liquid.mass_path, 0)
    cross_section = 3 * mass / (4 * WATER_DENSITY * radius)
    extinction = cross_section * q_ext
    scatterer = Scatterer(extinction - cross_section * q_abs, phase, cloudy)
    return OpticalProperties(extinction[None, :], jnp.ones(1, extinction.dtype), (scatterer,))


def fitted_radii_um(liquid: LiquidCloud) -> tuple[float, float]:
    """Smallest and largest effective radius that the optics of a liquid cloud are for. [um]

    Of Mie tables, whose first and last interval are there for the slopes to fade, what lies
    between; of ``"mitchell"`` the range of the asymmetry factor.
    """
    if liquid.optics == "mie":
        radii = mie_table(DROPLETS).effective_radius_um
        return float(radii[1]), float(radii[-2])
    return float(EFFECTIVE_RADIUS_UM[0]), float(EFFECTIVE_RADIUS_UM[-1])


@where_occupied
def _mitchell(
    radius_um: Array, wavelength_um: float | Array, water: Matter, band: OneOf
) -> tuple[Array, Array, Array]:
    """Efficiencies for extinction and absorption, and asymmetry factor. [-]"""
    efficiencies = mean_efficiencies(radius_um, wavelength_um, water, NU)
    return *efficiencies, droplet_asymmetry(radius_um, band)
