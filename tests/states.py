"""Specified columns for tests of the operator and of what stands on it."""

import jax
import jax.numpy as jnp
import numpy as np

from abi_operator import GRASSO2013, Atmosphere, Geometry, LiquidCloud, State, ash, smoke


def column(liquid=0.05, smoke_aod=0.8, ash_aod=0.0, albedo=0.1, num_layers=12):
    """One column on 0-24 km with a droplet layer, smoke and ash, sun and satellite oblique."""
    height = np.linspace(24e3, 0, num_layers + 1)
    pressure = 101325 * np.exp(-height / 8000)
    pressure[0] = 0
    mass = np.zeros(num_layers)
    mass[-1] = liquid
    number = np.full(num_layers, 1e8 * 600.0) * (mass > 0)
    plumes = {"smoke": smoke(smoke_aod), "ash": ash(ash_aod)}
    return State(
        Atmosphere(jnp.asarray(pressure), jnp.asarray(height), LiquidCloud(mass, number), plumes),
        {name: albedo for name in GRASSO2013},
        Geometry(jnp.asarray(0.6), jnp.asarray(0.8), jnp.asarray(1.2)),
    )


def stacked(states):
    """States of one structure as a batch of them."""
    return jax.tree.map(lambda *x: np.stack([np.asarray(y) for y in x]), *states)
