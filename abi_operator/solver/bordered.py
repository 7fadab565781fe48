r"""Matrices whose last two nodes are the sun and the view.

The sun (cosine mu0) and the view (mu) join the quadrature nodes with weight zero: the sun feeds
nodes and view and is fed by nothing, the view is fed by nodes and sun and feeds nothing. Acting on
(nodes, sun, view), a matrix of that kind is

.. math::
   \begin{pmatrix} c & b_s & 0 \\ 0 & d_s & 0 \\ b_v^T & x & d_v \end{pmatrix},

and products, inverses and sums keep the form. So one algebra carries the multiple scattering (c),
the particular solution for the sun (b_s), the integration of the source function towards the view
(b_v), the exact attenuation of both beams (d) and the answer itself (x), and the classical
resonances, mu0 at an eigenvalue or equal to mu, do not exist.

Nodes are scaled by sqrt(w mu) and the view's row by mu, which makes every core symmetric.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._numerics import fenced, inverse, matmul

_inverse, _matmul = fenced(inverse), fenced(matmul)


class Bordered(eqx.Module):
    """A bordered matrix, batch last.

    Parameters
    ----------
    core
        Nodes to nodes.
    border
        Sun to nodes (first column) and nodes to view (second, the view's row).
    diagonal
        Sun to sun and view to view.
    corner
        Sun to view.
    """

    core: Float[Array, "node node *batch"]
    border: Float[Array, "node 2 *batch"]
    diagonal: Float[Array, "2 *batch"]
    corner: Float[Array, "*batch"]

    def __add__(self, other: "Bordered") -> "Bordered":
        return Bordered(
            self.core + other.core,
            self.border + other.border,
            self.diagonal + other.diagonal,
            self.corner + other.corner,
        )

    def __sub__(self, other: "Bordered") -> "Bordered":
        return self + (-1.0) * other

    def __rmul__(self, factor: float | Float[Array, "*batch"]) -> "Bordered":
        return Bordered(
            factor * self.core,
            factor * self.border,
            factor * self.diagonal,
            factor * self.corner,
        )

    def inverse(self) -> "Bordered":
        """Inverse of a matrix with positive definite core and diagonal."""
        core = _inverse(self.core)
        solved = _matmul(core, self.border)
        between = jnp.sum(self.border[:, 1] * solved[:, 0], axis=0)
        return Bordered(
            core,
            -solved / self.diagonal,
            1 / self.diagonal,
            (between - self.corner) / (self.diagonal[0] * self.diagonal[1]),
        )


def between(left: Bordered, middle: Bordered, right: Bordered) -> Bordered:
    """Product ``left middle^-1 right``, the one operation of the whole solver.

    `middle` has a positive definite core and diagonal. All three are functions of the same pair of
    matrices wherever this is called, so that the product is symmetric like its factors.
    """
    sun = right.diagonal[0] / middle.diagonal[0]
    view = left.diagonal[1] / middle.diagonal[1]
    source = right.border[:, 0] - middle.border[:, 0] * sun
    target = left.border[:, 1] - middle.border[:, 1] * view
    middle_inverse = _inverse(middle.core)
    solved = _matmul(
        middle_inverse,
        jnp.concatenate([right.core, source[:, None], target[:, None]], axis=1),
    )
    n = source.shape[0]
    solved_source, solved_target = solved[:, n], solved[:, n + 1]
    core = _matmul(left.core, solved[:, :n])
    to_nodes = _matmul(left.core, solved_source[:, None])[:, 0] + left.border[:, 0] * sun
    to_view = _matmul(right.core, solved_target[:, None])[:, 0] + right.border[:, 1] * view
    corner = (
        jnp.sum(target * solved_source, axis=0)
        + left.corner * sun
        + right.corner * view
        - middle.corner * sun * view
    )
    diagonal = jnp.stack([left.diagonal[0] * sun, view * right.diagonal[1]])
    return Bordered(core, jnp.stack([to_nodes, to_view], axis=1), diagonal, corner)
