"""What the solver refuses, unasked and when asked to check values, and in which words."""

import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from columns import hard_columns, simple_columns

from abi_operator.ranges import SOLVER
from abi_operator.solver import toa_brf, toa_radiance
from abi_operator.solver.checks import check_arguments, check_in_memory

NAMES = ("tau", "ssa", "moments", "albedo", "mu0", "mu", "relative_azimuth")


def arguments(columns=None, **changed):
    """Arguments that pass, except for those changed."""
    columns = simple_columns(count=2, num_layers=3) if columns is None else columns
    return dict(zip(NAMES, columns, strict=True)) | changed


def with_value(name, index, value, **options):
    x = np.array(arguments(**options)[name])
    x[index] = value
    return arguments(**options) | {name: x}


def says(text):
    return pytest.raises(ValueError, match="^" + re.escape(text))


def test_good_values_pass():
    check_arguments(arguments(), series_summed=False)
    check_arguments(arguments(hard_columns()[1]), series_summed=False)
    check_arguments(
        arguments(
            albedo=0,
            mu0=1,
            phase_function=np.zeros(3),
            secant=np.ones((2, 3)),
            solar_irradiance=1.0,
            planck_levels=np.zeros(4),
            surface_emission=jnp.zeros(2),
            isotropic_top=0.0,
        ),
        series_summed=False,
    )
    check_arguments(arguments(phase_function=None, secant=None), series_summed=False)


@pytest.mark.parametrize(
    "name, value, allowed",
    [
        ("tau", -1e-9, "[0, 1e+15)"),
        ("tau", 1e15, "[0, 1e+15)"),
        ("ssa", 1.2, "[0, 1]"),
        ("ssa", -0.5, "[0, 1]"),
        ("albedo", 1.5, "[0, 1]"),
        ("albedo", -0.5, "[0, 1]"),
        ("mu0", 0.0, "(0, 1]"),
        ("mu0", -0.5, "(0, 1]"),
        ("mu", 0.0, "(0, 1]"),
        ("mu", 1.5, "(0, 1]"),
        ("relative_azimuth", np.inf, "[-6.2832, 6.2832] rad"),
        ("relative_azimuth", 30.0, "[-6.2832, 6.2832] rad"),
        ("phase_function", -0.5, "[0, inf)"),
        ("secant", 0.0, "(0, 1e+06)"),
        ("secant", np.inf, "(0, 1e+06)"),
        ("solar_irradiance", -1.0, "[0, 1e+20)"),
        ("planck_levels", -1.0, "[0, 1e+20)"),
        ("surface_emission", -1.0, "[0, 1e+20)"),
        ("isotropic_top", -1.0, "[0, 1e+20)"),
    ],
)
def test_each_range(name, value, allowed):
    message = f"{name}[1] = {value} is outside {allowed}."
    with says(message):
        check_arguments(arguments(**{name: np.array([0.5, value])}), series_summed=False)
    with says(f"{name} = {value} is outside {allowed}."):
        check_arguments(arguments(**{name: value}), series_summed=False)


@pytest.mark.parametrize(
    "name",
    [*NAMES, "phase_function", "secant", "planck_levels", "surface_emission", "isotropic_top"],
)
def test_nan_is_outside_every_range(name):
    x = np.full((2, 3), 0.5)
    x[1, 2] = np.nan
    with says(f"{name}[1, 2] = nan is outside"):
        check_arguments(arguments(**{name: x}), series_summed=False)


def test_moments():
    with says("moments[1, 2, 5] = -1.5 is outside [-1, 1]."):
        check_arguments(with_value("moments", (1, 2, 5), -1.5), series_summed=False)
    # The solver reads no chi_0; an empty layer may have 0, rounding may leave more than 1.
    check_arguments(with_value("moments", (1, 2, 0), 0.0), series_summed=False)
    check_arguments(with_value("moments", (1, 2, 0), 1 + 1e-6), series_summed=False)
    with says("moments[1, 2, 0] = nan is outside (-inf, inf)."):
        check_arguments(with_value("moments", (1, 2, 0), np.nan), series_summed=False)


def test_first_offender_and_number_of_others():
    ssa = np.full((4, 3), 0.5)
    ssa[3] = [1.2, 1.3, 1.4]
    with says("ssa[3, 0] = 1.2 is outside [0, 1] (and 2 more)."):
        check_arguments(arguments(ssa=ssa), series_summed=False)
    # The order of the call decides between arguments.
    with says("tau = -1 is outside"):
        check_arguments(arguments(ssa=ssa, tau=-1), series_summed=False)


@pytest.mark.float32
def test_float32_is_judged_in_float32():
    above = np.nextafter(np.float32(1), np.float32(2))
    with says("ssa[1] = 1.0000001 is outside [0, 1]."):
        check_arguments(arguments(ssa=jnp.asarray([1.0, above], jnp.float32)), series_summed=False)
    check_arguments(arguments(ssa=jnp.ones(3, jnp.float32)), series_summed=False)


