"""Pixels of smoke over land for the other examples: a State whose leaves lead with the pixels."""

import jax
import jax.numpy as jnp
import numpy as np

from abi_operator import Atmosphere, Geometry, LiquidCloud, State, smoke

BANDS = ("C01", "C02", "C03", "C05", "C06")


def smoky_pixels(num_pixels: int, bands: tuple[str, ...] = BANDS) -> State:
    """So many columns of eight layers, each with a sun, a view and a ground of its own."""
    height = jnp.array([40e3, 20e3, 10e3, 5e3, 3e3, 2e3, 1e3, 500.0, 0.0])  # levels [m]
    droplets = LiquidCloud(mass_path=jnp.zeros(8), number_path=jnp.zeros(8))
    plumes = {"smoke": smoke(aod_550=0.5, bands=bands)}
    air = Atmosphere(101325 * jnp.exp(-height / 8000), height, droplets, plumes)
    one = State(air, dict.fromkeys(bands, 0.1), Geometry(0.6, 0.8, 1.2))
    state = jax.tree.map(lambda x: np.broadcast_to(x, (num_pixels, *np.shape(x))), one)
    rng = np.random.default_rng(1)
    sun, view = rng.uniform(0.2, 1.0, (2, num_pixels))
    ground = {band: rng.uniform(0.02, 0.25, num_pixels) for band in bands}
    return State(state.atmosphere, ground, Geometry(sun, view, rng.uniform(0, 3, num_pixels)))
