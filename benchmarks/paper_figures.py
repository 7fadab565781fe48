"""The physics of Grasso et al. (2013), as this operator has it.

    python benchmarks/paper_figures.py

Takes no options and prints tables: at which temperature a fire in one cell of 400 m saturates a
pixel of 2 km, without air and sun and with them; how its contrast in C06 hangs on the ground beside
it; the green of Eq. (1) and of the other recipes against simulated light of 0.555 um over standard
grounds and plumes, before and after the air is taken out; what the gases take that the paper
leaves out; and the test with the near infrared 10 % up and down. Float64; a minute or two.
"""

import platform
from dataclasses import replace
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from grounds import COLORS, FIRE_GROUNDS, GROUNDS

from abi_operator import (
    BANDS,
    Fire,
    Geometry,
    State,
    __version__,
    ash,
    brf,
    mie_plume,
    radiance,
    smoke,
    standard_atmosphere,
)
from abi_operator.instrument import IMAGER, Imager, observe
from abi_operator.optics import gas_absorption, transmittance
from abi_operator.products import (
    GREEN_RECIPES,
    corrected_colors,
    derived_green,
    fire_contrast,
    nir_test,
    rayleigh_corrected,
)
from abi_operator.scene.angles import find_angles
from abi_operator.surface import emissivity_3900nm

# Levels on the edges of the plumes. [m]
HEIGHT = 1e3 * np.array(
    [60, 40, 30, 25, 20, 16, 14, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2.5, 2, 1.5, 1, 0.5, 0]
)
# The paper's cases: time, latitude and longitude. [degree]
CASES = {
    "case 1": (np.datetime64("2007-10-23T18:00"), 33.0, -117.0),
    "case 2": (np.datetime64("2005-06-27T18:00"), 43.0, -105.0),
}
SATELLITES = {"75 W": -75.0, "137 W": -137.0}
SUN_DISTANCE = 0.9949  # in case 1 [AU]
CASE1_GASES = {"precipitable_water": 10.0, "ozone_column": 280.0}  # [kg m-2], [DU]
GROUND = 300.0  # beside the fire [K]
CELLS = jnp.array([1.0, 24.0])  # that burn and that do not, of the 25 in a pixel
LIMITS = {
    "C07, 411.9 K": ("C07", IMAGER),
    "C07, 400 K": ("C07", Imager(fire_saturation_temperature=400.0)),
    "C06": ("C06", IMAGER),
}
FIRE_BANDS = ("C06", "C07")
# Optical depth at 550 nm of each species.
PLUMES = {
    "none": (0.0, 0.0, 0.0),
    "smoke 0.5": (0.5, 0.0, 0.0),
    "smoke 2": (2.0, 0.0, 0.0),
    "ash 0.5": (0.0, 0.5, 0.0),
    "ash 2": (0.0, 2.0, 0.0),
    "dust 0.5": (0.0, 0.0, 0.5),
    "dust 2": (0.0, 0.0, 2.0),
}
# Thin and thick ash over the grounds of the paper's second case.
NIR_GROUNDS = ("canopy", "withered canopy", "dry soil", "lake")
NIR_DEPTHS = (0.2, 1.0, 5.0, 30.0)


def table(head, rows):
    print(f"| {' | '.join(head)} |\n|{' --- |' * len(head)}")
    for row in rows:
        print(f"| {' | '.join(map(str, row))} |")
    print(flush=True)


def directions(case, satellite):
    """Geometry of a case seen from a satellite."""
    time, latitude, longitude = CASES[case]
    angles = find_angles(time, np.array([latitude]), np.array([longitude]), SATELLITES[satellite])
    return Geometry(*(jnp.asarray(np.radians(x[0])) for x in angles))


def columns(states):
    """Many states as one batch."""
    return jax.tree.map(lambda *x: jnp.stack([jnp.asarray(y, float) for y in x]), *states)


# Fires