def test_any_sun_where_there_is_no_sunlight():
    dark = {"mu0": np.array([0.5, -0.3]), "solar_irradiance": np.array([1.0, 0.0])}
    check_arguments(arguments(**dark), series_summed=False)
    with says("mu0[1] = -0.3 is outside (0, 1]."):
        check_arguments(arguments(**dark | {"solar_irradiance": 1.0}), series_summed=False)
    check_arguments(arguments(mu0=-0.3, solar_irradiance=0.0), series_summed=False)
    with says("mu0[1] = nan is outside (-inf, inf)."):
        check_arguments(
            arguments(mu0=np.array([0.5, np.nan]), solar_irradiance=0.0), series_summed=False
        )


def test_sunlight_broadcasts_against_the_sun():
    lit = np.array([[0.0, 0.0], [0.0, 1.0]])
    with says("mu0[1] = -2.0 is outside (0, 1]."):
        check_arguments(
            arguments(mu0=np.array([-1.0, -2.0]), solar_irradiance=lit), series_summed=False
        )
    with says("mu0[1, 0] = -2.0 is outside (0, 1]."):
        check_arguments(
            arguments(mu0=np.array([[-1.0], [-2.0]]), solar_irradiance=lit), series_summed=False
        )
    with says("mu0 = -1.0 is outside (0, 1]."):
        check_arguments(arguments(mu0=-1.0, solar_irradiance=lit), series_summed=False)


class Ground(eqx.Module):
    weights: jax.Array | np.ndarray
    name: str = "grass"


def test_arrays_of_a_surface_must_be_finite_and_no_more():
    check_arguments(arguments(albedo=Ground(np.array([3.0, -2.0]))), series_summed=False)
    with says("albedo.weights[1] = inf is outside (-inf, inf)."):
        check_arguments(arguments(albedo=Ground(jnp.asarray([3.0, np.inf]))), series_summed=False)


def test_lists_are_arrays():
    with says("albedo[1] = 1.5 is outside [0, 1]."):
        check_arguments(arguments(albedo=[0.5, 1.5]), series_summed=False)


@pytest.mark.parametrize("transform", [jax.jit, jax.vmap, jax.grad])
def test_traced_arguments_are_named(transform):
    def check(mu0):
        check_arguments(arguments(mu0=mu0), series_summed=False)
        return mu0

    point = jnp.ones(2) if transform is jax.vmap else 1.0
    with says("mu0 is traced, so its values cannot be checked: call outside jax.jit"):
        transform(check)(point)


def test_traced_leaf_of_a_surface_is_named():
    def check(ground):
        check_arguments(arguments(albedo=ground), series_summed=False)

    with pytest.raises(ValueError, match=r"albedo\.weights is traced.*check_values=False"):
        eqx.filter_jit(check)(Ground(jnp.ones(2)))


def test_short_series_is_refused_where_it_is_summed():
    moments = np.zeros((2, 3, 17))
    moments[..., 0] = 1
    moments[1, 0] = 0.86 ** np.arange(17)
    moments[1, 2] = 0.7 ** np.arange(17)
    short = arguments(moments=moments)
    check_arguments(short, series_summed=False)
    last = 33 * 0.86**16
    with says(
        f"moments end too early to sum the phase function of layer 0 of column (1,): "
        f"(2l + 1) |chi_l| = {last:.3g} at the last l = 16 is above 0.001 (and 1 more); pass the "
        "phase function itself as phase_function, from its closed form or a table "
        "(interpolate_phase_function), or more moments"
    ):
        check_arguments(short, series_summed=True)
    with says("moments end too early to sum the phase function of layer 2: "):
        check_arguments(arguments(moments=moments[1, [1, 1, 2]]), series_summed=True)
    # Layers that scatter nothing need no series.
    check_arguments(short | {"ssa": np.array([0.0, 0.9, 0.0])}, series_summed=True)
    check_arguments(short | {"tau": np.array([[1.0, 1, 1], [0, 1, 0]])}, series_summed=True)


def test_long_enough_series_passes():
    check_arguments(
        arguments(moments=0.86 ** np.arange(90.0) * np.ones((3, 1))), series_summed=True
    )
    with says("moments end too early"):
        check_arguments(
            arguments(moments=0.86 ** np.arange(64.0) * np.ones((3, 1))), series_summed=True
        )


OPTIONS = {"num_streams": 2}


def called(**changed):
    """brf of two columns of three layers, of which some arguments are changed."""
    return toa_brf(**arguments(**changed), **OPTIONS)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("name", SOLVER)
