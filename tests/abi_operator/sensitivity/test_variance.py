"""The variance that uncertain inputs cause: to first order, and by draws."""

import numpy as np
import pytest
from columns_of_smoke import INPUTS as COLUMN_INPUTS
from columns_of_smoke import colour, columns

from abi_operator.sensitivity import (
    covariance_of,
    sampled_variance,
    sensitivity,
    variance_parts,
)
from abi_operator.sensitivity.inputs import part

# One after the other, so small that what follows is nearly a straight line.
SMALL = (0.01, 0.002, 50.0, 0.002, 0.2, 0.02, 0.002, 1e-6)
INPUTS = tuple(one.stepping(sigma) for one, sigma in zip(COLUMN_INPUTS, SMALL, strict=True))
CORRELATIONS = {("aod_550", "ssa"): 0.6, ("albedo_C03", "solar_zenith"): -0.3}
# Of 12 variances and 96 parts at once; a normal deviate exceeds it once in 16,000.
STANDARD_ERRORS = 4.0


@pytest.fixture(scope="module")
def case():
    states = columns()
    found = sensitivity(colour, states, INPUTS, second_order=False)
    return states, found.jacobian, covariance_of(INPUTS, CORRELATIONS)


def test_parts_sum_to_the_variance(case):
    _, jacobian, covariance = case
    parts = variance_parts(jacobian, covariance)
    total = np.einsum("coi,ij,coj->co", jacobian, covariance, jacobian)
    np.testing.assert_allclose(parts.sum(axis=-1), total, rtol=1e-12)
    alone = variance_parts(jacobian, np.diag(np.diag(covariance)))
    np.testing.assert_allclose(alone, jacobian**2 * np.diag(covariance), rtol=1e-12)
    assert (alone >= 0).all()


def test_the_parts_are_those_of_draws_within_the_sampling_error(case):
    states, jacobian, covariance = case
    found = sampled_variance(colour, states, INPUTS, jacobian, covariance, num_samples=1500)
    assert (found.draws == 1500).all()
    parts = variance_parts(jacobian, covariance)
    apart = (found.total - parts.sum(axis=-1)) / found.total_error
    assert np.max(np.abs(apart)) < STANDARD_ERRORS
    known = parts != 0  # a number does not hang on the albedo of a band that it is not made of
    assert known.mean() > 0.9 and (found.parts[~known] == 0).all()
    apart = (found.parts - parts)[known] / found.parts_error[known]
    assert np.max(np.abs(apart)) < STANDARD_ERRORS
    # The errors are those of a normal distribution: sqrt(2 / n) of a variance, 0.037.
    np.testing.assert_allclose(found.total_error / found.total, (2 / 1500) ** 0.5, rtol=0.2)
    # Inputs being this certain, the same draws to first order are nearer than that error.
    np.testing.assert_allclose(found.linear, found.total, rtol=0.03)


def test_draws_of_a_straight_line_are_exact(case):
    """But for the draws themselves, all of whose parts are those of their own covariance."""

    def line(states):
        smoke = part(states, "atmosphere.plumes.smoke")
        return 3 * smoke.aod_550 - 2 * states.albedo["C03"]

    states, _, covariance = case
    # The last input is the plume's extinction, over its depth of 2 km.
    jacobian = np.tile([3.0, 0.0, 0.0, -2.0, 0.0, 0.0, 0.0, 3 * 2000.0], (6, 1, 1))
    found = sampled_variance(line, states, INPUTS, jacobian, covariance, num_samples=50)
    np.testing.assert_allclose(found.linear, found.total, rtol=1e-9)
    np.testing.assert_allclose(found.parts.sum(axis=-1), found.total, rtol=1e-9)


def test_draws_that_may_not_be_are_left_out_and_counted(case):
    states, jacobian, _ = case
    wide = [one.stepping(0.3) if one.name == "albedo_C03" else one for one in INPUTS]
    covariance = covariance_of(wide)
    found = sampled_variance(
        lambda s: s.albedo["C03"], states, wide, jacobian[:, :1], covariance, num_samples=200
    )
    assert (found.draws > 60).all() and (found.draws < 180).all()
    assert (found.total < 0.3**2).all()


def test_what_is_no_covariance_is_told(case):
    _, jacobian, covariance = case
    with pytest.raises(ValueError, match=r"symmetric, \(8, 8\); got \(3, 3\)"):
        variance_parts(jacobian, covariance[:3, :3])
    names = ("aod_550", "ssa", "albedo_C03")
    pairs = {names[:2]: 0.9, names[1:]: 0.9, names[::2]: -0.9}
    with pytest.raises(ValueError, match="these correlations cannot be"):
        covariance_of(INPUTS, pairs)
    with pytest.raises(ValueError, match="a correlation is of two of aod_550, ssa"):
        covariance_of(INPUTS, {("aod_550", "ozone"): 0.5})
    with pytest.raises(ValueError, match="2 samples or more; got 1"):
        sampled_variance(colour, *case[:1], INPUTS, jacobian, covariance, num_samples=1)
