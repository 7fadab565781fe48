"""Fields over the pixels of an image, neighbours alike: the precision Q of their prior."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse
import scipy.sparse.csgraph
import scipy.sparse.linalg
from jaxtyping import Array, Bool, Float, Int

_MOST_EXACT = 1024
"""Pixels of a patch whose variances come from a dense inverse, which takes 0.1 s for so many."""

_NUM_FIELDS = 256
"""Draws of larger ones, whose standard deviations are known to one part in 23;
of 90,000 pixels they take 3 s."""


class Smoothness(eqx.Module):
    """The precision Q = D B B D of one field over the pixels that are retrieved.

    B is 1 - length^2 times the Laplacian, and D makes the variance 1 of every pixel.

    Parameters
    ----------
    one, other
        Ends of each pair of neighbours, as rows of the pixels.
    length
        Correlation length. [pixel]
    sigma
        D: standard deviations that the field would have without it. [-]
    """

    one: Int[Array, " pair"]
    other: Int[Array, " pair"]
    length: Float[Array, ""]
    sigma: Float[Array, " pixel"]

    def root(self, z: Float[Array, "pixel *x"]) -> Float[Array, "pixel *x"]:
        """B D times fields, whose squares add up to those of Q. [-]"""
        return self._rough(self._scaled(z))

    def transposed_root(self, z: Float[Array, "pixel *x"]) -> Float[Array, "pixel *x"]:
        """D B times fields: of white noise, a field whose covariance is Q. [-]"""
        return self._scaled(self._rough(z))

    def __call__(self, z: Float[Array, "pixel *x"]) -> Float[Array, "pixel *x"]:
        """Q times fields. [-]"""
        return self.transposed_root(self.root(z))

    def diagonal(self) -> Float[Array, " pixel"]:
        """Of Q: of B the squares of a row, one of its own and one of each neighbour. [-]"""
        neighbours = jnp.zeros_like(self.sigma).at[self.one].add(1).at[self.other].add(1)
        far = self.length**2
        return self.sigma**2 * ((1 + far * neighbours) ** 2 + far**2 * neighbours)

    def _rough(self, z: Array) -> Array:
        slope = z[self.other] - z[self.one]
        laplacian = jnp.zeros_like(z).at[self.one].add(slope).at[self.other].add(-slope)
        return z - self.length**2 * laplacian

    def _scaled(self, z: Array) -> Array:
        return z * self.sigma.reshape(-1, *[1] * (z.ndim - 1))


def smoothness(chosen: Bool[np.ndarray, "*image y x"], length: float) -> Smoothness:
    """The precision over the pixels of images.

    Parameters
    ----------
    chosen
        Pixels that are retrieved, whose rows are in this order; those of several images are none
        of each other's neighbours.
    length
        Correlation length, above 0 and at most what its fourth power leaves digits for: 8192 in
        double precision, 53 in single. [pixel]

    Raises
    ------
    ValueError
        If the length is not above 0, or longer than that.
    """
    dtype = jax.dtypes.canonicalize_dtype(np.float64)
    if not (length > 0 and np.isfinite(length)):
        raise ValueError(f"the length of smoothness must be above 0 pixels; got {length}.")
    # Q has 64 times its fourth power beside what an image measures, of which rounding is to leave
    # enough: at ten times this limit standard deviations come out as half of what they are.
    longest = int(float(jnp.finfo(dtype).eps) ** -0.25)
    if length > longest:
        raise ValueError(
            f"the length of smoothness must be at most {longest} pixels, as rounding leaves "
            f"nothing of what is measured beside longer ones; got {length}."
        )
    rows = np.full(chosen.shape, -1)
    rows[chosen] = np.arange(np.count_nonzero(chosen))
    pairs = [
        (rows[..., :, :-1], rows[..., :, 1:]),
        (rows[..., :-1, :], rows[..., 1:, :]),
    ]
    one, other = (np.concatenate([pair[i].ravel() for pair in pairs]) for i in (0, 1))
    both = (one >= 0) & (other >= 0)
    one, other = one[both], other[both]
    sigma = _standard_deviations(one, other, int(np.count_nonzero(chosen)), length)
    return Smoothness(
        jnp.asarray(one),
        jnp.asarray(other),
        jnp.asarray(length, dtype),
        jnp.asarray(sigma, dtype),
    )


def _standard_deviations(one: np.ndarray, other: np.ndarray, num: int, length: float) -> np.ndarray:
    """Roots of the diagonal of (1 - length^2 Laplacian)^-2, patch by patch of neighbours. [-]"""
    ends = np.concatenate([one, other]), np.concatenate([other, one])
    joined = scipy.sparse.csr_array((np.ones(2 * len(one)), ends), (num, num))
    neighbours = joined.sum(axis=1)
    matrix = (scipy.sparse.diags_array(1 + length**2 * neighbours) - length**2 * joined).tocsr()
    _, patch = scipy.sparse.csgraph.connected_components(joined, directed=False)
    order = np.argsort(patch, kind="stable")
    found = np.ones(num)  # of a pixel without neighbours
    for rows in np.split(order, np.flatnonzero(np.diff(patch[order])) + 1):
        if 1 < len(rows) <= _MOST_EXACT:
            inverse = np.linalg.inv(matrix[rows][:, rows].toarray())
            found[rows] = np.sqrt(np.sum(inverse**2, axis=1))
        elif len(rows) > 1:
            found[rows] = _drawn(matrix[rows][:, rows], len(rows))
    return found


def _drawn(matrix: scipy.sparse.csr_array, num: int) -> np.ndarray:
    """The same of a large patch, from draws of its field."""
    options = {"SymmetricMode": True}
    solve = scipy.sparse.linalg.splu(matrix.tocsc(), "MMD_AT_PLUS_A", options=options).solve
    rng = np.random.default_rng(0)
    square = np.zeros(num)
    for _ in range(_NUM_FIELDS // 32):
        square += np.sum(solve(rng.standard_normal((num, 32))) ** 2, axis=1)
    return np.sqrt(square / _NUM_FIELDS)
