"""Fields over the pixels of an image, neighbours alike: the precision Q of their prior."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int


class Smoothness(eqx.Module):
    """The precision Q of one field over the pixels that are retrieved.

    Parameters
    ----------
    one, other
        Ends of each pair of neighbours, as rows of the pixels.
    length
        Correlation length. [pixel]
    scale
        c. [-]
    """

    one: Int[Array, " pair"]
    other: Int[Array, " pair"]
    length: Float[Array, ""]
    scale: Float[Array, ""]

    def root(self, z: Float[Array, "pixel *x"]) -> Float[Array, "pixel *x"]:
        """The symmetric root of Q times fields. [-]"""
        slope = z[self.other] - z[self.one]
        laplacian = jnp.zeros_like(z).at[self.one].add(slope).at[self.other].add(-slope)
        return jnp.sqrt(self.scale) * (z - self.length**2 * laplacian)

    def __call__(self, z: Float[Array, "pixel *x"]) -> Float[Array, "pixel *x"]:
        """Q times fields. [-]"""
        return self.root(self.root(z))

    def diagonal(self, num_pixels: int) -> Float[Array, " pixel"]:
        """Of Q: of the root r the squares of a row, r_pp and one of each neighbour. [-]"""
        nothing = jnp.zeros(num_pixels, self.scale.dtype)
        neighbours = nothing.at[self.one].add(1).at[self.other].add(1)
        far = self.length**2
        return self.scale * ((1 + far * neighbours) ** 2 + far**2 * neighbours)


def smoothness(chosen: Bool[np.ndarray, "*image y x"], length: float) -> Smoothness:
    """The precision over the pixels of images.

    Parameters
    ----------
    chosen
        Pixels that are retrieved, whose rows are in this order; those of several images are none
        of each other's neighbours.
    length
        Correlation length, above 0. [pixel]

    Raises
    ------
    ValueError
        If the length is not above 0 and finite.
    """
    if not (length > 0 and np.isfinite(length)):
        raise ValueError(f"the length of smoothness must be above 0 pixels; got {length}.")
    rows = np.full(chosen.shape, -1)
    rows[chosen] = np.arange(np.count_nonzero(chosen))
    pairs = [
        (rows[..., :, :-1], rows[..., :, 1:]),
        (rows[..., :-1, :], rows[..., 1:, :]),
    ]
    one, other = (np.concatenate([pair[i].ravel() for pair in pairs]) for i in (0, 1))
    both = (one >= 0) & (other >= 0)
    dtype = jax.dtypes.canonicalize_dtype(np.float64)
    return Smoothness(
        jnp.asarray(one[both]),
        jnp.asarray(other[both]),
        jnp.asarray(length, dtype),
        jnp.asarray(_scale(length), dtype),
    )


def _scale(length: float) -> float:
    """c: the mean over all waves of a grid of the variance that each has with c = 1. [-]"""
    size = int(np.clip(2 ** np.ceil(np.log2(32 * length)), 64, 2048))
    wave = 2 - 2 * np.cos(2 * np.pi * np.arange(size) / size)
    return float(np.mean((1 + length**2 * (wave[:, None] + wave)) ** -2.0))
