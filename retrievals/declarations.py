"""State vectors that are shipped: smoke, ash, dust, liquid cloud, fire, and the ground beneath.

Each is a list of `Quantity`; one of your own is another list. Priors are wide, meant to be replaced
by what is known of a scene (`StateVector.prior`, or the command's ``--prior``).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from abi_operator import Fire, LiquidCloud, MiePlume, Plume
from abi_operator.constants import WATER_DENSITY
from abi_operator.optics import effective_radius, mie_optics

from .mass_loading import DENSITY, MassLoading
from .quantities import Derived, Quantity, itself, logit_shifted, replaced
from .results import expected_error
from .state_vector import StateVector
from .transforms import Bounded, Unbounded

SCANNED_AOD_550 = (0.02, 0.06, 0.15, 0.35, 0.8, 1.8, 4.5)
"""Optical depths of a scan; those above a limit are left out. [-]"""
AOD_LIMIT = 10.0
"""Optical depth that plumes stay below where nothing else is asked for. [-]"""

STEFAN_BOLTZMANN = 5.670374419e-8
"""Exact in the SI of 2019: CODATA 2018. [W m-2 K-4]"""

_MICRON = 1e-6  # [m]
# Effective radii that a table is meant for, and where a scan looks. [um]
_RADII = {"smoke": (0.043, 0.56), "ash": (0.28, 17.9), "dust": (0.28, 17.9)}
_SCANNED_RADII = {"smoke": (0.08, 0.14, 0.25), "ash": (1.0, 3.0, 8.0), "dust": (0.7, 1.5, 4.0)}
_MEAN_RADIUS = {"smoke": 0.14, "ash": 3.0, "dust": 1.5}


def aod_550(species: str, limit: float = AOD_LIMIT) -> Quantity:
    """Optical depth of a plume at 550 nm; a success is known to the expected error of MODIS.

    Parameters
    ----------
    species
        Name of the plume in the state.
    limit
        Optical depths from here on are out of reach. [-]
    """
    if not limit > 0:
        raise ValueError(f"aod_limit must be positive; got {limit}.")
    return Quantity(
        "aod_550",
        "1",
        f"optical depth of the {species} plume at 550 nm",
        f"atmosphere.plumes.{species}",
        Bounded(0.0, limit),
        with_aod_550,
        sigma=1.5,
        mean=min(0.4, limit / 2),
        get=_aod_550,
        starts=tuple(x for x in SCANNED_AOD_550 if x < limit) or (limit / 2,),
        largest_error=expected_error,
    )


def ssa_shift(species: str) -> Quantity:
    """One shift of the logit of a plume's single-scattering albedo in all bands.

    A scan begins at -0.4: half as much absorption again, relative to scattering, as the scenario
    specifies.
    """
    return Quantity(
        "ssa_shift",
        "1",
        f"shift of the logit of the single-scattering albedo of the {species} plume",
        f"atmosphere.plumes.{species}.ssa",
        Unbounded(),
        logit_shifted,
        sigma=0.7,
        mean=0.0,
        starts=(-0.8, 0.8),
    )


def effective_radius_um(species: str) -> Quantity:
    """Effective radius of a plume's particles, of smoke that of its fine mode, by Mie tables.

    A `MiePlume` has that radius. Of a `Plume`, specified by band, relative extinction, asymmetry
    factor and single-scattering albedo become those of the table at that radius, and its phase
    function stays that of Henyey and Greenstein.
    """
    lower, upper = _RADII[species]
    return Quantity(
        "effective_radius_um",
        "um",
        f"effective radius of the particles of the {species} plume",
        f"atmosphere.plumes.{species}",
        Bounded(lower, upper, logarithmic=True),
        WithEffectiveRadius(species),
        sigma=1.0,
        mean=_MEAN_RADIUS[species],
        get=_effective_radius_um,
        starts=_SCANNED_RADII[species],
    )


def albedo(band: str, sigma: float = 0.01) -> Quantity:
    """Lambertian albedo of the ground in a band, which the state knows to `sigma`. [-]"""
    return Quantity(
        f"albedo_{band}",
        "1",
        f"albedo of the ground in {band}",
        f"albedo.{band}",
        Bounded(0.0, 1.0),
        replaced,
        sigma=sigma / 0.09,  # the derivative of the transform is 0.09 at an albedo of 0.1
        get=itself,
    )


def plume(
    species: str,
    *,
    ssa: bool = False,
    effective_radius: bool = False,
    aod_limit: float = AOD_LIMIT,
) -> StateVector:
    """State vector of a plume: optical depth, and what else is asked for.

    Parameters
    ----------
    species
        Name of the plume in the state: ``"smoke"``, ``"ash"`` or ``"dust"`` where the effective
        radius is asked for.
    ssa
        Whether its single-scattering albedo is retrieved; not of a `MiePlume`, which has none of
        its own.
    effective_radius
        Whether its effective radius is; of ash and dust the mass loading follows.
    aod_limit
        Optical depths from here on are out of reach. [-]
    """
    quantities, derived = [aod_550(species, aod_limit)], []
    if ssa:
        quantities.append(ssa_shift(species))
        place = f"atmosphere.plumes.{species}.ssa"
        derived.append(
            Derived("ssa", "1", f"single-scattering albedo of the {species} plume", place, itself)
        )
    if effective_radius:
        if species not in _RADII:
            raise ValueError(f"no Mie table of {species!r}; choose from {list(_RADII)}.")
        quantities.append(effective_radius_um(species))
        if species in DENSITY:
            words = f"mass of the {species} plume, at {DENSITY[species]:g} kg m-3"
            needs = ("aod_550", "effective_radius_um")
            place, read = f"atmosphere.plumes.{species}", MassLoading(species)
            derived.append(Derived("mass_loading", "g m-2", words, place, read, needs))
    return StateVector(tuple(quantities), tuple(derived))


def liquid_cloud() -> StateVector:
    """State vector of liquid cloud: optical thickness and effective radius of its droplets.

    The cloud has to be in the state, with any mass and number: its layers keep their shares of the
    optical thickness, and all get one effective radius. Optical thickness is that of droplets with
    an extinction efficiency of 2, :math:`3 W / (2 \\rho_w r_\\mathrm{eff})`.
    """
    place = "atmosphere.liquid"
    thickness = Quantity(
        "cloud_optical_thickness",
        "1",
        "optical thickness of the liquid cloud",
        place,
        Bounded(0.0, 150.0),
        with_optical_thickness,
        sigma=1.5,
        mean=10.0,
        get=optical_thickness,
        starts=(1.0, 5.0, 15.0, 40.0),
    )
    radius = Quantity(
        "cloud_effective_radius_um",
        "um",
        "effective radius of the cloud's droplets",
        place,
        Bounded(2.0, 40.0, logarithmic=True),
        with_droplet_radius,
        sigma=1.0,
        mean=10.0,
        get=mean_droplet_radius_um,
        starts=(6.0, 10.0, 20.0),
    )
    path = Derived("liquid_water_path", "kg m-2", "mass of liquid water", place, _water_path)
    return StateVector((thickness, radius), (path,))


def fire() -> StateVector:
    """State vector of a fire: its temperature, and the share of the pixel that burns.

    What surrounds it, the temperature and the albedo of the ground, is known from the state. A
    state needs a `Fire`, with any values, temperatures, and the bands C05, C06 or C07.
    """
    temperature = Quantity(
        "fire_temperature",
        "K",
        "temperature of the fire",
        "fire.temperature",
        Bounded(350.0, 1800.0),
        replaced,
        sigma=1.0,
        mean=800.0,
        get=itself,
        starts=(500.0, 700.0, 1000.0),
    )
    fraction = Quantity(
        "fire_fraction",
        "1",
        "share of the pixel that burns",
        "fire.fraction",
        Bounded(1e-7, 1.0, logarithmic=True),
        replaced,
        sigma=0.5,
        mean=1e-3,
        get=itself,
        starts=(3e-4, 3e-3, 3e-2),
    )
    power = Derived(
        "fire_emitted_power",
        "W m-2",
        "power that the fire emits per area of the pixel",
        "fire",
        emitted_power,
    )
    return StateVector((temperature, fraction), (power,))


def assumed_of_fire(bands: Sequence[str]) -> StateVector:
    """What a retrieval of a fire assumes of the ground: its albedo, to 0.01, and its heat, to 1 K.

    A fire emits 1 minus the albedo of what a black one would.
    """
    ground = Quantity(
        "surface_temperature",
        "K",
        "temperature of the ground beside the fire",
        "surface_temperature",
        Unbounded(),
        replaced,
        sigma=1.0,
        get=itself,
    )
    return StateVector((*(albedo(band) for band in bands), ground))


def emitted_power(fire: Fire) -> Float[Array, "*batch"]:
    """Power of a black fire per area of the pixel, p sigma T^4, better known than both. [W m-2]"""
    return STEFAN_BOLTZMANN * fire.fraction * fire.temperature**4


def assumed_of_plume(species: str, bands: Sequence[str]) -> StateVector:
    """What a retrieval of a plume assumes, and how well that may be known.

    Albedo of the ground in each band, to 0.01; height of the plume, to 500 m; its asymmetry factor,
    to a shift of the logit of 0.1, which is 0.023 at 0.65. A `MiePlume` has no asymmetry factor.
    """
    height = Quantity(
        "height_shift",
        "m",
        f"shift of the height of the {species} plume",
        f"atmosphere.plumes.{species}",
        Unbounded(),
        lifted,
        sigma=500.0,
        mean=0.0,
    )
    asymmetry = Quantity(
        "asymmetry_shift",
        "1",
        f"shift of the logit of the asymmetry factor of the {species} plume",
        f"atmosphere.plumes.{species}.asymmetry",
        Unbounded(),
        logit_shifted,
        sigma=0.1,
        mean=0.0,
    )
    return StateVector((*(albedo(band) for band in bands), height, asymmetry))


def lifted(plume: Plume | MiePlume, value: Float[Array, "*batch"]) -> Plume | MiePlume:
    """A plume higher up by a value. [m]"""
    edges = (plume.base + value, plume.top + value)
    return eqx.tree_at(lambda p: (p.base, p.top), plume, edges)


def with_aod_550(plume: Plume | MiePlume, value: Float[Array, "*batch"]) -> Plume | MiePlume:
    """A plume of another optical depth, of which all else is kept."""
    extinction = value / (plume.top - plume.base)
    return eqx.tree_at(
        lambda p: (p.extinction_550, p.brightness), plume, (extinction, jnp.ones_like(extinction))
    )


@dataclass(frozen=True)
class WithEffectiveRadius:
    """A plume of another effective radius, by the table of its species (`effective_radius_um`)."""

    species: str

    def __call__(self, plume: Plume | MiePlume, value: Float[Array, "*batch"]) -> Plume | MiePlume:
        """The plume with an effective radius. [um]"""
        if isinstance(plume, MiePlume):
            return eqx.tree_at(lambda p: p.effective_radius_um, plume, value)
        optics = {band: mie_optics(self.species, value, band) for band in plume.ssa}
        return eqx.tree_at(
            lambda p: (p.relative_extinction, p.ssa, p.asymmetry),
            plume,
            (
                {band: spheres.relative_extinction for band, spheres in optics.items()},
                {band: 1 - spheres.coalbedo for band, spheres in optics.items()},
                {band: spheres.asymmetry for band, spheres in optics.items()},
            ),
        )


def optical_thickness(cloud: LiquidCloud) -> Float[Array, "*batch"]:
    """Optical thickness of a cloud whose droplets have an extinction efficiency of 2. [-]"""
    return jnp.sum(_layers_of(cloud), axis=-1)


def with_optical_thickness(cloud: LiquidCloud, value: Float[Array, "*batch"]) -> LiquidCloud:
    """A cloud of the same droplets, more or fewer of them."""
    factor = (value / optical_thickness(cloud))[..., None]
    return _with_paths(cloud, cloud.mass_path * factor, cloud.number_path * factor)


def with_droplet_radius(cloud: LiquidCloud, value: Float[Array, "*batch"]) -> LiquidCloud:
    """A cloud of the same optical thickness, layer by layer, with droplets of one radius. [um]"""
    radius = effective_radius(cloud)
    cloudy = radius > 0
    growth = jnp.where(cloudy, value[..., None] * _MICRON / jnp.where(cloudy, radius, 1), 1)
    # Mass is optical thickness times radius, and number is mass by radius cubed.
    return _with_paths(cloud, cloud.mass_path * growth, cloud.number_path / growth**2)


def _layers_of(cloud: LiquidCloud) -> Float[Array, "*batch layer"]:
    radius = effective_radius(cloud)
    cloudy = radius > 0
    thickness = 1.5 * cloud.mass_path / WATER_DENSITY / jnp.where(cloudy, radius, 1)
    return jnp.where(cloudy, thickness, 0)


def _with_paths(cloud: LiquidCloud, mass: Array, number: Array) -> LiquidCloud:
    return eqx.tree_at(lambda c: (c.mass_path, c.number_path), cloud, (mass, number))


def mean_droplet_radius_um(cloud: LiquidCloud) -> Float[Array, "*batch"]:
    """Effective radius of all droplets together, 3 W / (2 rho tau); NaN without cloud. [um]"""
    path = _water_path(cloud)
    thickness = optical_thickness(cloud)
    cloudy = thickness > 0
    radius = 1.5 * path / WATER_DENSITY / jnp.where(cloudy, thickness, 1) / _MICRON
    return jnp.where(cloudy, radius, jnp.nan)


def _water_path(cloud: LiquidCloud) -> Float[Array, "*batch"]:
    return jnp.sum(jnp.asarray(cloud.mass_path), axis=-1)


def _aod_550(plume: Plume | MiePlume) -> Array:
    return plume.aod_550


def _effective_radius_um(plume: Plume | MiePlume) -> Array:
    """Radius of a `MiePlume`; a plume by band has none, which is NaN."""
    if isinstance(plume, MiePlume):
        return plume.effective_radius_um
    return jnp.full_like(jnp.asarray(plume.brightness), jnp.nan)
