"""Radiances: sunlight, emission and both, in closed forms and invariances."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from columns import standard_columns

from abi_operator.solver import toa_brf, toa_radiance

# Emission at four streams is in `test_judge`.
OPTIONS = {"num_streams": 2, "num_doublings": None}
# One doubling is as differentiable as many, and compiles faster.
SLOPES = OPTIONS | {"num_doublings": 1}
# The start of a layer errs by 1e-12, and rounding adds up over five layers.
SOLVED = 1e-11


def sunny(irradiance):
    """One for each column."""
    return np.full(4, irradiance)


def warm(num_levels=6, count=4, seed=8):
    """Planck levels, ground emission and light from above, nothing isothermal."""
    rng = np.random.default_rng(seed)
    return {
        "planck_levels": rng.uniform(1, 9, (count, num_levels)),
        "surface_emission": rng.uniform(1, 9, count),
        "isotropic_top": rng.uniform(0, 2, count),
    }


def test_sun_of_irradiance_pi_over_mu0_is_the_brf():
    columns = standard_columns()
    radiance = toa_radiance(*columns, solar_irradiance=np.pi, **OPTIONS)
    np.testing.assert_allclose(radiance / columns[4], toa_brf(*columns, **OPTIONS), rtol=1e-14)


@pytest.mark.parametrize(
    "given_alone",
    [
        ("planck_levels", "surface_emission"),
        pytest.param(("isotropic_top",), marks=pytest.mark.slow),
    ],
    ids=" ".join,
)
def test_sun_and_emission_add(given_alone):
    columns, sources = standard_columns(), warm()
    both = toa_radiance(*columns, solar_irradiance=sunny(5.0), **sources, **OPTIONS)
    sun = toa_radiance(*columns, solar_irradiance=5.0, **OPTIONS)
    night = toa_radiance(*columns, solar_irradiance=sunny(0.0), **sources, **OPTIONS)
    np.testing.assert_allclose(both, sun + night, rtol=1e-13)
    # Each source alone, first among others that are 0, then where no others are given.
    dark = {name: 0 * x for name, x in sources.items()}
    parts = [
        toa_radiance(*columns, solar_irradiance=sunny(0.0), **(dark | {name: x}), **OPTIONS)
        for name, x in sources.items()
    ]
    np.testing.assert_allclose(sum(parts), night, rtol=1e-12)
    for name in given_alone:
        (part,) = (x for other, x in zip(sources, parts, strict=True) if other == name)
        alone = toa_radiance(*columns, solar_irradiance=0.0, **{name: sources[name]}, **OPTIONS)
        np.testing.assert_allclose(alone, part, rtol=1e-12, err_msg=name)


def test_absorbing_air_follows_schwarzschild():
    r"""Without scattering, over black ground: each layer in closed form, :math:`e^{-\tau/\mu}`."""
    tau, ssa, moments, albedo, mu0, mu, azimuth = standard_columns()
    sources = warm()
    result = toa_radiance(
        tau, 0 * ssa, moments, 0 * albedo, mu0, mu, azimuth,
        solar_irradiance=sunny(0.0), **sources, **OPTIONS,
    )  # fmt: skip
    planck, below = sources["planck_levels"], sources["surface_emission"]
    for i in reversed(range(tau.shape[1])):
        t = tau[:, i] / mu
        top, bottom = planck[:, i], planck[:, i + 1]
        # integral of (top + (bottom - top) x / t) exp(-x), x from 0 to t
        own = top - bottom * np.exp(-t) + (bottom - top) * -np.expm1(-t) / t
        below = below * np.exp(-t) + own
    np.testing.assert_allclose(result, below, rtol=SOLVED)


@pytest.mark.parametrize("albedo", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("ssa", [0.0, 0.7, 1.0])
def test_isothermal_black_body(ssa, albedo):
    tau, _, moments, _, *angles = standard_columns()
    one = np.ones(4)
    result = toa_radiance(
        tau, np.full(tau.shape, ssa), moments, albedo * one, *angles, solar_irradiance=sunny(0.0),
        planck_levels=np.full((4, 6), 7.0), surface_emission=7 * (1 - albedo) * one,
        isotropic_top=7 * one, **OPTIONS,
    )  # fmt: skip
    np.testing.assert_allclose(result, 7, rtol=1e-14)


def layers_of(chosen, share, levels, sources):
    """Radiance of parts of the standard columns' layers, all of which makes one program."""
    tau, ssa, moments, *rest = standard_columns()
    layers = tau[:, chosen] * np.array(share), ssa[:, chosen], moments[:, chosen]
    sources = sources | {"planck_levels": np.stack(levels, axis=1)}
    return toa_radiance(*layers, *rest, solar_irradiance=sunny(1.0), **sources, **OPTIONS)


