"""Columns of every kind that scenes hold, as one batch of states: what `truth.py` judges.

Every column has every kind of matter, most of it in the amount of nothing, so that all kinds are
one structure and one program. Layers are few, as what they cost is the truth's.
"""

import numpy as np

from abi_operator import (
    Atmosphere,
    Fire,
    Gases,
    Geometry,
    LiquidCloud,
    State,
    ash,
    mie_plume,
    smoke,
    standard_atmosphere,
)
from abi_operator.optics import from_effective_radius
from abi_operator.surface import snow_and_ice_albedo

BANDS = ("C01", "C02", "C03", "C04", "C05", "C06", "C07")
KINDS = (
    *("clear", "smoke", "ash", "dust", "liquid", "ice", "mixed", "snow ground", "sea", "fire"),
)
# Levels. [m]
HEIGHT = 1e3 * np.array([30, 16, 12, 9.5, 7, 4.5, 2.5, 1.2, 0.5, 0])
NUM_LAYERS = HEIGHT.size - 1
AIR = ("tropical", "midlatitude_summer", "midlatitude_winter", "us_standard")
# Albedo of plants and of bare soil. [-]
PLANTS = (0.03, 0.05, 0.27, 0.25, 0.17, 0.085, 0.06)
SOIL = (0.12, 0.24, 0.31, 0.40, 0.40, 0.35, 0.14)
SEA = 0.03
EMISSIVITY_OF_SNOW = 0.98


def snow_albedo():
    """Old snow, by band."""
    found = [snow_and_ice_albedo("old snow", band) for band in BANDS[:-1]]
    return np.array([*found, 1 - EMISSIVITY_OF_SNOW])


class Drawn:
    """Random numbers for the columns of one kind, and zero for all others."""

    def __init__(self, kinds, rng):
        self.kinds, self.rng = np.asarray(kinds), rng

    def of(self, *names):
        return np.isin(self.kinds, names)

    def between(self, low, high):
        return self.rng.uniform(low, high, self.kinds.size)

    def log_between(self, low, high, *names):
        """Evenly in the logarithm, for the kinds of these names if there are any."""
        values = np.exp(self.rng.uniform(np.log(low), np.log(high), self.kinds.size))
        return np.where(self.of(*names), values, 0.0) if names else values

    def in_layers(self, path, first, last):
        """A path in one layer of these, drawn anew for each column. (column, layer)"""
        layers = np.zeros((self.kinds.size, NUM_LAYERS))
        chosen = self.rng.integers(first, last + 1, self.kinds.size)
        layers[np.arange(self.kinds.size), chosen] = path
        return layers


def make_states(count, seed, liquid_optics):
    """States (column), and the kind of each; the same columns for any optics of liquid clouds."""
    kinds = [KINDS[k % len(KINDS)] for k in range(count)]
    drawn = Drawn(kinds, np.random.default_rng(seed))
    ground = _ground(drawn)
    geometry = Geometry(
        np.arccos(drawn.between(0.2, 1.0)),
        np.arccos(drawn.between(0.3, 1.0)),
        drawn.between(0.0, np.pi),
    )
    plumes = _plumes(drawn)
    classes, liquid = _clouds(drawn, liquid_optics)
    air = _air(drawn)
    warmer = drawn.between(-3.0, 10.0)
    atmosphere = Atmosphere(**air, liquid=liquid, plumes=plumes, hydrometeors=classes)
    fire = Fire(drawn.log_between(1e-4, 0.1, "fire"), drawn.between(500.0, 1200.0))
    surface = air["temperature"][:, -1] + np.where(drawn.of("snow ground"), 0.0, warmer)
    return State(atmosphere, ground, geometry, surface, fire), np.array(kinds)


def _ground(drawn):
    plants, wet = drawn.between(0, 1), drawn.between(0.6, 1.2)
    land = plants[:, None] * PLANTS + (wet * (1 - plants))[:, None] * SOIL
    sea, snow = drawn.of("sea")[:, None], drawn.of("snow ground")[:, None]
    albedo = np.where(snow, snow_albedo(), np.where(sea, SEA, land))
    return {band: albedo[:, k] for k, band in enumerate(BANDS)}


def _air(drawn):
    """One of the standard atmospheres, with more or less vapour, warmer or colder."""
    every = [standard_atmosphere(name, HEIGHT) for name in AIR]
    which = drawn.rng.integers(len(AIR), size=drawn.kinds.size)

    def picked(read):
        return np.stack([np.asarray(read(x)) for x in every])[which]

    wet = drawn.between(0.5, 1.4)[:, None]
    same = np.ones(drawn.kinds.size)
    return {
        "pressure": picked(lambda x: x.pressure),
        "height": picked(lambda x: x.height),
        "temperature": picked(lambda x: x.temperature) + drawn.between(-5, 5)[:, None],
        "gases": Gases(
            picked(lambda x: x.gases.vapour) * wet,
            picked(lambda x: x.gases.ozone),
            *(x * same for x in (420e-6, 1.9e-6, 0.335e-6)),
        ),
    }


def _plumes(drawn):
    """Smoke (over fires, too) and dust low, ash high; a third of the sea has a haze of smoke."""
    low, high = drawn.between(200, 2000), drawn.between(7000, 9500)
    thick = drawn.between(500, 3000)
    smoky = drawn.log_between(0.05, 4.0, "smoke", "fire")
    haze = np.where(drawn.of("sea") & (drawn.between(0, 1) < 1 / 3), 0.1, 0.0)
    where = {"base": low, "top": low + thick}
    above = {"base": high, "top": high + thick}
    dusty = drawn.log_between(0.05, 4.0, "dust"), drawn.between(0.8, 2.5)
    return {
        "smoke": smoke(smoky + haze, bands=BANDS, **where),
        "ash": ash(drawn.log_between(0.05, 4.0, "ash"), bands=BANDS, **above),
        "dust": mie_plume("dust", *dusty, **where),
    }


def _clouds(drawn, liquid_optics):
    """Liquid below 4.5 km and ice above 7 km; mixed columns have both, and snow or rain."""
    mass = drawn.in_layers(drawn.log_between(0.005, 0.4, "liquid", "mixed"), 6, 7)
    radius = drawn.between(4e-6, 20e-6)[:, None]
    # Mean mass of a droplet of a gamma distribution of effective variance 0.1.
    liquid = LiquidCloud(mass, mass / (1000 * 4 / 3 * np.pi * radius**3 * 0.72), liquid_optics)
    frozen = drawn.in_layers(drawn.log_between(0.002, 0.5, "ice", "mixed"), 2, 3)
    half = drawn.between(0, 1) < 0.5
    snow = np.where(half, drawn.log_between(0.01, 1.0, "mixed"), 0)
    rain = np.where(half, 0, drawn.log_between(0.01, 1.0, "mixed"))

    def particles(name, path, low, high):
        sizes = np.where(path > 0, drawn.between(low, high)[:, None], 0.0)
        return from_effective_radius(path, sizes, name)

    classes = {
        "ice": particles("ice", frozen, 15e-6, 60e-6),
        "snow": particles("snow", drawn.in_layers(snow, 4, 5), 8e-5, 2.5e-4),
        "rain": particles("rain", drawn.in_layers(rain, 7, 8), 2e-4, 6e-4),
    }
    return classes, liquid
