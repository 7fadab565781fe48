"""Columns that are solved side by side: in which order, and that they are none of each other's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.solver import toa_brf
from abi_operator.solver.gradient.mode_sum import of_own_groups
from abi_operator.solver.skipping import company
from abi_operator.solver.skipping.budget import Expected
from abi_operator.solver.skipping.grouping import Alike, Groups

LAYERS = 12


def test_groups_of_slopes_put_columns_in_order_of_slopes():
    """A cloud that is one group of a value is several of slopes; to mu0 = mu = 1 all modes but the
    mean are nothing, so that what is needed are the groups."""
    tau = jnp.stack([jnp.full(LAYERS, 1.0), jnp.full(LAYERS, 1e-3)], axis=1)
    same, one = 0 * tau + 0.9, jnp.ones(2)
    known = Expected(one[None], one, 0.01 * one, one, one, one)
    of_values, of_slopes = (
        np.asarray(company.need(Alike(tau, same, 0.5 * same), known, one, one, 1e-3, slopes))
        for slopes in (False, True)
    )
    assert of_values.max() < 1
    assert of_slopes[0] > 4 and of_slopes[1] < 1


class Told(Exception):
    """Enough is known, and nothing needs to be solved."""


@pytest.mark.parametrize("of_slopes", [False, True])
def test_columns_are_in_order_of_what_is_wanted(monkeypatch, of_slopes):
    """The program of slopes asks for what slopes need, that of values for what values need."""

    def need(*arguments):
        assert arguments[-1] == of_slopes
        raise Told

    monkeypatch.setattr(company, "need", need)
    one = np.ones(70)
    given = {"tau": np.ones((70, 1)), "ssa": np.ones((70, 1)), "moments": np.ones((70, 1, 7))}
    given |= {"albedo": 0 * one, "mu0": one, "mu": one, "relative_azimuth": one}

    def total(arguments):
        return jnp.sum(toa_brf(**arguments, num_streams=6, error_budget=1e-3))

    with pytest.raises(Told):
        jax.jit(jax.grad(total) if of_slopes else total).lower(given)


def test_groups_that_a_column_does_not_have_are_none_of_its_slopes():
    """The last modes are small beside the slopes in depth, of which empty groups have some."""
    labels = jnp.array([[0.0, 0, 0], [0, 1, 0], [0, 2, 1]])
    groups = Groups(labels, labels.min(axis=1), labels.max(axis=1), jnp.array(3.0))
    found = of_own_groups(groups, jnp.ones((3, 3)))
    np.testing.assert_array_equal(found, [[1, 1, 1], [0, 1, 1], [0, 1, 0]])
