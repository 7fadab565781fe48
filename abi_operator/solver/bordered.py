r"""Matrices whose last nodes are the sun and the views.

The sun (cosine mu0) and any number of views (mu) join the quadrature nodes with weight zero: the
sun feeds nodes and views and is fed by nothing, a view is fed by nodes and sun and feeds nothing.
Acting on (nodes, sun, views), a matrix of that kind is

.. math::
   \begin{pmatrix} c & b_s & 0 \\ 0 & d_s & 0 \\ b_v^T & x & d_v \end{pmatrix},

with d_v diagonal, and products, inverses and sums keep the form. So one algebra carries the
multiple scattering (c), the particular solution for the sun (b_s), the integration of the source
function towards the views (b_v), the exact attenuation of all beams (d) and the answer itself (x),
and the classical resonances, mu0 at an eigenvalue or equal to mu, do not exist.

Nodes are scaled by sqrt(w mu), which makes every core symmetric, and the sun is counted by what it
sheds on a level plane. Sun and views are then the same kind of border, called *beams* (the sun is
beam 0, the views follow), and no product with a cosine is ever undone by a division.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._numerics import fenced, inverse, matmul

_inverse, _matmul = fenced(inverse), fenced(matmul)


class Vector(eqx.Module):
    """What a bordered matrix of symmetric kind acts on: one number a node and one a beam.

    Parameters
    ----------
    nodes
        At the nodes, times sqrt(w mu).
    beams
        At the beams.
    """

    nodes: Float[Array, "node *batch"]
    beams: Float[Array, "beam *batch"]

    def __add__(self, other: "Vector") -> "Vector":
        return Vector(self.nodes + other.nodes, self.beams + other.beams)

    def __sub__(self, other: "Vector") -> "Vector":
        return Vector(self.nodes - other.nodes, self.beams - other.beams)

    def __rmul__(self, factor: float | Float[Array, "*batch"]) -> "Vector":
        return Vector(factor * self.nodes, factor * self.beams)


class Bordered(eqx.Module):
    """A bordered matrix, batch last.

    Parameters
    ----------
    core
        Nodes to nodes.
    border
        Sun to nodes (first column) and nodes to views (the others, the views' rows).
    diagonal
        Sun to sun and each view to itself.
    corner
        Sun to views.
    """

    core: Float[Array, "node node *batch"]
    border: Float[Array, "node beam *batch"]
    diagonal: Float[Array, "beam *batch"]
    corner: Float[Array, "view *batch"]

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

    def __matmul__(self, vector: Vector) -> Vector:
        """Action on light that no beam feeds into the nodes: thermal, or lost by the ground.

        The sun's entry of the result is its border taken as a row, as if the sun were a view.
        """
        to_beams = jnp.sum(self.border * vector.nodes[:, None], axis=0)
        return Vector(
            _matmul(self.core, vector.nodes[:, None])[:, 0],
            to_beams + self.diagonal * vector.beams,
        )

    def inverse(self) -> "Bordered":
        """Inverse of a matrix with positive definite core and diagonal."""
        core = _inverse(self.core)
        solved = _matmul(core, self.border)
        between = jnp.sum(self.border[:, 1:] * solved[:, :1], axis=0)
        return Bordered(
            core,
            -solved / self.diagonal,
            1 / self.diagonal,
            (between - self.corner) / (self.diagonal[0] * self.diagonal[1:]),
        )


class Quotient(eqx.Module):
    """``middle^-1 right`` of a symmetric product, kept for acting on vectors.

    Parameters
    ----------
    inverse
        Inverse of the middle's core.
    core
        That inverse times the right core.
    border
        That inverse times (right border - middle border * ratio).
    ratio
        Right diagonal over the middle's.
    """

    inverse: Float[Array, "node node *batch"]
    core: Float[Array, "node node *batch"]
    border: Float[Array, "node beam *batch"]
    ratio: Float[Array, "beam *batch"]

    def transposed_action(self, vector: Vector) -> Vector:
        """``right middle^-1`` applied to a vector without a sun (see `Bordered.__matmul__`)."""
        nodes = jnp.sum(self.core * vector.nodes[:, None], axis=0)
        beams = jnp.sum(self.border * vector.nodes[:, None], axis=0)
        return Vector(nodes, beams + self.ratio * vector.beams)


def between(left: Bordered, middle: Bordered, right: Bordered) -> Bordered:
    """Product ``left middle^-1 right``, the one operation of the whole solver.

    `middle` has a positive definite core and diagonal. All three are functions of the same pair of
    matrices wherever this is called, so that they commute, the product is symmetric like its
    factors, and the views' rows are found like the sun's column.
    """
    return between_and_quotient(left, middle, right)[0]


def between_and_quotient(
    left: Bordered, middle: Bordered, right: Bordered
) -> tuple[Bordered, Quotient]:
    """`between`, and the quotient that it formed on the way (for `left` equal to `right`)."""
    n = right.core.shape[0]
    ratio = right.diagonal / middle.diagonal
    source = right.border - middle.border * ratio
    middle_inverse = _inverse(middle.core)
    solved = _matmul(middle_inverse, jnp.concatenate([right.core, source], axis=1))
    product = _matmul(left.core, solved)
    sun, views = ratio[:1], left.diagonal[1:] / middle.diagonal[1:]
    target = left.border[:, 1:] - middle.border[:, 1:] * views
    corner = (
        jnp.sum(target * solved[:, n : n + 1], axis=0)
        + left.corner * sun
        + right.corner * views
        - middle.corner * sun * views
    )
    border = product[:, n:] + left.border * ratio
    result = Bordered(product[:, :n], border, left.diagonal * ratio, corner)
    return result, Quotient(middle_inverse, solved[:, :n], solved[:, n:], ratio)
