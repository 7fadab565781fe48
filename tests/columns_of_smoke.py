"""Random columns with smoke and cloud, and a function of what is seen of them, at 2 streams."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from states import column, stacked

from abi_operator import Fire, brf
from abi_operator.sensitivity import declared, factor, leaf

HOW = {"gases": (), "num_streams": 2}
BANDS = ("C01", "C02", "C03", "C06")
INPUTS = (
    declared("aod_550", "smoke"),
    declared("ssa", "smoke"),
    declared("plume_height", "smoke"),
    declared("albedo_C03"),
    declared("solar_zenith"),
    declared("liquid_mass"),
    factor("atmosphere.plumes.smoke.asymmetry", 0.02, name="factor of asymmetry"),
    leaf("atmosphere.plumes.smoke.extinction_550", 1e-5),
)


def columns(count=6, seed=0):
    rng = np.random.default_rng(seed)
    states = stacked(
        [
            column(rng.uniform(0.001, 0.1), rng.uniform(0.2, 1.5), 0.0, rng.uniform(0.05, 0.3))
            for _ in range(count)
        ]
    )
    angles = {
        name: rng.uniform(low, high, count)
        for name, low, high in (("solar_zenith", 0.2, 1.0), ("relative_azimuth", 0.3, 2.8))
    }
    return replace(states, geometry=replace(states.geometry, **angles))


def colour(states):
    """Two numbers that are no band: a ratio and a logarithm."""
    seen = brf(states, BANDS, **HOW)
    return jnp.stack([seen[..., 0] / seen[..., 2], jnp.log(seen[..., 1]) * seen[..., 3]], axis=-1)


def burning(states, fraction=0.02, temperature=800.0):
    """The same where something burns, under air of 280 K."""
    count = states.geometry.solar_zenith.shape[0]
    air = states.atmosphere
    return replace(
        states,
        atmosphere=replace(air, temperature=np.full_like(air.pressure, 280.0)),
        surface_temperature=np.full(count, 290.0),
        fire=Fire(np.full(count, fraction), np.full(count, temperature)),
    )