def fire_state(albedo, geometry, profile=None):
    """Ground at 300 K below a standard atmosphere, or below none."""
    air = standard_atmosphere(profile or "us_standard", HEIGHT)
    if profile is None:
        air = replace(air, pressure=0 * air.pressure, gases=jax.tree.map(jnp.zeros_like, air.gases))
    return State(air, dict(zip(FIRE_BANDS, albedo, strict=True)), geometry, jnp.asarray(GROUND))


def pixel(states, temperature):
    """Radiance of the burning cell and of the others, (states, cell, band)."""
    one = jnp.ones_like(temperature)
    cells = [replace(states, fire=Fire(share * one, temperature)) for share in (1.0, 0.0)]
    both = jax.tree.map(lambda *x: jnp.stack(x, axis=1), *cells)
    return radiance(both, FIRE_BANDS, sun_distance=SUN_DISTANCE, num_doublings=4)


def observed(seen, band, imager=IMAGER):
    """What the imager makes of these pixels in a band."""
    cells = seen[:, :, FIRE_BANDS.index(band)]
    watch = partial(observe, band=band, imager=imager, sun_distance=SUN_DISTANCE)
    return jax.vmap(lambda x: watch(x, CELLS))(cells)


def saturation_temperatures(states):
    """Temperature of the fire from which on a pixel saturates, (limit, state), by bisection. [K]"""
    count = states.surface_temperature.shape[0]
    many = jax.tree.map(lambda x: jnp.concatenate([x] * len(LIMITS)), states)
    low, high = np.full((len(LIMITS), count), 400.0), np.full((len(LIMITS), count), 2000.0)
    while np.max(high - low) > 0.02:
        middle = (low + high) / 2
        seen = pixel(many, jnp.asarray(middle.ravel())).reshape(len(LIMITS), count, 2, 2)
        full = [
            observed(x, *limit).saturated for x, limit in zip(seen, LIMITS.values(), strict=True)
        ]
        low, high = np.where(full, low, middle), np.where(full, middle, high)
    return high


def fires():
    day = directions("case 1", "75 W")
    night = replace(day, solar_zenith=jnp.asarray(2.0))
    black, profile = (0.0, 0.0), "midlatitude_summer"
    states = {
        "black, no air, no sun": fire_state(black, night),
        "black, US standard, no sun": fire_state(black, night, "us_standard"),
        "black, midlatitude summer, no sun": fire_state(black, night, profile),
        "black, tropical, no sun": fire_state(black, night, "tropical"),
    }
    for name, (albedo, surface_type) in FIRE_GROUNDS.items():
        albedos = (albedo, 1 - emissivity_3900nm(surface_type))
        label = f"{name} ({albedos[0]:.2f}, {albedos[1]:.2f})"
        states |= {
            f"{label}, no air, no sun": fire_state(albedos, night),
            f"{label}, no air, sun": fire_state(albedos, day),
            f"{label}, midlatitude summer, no sun": fire_state(albedos, night, profile),
            f"{label}, midlatitude summer, sun": fire_state(albedos, day, profile),
        }
    found = saturation_temperatures(columns(list(states.values())))
    print("Temperature [K] from which on a fire in one cell of 25 saturates the pixel; in brackets")
    print(f"albedo in C06 and C07. Sun and satellite of case 1 ({angles_of(day)}):\n")
    rows = [[n, *(f"{x:.0f}" for x in found[:, k])] for k, n in enumerate(states)]
    table(["ground, air, sun", *LIMITS], rows)

    albedos, temperatures = (0.05, 0.1, 0.2, 0.3, 0.5), (500.0, 600.0, 700.0, 800.0)
    states = columns([fire_state((a, 0.06), day, profile) for a in albedos])
    rows = []
    for temperature in temperatures:
        seen = pixel(states, jnp.full(len(albedos), temperature))
        burning = observed(seen, "C06")
        quiet = observed(seen[:, [1, 1]], "C06").reflectance_factor
        contrast = fire_contrast(burning.reflectance_factor, quiet)
        cells = zip(np.asarray(contrast), np.asarray(burning.saturated), strict=True)
        rows.append([f"{temperature:.0f} K", *(f"{c:.3g}{'*' * int(s)}" for c, s in cells)])
    rows.append(["reflectance factor without fire", *(f"{x:.4f}" for x in np.asarray(quiet))])
    print("Contrast of the same fire in C06, (L - L_b) / L_b, by the albedo of the ground it burns")
    print("in, midlatitude summer, same sun and satellite (* saturated):\n")
    table(["fire", *(f"albedo {a}" for a in albedos)], rows)


