"""Fires of `paper_figures.py`: when they saturate a pixel, and how they stand out in C06."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from grounds import FIRE_GROUNDS
from paper_cases import HEIGHT, SUN_DISTANCE, angles_of, columns, directions, table

from abi_operator import Fire, State, radiance, standard_atmosphere
from abi_operator.instrument import IMAGER, Imager, observe
from abi_operator.products import fire_contrast
from abi_operator.surface import emissivity_3900nm

GROUND = 300.0  # beside the fire [K]
CELLS = jnp.array([1.0, 24.0])  # that burn and that do not, of the 25 in a pixel
LIMITS = {
    "C07, 411.9 K": ("C07", IMAGER),
    "C07, 400 K": ("C07", Imager(fire_saturation_temperature=400.0)),
    "C06": ("C06", IMAGER),
}
FIRE_BANDS = ("C06", "C07")


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
