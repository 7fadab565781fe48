"""What can be changed, by declaration."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from columns_of_smoke import burning, columns

from abi_operator.plume_edges import moves_plume_edges
from abi_operator.sensitivity import declared, factor, leaf, sensitivity
from abi_operator.sensitivity.declarations import BY_BAND, SHORT_NAMES
from abi_operator.sensitivity.inputs import changed, part
from abi_operator.surface import LandAndSea, RossLi, ocean


@pytest.fixture(scope="module")
def states():
    return burning(columns())


def moved(states, one, by):
    count = states.geometry.solar_zenith.shape[0]
    return changed(states, [one], jnp.full((count, 1), by))


NAMES = [x for x in SHORT_NAMES if x not in ("vapour", "ozone")]


@pytest.mark.parametrize("name", [*NAMES, *(f"{x}_C03" for x in BY_BAND)])
def test_no_change_changes_nothing_and_a_step_moves_the_value(states, name):
    one = declared(name, "smoke")
    same = moved(states, one, 0.0)
    for ours, theirs in zip(jax.tree.leaves(same), jax.tree.leaves(states), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_allclose(one.value(same), one.value(states), rtol=1e-12)
    step = moved(states, one, one.step)
    assert one.holds(states).all() and one.units and one.long_name
    if one.units == "1" and name in ("liquid_mass", "droplet_number"):
        np.testing.assert_array_equal(one.value(states), 1)
        path = f"atmosphere.liquid.{'mass' if name == 'liquid_mass' else 'number'}_path"
        np.testing.assert_allclose(part(step, path), 1.1 * part(states, path), rtol=1e-12)
    else:
        np.testing.assert_allclose(one.value(step) - one.value(states), one.step, rtol=1e-7)


def test_a_depth_that_changes_leaves_the_picture_as_it_was(states):
    """So that what is declared beside it, in whatever order, is of the picture too."""
    picture = np.array([0.0, 1e-9, 0.1, 0.4, 0.7, 1.0])
    plume = part(states, "atmosphere.plumes.smoke")
    thick = plume.extinction_550 * (plume.top - plume.base)
    some = eqx.tree_at(lambda s: part(s, "atmosphere.plumes.smoke").brightness, states, picture)
    depth, strength = declared("aod_550", "smoke"), "atmosphere.plumes.smoke.brightness"
    for inputs in ([depth, declared(strength)], [declared(strength), depth]):
        slopes = sensitivity(depth.value, some, inputs, second_order=False).jacobian[:, 0]
        for one, slope in zip(inputs, slopes.T, strict=True):
            expected = 1 if one is depth else picture * thick
            np.testing.assert_allclose(slope, expected, rtol=1e-12)
    thicker = part(moved(some, depth, 0.3), "atmosphere.plumes.smoke")
    np.testing.assert_array_equal(thicker.brightness, np.where(picture > 1e-6, picture, 1))
    np.testing.assert_allclose(thicker.aod_550, picture * thick + 0.3, rtol=1e-12)


def test_a_leaf_is_declared_by_its_place(states):
    one = leaf("albedo.C02", 0.05)
    assert (one.name, one.units) == ("albedo.C02", "1")
    step = moved(states, one, 0.05)
    np.testing.assert_allclose(step.albedo["C02"], np.asarray(states.albedo["C02"]) + 0.05)
    assert (step.albedo["C01"] == states.albedo["C01"]).all()
    assert not one.holds(moved(states, one, 2.0)).any()
    every = factor("atmosphere.liquid", 0.1)
    step = moved(states, every, 0.1)
    for name in ("mass_path", "number_path"):
        ours, theirs = (getattr(x.atmosphere.liquid, name) for x in (step, states))
        np.testing.assert_allclose(ours, 1.1 * theirs, rtol=1e-12)
    assert declared("atmosphere.pressure").units == "1"
    assert "relative" in declared("albedo.C03").long_name


@pytest.fixture(scope="module")
def uneven(states):
    """Grounds from land with kernels, the first of it dark, to a sea under wind, in two bands."""
    land = RossLi(jnp.linspace(0.02, 0.3, 6), jnp.full(6, 0.05), jnp.full(6, 0.015))
    share, wind = jnp.array([0, 0, 0.3, 0.6, 1, 1]), jnp.array([2.0, 3, 7, 5, 5, 12])
    grounds = {x: LandAndSea(land, ocean(wind, x), share) for x in ("C02", "C03")}
    # NumPy's arrays with an axis each, as of a scene's columns.
    grounds = jax.tree.map(lambda x: np.broadcast_to(np.asarray(x), 6), grounds)
    return replace(states, albedo=grounds)


@jax.jit
def of_sky(ground):
    return jax.tree.map(jnp.asarray, ground).white_sky_albedo()


@pytest.mark.parametrize("name, bands", [("albedo", ("C02", "C03")), ("albedo_C03", ("C03",))])
def test_albedo_is_that_of_any_ground(uneven, name, bands):
    """To all sides alike: kernels, wind and share of water stay, and what is added is exact."""
    one = declared(name)
    step = moved(uneven, one, one.step)
    for band, ground in uneven.albedo.items():
        rise = of_sky(step.albedo[band]) - of_sky(ground)
        np.testing.assert_allclose(rise, one.step if band in bands else 0, atol=1e-14)
        for path in ("land.f_vol", "land.f_geo", "sea.wind_speed", "water_share"):
            ours, theirs = (part(x, f"albedo.{band}.{path}") for x in (step, uneven))
            np.testing.assert_array_equal(ours, theirs)
    # Foam's reflectance is rounded in the seventh place, and covers some hundredths of the sea.
    own = np.mean([of_sky(uneven.albedo[band]) for band in bands], axis=0)
    np.testing.assert_allclose(one.value(uneven), own, atol=1e-8)
    np.testing.assert_allclose(one.value(step) - one.value(uneven), one.step, rtol=1e-9)
    assert one.holds(uneven).all() and one.holds(step).all()
    assert one.holds(moved(uneven, one, -one.step)).tolist() == [False] + 5 * [True]
    assert not one.holds(moved(uneven, one, 1.0)).any()


def test_a_share_of_an_albedo_is_one_in_every_band(uneven):
    """Of any ground; in Lambertian ones, and of leaves, each number is multiplied."""
    by = jnp.full(6, 0.1)
    bright = declared("albedo").relative(uneven)(uneven, by)
    for band in uneven.albedo:
        own, more = of_sky(uneven.albedo[band]), of_sky(bright.albedo[band])
        np.testing.assert_allclose(more, 1.1 * own, atol=1e-8)
    plain = replace(uneven, albedo={"C02": np.full(6, 0.1), "C03": np.full(6, 0.3)})
    for one in (declared("albedo"), leaf("albedo", 0.01)):
        bright = one.relative(plain)(plain, by).albedo
        np.testing.assert_allclose(np.stack(list(bright.values())), [[0.11] * 6, [0.33] * 6])
    assert declared("albedo_C03").relative is None and declared("liquid_mass").relative is None


def test_what_there_is_not_is_told(states):
    with pytest.raises(ValueError, match="no input 'depth'; choose from aod_550, ssa"):
        declared("depth")
    with pytest.raises(ValueError, match="ssa is of a plume"):
        declared("ssa")
    with pytest.raises(ValueError, match="ssa is of a plume"):
        declared("ssa_C03")
    with pytest.raises(ValueError, match="no atmosphere.plumes.dust.ssa: instead of 'dust' there"):
        declared("ssa", "dust").change(states, jnp.zeros(6))
    with pytest.raises(ValueError, match="no albedo.C05: instead of 'C05' there is"):
        declared("albedo_C05").change(states, jnp.zeros(6))
    for step in (0.0, np.nan, np.inf):
        with pytest.raises(ValueError, match=f"a step is above 0 and finite; got {step} for alb"):
            declared("albedo").stepping(step)


@pytest.mark.parametrize(
    "ours",
    [
        declared("plume_height", "smoke"),
        *(leaf(f"atmosphere.plumes.smoke.{end}", 100.0, name="mine") for end in ("base", "top")),
    ],
)
def test_what_moves_a_plume_is_told_by_what_it_does(states, ours):
    others = [declared(name, "smoke") for name in ("aod_550", "ssa", "solar_zenith")]
    first = jax.tree.map(lambda x: x[:1], states)
    for inputs, moves in ((others, False), ([*others, ours], True)):
        assert (
            moves_plume_edges(lambda x, i=inputs: changed(first, i, x[None]), len(inputs)) is moves
        )