def angles_of(geometry):
    sun, view, azimuth = (np.degrees(np.asarray(x)) for x in jax.tree.leaves(geometry))
    return f"zenith angles {sun:.1f} and {view:.1f}, azimuth {azimuth:.1f} degrees"


# Green


def colour_states(labels, views):
    """A column for each pair of ground and depths of smoke, ash and dust, by its directions."""
    smoke_depth, ash_depth, dust_depth = np.array([depths for _, depths in labels]).T
    plumes = {
        "smoke": smoke(smoke_depth, bands=COLORS),
        "ash": ash(ash_depth, bands=COLORS),
        "dust": mie_plume("dust", dust_depth, 1.5, base=0.0, top=3000.0),
    }
    air = standard_atmosphere("midlatitude_summer", HEIGHT, **CASE1_GASES)
    count = len(labels)
    air = jax.tree.map(lambda x: jnp.broadcast_to(x, (count, *x.shape)), air)
    albedo = {x: jnp.array([GROUNDS[ground][x] for ground, _ in labels]) for x in COLORS}
    return State(replace(air, plumes=plumes), albedo, columns(views))


def without_gases(states):
    gases = jax.tree.map(jnp.zeros_like, states.atmosphere.gases)
    return replace(states, atmosphere=replace(states.atmosphere, gases=gases))


def seen_colours(states):
    # Doublings enough for a layer of ash of 10; oxygen is left out.
    values = brf(states, COLORS, gases=("O3", "H2O"), num_streams=16, num_doublings=5)
    return dict(zip(COLORS, np.asarray(values).T, strict=True))


def green():
    views = [directions(case, satellite) for case in CASES for satellite in SATELLITES]
    labels = [(g, p) for g in GROUNDS for p in PLUMES for _ in views]
    every = views * (len(GROUNDS) * len(PLUMES))
    states = colour_states([(g, PLUMES[p]) for g, p in labels], every)
    seen = seen_colours(without_gases(states))
    geometry = states.geometry
    pressure = states.atmosphere.pressure
    correct = partial(
        rayleigh_corrected,
        mu0=np.asarray(geometry.mu0),
        mu=np.asarray(geometry.mu),
        relative_azimuth=np.asarray(geometry.relative_azimuth),
        pressure=np.asarray(pressure[:, -1] - pressure[:, 0]),
    )
    truth = correct("green", seen["green"])

    def errors(recipe, seen=seen):
        top = derived_green(seen["C02"], seen["C01"], seen["C03"], recipe=recipe) - seen["green"]
        orders = [
            corrected_colors(seen, correct, order, recipe=recipe)[:, 1] - truth
            for order in ("green_first", "correct_first")
        ]
        return [top, *orders]

    def cells(found, chosen=slice(None)):
        return [f"{1e3 * np.mean(x[chosen]):+.1f} ± {1e3 * np.std(x[chosen]):.1f}" for x in found]

    head = ["top of atmosphere", "green first, then corrected", "corrected first"]
    by_ground, by_plume = (np.array(x) for x in zip(*labels, strict=True))
    paper = errors("grasso2013")
    print("Derived green less simulated light of 0.555 um, in 0.001 of brf: mean and standard")
    print(f"deviation over {len(views)} directions and all of the rest. The corrected ones against")
    print("0.555 um corrected in the same way. No gases. Eq. (1) by plume (depth at 550 nm):\n")
    table(["plume", *head], [[p, *cells(paper, by_plume == p)] for p in PLUMES])
    print("Eq. (1) by ground:\n")
    rows = [
        [g, f"{GROUNDS[g]['green']:.3f}", *cells(paper, by_ground == g)]
        + [f"{1e3 * derived(GROUNDS[g], 'grasso2013'):+.1f}"]
        for g in GROUNDS
    ]
    table(["ground", "albedo at 0.555 um", *head, "of the albedos alone"], rows)
    print("By recipe:\n")
    rows = []
    for recipe in GREEN_RECIPES:
        alone = [np.array([derived(x, recipe) for x in GROUNDS.values()])]
        rows.append([recipe, *cells(errors(recipe)), *cells(alone)])
    table(["recipe", *head, "of the albedos alone"], rows)
    absorbed = errors("grasso2013", seen_colours(states))[0]
    print(f"Eq. (1) at the top of the atmosphere with gases: {cells([absorbed])[0]}\n")


