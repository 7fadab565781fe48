"""A GPU gives what a CPU gives: value and gradient of a few columns, in both precisions.

    python -m pytest -m gpu tests/abi_operator/solver/test_gpu.py

The CPU's answer comes from a process of its own, in which JAX has no other device.
"""

import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from columns import standard_columns

from abi_operator.solver import toa_brf

# Of the largest value, and of an input's largest derivative. In double precision sums are taken in
# another order; in single precision see `test_float32`.
TOLERANCE = {"float32": 1e-3, "float64": 1e-11}
NAMES = "value", "tau", "ssa", "moments", "albedo", "mu0", "mu", "relative_azimuth"


def value_and_gradient(dtype, num_streams):
    """Of columns that single precision holds exactly."""
    given = [np.asarray(x, np.float32).astype(dtype) for x in standard_columns(20)]

    def total(*arguments):
        values = toa_brf(*arguments, num_streams=num_streams, num_doublings=6)
        return jnp.sum(values), values

    slopes, value = jax.grad(total, tuple(range(len(given))), has_aux=True)(*given)
    return dict(zip(NAMES, map(np.asarray, (value, *slopes)), strict=True))


def by_cpu(path, num_streams):
    """The same in double precision, by another process."""
    settings = {"JAX_PLATFORMS": "cpu", "JAX_ENABLE_X64": "1"}
    settings["PYTHONPATH"] = os.pathsep.join(p for p in sys.path if p)
    subprocess.run(
        [sys.executable, __file__, str(path), str(num_streams)],
        env=os.environ | settings,
        check=True,
    )
    return np.load(path)


def assert_close(found, expected, dtype):
    for name in NAMES:
        assert found[name].dtype == dtype
        largest = np.max(np.abs(expected[name]))
        error = np.max(np.abs(found[name] - expected[name])) / largest
        assert error < TOLERANCE[dtype], f"{name}: {error:.1e} of its largest value"


@pytest.mark.gpu
@pytest.mark.parametrize("num_streams", [4, 8, 16])
def test_a_gpu_gives_what_a_cpu_gives(num_streams, tmp_path):
    if jax.default_backend() != "gpu":
        pytest.skip("there is no GPU")
    expected = by_cpu(tmp_path / "cpu.npz", num_streams)
    for dtype in TOLERANCE:
        assert_close(value_and_gradient(dtype, num_streams), expected, dtype)


@pytest.mark.slow
def test_the_comparison_itself(tmp_path):
    """Of this CPU with another process of it, so that it works where a GPU is."""
    expected = by_cpu(tmp_path / "cpu.npz", 4)
    for dtype in TOLERANCE:
        assert_close(value_and_gradient(dtype, 4), expected, dtype)


if __name__ == "__main__":
    np.savez(sys.argv[1], **value_and_gradient("float64", int(sys.argv[2])))
