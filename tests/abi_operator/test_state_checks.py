"""States that cannot be, columns by night and out of sight, and what flags say of them."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from states import column

from abi_operator import (
    Fire,
    Geometry,
    Hydrometeor,
    brf,
    check_state,
    outside_fitted_range,
    quality_flags,
    radiance,
    reflectance_factor,
)
from abi_operator.geometry import is_up
from abi_operator.nomenclature import QUALITY_FLAGS
from abi_operator.quality import flags_from
from abi_operator.state_checks import uniform
from abi_operator.surface import Lambertian, LandAndSea, RossLi, ocean

# As in `test_reflectance`, for its programs.
OPTIONS = {"num_streams": 4, "num_doublings": 4}
BANDS = ("C06", "C01")
LAYERS = 12


def batch_of(count=3):
    """Equal columns."""
    state = column(num_layers=LAYERS)
    return jax.tree.map(lambda x: np.stack([np.asarray(x, float)] * count), state)


def changed(state, read, column_number, value):
    x = np.array(read(state))
    x[column_number] = value
    return eqx.tree_at(read, state, x)


BAD = {
    "mass": (lambda s: s.atmosphere.liquid.mass_path, (1, 2), -1e-3,
             r"liquid\.mass_path of entry 2 of column 1 is -0\.001; allowed is 0 or more"),
    "albedo": (lambda s: s.albedo["C02"], 2, 1.2,
               r"state\.albedo\['C02'\] of column 2 is 1\.2; allowed is 0 to 1"),
    "levels": (lambda s: s.atmosphere.height, (0, 1), 5e4,
               r"state\.atmosphere\.height, from level to level of entry 0 of column 0"),
    "pressure": (lambda s: s.atmosphere.pressure, (2, 3), 1e6,
                 r"pressure, from level to level of entry 3 of column 2 .* ordered from the top"),
    "ssa": (lambda s: s.atmosphere.plumes["ash"].ssa["C01"], 1, 1.01, r"\['ash'\]\.ssa\['C01'\]"),
    "plume": (lambda s: s.atmosphere.plumes["smoke"].base, 1, 4000.0,
              r"plumes\['smoke'\], top - base of column 1 is -1000\.0; allowed is above 0"),
    "zenith": (lambda s: s.geometry.view_zenith, 0, -0.1, r"view_zenith of column 0 .* 0 to pi"),
    "degrees": (lambda s: s.geometry.relative_azimuth, 2, 120.0,
                r"relative_azimuth of column 2 is 120\.0; allowed is -2 pi to 2 pi"),
    "hPa": (lambda s: s.atmosphere.pressure, 1, 1013.25 * np.linspace(0, 1, LAYERS + 1),
            r"pressure at the ground of column 1 is 1013\.25; allowed is 2000 to 120000 Pa"),
    "km": (lambda s: s.atmosphere.height, 1, np.linspace(24, 0, LAYERS + 1),
           r"in which pressure falls to 1 / e of column 1 is [89]\.\d+; .* \(height is in m"),
    "droplets": (lambda s: s.atmosphere.liquid.number_path, 2, 0.0,
                 r"liquid\.number_path, where there is mass, of entry 11 of column 2 is 0\.0"),
    "forward": (lambda s: s.atmosphere.plumes["smoke"].asymmetry["C02"], 1, 1.0,
                r"asymmetry\['C02'\] of column 1 is 1\.0; allowed is above -1 and below 1"),
    "nan": (lambda s: s.geometry.relative_azimuth, 1, np.nan, "azimuth of column 1 is nan"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_errors_name_field_column_and_range(case):
    read, where, value, message = BAD[case]
    bad = changed(batch_of(), read, where, value)
    with pytest.raises(ValueError, match=message):
        check_state(bad)
    with pytest.raises(ValueError, match=message):
        brf(bad, BANDS, **OPTIONS)


def test_good_states_pass_and_one_column_has_no_number():
    check_state(batch_of())
    with pytest.raises(ValueError, match=r"state\.albedo\['C01'\] is -0\.1; allowed is 0 to 1\.$"):
        check_state(eqx.tree_at(lambda s: s.albedo["C01"], column(), -0.1))
    bad = changed(batch_of(), lambda s: s.albedo["C01"], slice(1, 3), 2.0)
    with pytest.raises(ValueError, match=r"column 1 is 2\.0 \(and 1 more\)"):
        check_state(bad)


def test_temperatures_and_fires_are_checked():
    cold = dataclasses.replace(column(), surface_temperature=jnp.asarray(15.0))  # of Celsius
    with pytest.raises(
        ValueError, match="surface_temperature is 15.0; allowed is above 50 and below 100000 K"
    ):
        check_state(cold)
    fire = Fire(jnp.asarray(1.5), jnp.asarray(900.0))
    with pytest.raises(ValueError, match=r"fire\.fraction is 1\.5; allowed is 0 to 1"):
        check_state(dataclasses.replace(column(), fire=fire))


def with_leaf(read, value, count=2):
    return eqx.tree_at(read, batch_of(count), value)


SHAPES = {
    "layers": (lambda s: s.atmosphere.liquid.mass_path, np.zeros((2, LAYERS - 1)),
               r"mass_path has the shape \(11,\) in a column; it needs 12 layers, as pressure"),
    "levels": (lambda s: s.atmosphere.height, np.zeros((2, LAYERS)),
               r"height has the shape \(12,\) in a column; it needs 13 levels, as pressure has"),
    "pressure": (lambda s: s.atmosphere.pressure, np.zeros(2),
                 r"pressure has shape \(2,\); it needs the 1 axes of the batch and one of two"),
    "plume": (lambda s: s.atmosphere.plumes["smoke"].base, np.zeros((2, LAYERS)),
              r"\['smoke'\]\.base has the shape \(12,\) in a column; it needs one number a column"),
    "list": (lambda s: s.albedo["C01"], [0.1, 0.2],
             r"state\.albedo\['C01'\] is a list or a tuple; it must be one array"),
    "tuple": (lambda s: s.atmosphere.pressure, (0.0, 1e5), r"\.atmosphere\.pressure is a list"),
}  # fmt: skip


@pytest.mark.parametrize("case", SHAPES)
def test_shapes_are_those_of_the_field(case):
    read, value, message = SHAPES[case]
    for function in (brf, quality_flags):
        with pytest.raises(ValueError, match=message):
            function(with_leaf(read, value), BANDS)


def test_air_may_be_absent():
    check_state(with_leaf(lambda s: s.atmosphere.pressure, np.zeros((2, LAYERS + 1))))


def test_names_are_not_one_string():
    for function in (brf, reflectance_factor, radiance, quality_flags, outside_fitted_range):
        with pytest.raises(ValueError, match=r"such as \('C01',\); got the string 'C01'"):
            function(column(), "C01")
    with pytest.raises(ValueError, match=r"gases are a sequence .* got the string 'O3'"):
        brf(column(), BANDS, gases="O3")


def test_no_columns_are_an_empty_answer():
    none = jax.tree.map(lambda x: x[:0], batch_of(1))
    found = [brf(none, BANDS, **OPTIONS), jax.jit(lambda s: brf(s, BANDS, **OPTIONS))(none)]
    found += [reflectance_factor(none, BANDS, **OPTIONS), radiance(none, BANDS, **OPTIONS)]
    assert {x.shape for x in found} == {(0, 2)}
    slope = jax.grad(lambda s: brf(s, BANDS, num_streams=4).sum())(none)
    assert slope.atmosphere.pressure.shape == (0, LAYERS + 1)
    assert quality_flags(none, BANDS).shape == (0,)


def test_slopes_of_a_column_that_is_no_number_are_its_own_affair():
    """Inside a derivative nothing is checked: others are solved as if it were not there."""
    bad = changed(batch_of(2), lambda s: s.atmosphere.pressure, (1, slice(None)), np.nan)

    def total(state):
        return jnp.sum(brf(state, BANDS, num_streams=4)[0])

    slopes, expected = (jax.grad(total)(s).albedo["C01"] for s in (bad, batch_of(2)))
    np.testing.assert_allclose(slopes[0], expected[0], rtol=1e-12)


@pytest.mark.parametrize(
    ("read", "value", "message"),
    [
        (lambda g: g.water_share, 50.0, r"\.water_share of column 1 is 50\.0; allowed is 0 to 1"),
        (lambda g: g.water_share, -0.1, r"\.water_share of column 1 is -0\.1"),
        (lambda g: g.sea.foam_reflectance, 1.2, r"\.sea\.foam_reflectance of column 1 is 1\.2"),
        (lambda g: g.sea.water_reflectance, -0.1, r"\.sea\.water_reflectance of column 1 is -0"),
        (lambda g: g.sea.refractive_index, 0.34, r"index of column 1 is 0\.34; allowed is 1 to 10"),
        (lambda g: g.sea.absorption_index, -1e-9, r"\.sea\.absorption_index of column 1 is -1e-09"),
        (lambda g: g.sea.wind_speed, 40.0, r"\.sea\.wind_speed of column 1 is 40\.0"),
    ],
)
def test_a_coast_is_of_water_and_of_land(read, value, message):
    """Percent, what is added to 1, and a sign that is that of the other convention."""
    land = RossLi(*(jnp.full(3, x) for x in (0.2, 0.05, 0.01)))
    sea = jax.tree.map(lambda x: jnp.full(3, x), ocean(jnp.asarray(6.0), "C01"))
    coast = LandAndSea(land, sea, jnp.array([0.0, 0.5, 1.0]))
    state = dataclasses.replace(batch_of(), albedo={"C01": coast})
    check_state(state)
    with pytest.raises(ValueError, match=message):
        check_state(changed(state, lambda s: read(s.albedo["C01"]), 1, value))


def test_satellites_are_known():
    with pytest.raises(ValueError, match="GOES-20"):
        reflectance_factor(column(), BANDS, satellite="GOES-20")


def test_night_and_out_of_sight():
    """Sun and satellite up, sun down, satellite down; derivatives of the first are its own."""
    state = batch_of()
    state = changed(state, lambda s: s.geometry.solar_zenith, 1, np.pi / 2 + 0.1)
    state = changed(state, lambda s: s.geometry.view_zenith, 2, 1.7)
    day = batch_of()

    def total(state):
        values = (
            brf(state, BANDS, **OPTIONS),
            reflectance_factor(state, BANDS, **OPTIONS),
            radiance(state, BANDS, **OPTIONS),
        )
        # Columns that are not simulated take no part in a sum over those that are.
        return sum(jnp.nansum(x) for x in values), values

    slopes, values = jax.grad(total, has_aux=True)(state)
    alone, expected = jax.grad(total, has_aux=True)(day)
    for found, day in zip(values, expected, strict=True):
        np.testing.assert_allclose(found[0], day[0], rtol=1e-13)
        assert np.all(np.isnan(found[2]))
    by_night = [x[1] for x in values]
    assert np.all(np.isnan(by_night[0])) and np.all(by_night[1] == 0) and np.all(by_night[2] == 0)
    for (path, a), b in zip(
        jax.tree_util.tree_leaves_with_path(slopes), jax.tree.leaves(alone), strict=True
    ):
        name = jax.tree_util.keystr(path)
        np.testing.assert_allclose(a[0], b[0], rtol=1e-10, atol=1e-12, err_msg=name)
        assert np.all(a[1:] == 0), name
    flags = quality_flags(state, BANDS)
    assert flags.dtype == jnp.uint8
    np.testing.assert_array_equal(flags, [0, QUALITY_FLAGS["night"], QUALITY_FLAGS["out_of_sight"]])


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_the_horizon_itself_is_below_it(dtype):
    """To whoever judges it, though the cosine of the double nearest to pi/2 is above 0."""
    state, horizon = batch_of(), np.asarray(np.pi / 2, dtype)
    state = changed(state, lambda s: s.geometry.solar_zenith, 1, np.pi / 2)
    state = changed(state, lambda s: s.geometry.view_zenith, 2, np.pi / 2)
    state = jax.tree.map(lambda x: np.asarray(x, dtype), state)
    night, away = QUALITY_FLAGS["night"], QUALITY_FLAGS["out_of_sight"]
    assert quality_flags(state, BANDS).tolist() == [0, night, away]
    assert flags_from(horizon, np.asarray(0.6, dtype)) == night
    seen = brf(state, BANDS, **OPTIONS)
    assert np.isfinite(seen[0]).all() and np.isnan(seen[1:]).all()
    factor = reflectance_factor(state, BANDS, **OPTIONS)
    assert (factor[1] == 0).all() and np.isnan(factor[2]).all()
    light = radiance(state, BANDS, **OPTIONS)
    assert (light[0] > 0).all() and (light[1] == 0).all() and np.isnan(light[2]).all()
    assert not (state.geometry.mu0[1] > 0) and not (state.geometry.mu[2] > 0)
    before = np.nextafter(horizon, np.asarray(0, dtype))
    assert is_up(before) and Geometry(*3 * [jnp.asarray(before)]).mu0 > 0


def test_flags_of_angles_particles_and_grounds():
    state = batch_of(6)
    tiny = np.zeros((6, LAYERS))
    tiny[3, 1] = 1e-3
    snow = Hydrometeor(tiny, 1e16 * tiny)  # crystals far below 20 um
    state = eqx.tree_at(
        lambda s: s.atmosphere.hydrometeors,
        state,
        {"snow": snow},
        is_leaf=lambda x: isinstance(x, dict) and not x,
    )
    weights = np.tile([0.2, 0.05, 0.01], (6, 1))
    weights[4], weights[5] = (0.05, 0.0, 0.05), (1.1, 0.0, 0.0)
    grounds = {"C01": Lambertian(jnp.full(6, 0.1)), "C06": RossLi(*map(jnp.asarray, weights.T))}
    zenith = np.full(6, 0.6)
    sun, view = zenith.copy(), zenith.copy()
    sun[1], view[2] = 1.45, 1.45
    state = eqx.tree_at(
        lambda s: (s.albedo, s.geometry), state, (grounds, Geometry(sun, view, zenith))
    )
    names = [
        "",
        "grazing_sun",
        "grazing_view",
        "outside_fit",
        "ground_below_zero",
        "ground_above_one",
    ]
    expected = [QUALITY_FLAGS.get(name, 0) for name in names]
    liquid = eqx.tree_at(lambda s: s.atmosphere.liquid.mass_path, state, np.zeros((6, LAYERS)))
    liquid = eqx.tree_at(
        lambda s: [p.brightness for p in s.atmosphere.plumes.values()], liquid, [np.zeros(6)] * 2
    )
    np.testing.assert_array_equal(quality_flags(liquid, BANDS), expected)
    share = outside_fitted_range(liquid, BANDS)
    np.testing.assert_array_equal(share, [[0, 0]] * 3 + [[1, 1]] + [[0, 0]] * 2)


def test_fields_have_one_real_type():
    """That of the arrays, whatever a transformation makes of a number; others are refused by
    name."""
    state = jax.tree.map(lambda x: np.asarray(x, np.float32), column(num_layers=LAYERS))

    def with_albedo(x):
        return uniform(eqx.tree_at(lambda s: s.albedo["C02"], state, x))[0]

    found = jax.eval_shape(with_albedo, 0.3)
    assert {leaf.dtype for leaf in jax.tree.leaves(found)} == {np.dtype(np.float32)}
    with pytest.raises(TypeError, match=r"state\.albedo\['C02'\] is of the type bfloat16; allowed"):
        with_albedo(jnp.zeros((), jnp.bfloat16))
