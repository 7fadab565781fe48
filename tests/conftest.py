"""Precision and strictness under which every test runs."""

import os

import jax
import pytest

if "JAX_ENABLE_X64" not in os.environ:
    jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")


def pytest_addoption(parser):
    parser.addoption(
        "--scale", type=float, default=1.0, help="share of a slow study's full counts to run"
    )


@pytest.fixture
def scale(request):
    """Share of a long study's full counts."""
    return request.config.getoption("--scale")
