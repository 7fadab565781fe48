"""Specified columns, as dictionaries of plain numbers and as a batch of states.

Every column holds every kind of matter, most of it in the amount of nothing, so that all of them
are one batch of one structure. `independent_layers` makes layers of the same numbers.
"""

import independent_ice as ice
import numpy as np

from abi_operator import (
    Atmosphere,
    Fire,
    Gases,
    Geometry,
    Hydrometeor,
    LiquidCloud,
    State,
    ash,
    mie_plume,
    smoke,
)
from abi_operator.optics.mie_table import mie_table

BANDS = ("C01", "C02", "C03", "C04", "C05", "C06", "C07")
KINDS = ("clear", "smoke", "ash", "spheres", "liquid", "ice", "smoke over stratus", "fire")
GASES = ("vapour", "ozone", "CO2", "CH4", "N2O")
ANGLES = ("solar_zenith", "view_zenith", "relative_azimuth")
SPECIES = ("smoke", "ash", "dust")
# Radii that are nodes of the tables, by their number.
NODES = {"smoke": (12, 18, 24), "ash": (5, 10, 15), "dust": (5, 10, 15)}
NUM_LAYERS = 10


def column(kind, rng):
    """Numbers of one column of a kind."""
    height = np.array([18e3, 14e3, 11e3, 9e3, 7e3, 5e3, 3.6e3, 2.4e3, 1.4e3, 0.6e3, 0.0])
    height[1:-1] += rng.uniform(-200, 200, NUM_LAYERS - 1)
    surface = rng.uniform(860e2, 1025e2)
    ground = rng.uniform(275.0, 310.0)
    vapour = rng.uniform(2.0, 40.0) * -np.diff(np.exp(-height[::-1] / 2000.0))[::-1]
    made = {
        "kind": kind,
        "terrain": rng.uniform(0, 2000.0),
        "height": height,
        "pressure": surface * np.exp(-height / 7800.0),
        "temperature": np.maximum(ground - 2.0 - 6.5e-3 * height, 205.0),
        "vapour": vapour,
        "ozone": rng.uniform(250, 400) * np.r_[0.8, np.full(NUM_LAYERS - 1, 0.2 / 9)],
        "CO2": rng.uniform(380e-6, 430e-6),
        "CH4": rng.uniform(1.7e-6, 2.0e-6),
        "N2O": rng.uniform(0.31e-6, 0.34e-6),
        "albedo": dict(zip(BANDS, rng.uniform(0.0, 0.7, len(BANDS)), strict=True)),
        "ground": ground,
        # CDISORT drops the azimuth of a beam within 1e-5 of the vertical.
        "solar_zenith": rng.uniform(np.radians(2.0), np.radians(78.0)),
        "view_zenith": rng.uniform(np.radians(2.0), np.radians(75.0)),
        "relative_azimuth": rng.uniform(0.0, np.pi),
        "fire": (0.0, 600.0),
        "plumes": {name: (0.0, 1.0, 1000.0, 3000.0) for name in ("smoke", "ash")},
        "spheres": {s: (0.0, 1.0, 1000.0, 3000.0, NODES[s][0]) for s in SPECIES},
        "liquid": np.zeros((2, NUM_LAYERS)),
        "ice": np.zeros((2, NUM_LAYERS)),
    }
    depth, brightness = np.exp(rng.uniform(np.log(0.05), np.log(4.0))), rng.uniform(0.2, 1.0)
    low = rng.uniform(200.0, 2000.0)
    high = rng.uniform(7000.0, 9500.0)
    lower = depth, brightness, low, low + rng.uniform(300.0, 3000.0)
    upper = depth, brightness, high, high + rng.uniform(500.0, 3500.0)
    if kind == "smoke" or (kind == "fire" and rng.uniform() < 0.5):
        made["plumes"]["smoke"] = lower
    if kind == "smoke over stratus":
        made["plumes"]["smoke"] = depth, brightness, 1700.0, 1700.0 + rng.uniform(300.0, 3000.0)
    if kind == "ash":
        made["plumes"]["ash"] = upper
    if kind == "spheres":
        species = SPECIES[rng.integers(3)]
        node = NODES[species][rng.integers(3)]
        made["spheres"][species] = *(upper if species == "ash" else lower), node
    if kind in ("liquid", "smoke over stratus"):
        first = rng.integers(4, 8) if kind == "liquid" else 8
        for layer in range(first, first + rng.integers(1, 3)):
            radius = rng.uniform(4e-6, 25e-6)
            mass = np.exp(rng.uniform(np.log(0.003), np.log(0.15)))
            # Gamma distribution of shape 7: mean mass of a droplet from its effective radius.
            made["liquid"][:, layer] = mass, mass / (1000 * 4 / 3 * np.pi * radius**3 * 0.72)
    if kind == "ice":
        for layer in range(1, 1 + rng.integers(1, 4)):
            mass = np.exp(rng.uniform(np.log(0.002), np.log(0.05)))
            made["ice"][:, layer] = mass, rng.uniform(25.0, 200.0)
    if kind == "fire":
        made["fire"] = np.exp(rng.uniform(np.log(1e-4), np.log(0.1))), rng.uniform(500.0, 1200.0)
    return made


def specified_columns(each, seed):
    """So many columns of each of `KINDS`."""
    rng = np.random.default_rng(seed)
    return [column(kind, rng) for kind in KINDS for _ in range(each)]


def states(columns, liquid_optics="mie"):
    """Columns as the package takes them, one batch; `liquid_optics` is that of `LiquidCloud`."""

    def stacked(read):
        return np.stack([np.asarray(read(c), float) for c in columns])

    def extent(group, name):
        depth, brightness, base, top, *node = stacked(lambda c: c[group][name]).T
        return depth, {"brightness": brightness, "base": base, "top": top}, node

    every = {}
    for name, build in (("smoke", smoke), ("ash", ash)):
        depth, where, _ = extent("plumes", name)
        every[name] = build(depth, bands=BANDS, **where)
    for name in SPECIES:
        depth, where, (node,) = extent("spheres", name)
        radius = np.asarray(mie_table(name).effective_radius_um)[node.astype(int)]
        every[f"spheres of {name}"] = mie_plume(name, depth, radius, **where)
    crystals = [[m / ice.mean_mass(d) if m else 0.0 for m, d in c["ice"].T] for c in columns]
    air = Atmosphere(
        pressure=stacked(lambda c: c["pressure"]),
        height=stacked(lambda c: c["height"] + c["terrain"]),
        liquid=LiquidCloud(*np.moveaxis(stacked(lambda c: c["liquid"]), 1, 0), liquid_optics),
        plumes=every,
        temperature=stacked(lambda c: c["temperature"]),
        gases=Gases(*(stacked(lambda c, g=g: c[g]) for g in GASES)),
        hydrometeors={"ice": Hydrometeor(stacked(lambda c: c["ice"][0]), np.array(crystals))},
    )
    return State(
        air,
        {band: stacked(lambda c, band=band: c["albedo"][band]) for band in BANDS},
        Geometry(*(stacked(lambda c, x=x: c[x]) for x in ANGLES)),
        stacked(lambda c: c["ground"]),
        Fire(*stacked(lambda c: c["fire"]).T),
    )
