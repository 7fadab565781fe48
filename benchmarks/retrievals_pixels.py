"""Random pixels of which retrievals are measured: everything a pixel's own."""

import jax
import jax.numpy as jnp
import numpy as np

from abi_operator import Atmosphere, Geometry, LiquidCloud, Plume, State
from abi_operator.optics import mie_optics
from retrievals import ForwardModel, Prior, measurement, prepared
from retrievals.declarations import plume as plume_vector

BANDS = ("C01", "C02", "C03")

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


def pixels_of_prior(num_pixels, streams, names):
    """Forward model, states, prior, x drawn from it, and a generator for what else is drawn."""
    rng = np.random.default_rng(2)
    states = random_states(rng, num_pixels, BANDS)
    how = {"ssa": "ssa_shift" in names, "effective_radius": "effective_radius_um" in names}
    vector = plume_vector("smoke", **how)
    mean = {"aod_550": 0.4, "ssa_shift": 0.0, "effective_radius_um": 0.14}
    spread = {"aod_550": 0.7, "ssa_shift": 0.5, "effective_radius_um": 0.5}
    prior = Prior(
        np.asarray(vector.x(*(mean[name] for name in names))),
        np.diag([spread[name] ** 2 for name in names]),
    )
    x = prior.x_prior + rng.standard_normal((num_pixels, len(names))) @ np.sqrt(prior.S_prior)
    return ForwardModel(vector, BANDS, streams, gases=()), states, prior, x, rng


def with_prior(num_pixels, streams, names):
    """Noisy observations of pixels drawn from a prior."""
    forward, states, prior, x, rng = pixels_of_prior(num_pixels, streams, names)
    forward = prepared(forward, states)
    seen = np.asarray(forward(x, states))
    # The noise of the truth, which the retrieval takes from what was measured.
    noisy = seen + measurement(seen, BANDS).sigma * rng.standard_normal(seen.shape)
    return forward, measurement(noisy, BANDS), states, prior, x


def rows(tree, chosen):
    """Some of the pixels."""
    return jax.tree.map(lambda leaf: np.asarray(leaf)[chosen], tree)
