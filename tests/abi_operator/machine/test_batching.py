"""Tiles of columns, and the CPU devices that share them."""

import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.machine.batching import map_tiles


@pytest.mark.parametrize("size", [1, 7, 8, 9, 30, 64, 65])
@pytest.mark.parametrize("tile", [4, 16, 64])
def test_every_column_comes_back_in_its_place(size, tile):
    x = np.arange(2.0 * size).reshape(2, size)
    found = jax.jit(lambda x: map_tiles(lambda a: {"sum": a[0] + a[1], "all": 2 * a}, x, tile))(x)
    np.testing.assert_array_equal(found["sum"], x[0] + x[1])
    np.testing.assert_array_equal(found["all"], 2 * x)


@pytest.mark.parametrize("size, width", [(64, 64), (65, 40), (100, 56), (1000, 64)])
def test_tiles_are_as_narrow_as_their_number_lets_them_be(size, width):
    """And in whole vectors: 65 columns are two tiles of 40, not two of 64."""
    widths = []

    def watched(x):
        widths.append(x.shape[-1])
        return x

    jax.eval_shape(lambda x: map_tiles(watched, x, 64), jnp.zeros(size))
    assert set(widths) == {width}


TWO_DEVICES = """
import jax
import jax.numpy as jnp
import numpy as np
from columns import simple_columns
from abi_operator.solver import toa_brf

first, second = jax.devices()
given = [jnp.asarray(x) for x in simple_columns(count=300, num_layers=2, num_moments=3)]

def solve(*arguments):
    return toa_brf(*arguments, num_streams=2, num_modes=1, num_doublings=0)

def slopes(*arguments):
    return jax.vmap(jax.grad(solve, argnums=(0, 3)))(*arguments)

def in_a_loop(*arguments):
    def again(_, albedo):
        return solve(*arguments[:3], albedo, *arguments[4:])

    return jax.lax.fori_loop(0, 2, again, arguments[3])

def slopes_of_the_sum(*arguments):
    "The albedo is all columns' and its slope is from both devices."
    def total(tau, albedo):
        return solve(tau, *arguments[1:3], albedo, *arguments[4:]).sum()

    return jax.grad(total, argnums=(0, 1))(arguments[0], arguments[3][0])

def in_two_axes(*arguments):
    return solve(*(x.reshape(2, -1, *x.shape[1:]) for x in arguments))

def agree(shared, alone):
    for a, b in zip(jax.tree.leaves(shared), jax.tree.leaves(alone), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-11)  # tiles of other widths round differently

# Each device has its half from the beginning to the end.
program = jax.jit(solve).lower(*given).compile()
for exchange in ("all-gather", "all-to-all", "collective-permute", "all-reduce"):
    assert exchange not in program.as_text(), exchange
shared = program(*given)
assert shared.devices() == {first, second}

# What one device gives, of every column; the rest follows from that.
with jax.default_device(first):
    on_one, slopes_on_one = jax.jit(solve), jax.jit(slopes)
    alone, alone_slopes = on_one(*given), slopes_on_one(*given)
    alone_twice = on_one(*given[:3], alone, *given[4:])
    of_tau, of_albedo = slopes_on_one(*given[:3], 0 * given[3] + given[3][0], *given[4:])
for x in jax.tree.leaves((alone, alone_slopes, alone_twice, of_tau, of_albedo)):
    assert x.devices() == {first}, x.devices()
odd = [x[:299] for x in given]
agree(shared, alone)
agree(jax.jit(slopes)(*given), alone_slopes)
agree(jax.jit(in_a_loop)(*given), alone_twice)
agree(jax.jit(slopes_of_the_sum)(*given), (of_tau, of_albedo.sum()))
agree(jax.jit(in_two_axes)(*given), alone.reshape(2, -1))
agree(jax.jit(solve)(*odd), alone[:299])
few = jax.jit(solve)(*(x[:40] for x in given))
assert len(few.devices()) == 1
agree(few, alone[:40])

# Columns with values are cut into chunks, which need no devices.
agree(solve(*given), alone)

# An axis that the caller maps over devices is the caller's.
mesh = jax.sharding.Mesh(np.asarray([first, second]), ("mine",))
mine = jax.sharding.PartitionSpec("mine")
shared = jax.shard_map(solve, mesh=mesh, in_specs=mine, out_specs=mine, check_vma=False)(*given)
np.testing.assert_allclose(shared, program(*given), rtol=1e-13)
"""


@pytest.mark.slow
def test_two_devices_share_the_tiles_under_every_transformation():
    """In a process of its own: how many devices there are is settled when JAX is first used."""
    settings = {"JAX_NUM_CPU_DEVICES": "2", "JAX_ENABLE_X64": "1", "JAX_PLATFORMS": "cpu"}
    paths = os.pathsep.join(p for p in sys.path if p)
    subprocess.run(
        [sys.executable, "-c", TWO_DEVICES],
        env=os.environ | settings | {"PYTHONPATH": paths},
        check=True,
    )
