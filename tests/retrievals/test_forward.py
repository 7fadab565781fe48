"""The forward model is the operator."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from abi_operator import reflectance_factor
from retrievals.smoke import BANDS
from retrievals.state_vector import StateVector

ROUNDING = 1e-11


def test_the_true_x_gives_what_was_simulated(columns, forward):
    observation, states, truth = columns
    value = jax.jit(forward)(forward.vector.x(truth), states)
    np.testing.assert_allclose(value, observation.reflectance_factor, rtol=ROUNDING)


def test_the_state_is_what_is_seen(columns, forward):
    _, states, _ = columns
    column = jax.tree.map(lambda x: jnp.asarray(x[1]), states)
    model = replace(forward, vector=StateVector(retrieve_ssa=True))
    x = model.vector.x(1.3, -0.5)
    state = model.state(x, column)
    np.testing.assert_allclose(state.atmosphere.plumes["smoke"].aod_550, 1.3, rtol=ROUNDING)
    expected = reflectance_factor(state, BANDS, num_streams=4)
    np.testing.assert_allclose(model(x, column), expected, rtol=ROUNDING)


def test_prepared_doublings_suffice_at_the_limit(columns, forward):
    _, states, truth = columns
    x = forward.vector.x(np.full(len(truth), 9.999))
    many = replace(forward, num_doublings=13)
    np.testing.assert_allclose(forward(x, states), many(x, states), rtol=ROUNDING)
