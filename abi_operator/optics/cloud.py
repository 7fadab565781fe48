"""Scattering and absorption by the droplets of liquid cloud."""

import jax.numpy as jnp
from jaxtyping import Array

from ..atmosphere import Atmosphere
from ..bands import AnyBand, OneOf, constants, first_missing, one_of
from ..constants import WATER_DENSITY
from ..optical_properties import OpticalProperties, Scatterer
from .anomalous_diffraction import Matter, matter, mean_efficiencies
from .droplets import NU, effective_radius
from .mie_aerosol import mie_optics
from .mie_phase import MiePhase
from .mie_table import DROPLETS
from .phase import HenyeyGreenstein
from .pointwise import pointwise
from .water import REFRACTIVE_INDEX, droplet_asymmetry

# Radius at which the formulas are evaluated, to no effect, where there is no cloud. [m]
_IDLE_RADIUS = 1e-5


def liquid_cloud(atmosphere: Atmosphere, band: AnyBand) -> OpticalProperties:
    r"""Optical properties of liquid cloud, from mass and number of its droplets.

    .. math:: \tau = \frac{3\, m\, \bar Q_\mathrm{ext}}{4\, \rho_w\, r_\mathrm{eff}}

    By ``optics="mitchell"`` of the cloud, efficiencies are by modified anomalous diffraction
    (`mean_efficiencies`), and the phase function is that of Henyey and Greenstein with the
    asymmetry factor of Mie theory (`droplet_asymmetry`); by ``"mie"`` all are Mie theory by table
    for effective radii of 1.74-59 um (`MiePhase`). A layer without mass or without number is
    empty, with derivative 0.

    Parameters
    ----------
    atmosphere
        One column, of which the liquid cloud is read.
    band
        Band for which the refractive index of water is tabulated.
    """
    if missing := first_missing(band.name, REFRACTIVE_INDEX):
        raise ValueError(f"no water index for band {missing!r}; have {list(REFRACTIVE_INDEX)}.")
    radius = effective_radius(atmosphere.liquid)
    cloudy = radius > 0
    radius = jnp.where(cloudy, radius, radius.dtype.type(_IDLE_RADIUS))
    radius_um = 1e6 * radius
    if atmosphere.liquid.optics == "mie":
        droplets = mie_optics(DROPLETS, radius_um, band.name)
        q_ext = droplets.relative_extinction
        q_abs = q_ext * droplets.coalbedo
        phase = MiePhase(radius_um, DROPLETS, band.name)
    else:
        water = constants(lambda x: matter(REFRACTIVE_INDEX[x]), band.name, radius.dtype)
        name = one_of(band.name)
        q_ext, q_abs, asymmetry = _mitchell(radius_um, band.wavelength_um, water, name)
        phase = HenyeyGreenstein(asymmetry)
    mass = jnp.where(cloudy, atmosphere.liquid.mass_path, 0)
    cross_section = 3 * mass / (4 * WATER_DENSITY * radius)
    extinction = cross_section * q_ext
    scatterer = Scatterer(extinction - cross_section * q_abs, phase)
    return OpticalProperties(extinction[None, :], jnp.ones(1, extinction.dtype), (scatterer,))


@pointwise
def _mitchell(
    radius_um: Array, wavelength_um: float | Array, water: Matter, band: OneOf
) -> tuple[Array, Array, Array]:
    """Efficiencies for extinction and absorption, and asymmetry factor. [-]"""
    efficiencies = mean_efficiencies(radius_um, wavelength_um, water, NU)
    return *efficiencies, droplet_asymmetry(radius_um, band)