def test_the_quick_look_lets_pass_what_the_close_one_does(name, dtype):
    """Numbers about both ends of the range, and those that are no numbers, in a good array."""
    one = np.asarray(1, dtype)
    numbers = [-7, -1.5, -1, -0.5, -1e-30, -0.0, 0, 1e-30, 0.5, 1, np.nextafter(one, one + 1), 7]
    for number in np.asarray([*numbers, np.inf, -np.inf, np.nan, -np.asarray(np.nan)], dtype):
        x = np.full((4, 3, 6), 0.5, dtype)
        x[2, 1, 3] = number
        given = {name: np.ascontiguousarray(x)}
        try:
            check_arguments(given, series_summed=False)
            refused = None
        except ValueError as error:
            refused = str(error)
        for array in (given[name], np.moveaxis(given[name], 0, -1), jnp.asarray(given[name])):
            try:
                check_in_memory({name: array})
                assert refused is None, (name, number)
            except ValueError as error:
                assert refused is not None, (name, number, error)


def test_calls_check_unasked():
    bad = {"tau": [1.0, -0.5, 1.0], "ssa": [1.2, 0.9, 0.9], "mu0": [0.5, 1.5], "albedo": 1.5}
    bad |= {"relative_azimuth": 120.0, "mu": 0.0}
    for name, value in bad.items():
        with pytest.raises(ValueError, match=rf"^{name}(\[\d\])? = .* is outside"):
            called(**{name: np.asarray(value)})
    with says("solar_irradiance = -1.0 is outside [0, 1e+20)."):
        toa_radiance(**arguments(), solar_irradiance=-1.0, **OPTIONS)
    unasked = arguments(ssa=np.full((2, 3), 1.2))

    def total(tau):
        return toa_brf(**unasked | {"tau": tau}, check_values=False, **OPTIONS).sum()

    # With slopes, for a program that the next tests have too.
    assert all(np.isfinite(x).all() for x in jax.value_and_grad(total)(unasked["tau"]))


def test_derivatives_and_vmap_check_what_they_read():
    def total(tau):
        return called(tau=tau).sum()

    for number in (np.nan, np.inf, -0.5):
        tau = np.array([1.0, number, 1.0])
        for function, x in ((jax.grad(total), tau), (jax.vmap(total), tau[None])):
            with pytest.raises(ValueError, match=rf"^tau\[.*1\] = {number} is outside"):
                function(x)


def test_columns_that_are_not_finite_are_alone_so_unchecked():
    """Where nobody checks, neither do they settle how the others are solved."""
    tau = np.array([[1.0, 2.0, 3.0], [1.0, np.nan, 1.0]])

    def total(tau):
        return jnp.nansum(toa_brf(**arguments(tau=tau), check_values=False, **OPTIONS))

    slopes = jax.grad(total)(tau)
    alone = jax.grad(total)(np.where(np.isfinite(tau), tau, 1.0))
    np.testing.assert_allclose(slopes[0], alone[0], rtol=1e-12)


def test_slopes_under_jit_of_layers_beyond_any_number_of_doublings_are_nan():
    """Of that column alone: for so thick a layer what is doubled does not begin thin enough."""
    columns = simple_columns(count=2, num_layers=3)
    tau = np.array(columns[0])
    tau[1, 1] = 1e10

    def brf(tau):
        return toa_brf(tau, *columns[1:], **OPTIONS)

    found = jax.jit(lambda t: jax.vjp(brf, t)[1](np.ones(2))[0])(tau)
    np.testing.assert_array_equal(np.isfinite(found).all(axis=1), [True, False])
    assert np.isnan(found[1]).all()
    np.testing.assert_allclose(found[0], jax.vjp(brf, np.array(columns[0]))[1](np.ones(2))[0][0])


def test_lists_of_what_is_traced_are_arrays_too():
    slope = jax.grad(lambda t: called(tau=[[t, 2.0, 3.0], [1.0, 1.0, 1.0]]).sum())(1.0)
    tau = np.array([[1.0, 2.0, 3.0], [1.0, 1.0, 1.0]])
    expected = jax.grad(lambda t: called(tau=t).sum())(tau)[0, 0]
    np.testing.assert_allclose(slope, expected, rtol=1e-12)


def test_no_columns_are_an_empty_answer_and_no_layers_an_error():
    none = arguments(tau=np.zeros((0, 3)), mu0=0.5, mu=0.5, albedo=0.2)
    none |= {"ssa": np.ones(3), "moments": 0.5 ** np.arange(129) * np.ones((3, 1))}
    none |= {"relative_azimuth": 0.3}

    def brf(tau):
        return toa_brf(**none | {"tau": tau}, **OPTIONS)

    tau = np.zeros((0, 3))
    assert brf(tau).shape == jax.jit(brf)(tau).shape == (0,)
    for gradient in (jax.grad(lambda t: brf(t).sum()), jax.jit(jax.grad(lambda t: brf(t).sum()))):
        assert gradient(tau).shape == (0, 3)
    with says("a column has one layer or more; there is none in tau."):
        brf(np.zeros((4, 0)))
