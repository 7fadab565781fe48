"""What a pixel gathers: the mean of radiance over the area that it sees."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


def overlap_lengths(
    cell_edges: Float[Array, " cell_edge"], pixel_edges: Float[Array, " pixel_edge"]
) -> Float[Array, "pixel cell"]:
    r"""Length of each cell that lies in each pixel, along one axis.

    .. math:: w_{ij} = \max(0, \min(x_{j+1}, X_{i+1}) - \max(x_j, X_i))

    The area of a cell in a pixel is the product of the lengths along both axes.

    Parameters
    ----------
    cell_edges, pixel_edges
        Edges of cells, x, and of pixels, X, ascending, in one unit.
    """
    upper = jnp.minimum(cell_edges[None, 1:], pixel_edges[1:, None])
    lower = jnp.maximum(cell_edges[None, :-1], pixel_edges[:-1, None])
    return jnp.maximum(upper - lower, 0)


def footprint_mean(
    radiance: Float[Array, " cell"], weights: Float[Array, " cell"]
) -> Float[Array, ""]:
    r"""Area-weighted mean of radiance over one footprint. [W m-2 sr-1 um-1]

    .. math:: \bar L = \sum_i w_i L_i / \sum_i w_i

    It is radiance that is averaged, never temperature, and never radiance that was limited to what
    the instrument can hold: a fire far hotter than that fills a small part of a pixel.

    Parameters
    ----------
    radiance
        Radiance of the cells, not limited. [W m-2 sr-1 um-1]
    weights
        Area of each cell in the footprint, in any one unit. Where all are 0, the footprint sees
        nothing and its mean is NaN, with derivative 0; so it is where it sees a cell that is NaN.
    """
    lost, lit = _parted(radiance)
    holed = jnp.sum(weights * lost) > 0
    return _quotient(jnp.sum(weights * lit), jnp.where(holed, 0, jnp.sum(weights)))


def image_mean(
    radiance: Float[Array, "cell_y cell_x"],
    weights_y: Float[Array, "pixel_y cell_y"],
    weights_x: Float[Array, "pixel_x cell_x"],
) -> Float[Array, "pixel_y pixel_x"]:
    """`footprint_mean` of all pixels of an image whose axes are those of the cells.

    Parameters
    ----------
    radiance
        Radiance of the cells, not limited. [W m-2 sr-1 um-1]
    weights_y, weights_x
        Lengths of the cells in the pixels along each axis, from `overlap_lengths`.
    """
    total = jnp.sum(weights_y, axis=1)[:, None] * jnp.sum(weights_x, axis=1)[None, :]
    exact = jax.lax.Precision.HIGHEST
    lost, sums = (
        jnp.einsum("ij,jl,kl->ik", weights_y, cells, weights_x, precision=exact)
        for cells in _parted(radiance)
    )
    return _quotient(sums, jnp.where(lost > 0, 0, total))


def _parted(radiance: Float[Array, "*shape"]) -> tuple[Array, Array]:
    """1 where a cell is NaN and 0 elsewhere; and radiance, which is 0 there: a sum over all cells
    would hand NaN to pixels that do not see it."""
    lost = jnp.isnan(radiance)
    return lost.astype(radiance.dtype), jnp.where(lost, 0, radiance)


def _quotient(numerator: Float[Array, "*shape"], total: Float[Array, "*shape"]) -> Array:
    """Quotient, NaN with derivative 0 where the total is 0."""
    seen = total > 0
    return jnp.where(seen, numerator / jnp.where(seen, total, 1), jnp.nan)
