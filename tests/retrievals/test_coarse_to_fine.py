"""The first steps by a coarse forward model lead to the minimum of the whole one."""

from dataclasses import dataclass, replace

import jax
import numpy as np
import pytest
from veil import TIGHT, TWO, Veil, veiled_pixels

from retrievals import ForwardModel, Minimiser, Prior, retrieve_pixels
from retrievals.coarse_to_fine import COARSE_STREAMS, coarse, minimise_from_coarse
from retrievals.declarations import plume
from retrievals.input_checks import checked
from retrievals.kinds import BANDS

# Posterior standard deviations: a last step of 0.05 leaves a fraction of itself.
RIGHT = 0.05


# By how much the reflectances of the rough model are off: it is too dark, or no number at all.
OFF = -0.1, np.nan


@dataclass(frozen=True)
class OfPair(Veil):
    """The veil of a ground that comes with a number for another forward model."""

    def __call__(self, x, state):
        ground, _ = state
        return super().__call__(x, ground)


@dataclass(frozen=True)
class Rough(Veil):
    """The veil with reflectances that are off by that share, or no numbers at all."""

    def __call__(self, x, state):
        ground, off = state
        return super().__call__(x, ground) * (1 + off)


@pytest.fixture(scope="module")
def pixels():
    """Measurements, states, prior, and the minima by tight steps of the whole forward model."""
    observation, ground, _ = veiled_pixels()
    prior = Prior(np.asarray(TWO.vector.x(0.4, 0.0)), np.diag([1.0, 0.02**2]))
    found = retrieve_pixels(TWO, observation, ground, prior=prior, minimiser=TIGHT)
    assert found.inversion.converged.all()
    return observation, ground, prior, found.inversion


@pytest.fixture(scope="module")
def from_rough(pixels):
    """Minima of all pixels after first steps that are off by each of `OFF`."""
    observation, ground, prior, _ = pixels
    _, usable, own = checked(TWO, observation, prior)
    count = len(ground)
    own, usable, ground = jax.tree.map(
        lambda x: np.concatenate([x] * len(OFF)), (own, usable, ground)
    )
    states = ground, np.repeat(OFF, count)[:, None]
    whole, rough = OfPair(TWO.vector), Rough(TWO.vector)
    found = minimise_from_coarse(
        rough, whole, Minimiser().chosen(True), (own, usable, states), own.x_prior
    )
    return jax.tree.map(lambda x: x.reshape(len(OFF), count, *x.shape[1:]), found)


@pytest.mark.parametrize("number", range(len(OFF)))
def test_however_rough_the_first_steps_are_the_minimum_is_the_same(pixels, from_rough, number):
    _, _, prior, tight = pixels
    found = jax.tree.map(lambda x: x[number], from_rough)
    assert found.converged.all()
    sigma = np.sqrt(np.diagonal(tight.covariance, axis1=1, axis2=2))
    assert np.abs((found.x - tight.x) / sigma).max() < RIGHT
    # Slopes are those one step before the end.
    np.testing.assert_allclose(found.covariance, tight.covariance, rtol=0.1, atol=1e-4)
    np.testing.assert_allclose(found.cost, tight.cost, rtol=1e-2, atol=1e-2)
    # Costs are those where it ended, and not where the last step but one would have led.
    departure = (found.x - prior.x_prior) / np.sqrt(np.diagonal(prior.S_prior))
    np.testing.assert_allclose(found.prior_cost, np.sum(departure**2, axis=1), rtol=1e-9)


@pytest.mark.parametrize("max_steps", [1, 5, 8])
def test_steps_are_no_more_than_are_allowed(pixels, max_steps):
    """But for three, of which the last gives the covariance."""
    observation, ground, prior, _ = pixels
    _, usable, own = checked(TWO, observation, prior)
    whole, rough, states = OfPair(TWO.vector), Rough(TWO.vector), (ground, np.full((12, 1), OFF[0]))
    how = Minimiser(max_steps=max_steps).chosen(True)
    found = minimise_from_coarse(rough, whole, how, (own, usable, states), own.x_prior)
    assert found.num_steps.max() == max(max_steps, 3)
    assert not found.converged.all()


def test_the_coarse_model_is_cheaper_or_none():
    forward = ForwardModel(plume("smoke"), BANDS, num_streams=8, num_doublings=3)
    rough = coarse(forward)
    assert rough is not None
    assert (rough.num_streams, rough.num_doublings) == (COARSE_STREAMS, 3)
    assert coarse(replace(forward, num_streams=COARSE_STREAMS)) is None
    assert coarse(TWO) is None  # nothing is known of a forward model of one's own
