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

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._numerics import (
    fenced,
    inverse,
    kernel_of_product,
    matmul,
    minus_product,
    product,
    weighted,
)

_ONE_KERNEL = 2  # nodes up to which a product of three matrices is computed in one pass


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
            matmul(self.core, vector.nodes[:, None])[:, 0],
            to_beams + self.diagonal * vector.beams,
        )

    def inverse(self) -> "Bordered":
        """Inverse of a matrix with positive definite core and diagonal."""
        core = inverse(self.core)
        solved = matmul(core, self.border)
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


Terms = Sequence[tuple[float | Float[Array, "*batch"], Bordered]]


def minus_quotient(
    base: Terms,
    factor: Float[Array, "*batch"],
    left: Bordered,
    middle: Bordered,
    right: Bordered,
) -> Bordered:
    """Weighted sum of `base` minus ``factor left middle^-1 right``, the solver's one operation.

    `middle` has a positive definite core and diagonal. All three are functions of the same pair of
    matrices wherever this is called, so that they commute, the product is symmetric like its
    factors, and the views' rows are found like the sun's column. Taking the sum along saves a pass
    over all matrices.
    """
    if left.core.shape[0] > _ONE_KERNEL:
        return minus_and_quotient(base, factor, left, middle, right)[0]
    ratio = _ratio(right.diagonal, middle.diagonal)
    own = ratio if left is right else _ratio(left.diagonal, middle.diagonal)
    middle_inverse = inverse(middle.core)
    cores, borders, diagonals, corners = _parts(base)
    drive = (left.border, right.border, middle.border, middle_inverse)
    passed = (left.corner, right.corner, middle.corner, ratio, own)
    return Bordered(
        _core_at_once(cores, factor, left.core, middle_inverse, right.core),
        _border_at_once(borders, factor, left.core, *drive, ratio),
        _minus_diagonal(diagonals, factor, left.diagonal, ratio),
        _corner_at_once(corners, factor, *drive, *passed),
    )


def minus_and_quotient(
    base: Terms,
    factor: Float[Array, "*batch"],
    left: Bordered,
    middle: Bordered,
    right: Bordered,
) -> tuple[Bordered, Quotient]:
    """`minus_quotient`, and the quotient ``middle^-1 right`` that it formed on the way."""
    ratio = _ratio(right.diagonal, middle.diagonal)
    source = _source(right.border, middle.border, ratio)
    middle_inverse = inverse(middle.core)
    solved = matmul(middle_inverse, right.core)
    driven = matmul(middle_inverse, source)
    own, target = ratio, source
    if left is not right:
        own = _ratio(left.diagonal, middle.diagonal)
        target = _source(left.border, middle.border, own)
    cores, borders, diagonals, corners = _parts(base)
    passed = (left.corner, right.corner, middle.corner, ratio, own)
    minus_border = kernel_of_product(_minus_border, left.core.shape[1])
    result = Bordered(
        minus_product(cores, factor, left.core, solved),
        minus_border(borders, factor, left.core, driven, left.border, ratio),
        _minus_diagonal(diagonals, factor, left.diagonal, ratio),
        _corner(corners, factor, target, driven, *passed),
    )
    return result, Quotient(middle_inverse, solved, driven, ratio)


def _parts(base):
    return tuple(
        [(weight, getattr(x, part)) for weight, x in base]
        for part in ("core", "border", "diagonal", "corner")
    )


def _ratio(right, middle):
    return right / middle


def _source(border, middle, ratio):
    return border - middle * ratio


def _minus_border(base, factor, core, driven, border, ratio):
    return weighted(base) - factor * (product(core, driven) + border * ratio)


def _minus_diagonal(base, factor, left, ratio):
    return weighted(base) - factor * (left * ratio)


def _corner(base, factor, target, driven, left, right, middle, ratio, own):
    nodes = jnp.sum(target[:, 1:] * driven[:, :1], axis=0)
    sun, views = ratio[:1], own[1:]
    corner = nodes + left * sun + right * views - middle * sun * views
    return weighted(base) - factor * corner


@fenced
def _core_at_once(base, factor, left, middle_inverse, right):
    return weighted(base) - factor * product(left, product(middle_inverse, right))


@fenced
def _border_at_once(base, factor, core, left, right, middle, middle_inverse, ratio):
    driven = product(middle_inverse, right - middle * ratio)
    return weighted(base) - factor * (product(core, driven) + left * ratio)


@fenced
def _corner_at_once(base, factor, left, right, middle, middle_inverse, *passed):
    ratio, own = passed[-2:]
    driven = product(middle_inverse, right[:, :1] - middle[:, :1] * ratio[:1])
    return _corner(base, factor, left - middle * own, driven, *passed)