def derived(albedo, recipe):
    """Error of a recipe on albedos, which is what the recipes were made for. [-]"""
    found = derived_green(albedo["C02"], albedo["C01"], albedo["C03"], recipe=recipe)
    return found - albedo["green"]


# Gases and near infrared


def gases():
    view = directions("case 1", "75 W")
    air_mass = 1 / view.mu0 + 1 / view.mu
    air = standard_atmosphere("midlatitude_summer", **CASE1_GASES)
    bands = [x for x in BANDS if x != "C07"]
    found = [transmittance(gas_absorption(air, BANDS[x]), air_mass) for x in bands]
    print(f"Transmittance of the gases, down and up, in case 1 from 75 W (air mass {air_mass:.2f},")
    print("1 cm of precipitable water, 280 DU of ozone), which the paper takes to be 1:\n")
    table(bands, [[f"{x:.3f}" for x in found]])


def near_infrared():
    view = directions("case 2", "75 W")
    labels = [(g, depth) for g in NIR_GROUNDS for depth in NIR_DEPTHS]
    depths = [(g, (0.0, depth, 0.0)) for g, depth in labels]
    states = without_gases(colour_states(depths, [view] * len(labels)))
    usual = states.atmosphere.plumes["ash"].ssa["C03"]
    brfs = seen_colours(states)
    plain = [brfs[x] for x in ("C02", "C01", "C03")]
    change = nir_test(*plain)

    def near(ssa):
        """brf in C03 of ash that scatters so."""
        other = eqx.tree_at(lambda s: s.atmosphere.plumes["ash"].ssa["C03"], states, ssa)
        return seen_colours(other)["C03"]

    def tuned(factor):
        """Single-scattering albedo that makes C03 so many times brighter; NaN where none does."""
        low, high = np.full(len(labels), 0.5), np.full(len(labels), 1.0)
        wanted = factor * plain[2]
        possible = (near(low) < wanted) & (near(high) > wanted)
        for _ in range(12):
            middle = (low + high) / 2
            bright = near(middle) > wanted
            low, high = np.where(bright, low, middle), np.where(bright, middle, high)
        return np.where(possible, middle, np.nan)

    up, down = tuned(1.1), tuned(0.9)
    rows = []
    for k, (ground, depth) in enumerate(labels):
        ratio = plain[2][k] / derived_green(*(x[k] for x in plain))
        row = [ground, depth, f"{ratio:.2f}"]
        row += [f"{100 * x[k]:+.2f} %" for x in change]
        row += ["none" if np.isnan(x[k]) else f"{x[k]:.3f}" for x in (up, down)]
        rows.append(row)
    print("The near infrared 10 % up and down: change of the green of Eq. (1), Eqs. (2) and (3) of")
    print("the paper, under ash of optical depth tau in case 2 from 75 W")
    print(f"({angles_of(view)}), and the single-scattering albedo of")
    print(f"the ash in C03 that makes it so ({float(usual[0]):.3f} as it is):\n")
    table(["ground", "tau", "NIR / green", "up", "down", "albedo up", "albedo down"], rows)


def main():
    jax.config.update("jax_enable_x64", True)
    print(f"abi-operator {__version__}, jax {jax.__version__}, {platform.machine()}, float64\n")
    fires()
    green()
    gases()
    near_infrared()


if __name__ == "__main__":
    main()
