"""The project's own columns: one of each kind that the operator is made for."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..atmosphere import Atmosphere, Fire, Hydrometeor, LiquidCloud, MiePlume, Plume, State
from ..bands import BANDS
from ..geometry import Geometry
from ..optics import ash, background_aerosol, mie_plume, mie_species, smoke
from ..standard_atmospheres import standard_atmosphere
from ..surface import RossLi, ocean

# Few layers, of which every producer gets its own: ash lies in 8 to 11 km, smoke in 1 to 3 km.
_HEIGHT = (30e3, 16e3, 11e3, 8e3, 6e3, 4e3, 3e3, 2e3, 1e3, 0.0)
_ICE_LAYER, _SNOW_LAYER, _RAIN_LAYER, _STRATUS_LAYER = 2, 4, 8, 8

# Albedo by band: grass that is neither grey nor the same in two bands. [-]
_ALBEDO = {
    "C01": 0.04,
    "green": 0.08,
    "C02": 0.06,
    "C03": 0.30,
    "C04": 0.25,
    "C05": 0.22,
    "C06": 0.12,
    "C07": 0.05,
}
# Solar zenith, view zenith and relative azimuth. [rad] One is at nadir, where derivatives by a
# cosine would be infinite.
_OBLIQUE, _GLINT, _NADIR = (0.6, 0.8, 1.2), (0.5, 0.7, 2.9), (0.9, 0.0, 0.4)
_LOW_SUN, _NIGHT = (1.3, 0.6, 0.5), (2.2, 0.5, 1.0)
# Where paths through a sphere are begun to be taken, and at 11 degrees above the horizon.
_RATHER_LOW_SUN, _VERY_LOW_SUN = (1.18, 0.4, 1.5), (1.38, 0.7, 2.0)
# Bands over the sea and over grass where the ground is not Lambertian: none that emits.
_SEA, _LAND = ("C01", "C02", "C04", "C06"), ("green", "C03", "C05")
# Layer, and particles in a kilogram, of the classes beside ice, snow and rain.
_OTHER_CLASSES = {
    "drizzle": (_STRATUS_LAYER, 2e9),
    "pristine": (_ICE_LAYER, 2e10),
    "aggregates": (_SNOW_LAYER, 1e7),
    "graupel": (_SNOW_LAYER, 1e6),
    "hail": (_SNOW_LAYER, 1e4),
}
_MIE_RADII = {"smoke": 0.2, "ash": 2.0}  # [um]


def standard_columns() -> dict[str, State]:
    """Clear air, plumes, clouds and fires in the air of midlatitude summer, one column each.

    Most columns are of one structure: smoke, ash, one plume of every species that has a table of
    Mie theory but no published optics, droplets, ice, snow, rain, gases and a fire, with nothing
    of what is not in the column. So a derivative by what is absent is guarded as well, and they
    are one batch. Grounds that are not Lambertian, Mie theory of smoke and ash, and other classes
    of hydrometeors have columns of another; paths of the sun through a sphere, droplets by modified
    anomalous diffraction, rough ice and background aerosol of a third. Leaves are float64 whatever
    JAX is set to.
    """
    with jax.enable_x64(True):
        return _columns()


def _columns() -> dict[str, State]:
    tables = [species for species in mie_species() if species not in ("smoke", "ash")]
    columns = {
        "clear": _column(_OBLIQUE),
        "smoke": _column(_OBLIQUE, smoke_aod=0.8),
        "ash": _column(_LOW_SUN, ash_aod=0.6),
        "liquid cloud": _column(_NADIR, liquid=0.1),
        "ice, snow and rain": _column(_GLINT, frozen=0.05, rain=0.4),
        "smoke over stratus": _column(_OBLIQUE, smoke_aod=0.5, liquid=0.06),
        "fire by day": _column(_OBLIQUE, smoke_aod=0.3, fire_fraction=0.01, fire_temperature=900.0),
        "fire by night": _column(_NIGHT, fire_fraction=0.002, fire_temperature=800.0),
    }
    for species in tables:
        columns[species] = _column(_GLINT, table=species, table_aod=0.5)
    columns["sea and land"] = _on_rough_ground(_GLINT)
    columns["Mie droplets over sea and land"] = _on_rough_ground(_OBLIQUE, liquid=0.02)
    columns["Mie smoke and ash over sea and land"] = _on_rough_ground(_OBLIQUE, aod=0.4)
    columns["other hydrometeors over sea and land"] = _on_rough_ground(_GLINT, condensate=0.02)
    columns["droplets by anomalous diffraction"] = _in_a_sphere(_RATHER_LOW_SUN, liquid=0.05)
    columns["rough ice and snow"] = _in_a_sphere(_LOW_SUN, frozen=0.03)
    columns["background aerosol"] = _in_a_sphere(_VERY_LOW_SUN, aod=0.15)
    return columns


def _column(
    angles: tuple[float, float, float],
    *,
    smoke_aod: float = 0.0,
    ash_aod: float = 0.0,
    table: str | None = None,
    table_aod: float = 0.0,
    liquid: float = 0.0,
    frozen: float = 0.0,
    rain: float = 0.0,
    fire_fraction: float = 0.0,
    fire_temperature: float = 800.0,
) -> State:
    """One column of the common structure; masses in kg m-2."""
    every = tuple(BANDS)
    plumes: dict[str, Plume | MiePlume] = {
        "smoke": smoke(smoke_aod, bands=every),
        "ash": ash(ash_aod, bands=every),
    }
    for species in mie_species():
        if species not in plumes:
            aod = table_aod if species == table else 0.0
            plumes[species] = mie_plume(species, aod, 1.4, base=500.0, top=2500.0)
    air: Atmosphere = standard_atmosphere(
        "midlatitude_summer",
        _HEIGHT,
        liquid=LiquidCloud(*_in_layer(_STRATUS_LAYER, liquid, 7e11)),
        plumes=plumes,
        hydrometeors={
            "ice": Hydrometeor(*_in_layer(_ICE_LAYER, frozen, 2e9)),
            "snow": Hydrometeor(*_in_layer(_SNOW_LAYER, 2 * frozen, 1e6)),
            "rain": Hydrometeor(*_in_layer(_RAIN_LAYER, rain, 3e6)),
        },
    )
    return State(
        air,
        {band: jnp.asarray(_ALBEDO[band]) for band in every},
        _seen_under(angles),
        surface_temperature=jnp.asarray(297.0),
        fire=Fire(jnp.asarray(fire_fraction), jnp.asarray(fire_temperature)),
    )


def _on_rough_ground(
    angles: tuple[float, float, float],
    *,
    liquid: float = 0.0,
    aod: float = 0.0,
    condensate: float = 0.0,
) -> State:
    """The sea in some bands and grass in the others, in air without fires.

    With droplets by Mie theory, smoke and ash by Mie theory in one layer, and of each of the other
    classes of hydrometeors a mass in kg m-2.
    """
    grass = RossLi(f_iso=jnp.asarray(0.3), f_vol=jnp.asarray(0.15), f_geo=jnp.asarray(0.03))
    wind = jnp.asarray(6.0)
    air = standard_atmosphere(
        "us_standard",
        _HEIGHT,
        liquid=LiquidCloud(*_in_layer(_STRATUS_LAYER, liquid, 7e11), "mie"),
        plumes={
            name: mie_plume(name, aod, radius, base=1000.0, top=3000.0)
            for name, radius in _MIE_RADII.items()
        },
        hydrometeors={
            name: Hydrometeor(*_in_layer(layer, condensate, number_per_mass))
            for name, (layer, number_per_mass) in _OTHER_CLASSES.items()
        },
    )
    return State(
        air,
        {band: ocean(wind, band) for band in _SEA} | dict.fromkeys(_LAND, grass),
        _seen_under(angles),
    )


def _in_a_sphere(
    angles: tuple[float, float, float],
    *,
    liquid: float = 0.0,
    frozen: float = 0.0,
    aod: float = 0.0,
) -> State:
    """Air of a winter under a low sun, with optics that are others by choice."""
    bands = (*_SEA, *_LAND)
    frozen_classes = {"ice": (_ICE_LAYER, frozen, 2e9), "snow": (_SNOW_LAYER, 2 * frozen, 1e6)}
    air = standard_atmosphere(
        "midlatitude_winter",
        _HEIGHT,
        liquid=LiquidCloud(*_in_layer(_STRATUS_LAYER, liquid, 7e11), "mitchell"),
        hydrometeors={
            name: Hydrometeor(*_in_layer(*particles), "rough")
            for name, particles in frozen_classes.items()
        },
    )
    return State(
        replace(air, background=background_aerosol(aod, bands=bands)),
        {band: jnp.asarray(_ALBEDO[band]) for band in bands},
        replace(_seen_under(angles), spherical=True),
    )


def _seen_under(angles: tuple[float, float, float]) -> Geometry:
    sun, view, azimuth = (jnp.asarray(angle) for angle in angles)
    return Geometry(sun, view, azimuth)


def _in_layer(layer: int, mass: float, number_per_mass: float) -> tuple[Array, Array]:
    """Mass and number of particles in one layer. [kg m-2], [m-2]"""
    masses = np.zeros(len(_HEIGHT) - 1)
    masses[layer] = mass
    return jnp.asarray(masses), jnp.asarray(number_per_mass * masses)
