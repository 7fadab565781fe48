"""Optics of air, gases and aerosols, whatever a state may hold of them."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import REPEATABLE, all_finite, among, array, powers
from hypothesis import given, strategies

from abi_operator import Atmosphere, LiquidCloud, MiePlume, Plume
from abi_operator.atmosphere import BackgroundAerosol, Gases
from abi_operator.bands import BANDS
from abi_operator.optics import (
    aerosol,
    background,
    column_optics,
    gas_absorption,
    mie_species,
    rayleigh,
)

COUNT, LAYERS, NUM_MOMENTS = 6, 2, 7
AMOUNT = powers(-12, 4, 1e-30, 9e5, 1.0)
SHARE = among(0.0, 1.0)
# The last numbers below 1 and above -1, in both precisions.
NEARLY = float(np.nextafter(np.float32(1), np.float32(0)))
ASYMMETRY = among(-NEARLY, NEARLY, 0.0, 0.999, -0.999)


@strategies.composite
def columns(draw, band, species):
    """Columns of any air, gases and aerosols, levels in order."""

    def some(numbers, *shape):
        return draw(array(numbers, COUNT * int(np.prod(shape)))).reshape(COUNT, *shape)

    # Nobody has levels nearer to each other than these, but at one height.
    steps = some(among(0.0, 1e4, 1e-6), LAYERS)
    steps = np.where(steps < 1e-6, 0, steps)
    height = np.concatenate([np.cumsum(steps[:, ::-1], axis=1)[:, ::-1], np.zeros((COUNT, 1))], 1)
    pressure = np.sort(some(among(0.0, 1.1e5, 1e-30, 1e5), LAYERS + 1), axis=1)
    base = some(among(0.0, 2e4))
    depth = base * 1e-5 + some(powers(-6, 5, 1.0)) + 1e-6
    optics = [{band: some(x)} for x in (AMOUNT, SHARE, ASYMMETRY)]
    gases = Gases(some(AMOUNT, LAYERS), some(AMOUNT, LAYERS), some(SHARE), some(SHARE), some(SHARE))
    none = np.zeros((COUNT, LAYERS))
    return Atmosphere(
        pressure,
        height,
        LiquidCloud(none, none),
        {
            "given": Plume(base, base + depth, some(AMOUNT), some(SHARE), *optics),
            "spheres": MiePlume(
                base,
                base + depth,
                some(AMOUNT),
                some(SHARE),
                some(powers(-30, 5)) + 1e-30,
                species,
            ),
        },
        some(among(1.0, 1e4, 150.0, 250.0, 325.0), LAYERS + 1),
        gases,
        background=BackgroundAerosol(some(AMOUNT), some(powers(-3, 6, 2e3)) + 1e-3, *optics),
    )


def optics_of(band, atmosphere):
    """Depths [term layer], scattering [layer] and moments [layer moment] of each, and of all."""
    band = BANDS[band]
    found = [rayleigh(atmosphere, band), gas_absorption(atmosphere, band)]
    found += [aerosol(atmosphere, name, band) for name in atmosphere.plumes]
    found += [background(atmosphere, band), column_optics(atmosphere, band)]
    return [(x.extinction, x.scattering, x.ssa, x.moments(NUM_MOMENTS)) for x in found]


@partial(jax.jit, static_argnums=0)
def judge(band, atmospheres):
    """The same of all columns, and slopes of the sum of everything."""
    found, pull = jax.vjp(jax.vmap(partial(optics_of, band)), atmospheres)
    return found, pull(jax.tree.map(jnp.ones_like, found))


def assert_right(band, atmospheres, dtype):
    atmospheres = jax.tree.map(lambda x: x.astype(dtype), atmospheres)
    found, slopes = judge(band, atmospheres)
    assert all_finite([*jax.tree.leaves(found), *jax.tree.leaves(slopes)])
    rounding = 16 * np.finfo(dtype).eps
    for tau, scattering, ssa, moments in jax.tree.map(np.asarray, found):
        assert (tau >= 0).all() and (scattering >= 0).all()
        assert (scattering[:, None] <= tau * (1 + rounding)).all()
        assert ((ssa >= 0) & (ssa <= 1 + rounding)).all()
        assert (np.abs(moments) <= 1 + rounding).all()
        assert (moments[..., 0] == 1).all()


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize(
    ("band", "species"), [("C06", "ash"), ("C02", "smoke"), ("C04", "ash"), ("C07", "dust")]
)
def test_optics_are_finite_and_in_their_ranges(band, species, dtype):
    assert species in mie_species()

    @given(columns(band, species))
    @REPEATABLE
    def of(atmospheres):
        with np.errstate(under="ignore"):
            assert_right(band, atmospheres, dtype)

    of()
