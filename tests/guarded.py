"""Two columns that are solved in a moment, for tests of the guard; also a scenario by itself."""

import jax.numpy as jnp

from abi_operator import Atmosphere, Geometry, LiquidCloud, State

SETTINGS = {"num_streams": 2}
BANDS = ("C02",)


def two_columns():
    """Clear air over two grounds, in two layers."""
    height, pressure = jnp.asarray([20e3, 5e3, 0.0]), jnp.asarray([5e3, 5e4, 1e5])
    nothing = jnp.zeros(2)
    air = Atmosphere(pressure, height, LiquidCloud(nothing, nothing), {})
    geometry = Geometry(jnp.asarray(0.6), jnp.asarray(0.8), jnp.asarray(1.2))
    grounds = {"dark": 0.05, "bright": 0.5}
    return {
        name: State(air, {"C02": jnp.asarray(albedo)}, geometry) for name, albedo in grounds.items()
    }


def nothing():
    """A scenario that forgot to return."""


def broken():
    """A scenario that fails."""
    raise RuntimeError("no levels")
