"""Sensitivities of a function of the operator's output, and the variance that follows from them.

Derivatives against differences, at random inputs; variance to first order and by draws.
"""

import importlib
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from columns_of_smoke import BANDS, HOW, INPUTS, burning, colour, columns

from abi_operator import brf, radiance
from abi_operator.products import derived_green
from abi_operator.satellites import solar_irradiance
from abi_operator.sensitivity import (
    covariance_of,
    declared,
    leaf,
    output_function,
    sampled_variance,
    sensitivity,
    variance_parts,
)
from abi_operator.sensitivity.inputs import changed, part
from abi_operator.settings import Settings

variance = importlib.import_module("abi_operator.sensitivity.variance")
# Central differences over a thousandth of a step err by its square, relative, and by rounding.
STEP, AGREE = 1e-3, 1e-6
# Of second derivatives, in steps: they too err by its square, relative.
FINE = 0.01
# Standard deviations, one after the other, so small that what follows is nearly a straight line.
SMALL = (0.01, 0.002, 50.0, 0.002, 0.2, 0.02, 0.002, 1e-6)
UNCERTAIN = tuple(one.stepping(sigma) for one, sigma in zip(INPUTS, SMALL, strict=True))
CORRELATIONS = {("aod_550", "ssa"): 0.6, ("albedo_C03", "solar_zenith"): -0.3}
# Of 12 variances and 96 parts at once; a normal deviate exceeds it once in 16,000.
STANDARD_ERRORS = 4.0


@pytest.fixture(scope="module")
def states():
    return columns()


@pytest.fixture(scope="module")
def found(states):
    return sensitivity(colour, states, INPUTS)


def value_at(states, k, change, function=colour):
    by = np.zeros((states.geometry.solar_zenith.shape[0], len(INPUTS)))
    by[:, k] = change
    return np.asarray(function(changed(states, INPUTS, jnp.asarray(by))))


def assert_close(ours, theirs, agree):
    """Relative to the largest of each column and number."""
    assert np.isfinite(ours).all()
    largest = np.abs(theirs).max(axis=-1, keepdims=True)
    assert np.max(np.abs(ours - theirs) / largest) < agree


def test_jacobians_are_central_differences(states, found):
    np.testing.assert_allclose(found.value, colour(states), rtol=1e-12)
    steps = [STEP * one.step for one in INPUTS]
    differences = [
        (value_at(states, k, h) - value_at(states, k, -h)) / (2 * h) for k, h in enumerate(steps)
    ]
    scale = np.array([one.step for one in INPUTS])
    assert_close(found.jacobian * scale, np.stack(differences, axis=-1) * scale, AGREE)


