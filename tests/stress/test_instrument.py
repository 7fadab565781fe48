"""The instrument's steps on any radiance."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import REPEATABLE, all_finite, among, array, powers
from hypothesis import given

from abi_operator.bands import BANDS
from abi_operator.instrument import (
    Imager,
    footprint_mean,
    noise_deviation,
    observe_mean,
    quantise,
    range_ceiling,
    smooth_ceiling,
)

COUNT = 16
RADIANCE = array(powers(-12, 5, 1e-300, 16.9, 411.0), COUNT)
WIDTH = among(0.01, 1.0, 0.1)
# Green is a band that the instrument lacks.
MEASURED = [band for band in BANDS if band != "green"]
SATELLITES = "GOES-16", "GOES-17", "GOES-18", "GOES-19"


# One program each, and not one for every operation.
counted = jax.jit(quantise, static_argnums=1)
each_ceiling = jax.jit(jax.vmap(jax.value_and_grad(smooth_ceiling), (0, None, None)))
footprint = jax.jit(jax.value_and_grad(footprint_mean))


@partial(jax.jit, static_argnums=1)
@partial(jax.grad, has_aux=True)
def reported(radiance, band):
    """Slope of the sum of all that is reported, and each of it."""
    seen = observe_mean(radiance, band, Imager(ceiling_width=0.1))
    rows = [seen.radiance, noise_deviation(radiance, band)]
    rows += [x for x in (seen.reflectance_factor,) if x is not None]
    return jnp.sum(jnp.stack(rows)), rows


@pytest.mark.parametrize("band", MEASURED)
@given(RADIANCE)
@REPEATABLE
def test_counts_are_kept_by_packing_them_again(band, radiance):
    once = np.asarray(counted(radiance, band))
    np.testing.assert_allclose(counted(once, band), once, rtol=1e-12)
    order = np.argsort(radiance)
    assert (np.diff(once[order]) >= 0).all()


@given(RADIANCE, WIDTH)
@REPEATABLE
def test_a_smooth_ceiling_rises_and_stays_below(radiance, width):
    ceiling = float(range_ceiling("C07"))
    found, slope = each_ceiling(radiance, ceiling, width)
    found, slope = np.asarray(found), np.asarray(slope)
    assert all_finite([found, slope])
    assert (found <= np.minimum(radiance, ceiling) * (1 + 1e-12)).all()
    assert ((slope >= 0) & (slope <= 1 + 1e-12)).all()


@pytest.mark.parametrize("band", MEASURED)
@given(RADIANCE)
@REPEATABLE
def test_what_is_reported_is_finite(band, radiance):
    slope, rows = reported(radiance, band)
    assert all_finite([slope, *rows])
    assert (np.asarray(rows[1]) > 0).all()


@given(RADIANCE, array(powers(-12, 6), COUNT))
@REPEATABLE
def test_a_footprint_sees_no_more_than_its_cells(radiance, weights):
    mean, slope = footprint(radiance, weights)
    assert np.isfinite(slope).all()
    if weights.any():
        seen = radiance[weights > 0]
        assert seen.min() * (1 - 1e-12) <= mean <= seen.max() * (1 + 1e-12)
    else:
        assert np.isnan(mean)


def test_every_band_of_every_satellite_saturates_at_its_ceiling():
    """Counts go no higher than what is saturated, which is told."""
    for satellite in SATELLITES:
        imager = Imager(satellite, quantised=True)
        for band in MEASURED:
            top = float(range_ceiling(band, satellite))
            seen = observe_mean(jnp.array([0.0, 0.5, 1.0, 2.0, 1e6]) * top, band, imager)
            assert np.asarray(seen.saturated).tolist() == [False, False, True, True, True]
            assert (np.asarray(seen.radiance) <= top * (1 + 1e-6)).all()
            assert all_finite([seen.radiance])
