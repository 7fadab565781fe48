"""The instrument's steps on any radiance."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import REPEATABLE, all_finite, among, array, powers
from hypothesis import given

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


@pytest.mark.parametrize("band", ["C02", "C07"])
@given(RADIANCE)
@REPEATABLE
def test_counts_are_kept_by_packing_them_again(band, radiance):
    once = quantise(jnp.asarray(radiance), band)
    np.testing.assert_allclose(quantise(once, band), once, rtol=1e-12)
    order = np.argsort(radiance)
    assert (np.diff(np.asarray(once)[order]) >= 0).all()


@given(RADIANCE, WIDTH)
@REPEATABLE
def test_a_smooth_ceiling_rises_and_stays_below(radiance, width):
    ceiling = float(range_ceiling("C07"))
    each = jax.vmap(jax.value_and_grad(smooth_ceiling), (0, None, None))
    found, slope = each(jnp.asarray(radiance), ceiling, width)
    found, slope = np.asarray(found), np.asarray(slope)
    assert all_finite([found, slope])
    assert (found <= np.minimum(radiance, ceiling) * (1 + 1e-12)).all()
    assert ((slope >= 0) & (slope <= 1 + 1e-12)).all()


@pytest.mark.parametrize("band", ["C02", "C07"])
@given(RADIANCE)
@REPEATABLE
def test_what_is_reported_is_finite(band, radiance):
    def total(radiance):
        seen = observe_mean(radiance, band, Imager(ceiling_width=0.1))
        rows = [seen.radiance, noise_deviation(radiance, band)]
        rows += [x for x in (seen.reflectance_factor,) if x is not None]
        return jnp.sum(jnp.stack(rows)), rows

    slope, rows = jax.grad(total, has_aux=True)(jnp.asarray(radiance))
    assert all_finite([slope, *rows])
    assert (np.asarray(rows[1]) > 0).all()


@given(RADIANCE, array(powers(-12, 6), COUNT))
@REPEATABLE
def test_a_footprint_sees_no_more_than_its_cells(radiance, weights):
    mean, slope = jax.value_and_grad(footprint_mean)(jnp.asarray(radiance), jnp.asarray(weights))
    assert np.isfinite(slope).all()
    if weights.any():
        seen = radiance[weights > 0]
        assert seen.min() * (1 - 1e-12) <= mean <= seen.max() * (1 + 1e-12)
    else:
        assert np.isnan(mean)