def test_elasticities_are_relative(states, found):
    """Those of a factor, 1, and of an optical depth: the slope of the logarithms."""
    for k in (0, 5):
        own = found.inputs[:, k]
        h = STEP * own
        ahead, behind = (value_at(states, k, s * h) for s in (1, -1))
        expected = np.log(np.abs(ahead / behind)) / np.log((1 + STEP) / (1 - STEP))
        np.testing.assert_allclose(found.elasticity[..., k], expected, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(found.inputs[:, 0], states.atmosphere.plumes["smoke"].aod_550)
    assert (found.inputs[:, 5] == 1).all()


@pytest.mark.parametrize("name", ["albedo", "albedo.C03", "geometry.solar_zenith", "ssa"])
def test_elasticities_do_not_hang_on_bands_that_are_not_looked_at(states, name):
    """Of a number that is a product: how often it has the input as a factor."""
    albedo = {"C01": np.full(6, 0.02), "C03": np.full(6, 0.4)}
    some = replace(states, albedo=albedo)

    def product(s):
        smoke = part(s, "atmosphere.plumes.smoke")
        return s.albedo["C03"] ** 2 * s.geometry.solar_zenith**2 * smoke.ssa["C03"] ** 2

    one = leaf(name, 0.01) if "." in name else declared(name, "smoke")
    found = sensitivity(product, some, [declared("liquid_mass"), one], second_order=False)
    np.testing.assert_allclose(found.elasticity[:, 0], [[0, 2]] * 6, rtol=1e-12)


def test_the_elasticity_by_a_plumes_height_is_by_that_of_its_middle(states):
    """Its edges move by one length, so that nothing hangs on its thickness."""
    plume = part(states, "atmosphere.plumes.smoke")
    height = [declared("plume_height", "smoke")]

    def edges(s):
        smoke = part(s, "atmosphere.plumes.smoke")
        return jnp.stack([smoke.top, smoke.top - smoke.base], axis=-1)

    found = sensitivity(edges, states, height, second_order=False).elasticity[..., 0]
    middle = (plume.base + plume.top) / 2
    np.testing.assert_allclose(found, np.stack([middle / plume.top, 0 * middle], axis=-1))


def test_finite_changes_are_those_of_the_operator(states, found):
    for k, one in enumerate(INPUTS):
        for ours, sign in ((found.up, 1), (found.down, -1)):
            theirs = value_at(states, k, sign * one.step) - found.value
            np.testing.assert_allclose(ours[..., k], theirs, atol=1e-13)


def test_second_derivatives_are_symmetric_and_those_of_values(states, found):
    scale = np.array([one.step for one in INPUTS])
    second = found.second * scale[:, None] * scale
    largest = np.abs(second).max(axis=(-1, -2), keepdims=True)
    # Heights of plumes have none where an edge is on a level; these lie between levels.
    assert np.max(np.abs(second - np.swapaxes(second, -1, -2)) / largest) < 1e-4
    for k, one in enumerate(INPUTS):
        h = FINE * one.step
        sides = value_at(states, k, h) + value_at(states, k, -h) - 2 * found.value
        expected = sides / FINE**2
        assert np.max(np.abs(second[..., k, k] - expected) / largest[..., 0, 0]) < 1e-4


def test_what_may_not_be_is_no_number(states):
    """A single-scattering albedo above 1, an optical depth below 0; what may be is told."""
    inputs = INPUTS[0].stepping(5.0), INPUTS[1].stepping(0.2), *INPUTS[2:]
    some = sensitivity(colour, states, inputs, second_order=False)
    assert np.isfinite(some.up[..., 0]).all() and np.isnan(some.down[..., 0]).all()
    assert np.isnan(some.up[..., 1]).all() and np.isfinite(some.down[..., 1]).all()
    assert np.isnan(some.second).all()


def test_outputs_by_name(states):
    names = ("C01", "C02", "green", "green:bah2018", "C06")
    some = output_function(names, Settings(**HOW))(states)
    blue, red, near, infrared = np.asarray(brf(states, BANDS, **HOW)).T
    np.testing.assert_allclose(some[:, 0], blue, rtol=1e-12)
    np.testing.assert_allclose(some[:, 1], red, rtol=1e-12)
    np.testing.assert_allclose(some[:, 2], derived_green(red, blue, near), rtol=1e-12)
    other = derived_green(red, blue, near, recipe="bah2018")
    np.testing.assert_allclose(some[:, 3], other, rtol=1e-12)
    np.testing.assert_allclose(some[:, 4], infrared, rtol=1e-12)


def test_what_burns_shines_in_what_is_seen_of_it(states):
    """As in a result: all light of C06 over that of a white ground, and its slopes."""
    fires, distance = burning(states), 0.99
    shining = output_function(["C06"], Settings(**HOW), distance)
    flames = [declared("fire_fraction"), declared("fire_temperature")]
    found = sensitivity(shining, fires, flames, second_order=False)
    light = radiance(fires, ("C06",), sun_distance=distance, **HOW)
    factor = light * np.pi * distance**2 / solar_irradiance("C06")
    brightness = factor / np.cos(np.asarray(states.geometry.solar_zenith))[:, None]
    np.testing.assert_allclose(found.value, brightness, rtol=1e-12)
    for k, one in enumerate(flames):
        h = STEP * one.step
        by = jnp.zeros((6, 2)).at[:, k].set(h)
        ahead, behind = (shining(changed(fires, flames, x)) for x in (by, -by))
        np.testing.assert_allclose(found.jacobian[..., k], (ahead - behind) / (2 * h), rtol=1e-5)
    assert (found.jacobian > 0).all() and (found.up > 0).all() and (found.down < 0).all()


@pytest.mark.slow
def test_a_fires_contrast_and_its_slopes(states):
    """A fire shows in proportion to its size; what it gives off is added to what is reflected."""
    fires = burning(states)
    inputs = [declared("fire_fraction"), declared("fire_temperature"), declared("albedo_C06")]
    contrast = output_function(["fire_contrast"], Settings(**HOW))
    found = sensitivity(contrast, fires, inputs, second_order=False)
    np.testing.assert_allclose(found.elasticity[:, 0, 0], 1, atol=1e-3)
    for k, one in enumerate(inputs):
        h = STEP * one.step
        by = jnp.zeros((6, 3)).at[:, k].set(h)
        ahead, behind = (contrast(changed(fires, inputs, x)) for x in (by, -by))
        np.testing.assert_allclose(found.jacobian[..., k], (ahead - behind) / (2 * h), rtol=1e-5)
    value = found.value[:, 0]
    smaller, hotter = burning(states, fraction=0.01), burning(states, temperature=900.0)
    np.testing.assert_allclose(contrast(smaller)[:, 0], value / 2, rtol=1e-3)
    assert (contrast(hotter)[:, 0] > 2 * value).all()
    assert (found.jacobian[:, 0, :2] > 0).all() and (found.jacobian[:, 0, 2] < 0).all()


def test_what_cannot_be_asked_is_told(states):
    with pytest.raises(ValueError, match="no input to be sensitive to"):
        sensitivity(colour, states, ())
    with pytest.raises(ValueError, match=r"gives \(6,\) or \(6, n\) numbers; got \(\)"):
        sensitivity(lambda s: colour(s).sum(), states, INPUTS)
    with pytest.raises(ValueError, match="no output 'C09'; choose from C01"):
        output_function(["C09"], Settings(**HOW))
    with pytest.raises(ValueError, match="no output to look at"):
        output_function([], Settings(**HOW))
    with pytest.raises(ValueError, match="of states with a fire"):
        output_function(["fire_contrast"], Settings(**HOW))(states)


@pytest.fixture(scope="module")
def case(states, found):
    return states, found.jacobian, covariance_of(UNCERTAIN, CORRELATIONS)


def test_parts_sum_to_the_variance(case):
    _, jacobian, covariance = case
    parts = variance_parts(jacobian, covariance)
    total = np.einsum("coi,ij,coj->co", jacobian, covariance, jacobian)
    np.testing.assert_allclose(parts.sum(axis=-1), total, rtol=1e-12)
    alone = variance_parts(jacobian, np.diag(np.diag(covariance)))
    np.testing.assert_allclose(alone, jacobian**2 * np.diag(covariance), rtol=1e-12)
    assert (alone >= 0).all()


def test_the_parts_are_those_of_draws_within_the_sampling_error(case, monkeypatch):
    states, jacobian, covariance = case
    # So few columns together that they are solved by the program that has been compiled for few.
    monkeypatch.setattr(variance, "_COLUMNS", 750)
    # Of the draws of seed 0 one variance is 3.4 standard errors off, and its own error as small.
    how = {"num_samples": 1500, "seed": 1}
    found = sampled_variance(colour, states, UNCERTAIN, jacobian, covariance, **how)
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
    found = sampled_variance(line, states, UNCERTAIN, jacobian, covariance, num_samples=50)
    np.testing.assert_allclose(found.linear, found.total, rtol=1e-9)
    np.testing.assert_allclose(found.parts.sum(axis=-1), found.total, rtol=1e-9)


def test_draws_that_may_not_be_are_left_out_and_counted(case):
    states, jacobian, _ = case
    wide = [one.stepping(0.3) if one.name == "albedo_C03" else one for one in UNCERTAIN]
    covariance = covariance_of(wide)
    found = sampled_variance(
        lambda s: s.albedo["C03"], states, wide, jacobian[:, :1], covariance, num_samples=200
    )
    assert (found.draws > 60).all() and (found.draws < 180).all()
    assert (found.total < 0.3**2).all()


def test_what_no_draw_is_left_of_has_no_variance(case):
    states, jacobian, covariance = case
    nowhere = replace(UNCERTAIN[0], holds=lambda s: np.zeros(len(s.geometry.solar_zenith), bool))
    never = [nowhere, *UNCERTAIN[1:]]
    found = sampled_variance(
        lambda s: s.albedo["C03"], states, never, jacobian[:, :1], covariance, num_samples=9
    )
    assert (found.draws == 0).all()
    assert all(np.isnan(some).all() for some in found[:-1])


def test_correlations_are_judged_whatever_the_units():
    """And drawn: those of 1 leave no other direction, in the smallest of units."""
    some = [declared(x, "smoke") for x in ("aod_550", "ssa", "albedo")]
    inputs = [one.stepping(x) for one, x in zip(some, (1e3, 3e-4, 3e-4), strict=True)]
    for wrong in (-1.5, 2.0, float("nan"), float("inf")):
        with pytest.raises(ValueError, match=f"is -1 to 1; got {wrong} of ssa and albedo"):
            covariance_of(inputs, {("ssa", "albedo"): wrong})
    tiny = covariance_of([one.stepping(1e-9) for one in inputs])
    tiny[0, 1] = 5e-19
    with pytest.raises(ValueError, match="is symmetric"):
        variance_parts(np.ones((1, 3)), tiny)
    sigma, correlations = variance._standardized(covariance_of(inputs, {("ssa", "albedo"): -1.0}))
    np.testing.assert_allclose(sigma, [1e3, 3e-4, 3e-4])
    np.testing.assert_allclose(correlations, [[1, 0, 0], [0, 1, -1], [0, -1, 1]], atol=1e-12)


def test_names_are_given_once():
    with pytest.raises(ValueError, match="each input is given once; got ssa more often"):
        covariance_of([declared("ssa", "smoke"), declared("ssa", "ash")])
    pairs = {("aod_550", "ssa"): 0.5, ("ssa", "aod_550"): 0.2}
    with pytest.raises(ValueError, match="each correlation is given once; got aod_550 and ssa"):
        covariance_of(UNCERTAIN, pairs)


def test_what_is_no_covariance_is_told(case):
    _, jacobian, covariance = case
    with pytest.raises(ValueError, match=r"symmetric, \(8, 8\); got \(3, 3\)"):
        variance_parts(jacobian, covariance[:3, :3])
    with pytest.raises(ValueError, match="the covariance of 2 inputs is finite; got .*nan"):
        variance_parts(jacobian[..., :2], np.diag([1.0, np.nan]))
    names = ("aod_550", "ssa", "albedo_C03")
    pairs = {names[:2]: 0.9, names[1:]: 0.9, names[::2]: -0.9}
    with pytest.raises(ValueError, match="these correlations cannot be"):
        covariance_of(UNCERTAIN, pairs)
    with pytest.raises(ValueError, match="a correlation is of two of aod_550, ssa"):
        covariance_of(UNCERTAIN, {("aod_550", "ozone"): 0.5})
    with pytest.raises(ValueError, match="2 samples or more; got 1"):
        sampled_variance(colour, *case[:1], UNCERTAIN, jacobian, covariance, num_samples=1)
