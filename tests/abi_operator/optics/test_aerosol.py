"""Plumes on the layers of a column."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.bands import BANDS, GRASSO2013
from abi_operator.optics import aerosol, ash, smoke
from abi_operator.optics.aerosol import overlap

ROUNDING = 1e-12
LEVELS = jnp.array([4.0, 3.0, 2.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("base", "top", "expected"),
    [
        (0.5, 2.25, [0, 0.25, 1, 0.5]),
        (1.0, 3.0, [0, 1, 1, 0]),
        (2.2, 2.7, [0, 0.5, 0, 0]),
        (2.0, 2.0, [0, 0, 0, 0]),
        (-1.0, 0.5, [0, 0, 0, 0.5]),
        (3.5, 9.0, [0.5, 0, 0, 0]),
    ],
)
def test_overlap(base, top, expected):
    np.testing.assert_allclose(overlap(LEVELS, jnp.asarray(base), jnp.asarray(top)), expected)


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_derivative_on_a_level_belongs_to_the_layer_inside(mode):
    to_base, to_top = mode(overlap, argnums=(1, 2))(LEVELS, jnp.asarray(1.0), jnp.asarray(3.0))
    np.testing.assert_array_equal(to_base, [0, 0, -1, 0])
    np.testing.assert_array_equal(to_top, [0, 1, 0, 0])


@pytest.mark.parametrize("band", GRASSO2013)
@pytest.mark.parametrize("species", ["smoke", "ash"])
def test_optical_depth_does_not_depend_on_the_levels(make_atmosphere, band, species):
    plumes = {"smoke": smoke(0.8, brightness=0.7), "ash": ash(0.5, brightness=0.4)}
    plume = plumes[species]
    expected = plume.aod_550 * plume.relative_extinction[band]
    for num_layers in (10, 27, 50):
        optics = aerosol(make_atmosphere(num_layers, plumes=plumes), species, BANDS[band])
        np.testing.assert_allclose(optics.tau.sum(), expected, rtol=ROUNDING)
        inside = optics.tau[0] > 0
        np.testing.assert_allclose(optics.ssa[0, inside], plume.ssa[band], rtol=ROUNDING)
        np.testing.assert_array_equal(optics.ssa[0, ~inside], 0)
        np.testing.assert_allclose(
            optics.moments(3)[inside, 1], plume.asymmetry[band], rtol=ROUNDING
        )


@pytest.mark.parametrize("edge", ["base", "top"])
def test_derivative_to_the_edges_against_differences(make_atmosphere, edge):
    atmosphere = make_atmosphere()

    def tau(value):
        plume = dataclasses.replace(atmosphere.plumes["smoke"], **{edge: value})
        moved = dataclasses.replace(atmosphere, plumes={"smoke": plume})
        return aerosol(moved, "smoke", BANDS["C01"]).tau[0]

    value, step = getattr(atmosphere.plumes["smoke"], edge), 1.0
    differences = (tau(value + step) - tau(value - step)) / (2 * step)
    assert np.count_nonzero(differences) == 1
    # Extinction is linear in the edge: what is left is rounding of depth / step.
    np.testing.assert_allclose(jax.jacfwd(tau)(value), differences, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(jax.jacrev(tau)(value), differences, rtol=1e-9, atol=1e-15)


def test_plume_counts_from_the_ground(make_atmosphere):
    atmosphere = make_atmosphere()
    raised = dataclasses.replace(atmosphere, height=atmosphere.height + 1500.0)
    np.testing.assert_allclose(
        aerosol(raised, "ash", BANDS["C01"]).tau,
        aerosol(atmosphere, "ash", BANDS["C01"]).tau,
        rtol=ROUNDING,
    )


def test_missing_band_and_plume_are_named(make_atmosphere):
    atmosphere = make_atmosphere()
    with pytest.raises(ValueError, match=r"plume 'ash'.*band 'C03'.*\['C01', 'C06'\]"):
        aerosol(atmosphere, "ash", BANDS["C03"])
    with pytest.raises(ValueError, match=r"no plume 'dust'.*\['ash', 'smoke'\]"):
        aerosol(atmosphere, "dust", BANDS["C01"])
