"""What is there: the specified state of one column.

Every class is a frozen pytree of floating arrays. One column has the shapes written here; a batch
of columns carries any number of leading axes, the same on every leaf, but that the fields of a
ground may stay single numbers. Layers and levels count from the top.
"""

from typing import Any

import equinox as eqx
from jaxtyping import Array, Float

from .geometry import Geometry

LIQUID_OPTICS = ("mie", "mitchell")
"""Ways to the optics of cloud droplets, the default first."""
ICE_OPTICS = ("fu", "rough")
"""Crystals whose asymmetry factors those of ice are, the default first."""


class LiquidCloud(eqx.Module):
    """Cloud droplets of each layer, by mass and number.

    Parameters
    ----------
    mass_path
        Mass of liquid water in the layer per horizontal area. [kg m-2]
    number_path
        Number of droplets in the layer per horizontal area; read only where there is mass. [m-2]
    optics
        Where their optics are from: ``"mie"``, Mie theory by table, with its rainbow and glory, or
        ``"mitchell"``, that of Grasso et al. (2013): modified anomalous diffraction and the phase
        function of Henyey and Greenstein.

    Raises
    ------
    ValueError
        Where `optics` is neither.
    """

    mass_path: Float[Array, "*batch layer"]
    number_path: Float[Array, "*batch layer"]
    optics: str = eqx.field(default=LIQUID_OPTICS[0], static=True)

    def __check_init__(self) -> None:
        if self.optics not in LIQUID_OPTICS:
            raise ValueError(
                f"optics of LiquidCloud must be one of {LIQUID_OPTICS}; got {self.optics!r}."
            )


class Plume(eqx.Module):
    """A vertically uniform aerosol layer, as Grasso et al. (2013) specify smoke and ash.

    Extinction in a band is ``brightness * extinction_550 * relative_extinction[band]`` between
    `base` and `top` and zero elsewhere, so that the column's optical depth at 550 nm is
    ``brightness * extinction_550 * (top - base)`` on any levels that reach above `top`. What is
    above the first level is not in the column.

    Parameters
    ----------
    base, top
        Lower and upper edge above the ground. [m]
    extinction_550
        Extinction coefficient at 550 nm where brightness is 1. [m-1]
    brightness
        Horizontal weight, 0 to 1 (the grey value of the picture that draws the plume). [-]
    relative_extinction, ssa, asymmetry
        By band: extinction relative to 550 nm, single-scattering albedo, asymmetry factor. [-]
    """

    base: Float[Array, "*batch"]
    top: Float[Array, "*batch"]
    extinction_550: Float[Array, "*batch"]
    brightness: Float[Array, "*batch"]
    relative_extinction: dict[str, Float[Array, "*batch"]]
    ssa: dict[str, Float[Array, "*batch"]]
    asymmetry: dict[str, Float[Array, "*batch"]]

    @property
    def aod_550(self) -> Float[Array, "*batch"]:
        """Optical depth of the plume at 550 nm, on levels that reach above it. [-]"""
        return self.brightness * self.extinction_550 * (self.top - self.base)


class MiePlume(eqx.Module):
    """A vertically uniform aerosol layer of spheres, lognormal in size, by its effective radius.

    As a `Plume`, but extinction relative to 550 nm, single-scattering albedo and phase function of
    every band follow from Mie theory, by the table of the species.

    Parameters
    ----------
    base, top
        Lower and upper edge above the ground. [m]
    extinction_550
        Extinction coefficient at 550 nm where brightness is 1. [m-1]
    brightness
        Horizontal weight, 0 to 1. [-]
    effective_radius_um
        Ratio of the third to the second moment of the size distribution, of radii; of smoke, that
        of its fine mode. [um]
    species
        Name of the table: refractive index and width of the size distribution.
    """

    base: Float[Array, "*batch"]
    top: Float[Array, "*batch"]
    extinction_550: Float[Array, "*batch"]
    brightness: Float[Array, "*batch"]
    effective_radius_um: Float[Array, "*batch"]
    species: str = eqx.field(static=True)

    @property
    def aod_550(self) -> Float[Array, "*batch"]:
        """Optical depth of the plume at 550 nm, on levels that reach above it. [-]"""
        return self.brightness * self.extinction_550 * (self.top - self.base)


