"""Made-up pixels of the experiments: air, grounds and plumes, of which all is known."""

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, ParamSpec

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from abi_operator import Atmosphere, Geometry, LiquidCloud, MiePlume, Plume, State
from abi_operator.demo.ground import make_ground
from abi_operator.demo.landscape import make_landscape
from abi_operator.demo.noise import make_noise
from abi_operator.optics import mie_optics
from abi_operator.surface import modis_to_abi, ocean
from abi_operator.surface.ocean import WATER_REFLECTANCE
from abi_operator.surface.ross_li import WHITE_SKY

RADIUS_UM = {"smoke": 0.14, "ash": 3.0, "dust": 1.5}
"""Effective radius of a plume's particles where nobody says another. [um]"""
BASE = {"smoke": 1.5e3, "ash": 6e3, "dust": 2e3}
"""Height of its lower edge. [m]"""
THICKNESS = 1.5e3
"""Height of its upper edge above that. [m]"""
NUM_LAYERS = 20
"""Of the columns. [-]"""
EXTENT = 128e3
"""Side of an image, however many pixels it has. [m]"""

_TOP = 40e3  # of the levels [m]
_SCALE_HEIGHT, _SURFACE_PRESSURE = 8e3, 1013.25e2  # [m], [Pa]
_DEGREES = {"solar_zenith": 48.0, "view_zenith": 55.0, "relative_azimuth": 70.0}
_INLAND = 80e3  # of the middle of the image of land, amid green hills and dry plains [m]
_TURBIDITY = 0.4  # standard deviation of the logarithm of the reflectance of water [-]
_WIND, _WIND_SPREAD = 6.0, 2.0  # over the sea, and its standard deviation [m s-1]

P = ParamSpec("P")


def in_double_precision(experiment: Callable[P, xr.Dataset]) -> Callable[P, xr.Dataset]:
    """The same experiment, in float64 whatever the process computes in."""

    @wraps(experiment)
    def run(*args: P.args, **options: P.kwargs) -> xr.Dataset:
        with jax.enable_x64(True):
            return experiment(*args, **options)

    return run


def directions(num_pixels: int) -> Geometry:
    """Sun and satellite as a morning in California has them for GOES-East, of each pixel."""
    sun, view, azimuth = (jnp.full(num_pixels, np.radians(_DEGREES[name])) for name in _DEGREES)
    return Geometry(sun, view, azimuth)


def random_directions(rng: np.random.Generator, num_pixels: int) -> Geometry:
    """Sun and view anywhere from 15 to 65 degrees from the zenith, of each pixel."""
    sun, view = np.radians(rng.uniform(15, 65, (2, num_pixels)))
    azimuth = rng.uniform(0, np.pi, num_pixels)
    return Geometry(jnp.asarray(sun), jnp.asarray(view), jnp.asarray(azimuth))


def clear_air(
    num_pixels: int,
    plumes: dict[str, Plume | MiePlume] | None = None,
    liquid: LiquidCloud | None = None,
) -> Atmosphere:
    """Air of 20 layers, thin ones below, without gases that absorb; and what else is in it."""
    levels = _TOP * jnp.linspace(1, 0, NUM_LAYERS + 1) ** 1.5
    height = jnp.broadcast_to(levels, (num_pixels, NUM_LAYERS + 1))
    pressure = _SURFACE_PRESSURE * jnp.exp(-height / _SCALE_HEIGHT)
    if liquid is None:
        nothing = jnp.zeros((num_pixels, NUM_LAYERS))
        liquid = LiquidCloud(nothing, nothing)
    return Atmosphere(pressure, height, liquid, plumes or {})


def known_plume(
    species: str, num_pixels: int, bands: Sequence[str], radius_um: float | None = None
) -> Plume:
    """A plume whose optics by band are those of the table at one radius.

    Its phase function is that of Henyey and Greenstein, and its optical depth is 1.
    """
    radius = jnp.asarray(RADIUS_UM[species] if radius_um is None else radius_um)
    spheres = {band: mie_optics(species, radius, band) for band in bands}

    def by_band(read: Callable[[Any], Any]) -> dict[str, Any]:
        return {band: jnp.full(num_pixels, float(read(s))) for band, s in spheres.items()}

    return Plume(
        base=jnp.full(num_pixels, BASE[species]),
        top=jnp.full(num_pixels, BASE[species] + THICKNESS),
        extinction_550=jnp.full(num_pixels, 1 / THICKNESS),
        brightness=jnp.ones(num_pixels),
        relative_extinction=by_band(lambda s: s.relative_extinction),
        ssa=by_band(lambda s: 1 - s.coalbedo),
        asymmetry=by_band(lambda s: s.asymmetry),
    )


def with_albedo(state: State, albedo: np.ndarray, bands: Sequence[str]) -> State:
    """States over other grounds, (pixel, band)."""
    grounds = {band: albedo[:, i] for i, band in enumerate(bands)}
    return State(state.atmosphere, grounds, state.geometry, state.surface_temperature, state.fire)


def random_field(
    rng: np.random.Generator, size: int, longest: float = 80e3, shortest: float = 8e3
) -> np.ndarray:
    """A smooth field over an image, (y, x), of mean 0 and variance 1 there. [-]"""
    field = make_noise(rng, longest, shortest)(*_places(size))
    return (field - field.mean()) / field.std()


def land_albedo(rng: np.random.Generator, size: int, bands: Sequence[str]) -> np.ndarray:
    """Albedo of green hills that turn into dry plains, (y, x, band), as the demonstration's. [-]"""
    east, north = _places(size)
    distance = _INLAND + east
    landscape = make_landscape(rng)
    ground = make_ground(landscape, east, north, distance, EXTENT / size)
    white_sky = ground.kernel_weights(0.0) @ np.array(WHITE_SKY)
    modis = {f"Band{i + 1}": jnp.asarray(white_sky[i]) for i in range(7)}
    return np.stack([np.asarray(modis_to_abi(modis, band)) for band in bands], axis=-1)


def water_albedo(rng: np.random.Generator, size: int, bands: Sequence[str]) -> np.ndarray:
    """Albedo of a sea under changing winds and of changing turbidity, (y, x, band). [-]

    It is the reflectance of `abi_operator.surface.ocean` in the `directions`, far from the glint:
    winds of 6 m/s with a standard deviation of 2, and light out of the water that varies by 40 %,
    in all bands together.
    """
    wind = jnp.asarray(np.maximum(_WIND + _WIND_SPREAD * random_field(rng, size), 1.0))
    turbidity = np.exp(_TURBIDITY * random_field(rng, size, 40e3))
    seas = [ocean(wind, band, jnp.asarray(WATER_REFLECTANCE[band] * turbidity)) for band in bands]
    sun, view, azimuth = (jnp.radians(_DEGREES[name]) for name in _DEGREES)
    return np.stack([np.asarray(s.brdf(jnp.cos(view), jnp.cos(sun), azimuth)) for s in seas], -1)


def _places(size: int) -> tuple[np.ndarray, np.ndarray]:
    """East and north of the middle of an image. [m]"""
    along = (np.arange(size) + 0.5) * (EXTENT / size) - EXTENT / 2
    north, east = np.meshgrid(along, along, indexing="ij")
    return east, north
