"""Grounds of every kind, and directions in the corners."""

import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.surface import Lambertian, RossLi, ocean


@pytest.fixture(scope="session")
def make_ground():
    """One ground of a kind, its fields of a shape."""

    def make(kind, shape=(), dtype=float):
        rng = np.random.default_rng(11)

        def field(low, high):
            return jnp.asarray(rng.uniform(low, high, shape), dtype)

        if kind == "lambertian":
            return Lambertian(field(0.1, 0.5))
        if kind == "ross_li":
            return RossLi(field(0.1, 0.4), field(0.02, 0.2), field(0.01, 0.05))
        return ocean(field(1, 12), "C02")

    return make


@pytest.fixture(scope="session")
def corners():
    """Directions where formulas may break (mu_out, mu_in, relative_azimuth), one axis."""
    up, slant, low = 1.0, 0.6, 0.02
    limit = float(np.cos(np.deg2rad(80.0)))
    directions = [
        (up, up, 0.0),
        (up, slant, 1.0),
        (slant, up, np.pi),
        (slant, slant, 0.0),  # hot spot
        (slant, slant, np.pi),  # glint
        (slant, slant, 2 * np.pi),
        (low, low, 0.0),
        (low, low, np.pi),
        (limit, limit, 0.0),
        (limit, low, np.pi),
        (1 - 1e-12, slant, 0.5),
    ]
    return np.asarray(directions).T
