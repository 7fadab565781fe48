"""Slopes of what several views of the same columns see, view by view.

Views share most of a value, but nothing of a gradient, whose light comes from the view.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .column import Column


def of_views(seen: Callable[[Column], Array], tile: Column) -> tuple[Array, Column]:
    """A result ``view batch`` and its slopes, like the tile with the views first.

    Parameters
    ----------
    seen
        Maps columns with one view, their batch last, to a result ``batch``.
    tile
        Columns with their views.
    """

    def of_one(view: Array) -> tuple[Array, Column]:
        def of_this(tile: Column) -> Array:
            phase = tile.phase_function
            return seen(
                tile._replace(
                    mu=tile.mu[view][None],
                    relative_azimuth=tile.relative_azimuth[view][None],
                    phase_function=None if phase is None else phase[:, view][:, None],
                )
            )

        result, pull_back = jax.vjp(of_this, tile)
        return result, pull_back(jnp.ones_like(result))[0]

    return jax.lax.map(of_one, jnp.arange(tile.mu.shape[0]))
