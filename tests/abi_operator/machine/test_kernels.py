"""Layers, or parts of larger ones, as one kernel compile wherever XLA has threads to share work.

The other tests run with one thread. A kernel that XLA cannot compile may end the process, hence
processes of their own.
"""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import sys
import jax
import numpy as np
from abi_operator.solver import toa_brf, toa_radiance

jax.config.update("jax_enable_x64", True)
num_streams, num_layers, count = map(int, sys.argv[1:])
rng = np.random.default_rng(7)
shape = count, num_layers
moments = rng.uniform(0.2, 0.8, (*shape, 1)) ** np.arange(num_streams + 1)
layers = 10 ** rng.uniform(-2, 1, shape), rng.uniform(0.8, 1, shape), moments
others = rng.uniform(0.2, 0.9, (4, count))
for dtype in (np.float64, np.float32):
    arguments = [np.asarray(x, dtype) for x in (*layers, *others)]
    total = lambda x: toa_brf(*x, num_streams=num_streams, num_doublings=2).sum()
    value, (slope, *_) = jax.value_and_grad(total)(arguments)
    assert np.isfinite(total(arguments)) and np.isfinite(slope).all()
    options = {"num_streams": num_streams, "num_doublings": 2, "single_scattering": None}
    views = [x[:, None] * np.ones(7, dtype) for x in arguments[5:]]
    assert np.isfinite(toa_brf(*arguments[:5], *views, multiple_views=True, **options)).all()
    sources = {
        "solar_irradiance": np.ones(count, dtype),
        "planck_levels": np.ones((count, num_layers + 1), dtype),
        "surface_emission": np.ones(count, dtype),
    }
    assert np.isfinite(toa_radiance(*arguments, **sources, **options)).all()
    cases = [(toa_radiance, sources, None)]
    if dtype == np.float64:
        cases += [(toa_brf, {}, 1e-3), (toa_radiance, sources, 1e-3)]
    for door, more, error_budget in cases:
        how = {"num_streams": num_streams, "num_doublings": 4, "error_budget": error_budget}
        total = lambda x: door(*x, **more, **how).sum()
        assert all(np.isfinite(x).all() for x in jax.grad(total)(arguments))
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "num_streams, num_layers", [(4, 1), *((n, 3) for n in (4, 8, 10, 12, 16, 20, 24))]
)
def test_value_and_gradient_compile_with_every_thread(num_streams, num_layers):
    """In both precisions, more columns than a tile has; also several views, heat, and budgets."""
    environment = {k: v for k, v in os.environ.items() if k not in ("XLA_FLAGS", "JAX_ENABLE_X64")}
    sizes = map(str, (num_streams, num_layers, 260))
    subprocess.run([sys.executable, "-c", PROGRAM, *sizes], env=environment, check=True)


MANY_VIEWS = """
import sys
import jax
import numpy as np
from abi_operator.solver import toa_brf

jax.config.update("jax_enable_x64", True)
num_streams, num_views = map(int, sys.argv[1:])
rng = np.random.default_rng(7)
shape = 130, 6
moments = rng.uniform(0.2, 0.8, (*shape, 1)) ** np.arange(num_streams + 1)
column = 10 ** rng.uniform(-2, 1, shape), rng.uniform(0.8, 1, shape), moments
column += tuple(rng.uniform(0.2, 0.9, (2, 130)))
views = rng.uniform(0.2, 0.9, (130, num_views)), rng.uniform(0, 3, (130, num_views))
how = {"num_streams": num_streams, "single_scattering": None}
one = toa_brf(*column, *(x[:, -1] for x in views), **how)
for error_budget, tolerance in ((None, 1e-12), (1e-3, 1e-2)):
    seen = toa_brf(*column, *views, multiple_views=True, error_budget=error_budget, **how)
    np.testing.assert_allclose(seen[:, -1], one, rtol=tolerance)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "num_streams, num_views",
    [(8, 64), (16, 24), (8, 31), (16, 15), (4, 38), (24, 12)],
)
def test_any_number_of_views_compiles(num_streams, num_views):
    """Their last is as if seen alone; whole to rounding, within a budget to ten times that."""
    environment = {k: v for k, v in os.environ.items() if k not in ("XLA_FLAGS", "JAX_ENABLE_X64")}
    sizes = map(str, (num_streams, num_views))
    subprocess.run([sys.executable, "-c", MANY_VIEWS, *sizes], env=environment, check=True)
