"""Layers far deeper than light sees, where nobody can read how deep they are."""

import jax
import jax.numpy as jnp
import numpy as np

from abi_operator import Geometry, State, brf, standard_atmosphere
from abi_operator.band_columns import columns_of_bands
from abi_operator.bands_of_states import TRACED_TAU
from abi_operator.optics import ALL_GASES

BANDS = ("C04",)
OPTIONS = {"num_streams": 2, "num_modes": 1}


def test_strong_lines_are_no_trouble_under_jit():
    """Water vapour has an exponential term of more than `TRACED_TAU` in a layer."""
    air = standard_atmosphere("tropical", np.array([30e3, 8e3, 0.0]))
    state = jax.tree.map(jnp.asarray, State(air, {"C04": 0.3}, Geometry(0.6, 0.8, 1.2)))
    layers = jax.jit(lambda s: [x.arguments for x in columns_of_bands(s, BANDS, ALL_GASES, 3)])
    (arguments,) = layers(state)
    assert np.max(arguments["tau"]) > TRACED_TAU

    found = jax.jit(lambda s: brf(s, BANDS, **OPTIONS))(state)
    np.testing.assert_allclose(found, brf(state, BANDS, **OPTIONS), rtol=1e-7)
