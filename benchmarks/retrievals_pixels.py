"""Random pixels of which retrievals are measured: everything a pixel's own."""

import jax
import jax.numpy as jnp
import numpy as np

from abi_operator import Atmosphere, Geometry, LiquidCloud, Plume, State
from abi_operator.optics import mie_optics

NUM_LAYERS = 20
TOP = 40e3
"""Height of the first level, above which there is air all the same. [m]"""


def random_states(rng, num_pixels, bands, species="smoke", albedo=(0.01, 0.4)):
    """Clear columns of 20 layers with a plume whose optics are those of the table.

    Sun to 75 degrees, view to 70, surface pressure 900 to 1030 hPa, albedo uniform in the range and
    another one in every band, the plume 1 to 3 km thick.
    """
    n = num_pixels
    ground = rng.uniform(900e2, 1030e2, n)[:, None]
    height = np.broadcast_to(np.linspace(TOP, 0, NUM_LAYERS + 1), (n, NUM_LAYERS + 1))
    base = rng.uniform(0.5e3, 3e3, n) if species == "smoke" else rng.uniform(4e3, 10e3, n)
    radius = 0.14 if species == "smoke" else 3.0
    spheres = {band: mie_optics(species, jnp.asarray(radius), band) for band in bands}
    plume = Plume(
        base=base,
        top=base + rng.uniform(1e3, 3e3, n),
        extinction_550=np.full(n, 1e-4),
        brightness=np.ones(n),
        relative_extinction={
            b: np.full(n, float(s.relative_extinction)) for b, s in spheres.items()
        },
        ssa={b: np.full(n, float(1 - s.coalbedo)) for b, s in spheres.items()},
        asymmetry={b: np.full(n, float(s.asymmetry)) for b, s in spheres.items()},
    )
    air = Atmosphere(
        ground * np.exp(-height / 8e3),
        height,
        LiquidCloud(np.zeros((n, NUM_LAYERS)), np.zeros((n, NUM_LAYERS))),
        {species: plume},
    )
    geometry = Geometry(
        np.radians(rng.uniform(0, 75, n)),
        np.radians(rng.uniform(0, 70, n)),
        rng.uniform(0, np.pi, n),
    )
    return State(air, {band: rng.uniform(*albedo, n) for band in bands}, geometry)


def rows(tree, chosen):
    """Some of the pixels."""
    return jax.tree.map(lambda leaf: np.asarray(leaf)[chosen], tree)
