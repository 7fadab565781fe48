"""The ground beneath: its albedo, band by band."""

from typing import Any

import jax
import jax.numpy as jnp

from abi_operator.surface import brightened

from ..quantities import Quantity
from ..transforms import Bounded


def albedo(band: str, sigma: float = 0.01) -> Quantity:
    """White-sky albedo of the ground in a band, which the state knows to `sigma`. [-]

    A ground that reflects unevenly keeps how it does: what is added it reflects to all sides.
    """
    return Quantity(
        f"albedo_{band}",
        "1",
        f"albedo of the ground in {band}",
        f"albedo.{band}",
        Bounded(0.0, 1.0),
        _with_albedo,
        sigma=sigma,
        get=_albedo,
        sigma_in_units=True,
    )


def _albedo(ground: Any) -> Any:
    if hasattr(ground, "white_sky_albedo"):
        return jax.tree.map(jnp.asarray, ground).white_sky_albedo()
    return ground


def _with_albedo(ground: Any, value: jax.Array) -> Any:
    return brightened(jax.tree.map(jnp.asarray, ground), value - _albedo(ground))
