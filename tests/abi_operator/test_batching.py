"""Tiles of columns, and the CPU devices that share them."""

import os
import subprocess
import sys

import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator._batching import map_tiles


@pytest.mark.parametrize("size", [1, 7, 8, 9, 30, 64, 65])
@pytest.mark.parametrize("tile", [4, 16, 64])
def test_every_column_comes_back_in_its_place(size, tile):
    x = jnp.arange(2.0 * size).reshape(2, size)
    found = map_tiles(lambda a: {"sum": a[0] + a[1], "all": 2 * a}, x, tile)
    np.testing.assert_array_equal(found["sum"], x[0] + x[1])
    np.testing.assert_array_equal(found["all"], 2 * x)


@pytest.mark.parametrize("size, width", [(64, 64), (65, 40), (100, 56), (1000, 64)])
def test_tiles_are_as_narrow_as_their_number_lets_them_be(size, width):
    """And in whole vectors: 65 columns are two tiles of 40, not two of 64."""
    widths = []

    def watched(x):
        widths.append(x.shape[-1])
        return x

    map_tiles(watched, jnp.zeros(size), 64)
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
    return toa_brf(*arguments, num_streams=2, num_modes=1, num_doublings=3)

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

odd = [x[:299] for x in given]
cases = [(f, given) for f in (solve, slopes, in_a_loop, slopes_of_the_sum)]
for function, arguments in [*cases, (in_two_axes, given), (solve, odd)]:
    function = jax.jit(function)
    shared = function(*arguments)
    with jax.default_device(first):
        alone = function(*arguments)
    for a, b in zip(jax.tree.leaves(shared), jax.tree.leaves(alone), strict=True):
        assert b.devices() == {first}, b.devices()
        np.testing.assert_allclose(a, b, rtol=1e-11)  # tiles of other widths round differently
assert solve(*given).devices() == {first, second}

# Each device has its half from the beginning to the end.
program = jax.jit(solve).lower(*given).compile().as_text()
for exchange in ("all-gather", "all-to-all", "collective-permute", "all-reduce"):
    assert exchange not in program, exchange
assert len(solve(*(x[:40] for x in given)).devices()) == 1

# An axis that the caller maps over devices is the caller's.
mesh = jax.sharding.Mesh(np.asarray([first, second]), ("mine",))
mine = jax.sharding.PartitionSpec("mine")
shared = jax.shard_map(solve, mesh=mesh, in_specs=mine, out_specs=mine, check_vma=False)(*given)
np.testing.assert_allclose(shared, solve(*given), rtol=1e-13)
"""


def test_two_devices_share_the_tiles_under_every_transformation():
    """In a process of its own: how many devices there are is settled when JAX is first used."""
    settings = {"JAX_NUM_CPU_DEVICES": "2", "JAX_ENABLE_X64": "1", "JAX_PLATFORMS": "cpu"}
    paths = os.pathsep.join(p for p in sys.path if p)
    subprocess.run(
        [sys.executable, "-c", TWO_DEVICES],
        env=os.environ | settings | {"PYTHONPATH": paths},
        check=True,
    )
