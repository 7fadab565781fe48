"""What lets one text serve arrays of NumPy and of JAX."""

from typing import Any

import numpy as np


def namespace(*values: Any) -> Any:
    """The module to compute with: `jax.numpy` if any of the values is a JAX array, or `numpy`."""
    modules = [x.__array_namespace__() for x in values if hasattr(x, "__array_namespace__")]
    return next((module for module in modules if module is not np), np)


def floats(*values: Any) -> tuple[Any, list[Any]]:
    """The module to compute with, and all values as its arrays of their common floating type.

    Python's numbers take the type of the arrays beside them; whole numbers become floating.
    """
    xp = namespace(*values)
    dtypes = [x.dtype for x in values if hasattr(x, "dtype")]
    common = np.result_type(*dtypes, np.float16) if dtypes else np.dtype(np.float64)
    return xp, cast(common, *(xp.asarray(x) for x in values))


def cast(dtype: Any, *values: Any) -> list[Any]:
    """Arrays in this floating type, or float32 where JAX knows no float64; numbers as they are."""
    return [
        x.astype(namespace(x).asarray(np.empty(0, dtype)).dtype) if hasattr(x, "dtype") else x
        for x in values
    ]


def sine(xp: Any, cosine: Any) -> Any:
    """Sine of an angle from 0 to pi by its cosine; 0, with derivative 0, where that is 1."""
    square = (1 - cosine) * (1 + cosine)
    positive = square > 0
    return xp.where(positive, xp.sqrt(xp.where(positive, square, 1)), 0)


def safe_log(xp: Any, x: Any) -> Any:
    """Natural logarithm; 0, with derivative 0, where `x` is not positive."""
    positive = x > 0
    return xp.where(positive, xp.log(xp.where(positive, x, 1)), 0)
