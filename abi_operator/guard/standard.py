"""The project's own columns: one of each kind that the operator is made for."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..atmosphere import Atmosphere, Fire, Hydrometeor, LiquidCloud, MiePlume, Plume, State
from ..bands import BANDS
from ..geometry import Geometry
from ..optics import ash, mie_plume, mie_species, smoke
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


def standard_columns() -> dict[str, State]:
    """Clear air, plumes, clouds and fires in the air of midlatitude summer, one column each.

    Most columns are of one structure: smoke, ash, one plume of every species that has a table of
    Mie theory but no published optics, droplets, ice, snow, rain, gases and a fire, with nothing
    of what is not in the column. So a derivative by what is absent is guarded as well, and they
    are one batch. Grounds that are not Lambertian and Mie theory of droplets have columns of
    another. Leaves are float64 whatever JAX is set to.
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
        Geometry(*(jnp.asarray(angle) for angle in angles)),
        surface_temperature=jnp.asarray(297.0),
        fire=Fire(jnp.asarray(fire_fraction), jnp.asarray(fire_temperature)),
    )


def _on_rough_ground(angles: tuple[float, float, float], liquid: float = 0.0) -> State:
    """The sea in C02 and grass in C03, in air without plumes, frozen water and fires."""
    mass, number = _in_layer(_STRATUS_LAYER, liquid, 7e11)
    grass = RossLi(f_iso=jnp.asarray(0.3), f_vol=jnp.asarray(0.15), f_geo=jnp.asarray(0.03))
    return State(
        standard_atmosphere("us_standard", _HEIGHT, liquid=LiquidCloud(mass, number, "mie")),
        {"C02": ocean(jnp.asarray(6.0), "C02"), "C03": grass},
        Geometry(*(jnp.asarray(angle) for angle in angles)),
    )


def _in_layer(layer: int, mass: float, number_per_mass: float) -> tuple[Array, Array]:
    """Mass and number of particles in one layer. [kg m-2], [m-2]"""
    masses = np.zeros(len(_HEIGHT) - 1)
    masses[layer] = mass
    return jnp.asarray(masses), jnp.asarray(number_per_mass * masses)
