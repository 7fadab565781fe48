"""Ash by Mie tables over a fire, seen in heat as well: every kind of measurement in one program."""

import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator import Atmosphere, Fire, Geometry, LiquidCloud, State, mie_plume
from retrievals import (
    ForwardModel,
    Minimiser,
    Prior,
    ResultCode,
    StateVector,
    measurement,
    prepared,
    retrieve_pixels,
)
from retrievals.declarations import aod_550, fire

BANDS = ("C03", "C05", "C06", "C07")
HEIGHT = np.array([60e3, 11e3, 8e3, 0.0])
VECTOR = StateVector((aod_550("ash"), *fire().quantities))
NUM_PIXELS = 6
SATURATED = NUM_PIXELS - 1  # the last pixel's fire is too hot for C07, and for C06


def known():
    """States without what is retrieved."""

    def every(value):
        return jnp.broadcast_to(jnp.asarray(value, float), (NUM_PIXELS, *np.shape(value)))

    droplets = LiquidCloud(every(np.zeros(3)), every(np.zeros(3)))
    ash = mie_plume("ash", every(0.5), every(3.0), base=8e3, top=11e3)
    air = Atmosphere(
        every(101325 * np.exp(-HEIGHT / 8000)),
        every(HEIGHT),
        droplets,
        {"ash": ash},
        temperature=every([220.0, 225.0, 240.0, 295.0]),
    )
    geometry = Geometry(every(0.6), every(0.8), every(1.2))
    burning = Fire(every(0.01), every(700.0))
    return State(air, {band: every(0.1) for band in BANDS}, geometry, every(300.0), burning)


@pytest.mark.slow
def test_ash_and_fire_are_retrieved_together():
    truth = (
        np.array([0.2, 0.4, 0.8, 1.5, 0.3, 0.6]),
        np.array([520.0, 650.0, 750.0, 900.0, 600.0, 1100.0]),
        np.array([3e-2, 1e-3, 3e-3, 4e-4, 1e-2, 3e-2]),
    )
    states = known()
    forward = prepared(ForwardModel(VECTOR, BANDS, num_streams=2, gases=()), states)
    observation = measurement(forward(VECTOR.x(*truth), states), BANDS)
    saturated = np.asarray(observation.saturated)
    assert saturated[SATURATED].sum() == 2 and not saturated[:SATURATED].any()
    prior = Prior(np.asarray(VECTOR.x(0.4, 700.0, 3e-3)), 4 * np.eye(3))
    how = Minimiser(tolerance=1e-5, max_steps=80, starts="prior")
    found = retrieve_pixels(forward, observation, states, prior=prior, minimiser=how)
    assert set(found.codes) == {ResultCode.SUCCESS}
    values, held = VECTOR.values(found.inversion.x), VECTOR.x(*truth)
    sigma = np.sqrt(np.diagonal(found.inversion.covariance, axis1=1, axis2=2))
    # The prior pulls by (posterior / prior sigma)^2 of its own departure.
    pulled = np.abs((found.inversion.x - held) / sigma)
    assert pulled[:SATURATED].max() < 0.1
    np.testing.assert_allclose(values["fire_temperature"][:SATURATED], truth[1][:SATURATED], atol=1)
    # What is saturated says that it is bright, and the retrieved fire is as bright.
    bright = np.asarray(forward(found.inversion.x, states))[SATURATED]
    lowest = observation.measured[SATURATED] - 3 * observation.sigma[SATURATED]
    assert (bright >= lowest)[saturated[SATURATED]].all()
    assert sigma[SATURATED].max() > 3 * sigma[:SATURATED].max()