def test_splitting_a_layer_where_the_planck_function_is_linear():
    """Three layers over two empty ones; and two of them as two halves each."""
    sources = warm()
    levels = sources["planck_levels"]
    middle = 0.5 * (levels[:, 1:] + levels[:, :-1])
    last = levels[:, 3]
    whole = layers_of([0, 1, 2, 3, 3], [1, 1, 1, 0, 0], [*levels.T[:4], last, last], sources)
    halves = [levels[:, 0], middle[:, 0], levels[:, 1], middle[:, 1], levels[:, 2], last]
    split = layers_of([0, 0, 1, 1, 2], [0.5, 0.5, 0.5, 0.5, 1], halves, sources)
    np.testing.assert_allclose(split, whole, rtol=1e-10)


def test_empty_layers_do_not_emit():
    """Above two layers, between them and on the ground."""
    sources = warm()
    level = sources["planck_levels"].T
    whole = layers_of([0, 1, 2, 2, 2], [1, 1, 0, 0, 0], level[[0, 1, 2, 2, 2, 2]], sources)
    # An empty layer lies between the level's value and another from which the next layer starts:
    # continuous levels make that the same value.
    for places in ([0, 2, 2], [1, 1, 2], [0, 0, 1]):
        chosen = np.insert([0, 1], places, 2)
        share = np.insert([1.0, 1.0], places, 0.0)
        levels = np.insert(level[:3], places, level[places], axis=0)
        result = layers_of(chosen, share, levels, sources)
        np.testing.assert_allclose(result, whole, rtol=1e-13)


def test_at_night_the_sun_may_stand_anywhere():
    tau, ssa, moments, albedo, mu0, mu, azimuth = standard_columns()
    sources, none = warm(), sunny(0.0)

    def night(cosine, sources=sources, irradiance=none, **options):
        return toa_radiance(
            tau, ssa, moments, albedo, cosine, mu, azimuth, solar_irradiance=irradiance, **sources,
            **(OPTIONS | options),
        )  # fmt: skip

    # In the sources too, for a program that is also the next test's.
    slopes = jax.grad(lambda *x: jnp.sum(night(*x, **SLOPES)), argnums=(0, 1, 2))
    inputs = {name: jnp.asarray(x) for name, x in sources.items()}, jnp.asarray(none)
    day = night(mu0)
    for cosine in (-mu0, 0 * mu0, 1e-300 + 0 * mu0):
        np.testing.assert_allclose(night(cosine), day, rtol=1e-13)
        np.testing.assert_array_equal(slopes(jnp.asarray(cosine), *inputs)[0], 0)
    checked = night(-mu0, check_values=True)
    np.testing.assert_allclose(checked, day, rtol=1e-10)


def test_derivatives_in_the_sources_are_the_linear_parts():
    columns = [jnp.asarray(x) for x in standard_columns()]
    sources = {name: jnp.asarray(x) for name, x in warm().items()}
    sources["solar_irradiance"] = jnp.full(4, 2.0)

    def radiance(sources, mu0):
        return toa_radiance(*columns[:4], mu0, *columns[5:], **sources, **SLOPES)

    mu0 = columns[4]
    value, slope = jax.jvp(radiance, (sources, mu0), (sources, 0 * mu0))
    np.testing.assert_allclose(slope, value, rtol=1e-13)  # homogeneous of degree one
    back, _ = jax.grad(lambda *x: jnp.sum(radiance(*x)), argnums=(0, 1))(sources, mu0)
    total = sum(jnp.sum(back[name] * x) for name, x in sources.items())
    np.testing.assert_allclose(total, jnp.sum(value), rtol=1e-12)


def test_several_views_in_one_solve():
    tau, ssa, moments, albedo, mu0, mu, azimuth = standard_columns()
    sources = warm()
    views = np.stack([mu, mu0, np.full(4, 0.9)], axis=1)
    turned = np.stack([azimuth, 0 * azimuth, np.full(4, 2.5)], axis=1)
    together = toa_radiance(
        tau, ssa, moments, albedo, mu0, views, turned, solar_irradiance=sunny(1.0), **sources,
        multiple_views=True, **OPTIONS,
    )  # fmt: skip
    assert together.shape == (4, 3)
    for i in range(3):
        alone = toa_radiance(
            tau, ssa, moments, albedo, mu0, views[:, i], turned[:, i], solar_irradiance=sunny(1.0),
            **sources, **OPTIONS,
        )  # fmt: skip
        np.testing.assert_allclose(together[:, i], alone, rtol=1e-13)


def test_shapes_of_the_sources_are_checked():
    columns = standard_columns()
    for num_levels in (2, 5, 7):
        with pytest.raises(ValueError, match=f"one level more.* got {num_levels} levels for 5 lay"):
            toa_radiance(*columns, solar_irradiance=1.0, planck_levels=np.ones((4, num_levels)))
    with pytest.raises(ValueError, match=r"do not broadcast.*\(3,\) of surface_emission"):
        toa_radiance(*columns, solar_irradiance=1.0, surface_emission=np.ones(3))
