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

from collections.abc import Sequence
from typing import Any

import equinox as eqx
from jaxtyping import Array, Float

from ...machine.algebra import fenced, matmul, total, weighted
from ...machine.elimination import inverse
from ...machine.rows import are_few, in_rows


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
        to_beams = total(self.border * vector.nodes[:, None])
        return Vector(
            matmul(self.core, vector.nodes[:, None])[:, 0],
            to_beams + self.diagonal * vector.beams,
        )

    def inverse(self) -> "Bordered":
        """Inverse of a matrix with positive definite core and diagonal."""
        core = inverse(self.core)
        solved = matmul(core, self.border)
        between = total(self.border[:, 1:] * solved[:, :1])
        own = reciprocal(self.diagonal)
        border, corner = _edge_of_inverse(solved, between, own, self.corner)
        return Bordered(core, border, own, corner)


def _edge_of_inverse(solved, between, own, corner):
    return _minus_times((), own, solved), _corner_of_inverse(between, own, corner)


@in_rows
def _minus_times(_, own, solved):
    return -solved * own


@fenced
def _corner_of_inverse(between, own, corner):
    return (between - corner) * own[0] * own[1:]


def combined(weights: Sequence[float | Float[Array, "..."]], matrices: Sequence[Any]) -> Any:
    """Weighted sum of matrices, or of trees with parts of them."""
    return _combined(list(weights), *matrices)


@in_rows
def _combined(weights, *entries):
    return weighted(list(zip(weights, entries, strict=True)))


def reciprocal(diagonal: Float[Array, "beam *batch"]) -> Float[Array, "beam *batch"]:
    """``1 / diagonal``; of two beams by one division, which takes as long as 16 products."""
    if diagonal.shape[0] != 2 or are_few(diagonal):
        return _reciprocal((), diagonal)
    return _times_other(_one_over_both(diagonal), diagonal)


@in_rows
def _reciprocal(_, x):
    return 1 / x


@fenced
def _one_over_both(diagonal):
    return 1 / (diagonal[0] * diagonal[1])


@fenced
def _times_other(one_over_both, diagonal):
    return one_over_both * diagonal[::-1]