class BackgroundAerosol(eqx.Module):
    """Aerosol that is everywhere, the thinner the higher, as plumes are beside it.

    Its extinction falls with height z above the ground by ``exp(-z / scale_height)`` up to the
    first level, so that the column's optical depth at 550 nm is `aod_550` whatever the levels.

    Parameters
    ----------
    aod_550
        Optical depth at 550 nm. [-]
    scale_height
        Height by which extinction falls to 1 / e. [m]
    relative_extinction, ssa, asymmetry
        By band: extinction relative to 550 nm, single-scattering albedo, asymmetry factor. [-]
    """

    aod_550: Float[Array, "*batch"]
    scale_height: Float[Array, "*batch"]
    relative_extinction: dict[str, Float[Array, "*batch"]]
    ssa: dict[str, Float[Array, "*batch"]]
    asymmetry: dict[str, Float[Array, "*batch"]]


class Hydrometeor(eqx.Module):
    """Particles of one hydrometeor class in each layer, by mass and number.

    Parameters
    ----------
    mass_path
        Mass in the layer per horizontal area. [kg m-2]
    number_path
        Number of particles in the layer per horizontal area. [m-2]
    optics
        Whose asymmetry factor crystals have: ``"fu"``, smooth hexagonal columns (Fu 1996), or
        ``"rough"``, severely roughened crystals of many habits (Baum et al. 2014); see
        `optics.ice`. Of no effect on drops, graupel and hail.

    Raises
    ------
    ValueError
        Where `optics` is neither.
    """

    mass_path: Float[Array, "*batch layer"]
    number_path: Float[Array, "*batch layer"]
    optics: str = eqx.field(default=ICE_OPTICS[0], static=True)

    def __check_init__(self) -> None:
        if self.optics not in ICE_OPTICS:
            raise ValueError(
                f"optics of Hydrometeor must be one of {ICE_OPTICS}; got {self.optics!r}."
            )


class Gases(eqx.Module):
    """Gases that absorb in the bands of the imager.

    Parameters
    ----------
    vapour
        Mass of water vapour in the layer per horizontal area. [kg m-2]
    ozone
        Ozone in the layer. [DU]
    carbon_dioxide, methane, nitrous_oxide
        Mole fractions in dry air, the same in all layers. [-]
    """

    vapour: Float[Array, "*batch layer"]
    ozone: Float[Array, "*batch layer"]
    carbon_dioxide: Float[Array, "*batch"]
    methane: Float[Array, "*batch"]
    nitrous_oxide: Float[Array, "*batch"]


class Atmosphere(eqx.Module):
    """Air, cloud and plumes of one column.

    Parameters
    ----------
    pressure, height
        At the levels, top first: pressure, rising; height above sea level, falling. The last level
        is the ground. Above the first one is as much air as its pressure says, which scatters and
        absorbs with that of the uppermost layer (`optics.air`): wherever the levels begin, a
        column has all of its air. Nothing else is above it. [Pa], [m]
    liquid
        Cloud droplets in the layers between the levels.
    plumes
        Aerosol plumes by species name (``"smoke"``, ``"ash"``).
    temperature
        At the levels; None where neither gases nor emission are to be simulated. [K]
    gases
        Gases that absorb; None for air without them.
    hydrometeors
        Hydrometeor classes by name (``"rain"``, ``"snow"``), beside `liquid`.
    background
        Aerosol beside the plumes; None for none.
    """

    pressure: Float[Array, "*batch level"]
    height: Float[Array, "*batch level"]
    liquid: LiquidCloud
    plumes: dict[str, Plume | MiePlume]
    temperature: Float[Array, "*batch level"] | None = None
    gases: Gases | None = None
    hydrometeors: dict[str, Hydrometeor] = eqx.field(default_factory=dict)
    background: BackgroundAerosol | None = None


class Fire(eqx.Module):
    """A fire that is smaller than a column.

    Parameters
    ----------
    fraction
        Share of the column's ground that burns, 0 to 1. [-]
    temperature
        Of the flames. [K]
    """

    fraction: Float[Array, "*batch"]
    temperature: Float[Array, "*batch"]


class State(eqx.Module):
    """All that the operator needs to know of one column.

    Parameters
    ----------
    atmosphere
        Air, cloud and plumes.
    albedo
        Ground by band: its Lambertian (white-sky) albedo [-], or a surface with a reflectance of
        its own (`surface.RossLi`, `surface.Ocean`), each of whose fields is one number per column.
    geometry
        Directions of the sun and of the satellite.
    surface_temperature
        Of the ground that does not burn; None where no emission is to be simulated. [K]
    fire
        None where nothing burns.
    """

    atmosphere: Atmosphere
    albedo: dict[str, Any]
    geometry: Geometry
    surface_temperature: Float[Array, "*batch"] | None = None
    fire: Fire | None = None
