"""The solver's one operation: a weighted sum of bordered matrices minus a product with a quotient.

The quotient is found by elimination (`machine.elimination.solve`), together with what beams drive.
"""

from collections.abc import Sequence

import equinox as eqx
from jaxtyping import Array, Float

from ...machine.algebra import (
    Rows,
    fenced,
    kernel_of_product,
    minus_product,
    product,
    total,
    weighted,
)
from ...machine.elimination import Pair, inverse, of_pair, pair, solve
from .bordered import Bordered, Vector, reciprocal

_ONE_KERNEL = 2  # nodes up to which a product of three matrices is computed in one pass


class Quotient(eqx.Module):
    """``middle^-1 right`` of a symmetric product, kept for acting on vectors.

    Parameters
    ----------
    core
        Inverse of the middle's core times the right core.
    border
        That inverse times (right border - middle border * ratio).
    ratio
        Right diagonal over the middle's.
    over
        1 over the middle's diagonal.
    responses
        Inverse of the middle's core times each of the loads that were given.
    """

    core: Rows
    border: Rows
    ratio: Float[Array, "beam *batch"]
    over: Float[Array, "beam *batch"]
    responses: Sequence[Rows] = ()

    def transposed_action(self, vector: Vector) -> Vector:
        """``right middle^-1`` applied to a vector without a sun (see `Bordered.__matmul__`)."""
        nodes = total(self.core.joined() * vector.nodes[:, None])
        beams = total(self.border.joined() * vector.nodes[:, None])
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
    ratio, own = _ratios(left, reciprocal(middle.diagonal), right)
    factors = pair(middle.core) if len(middle.core) == 2 else inverse(middle.core)
    cores, borders, diagonals, corners = _parts(base)
    drive = (left.border, right.border, middle.border, factors)
    passed = (left.corner, right.corner, middle.corner, ratio, own)
    return Bordered(
        _core_at_once(cores, factor, left.core, factors, right.core),
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
    loads: Sequence[Float[Array, "node _ *batch"]] = (),
) -> tuple[Bordered, Quotient]:
    """`minus_quotient`, and the quotient ``middle^-1 right`` that it formed on the way.

    It also finds what the middle's core makes of more columns of nodes, the `loads`.
    """
    over = reciprocal(middle.diagonal)
    ratio, own = _ratios(left, over, right)
    source = _source(right.border, middle.border, ratio)
    solved, driven, *responses = solve(middle.core, [right.core, source, *loads])
    target = source if left is right else _source(left.border, middle.border, own)
    cores, borders, diagonals, corners = _parts(base)
    passed = (left.corner, right.corner, middle.corner, ratio, own)
    minus_border = kernel_of_product(_minus_border, left.core.shape[1])
    result = Bordered(
        minus_product(cores, factor, left.core, solved),
        minus_border(borders, factor, left.core, driven, left.border, ratio),
        _minus_diagonal(diagonals, factor, left.diagonal, ratio),
        _corner(corners, factor, target, driven.joined(), *passed),
    )
    return result, Quotient(solved, driven, ratio, over, responses)


def _parts(base):
    return tuple(
        [(weight, getattr(x, part)) for weight, x in base]
        for part in ("core", "border", "diagonal", "corner")
    )


def _ratios(left, over, right):
    """Diagonals of right and left over the middle's."""
    ratio = _multiplied(right.diagonal, over)
    return ratio, ratio if left is right else _multiplied(left.diagonal, over)


@fenced
def _multiplied(x, y):
    return x * y


def _source(border, middle, ratio):
    """In rows of all beams, see `machine.rows.in_rows`."""
    rows = (x.reshape(len(x), -1) for x in (border, middle))
    return _less_passed(*rows, ratio.reshape(-1)).reshape(border.shape)


@fenced
def _less_passed(border, middle, ratio):
    return border - middle * ratio


def _minus_border(base, factor, core, driven, border, ratio):
    return weighted(base) - factor * (product(core, driven) + border * ratio)


def _minus_diagonal(base, factor, left, ratio):
    return weighted(base) - factor * (left * ratio)


def _corner(base, factor, target, driven, left, right, middle, ratio, own):
    nodes = total(target[:, 1:] * driven[:, :1])
    sun, views = ratio[:1], own[1:]
    corner = nodes + left * sun + right * views - middle * sun * views
    return weighted(base) - factor * corner


def _solved(factors, right):
    return of_pair(factors, right) if isinstance(factors, Pair) else product(factors, right)


@fenced
def _core_at_once(base, factor, left, factors, right):
    return weighted(base) - factor * product(left, _solved(factors, right))


@fenced
def _border_at_once(base, factor, core, left, right, middle, factors, ratio):
    driven = _solved(factors, right - middle * ratio)
    return weighted(base) - factor * (product(core, driven) + left * ratio)


@fenced
def _corner_at_once(base, factor, left, right, middle, factors, *passed):
    ratio, own = passed[-2:]
    driven = _solved(factors, right[:, :1] - middle[:, :1] * ratio[:1])
    return _corner(base, factor, left - middle * own, driven, *passed)
