"""Numbers of a plume do what their names say, and change nothing else."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator import BANDS, smoke
from retrievals.tuning import NUMBERS, plume_numbers
from retrievals.tuning.plume_numbers import steeper, strengthened, with_middle, with_top

PLUME = smoke(0.8, bands=("C01", "C03"))


def test_each_keeps_what_it_should():
    assert float(strengthened(PLUME, jnp.asarray(2.0)).aod_550) == pytest.approx(1.6)
    moved = with_middle(PLUME, jnp.asarray(3500.0))
    assert (float(moved.base), float(moved.top)) == (2500.0, 4500.0)
    assert float(moved.aod_550) == pytest.approx(0.8)
    taller = with_top(PLUME, jnp.asarray(5000.0))
    assert (float(taller.base), float(taller.top)) == (1000.0, 5000.0)
    assert float(taller.aod_550) == pytest.approx(0.8)
    extinction = steeper(PLUME.relative_extinction, jnp.asarray(0.5))
    slope = [np.log(float(extinction[b] / PLUME.relative_extinction[b])) for b in ("C01", "C03")]
    wavelength = [np.log(BANDS[b].wavelength_um / 0.55) for b in ("C01", "C03")]
    np.testing.assert_allclose(slope, -0.5 * np.array(wavelength))


@pytest.mark.parametrize("name", [name for name in NUMBERS if name != "radius"])
def test_the_mean_of_its_prior_is_the_scenes_own_plume(name):
    """So that a fit begins with the scene; a radius is that of tables, which a scene is not of."""
    quantity = plume_numbers([name], "smoke", PLUME).quantities[0]
    x = quantity.transform.x(jnp.asarray(quantity.mean, float))
    end = quantity.place.removeprefix("atmosphere.plumes.smoke")
    node = getattr(PLUME, end[1:]) if end else PLUME
    same = quantity.put(node, quantity.transform.value(x))
    for ours, theirs in zip(jax.tree.leaves(same), jax.tree.leaves(node), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9)


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (["strength", "colour"], "some of strength, ssa, .*; got colour"),
        ([], "got none"),
        (["ssa", "ssa"], "fitted once"),
        (["height", "top"], "fit one of them"),
    ],
)
def test_what_cannot_be_fitted_is_refused(names, sentence):
    with pytest.raises(ValueError, match=sentence):
        plume_numbers(names, "smoke", PLUME)


@pytest.mark.parametrize("thickness", [1.5, 2000.0])
def test_the_upper_edge_never_comes_down_to_the_base(thickness):
    """At its lowest it has the same optical depth, in a layer that is thin."""
    plume = smoke(0.8, base=1000.0, top=1000.0 + thickness, bands=("C01",))
    transform = plume_numbers(["top"], "smoke", plume).quantities[0].transform
    lowest = with_top(plume, transform.value(jnp.asarray(min(transform.extremes), float)))
    assert 0 < float(lowest.top - lowest.base) <= 1
    assert float(lowest.aod_550) == pytest.approx(0.8, rel=1e-3)


def test_a_plume_on_the_ground_has_no_height_to_shift():
    with pytest.raises(ValueError, match="fit top"):
        plume_numbers(["height"], "smoke", smoke(0.8, base=0.0, top=2000.0))
