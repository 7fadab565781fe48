"""Images of what scenes hold, as states of the operator: what `pareto_columns` makes columns of.

An image is square and 100 km wide, whatever the number of its pixels: with 2,500 of them they are
2 km apart, as the imager's are. Everything in it (plume, cloud, ground, air, sun and view) is a
smooth random field, a sum of waves of 12 to 100 km, so that neighbours are alike. Sun and view go
through all of their range across it, as they do across a full disk and not across 100 km.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import workload

from abi_operator import (
    Atmosphere,
    Fire,
    Gases,
    Geometry,
    LiquidCloud,
    State,
    ash,
    smoke,
    standard_atmosphere,
)
from abi_operator.demo.noise import make_noise
from abi_operator.optics import from_effective_radius

EXTENT = 100e3  # of the image [m]
SHORTEST, LONGEST = 12e3, 100e3  # waves of the fields [m]
TOP = 20.5e3  # of the model over the sea [m]
STRETCHING = 4.0  # of 30 layers the lowest is 100 m thick and the highest 2.6 km
MU0, MU = (0.25, 0.97), (0.35, 0.97)  # cosines of sun and view

# Albedo of water, plants and bare soil; of C07 it is 1 - emissivity. [-]
ALBEDO = {
    "C01": (0.05, 0.03, 0.12),
    "C02": (0.03, 0.05, 0.24),
    "C03": (0.02, 0.27, 0.31),
    "C05": (0.01, 0.17, 0.40),
    "C06": (0.01, 0.085, 0.35),
    "C07": (0.022, 0.06, 0.14),
}
# Liquid water grows in stratocumulus by four fifths of the adiabatic rate. [kg m-4]
WATER_GROWTH = 1.6e-6


@dataclass(frozen=True)
class Image:
    """Places of the pixels in row order, and where randomness comes from."""

    east: np.ndarray
    north: np.ndarray
    rng: np.random.Generator

    def field(self):
        """A smooth random field with every value from 0 to 1 as frequent as any other. [-]"""
        noise = make_noise(self.rng, LONGEST, SHORTEST, num_waves=40)(self.east, self.north)
        return np.array([0.5 * math.erfc(-x / math.sqrt(2)) for x in noise])

    def between(self, low, high):
        return low + (high - low) * self.field()

    def log_between(self, low, high, power=1.0):
        """From low to high, evenly in the logarithm; more of the low where the power is above 1."""
        return low * (high / low) ** (self.field() ** power)


def image(num_pixels, rng):
    width = math.ceil(math.sqrt(num_pixels))
    row, column = np.divmod(np.arange(num_pixels), width)
    return Image(*((x + 0.5) * EXTENT / width for x in (column, row)), rng)


@dataclass(frozen=True)
class Air:
    """Levels of all pixels (pixel, level), top first: height [m], pressure [Pa], temperature [K].

    Beside them what is above each level: vapour [kg m-2] and ozone [DU].
    """

    height: np.ndarray
    pressure: np.ndarray
    temperature: np.ndarray
    vapour_above: np.ndarray
    ozone_above: np.ndarray

    @property
    def above_ground(self):
        return self.height - self.height[:, -1:]


def make_air(pixels: Image, num_layers, land):
    """Terrain-following levels of WRF's kind, thin near the ground, in a summer's air."""
    fine = np.linspace(60e3, 0, 1201)
    summer = standard_atmosphere("midlatitude_summer", fine)
    step = np.linspace(1, 0, num_layers + 1)
    height = TOP * np.sinh(STRETCHING * step) / math.sinh(STRETCHING)
    log_pressure = np.log(np.asarray(summer.pressure))
    of_height = np.exp(np.interp(height, fine[::-1], log_pressure[::-1]))
    eta = (of_height - of_height[0]) / (of_height[-1] - of_height[0])
    terrain = 1500 * land * pixels.field() ** 2
    ground = np.exp(np.interp(terrain, fine[::-1], log_pressure[::-1]))
    ground = ground * pixels.between(0.99, 1.01)
    pressure = of_height[0] + eta * (ground[:, None] - of_height[0])
    height = np.interp(np.log(pressure), log_pressure, fine)
    height = height + (terrain - height[:, -1])[:, None]

    def at_levels(values):
        return np.interp(height, fine[::-1], np.asarray(values)[::-1])

    def above(amounts):
        total = at_levels(np.concatenate([[0], np.cumsum(np.asarray(amounts))]))
        total[:, 0] = 0  # what is above the first level counts in the first layer
        return total

    temperature = at_levels(summer.temperature) + pixels.between(-6, 6)[:, None]
    vapour = above(summer.gases.vapour) * pixels.between(0.4, 1.4)[:, None]
    ozone = above(summer.gases.ozone) * pixels.between(0.85, 1.1)[:, None]
    return Air(height, pressure, temperature, vapour, ozone)


def make_ground(pixels: Image, bands):
    """Albedo by band, and where land is."""
    land = np.clip((pixels.field() - 0.35) / 0.04, 0, 1)  # a third of the image is water
    plants, soil = pixels.field(), pixels.between(0.7, 1.2)

    def of_band(water, green, bare):
        return (1 - land) * water + land * (plants * green + (1 - plants) * soil * bare)

    return {band: of_band(*ALBEDO[band]) for band in bands}, land


def make_geometry(pixels: Image):
    """Sun and view of every pixel; suns keep away from directions at which CDISORT fails."""
    mu0, mu = pixels.between(*MU0), pixels.between(*MU)
    drawn = mu0.copy()
    while (near := workload.near_node(mu0)).any():
        mu0[near] = drawn[near] + pixels.rng.uniform(-4e-3, 4e-3, near.sum())
    return Geometry(np.arccos(mu0), np.arccos(mu), np.pi * pixels.field())


def make_plumes(pixels: Image, bands):
    """Smoke in a half of the image, ash in the other; a fourth is clear, and much of it weak."""
    cover = pixels.field()
    covered = cover > 0.25
    depth = 0.05 * 80 ** (np.clip((cover - 0.25) / 0.75, 0, 1) ** 1.5)
    smoky = pixels.field() > 0.5
    base, thickness = pixels.between(0, 2000), pixels.between(500, 2000)
    smoke_plume = smoke(
        np.where(covered & smoky, depth, 0.0), base=base, top=base + thickness, bands=bands
    )
    base, thickness = pixels.between(6000, 9500), pixels.between(800, 2500)
    ash_plume = ash(
        np.where(covered & ~smoky, depth, 0.0), base=base, top=base + thickness, bands=bands
    )
    return {"smoke": smoke_plume, "ash": ash_plume}


def _spread(air: Air, path, base, top):
    """A path [kg m-2] over the layers between two heights above the ground, most in the middle."""
    share = np.clip((air.above_ground - base[:, None]) / (top - base)[:, None], 0, 1)
    below = share - np.sin(2 * np.pi * share) / (2 * np.pi)
    return -np.diff(below, axis=1) * path[:, None]


def make_clouds(pixels: Image, air: Air):
    """Stratocumulus, deep convection with its anvil, and cirrus, thin and thick, over all of it.

    Convection is in an eighth of the image and snow around it in as much; of the rest two fifths
    have stratocumulus. Half has cirrus, and some a fifth has no cloud at all.
    """
    tower = pixels.field()
    deep = np.clip((tower - 0.85) / 0.15, 0, 1)
    around = np.clip((tower - 0.75) / 0.1, 0, 1)
    cells, veil = pixels.field(), pixels.field()
    low = np.clip((cells - 0.55) / 0.45, 0, 1) * (deep == 0)
    base = pixels.between(300, 900)
    thickness = 600 * low**0.8
    inside = np.clip(air.above_ground - base[:, None], 0, thickness[:, None])
    liquid = -np.diff(inside**2, axis=1) * WATER_GROWTH / 2
    core = np.full_like(base, 1000.0), np.full_like(base, 7000.0)
    liquid = liquid + _spread(air, 2.5 * deep, *core)
    depth = -np.diff(air.height, axis=1)
    number = np.where(liquid > 0, depth * pixels.log_between(4e7, 4e8)[:, None], 0.0)
    rain = _spread(air, 2.0 * deep + 0.1 * around, 0 * base, 0 * base + 5000)
    snow = _spread(air, 2.0 * deep + 0.3 * around, 0 * base + 4500, 0 * base + 11500)
    ice = _spread(air, 0.3 * deep + 0.03 * around, 0 * base + 8000, 0 * base + 13000)
    thin = np.where(veil > 0.5, 10 ** (-4.0 + 2.7 * np.clip((veil - 0.5) / 0.5, 0, 1)), 0.0)
    base = pixels.between(7500, 10500)
    ice = ice + _spread(air, thin, base, base + pixels.between(600, 2500))

    def particles(name, mass, radius):
        sizes = np.where(mass > 0, radius[:, None], 0.0)
        return from_effective_radius(mass, sizes, name)

    classes = {
        "ice": particles("ice", ice, pixels.between(2e-5, 6e-5)),
        "snow": particles("snow", snow, pixels.between(8e-5, 2.5e-4)),
        "rain": particles("rain", rain, pixels.between(2e-4, 6e-4)),
    }
    return LiquidCloud(liquid, number), classes


def make_fires(pixels: Image):
    """A fifth of the pixels burn, on 1e-4 to 0.05 of their ground."""
    burning = np.clip((pixels.field() - 0.8) / 0.2, 0, 1)
    fraction = np.where(burning > 0, 1e-4 * 500**burning, 0.0)
    return Fire(fraction, pixels.between(600, 1200))


def make_state(num_pixels, num_layers, bands, rng, *, plumes=False, clouds=False, hot=False):
    """One batch of states; `hot` has gases, temperatures and fires."""
    pixels = image(num_pixels, rng)
    albedo, land = make_ground(pixels, bands)
    air = make_air(pixels, num_layers, land)
    empty = np.zeros((num_pixels, num_layers))
    liquid, classes = LiquidCloud(empty, empty), {}
    if clouds:
        liquid, classes = make_clouds(pixels, air)
    atmosphere = Atmosphere(
        pressure=air.pressure,
        height=air.height,
        liquid=liquid,
        plumes=make_plumes(pixels, bands) if plumes else {},
        hydrometeors=classes,
    )
    state = State(atmosphere, albedo, make_geometry(pixels))
    if not hot:
        return state
    same = np.ones(num_pixels)
    gases = Gases(
        np.diff(air.vapour_above, axis=1),
        np.diff(air.ozone_above, axis=1),
        *(x * same for x in (400e-6, 1.85e-6, 0.33e-6)),
    )
    atmosphere = replace(atmosphere, temperature=air.temperature, gases=gases)
    surface = air.temperature[:, -1] + pixels.between(-3, 12)
    return State(atmosphere, albedo, state.geometry, surface, make_fires(pixels))
