"""Derivatives against each other and against differences, on columns nobody chose."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from random_columns import random_columns

from abi_operator.solver import half_range, sufficient_doublings, toa_brf

INPUTS = ("tau", "ssa", "moments", "albedo", "mu0", "mu", "relative_azimuth")
SEED = 19860328
# Both multiply the same gradient: by tangents, or by cotangents.
MODES_AGREE = 1e-10
# Extrapolated differences lose five of the sixteen digits to their smallest steps, and more where
# an input hardly matters: hence the floor, in units of the column's BRF. Where they doubt
# themselves by more than half of the bar, they cannot judge: agreement within the doubt is
# asked for instead, and such cases are counted.
DIFFERENCES_AGREE, FLOOR = 1e-6, 1e-6
UNDECIDED, ROUNDING = 0.05, 1e-15
# Steps are a quarter of the one before.
NUM_STEPS, RATIO = 6, 4.0


def extrapolated(difference):
    """Central differences of ever smaller step, extrapolated to step 0 (Ridders 1982).

    Each entry of the triangle cancels one more even power of the step. Of all entries, that is
    taken which differs least from its two neighbours: truncation decides at large steps, rounding
    at small ones, and no step has to be chosen by hand. Returned with that difference, its doubt.

    References
    ----------
    .. [1] C. J. F. Ridders, "Accurate computation of F'(x) and F'(x) F''(x)", Adv. Eng. Software,
       4, 75-76, 1982, doi:10.1016/S0141-1195(82)80057-0
    """
    rows = [[d] for d in difference]
    best, least = rows[0][0], np.full_like(rows[0][0], np.inf)
    for k in range(1, len(rows)):
        for j in range(1, k + 1):
            power = RATIO ** (2 * j)
            here = (power * rows[k][j - 1] - rows[k - 1][j - 1]) / (power - 1)
            rows[k].append(here)
            doubt = np.maximum(abs(here - rows[k][j - 1]), abs(here - rows[k - 1][j - 1]))
            best, least = np.where(doubt < least, here, best), np.minimum(doubt, least)
    return best, least


def first_steps(columns, num_streams):
    """Largest step in each input: a part of the distance to the nearest singularity or scale."""
    tau, ssa, moments, albedo, mu0, mu, _ = columns
    transport = np.sum(tau * (1 - moments[..., 1]), axis=1)
    absorption = np.sum(tau * (1 - ssa), axis=1)
    steepest = np.minimum(np.minimum(mu0, mu), half_range(num_streams)[0][0])
    return {
        "tau": 0.3 * steepest,
        # A conservative layer of this depth has its nearest pole at ssa - 1 of about 1 / depth^2.
        "ssa": 0.2 / (1 + transport**2),
        "moments": np.full_like(mu, 1e-3),
        # The pole lies where the albedo is the inverse of what the air sends back: near 1 only for
        # thick air that absorbs little.
        "albedo": 0.1 * np.minimum(1, 1 - albedo + 0.5 / (1 + transport) + absorption),
        "mu0": 0.2 * np.minimum(mu0, 1 - mu0),
        "mu": 0.2 * np.minimum(mu, 1 - mu),
        "relative_azimuth": np.full_like(mu, 0.02),
    }


def probes(rng, columns, gradients):
    """Directions (input number, tangent): random signs, and the entry that matters most.

    Along random signs the errors of all entries add up at random, to no less than the largest in
    the mean square. Layers that pad a column are left as they are.
    """
    exists = columns[0] > 0
    for k, gradient in enumerate(gradients):
        if gradient.ndim == 1:
            yield k, np.ones_like(gradient)
            continue
        mask = exists if gradient.ndim == 2 else exists[..., None]
        yield k, rng.choice([-1.0, 1.0], gradient.shape) * mask
        flat = np.abs(gradient * mask).reshape(len(gradient), -1)
        largest = np.zeros(flat.shape)
        largest[np.arange(len(flat)), flat.argmax(axis=1)] = 1
        yield k, largest.reshape(gradient.shape)


def study(rng, columns, num_streams, single_scattering):
    """Worst error of each column and input, reverse against forward and against differences, and
    the share of cases that differences cannot judge.
    """
    count = len(columns[0])
    smallest = min(columns[4].min(), columns[5].min())
    doublings = sufficient_doublings(columns[0].max(), smallest, num_streams)

    def brf(*arguments):
        return toa_brf(
            *arguments,
            num_streams=num_streams,
            num_doublings=doublings,
            single_scattering=single_scattering,
            check_values=False,  # differences go beyond the ranges
        )

    arrays = [jnp.asarray(x) for x in columns]
    value, pull_back = jax.vjp(brf, *arrays)
    gradients = pull_back(jnp.ones_like(value))
    _, forward = jax.linearize(brf, *arrays)
    value, gradients = np.asarray(value), [np.asarray(g) for g in gradients]
    assert np.isfinite(value).all()
    assert all(np.isfinite(g).all() for g in gradients)

    steps = first_steps(columns, num_streams)
    mode_error, difference_error = np.zeros((2, len(INPUTS), count))
    undecided = 0
    for k, direction in probes(rng, columns, gradients):
        expand = (count,) + (1,) * (direction.ndim - 1)
        slope = np.sum((gradients[k] * direction).reshape(count, -1), axis=1)
        tangents = [np.zeros_like(x) for x in columns]
        tangents[k] = direction
        ahead = np.asarray(forward(*(jnp.asarray(x) for x in tangents)))

        step = steps[INPUTS[k]] / RATIO ** np.arange(NUM_STEPS)[:, None]
        defined = step[0] > 0  # not for mu = 1: see the tests of the zenith angle
        step = np.where(defined, step, 0.01)
        ladder = []
        for h in step:
            ends = []
            for sign in (1, -1):
                moved = [*columns]
                moved[k] = columns[k] + sign * np.where(defined, h, 0).reshape(expand) * direction
                ends.append(np.asarray(brf(*moved)))
            ladder.append((ends[0] - ends[1]) / (2 * h))
        difference, doubt = extrapolated(ladder)
        doubt = np.maximum(doubt, ROUNDING / step[0])  # neighbours may agree by accident
        error = np.where(defined, abs(slope - difference), 0)

        largest = np.abs(gradients[k]).reshape(count, -1).max(axis=1)
        norm = np.maximum(largest, FLOOR * np.abs(value))
        unsure = defined & (doubt > 0.5 * DIFFERENCES_AGREE * norm)
        assert np.all(error[unsure] <= 10 * doubt[unsure])
        undecided += unsure.sum() / count
        error = np.where(unsure, 0, error) / norm
        difference_error[k] = np.maximum(difference_error[k], error)
        mode_error[k] = np.maximum(mode_error[k], abs(slope - ahead) / norm)
    return mode_error, difference_error, undecided / len(INPUTS)


def report(title, errors):
    p50, p99, p999 = np.percentile(errors, [50, 99, 99.9])
    print(f"{title}: p50 {p50:.1e} p99 {p99:.1e} p99.9 {p999:.1e} max {errors.max():.1e}")


def assert_study(seeds, count, num_streams, single_scattering):
    """`count` columns of each seed, all at a time."""
    draws = [np.random.default_rng(seed) for seed in seeds]
    parts = [random_columns(rng, count) for rng in draws]
    columns = [np.concatenate(x) for x in zip(*parts, strict=True)]
    mode_error, difference_error, undecided = study(
        draws[0], columns, num_streams, single_scattering
    )
    print(f"\nseeds {seeds}, {count} columns each, {num_streams} streams, {single_scattering}")
    print(f"{len(columns[0])} columns", end="; ")
    print(f"{undecided:.2%} undecided by differences")
    report("reverse - forward", mode_error)
    for name, errors in zip(INPUTS, difference_error, strict=True):
        report(f"reverse - differences, {name}", errors)
    assert mode_error.max() <= MODES_AGREE
    assert difference_error.max() <= DIFFERENCES_AGREE
    assert undecided <= UNDECIDED


@pytest.mark.slow
def test_derivatives_of_random_columns():
    assert_study([SEED], 8, 4, "tms")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("num_streams", "single_scattering"), [(2, None), (4, "tms"), (8, "tms"), (8, None)]
)
def test_derivatives_of_hundreds_of_columns(num_streams, single_scattering, scale):
    first = SEED + 1000 * num_streams
    seeds = range(first, first + max(1, round(scale * 25)))
    assert_study(seeds, 20, num_streams, single_scattering)


def at_angles(num_streams, single_scattering):
    """BRF by the zenith angles of sun and view, and by what is added to their cosines."""
    # One hazy and one wider layer, and an oblique azimuth: nothing is symmetric about the vertical.
    tau, ssa = jnp.array([0.2, 0.5]), jnp.array([0.95, 0.9])
    moments = jnp.stack([0.7 ** jnp.arange(33.0), 0.3 ** jnp.arange(33.0)])

    def brf(sun, view, mu0_more, mu_more, azimuth):
        return toa_brf(
            tau,
            ssa,
            moments,
            0.2,
            jnp.cos(sun) + mu0_more,
            jnp.cos(view) + mu_more,
            azimuth,
            num_streams=num_streams,
            num_doublings=4,
            single_scattering=single_scattering,
            check_values=False,
        )

    compiled = jax.jit(jax.value_and_grad(brf, argnums=(0, 1, 2, 3)))

    def value_and_slopes(sun, view, mu0_more=0.0, mu_more=0.0, azimuth=0.7):
        # As arrays: numbers of Python and of NumPy would each be compiled for.
        inputs = (jnp.asarray(x, float) for x in (sun, view, mu0_more, mu_more, azimuth))
        value, slopes = compiled(*inputs)
        return float(value), [float(x) for x in slopes]

    return value_and_slopes


def check_towards_vertical(brf, which):
    """Sun (0) or view (1) near the vertical, the other oblique."""

    def at(angle, **azimuth):
        angles = (angle, 0.9) if which == 0 else (0.9, angle)
        value, slopes = brf(*angles, **azimuth)
        return value, slopes[which]

    for angle in (1e-3, 1e-2, 0.1):
        steps = 0.3 * angle / RATIO ** np.arange(NUM_STEPS)
        ladder = [(at(angle + h)[0] - at(angle - h)[0]) / (2 * h) for h in steps]
        expected, _ = extrapolated(np.array(ladder))
        # 1e-3 is the worst: differences of 1e-16 over steps of 1e-6 to 3e-4.
        np.testing.assert_allclose(at(angle)[1], expected, rtol=DIFFERENCES_AGREE)

    # Across the vertical a negative angle is a positive one on the other side.
    steps = 0.1 / RATIO ** np.arange(NUM_STEPS)
    across = [(at(h)[0] - at(h, azimuth=0.7 + np.pi)[0]) / (2 * h) for h in steps]
    limit = float(extrapolated(np.array(across))[0])
    assert abs(limit) > 1e-2
    for angle in (1e-3, 1e-4, 1e-5):
        # The next term is of first order in the angle, with a curvature about as large.
        assert abs(at(angle)[1] - limit) < 10 * angle * abs(limit)
    # Exactly there, the sine of the chain rule is 0: the odd part, all of the slope, is left out.
    assert at(0.0)[1] == 0


def check_cosine_of_one(brf, sun, view, which):
    """The derivative is the one of the solver continued to cosines above 1, where the sine is 0."""
    step = 1e-4
    points = []
    for i in range(5):
        more = (i * step, 0.0) if which == 0 else (0.0, i * step)
        points.append(brf(sun, view, *more)[0])
    # Forward differences of fourth order: h^4 / 5 times a fifth derivative, and rounding / h.
    expected = np.dot([-25, 48, -36, 16, -3], points) / (12 * step)
    slope = brf(sun, view)[1][2 + which]
    assert slope != 0
    np.testing.assert_allclose(slope, expected, rtol=1e-8)


@pytest.mark.parametrize(
    ("num_streams", "single_scattering"),
    [
        (2, "tms"),
        pytest.param(2, None, marks=pytest.mark.slow),
        pytest.param(4, "tms", marks=pytest.mark.slow),
    ],
)
def test_derivatives_at_the_vertical(num_streams, single_scattering):
    """In the zenith angle they are right at every angle above 0 and tend to the slope across the
    vertical; at 0 they are 0. In the cosine they are infinite there, and those with the sines held
    at 0 are returned.
    """
    brf = at_angles(num_streams, single_scattering)
    for which in (0, 1):
        check_towards_vertical(brf, which)
        check_cosine_of_one(brf, 0.0, 0.0, which)
    check_cosine_of_one(brf, 0.0, 0.9, 0)
    check_cosine_of_one(brf, 0.9, 0.0, 1)
