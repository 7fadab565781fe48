"""What layers absorb of isotropic light (`method.absorption`), on the way up for slopes.

It is kept in the azimuthal mean, in single precision. Besides the matrices it sets right the
quotients that the way down is made of (`method.refinement`).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
from jaxtyping import Array, Float

from ..method.absorption import absorbing, less, of_layer, of_stack, through
from ..method.bordered import Bordered, Vector
from ..method.layer import ModeKernels
from ..method.mode_layers import Layer, Order
from ..method.quotient import Quotient
from ..method.refinement import impeded, refined


class Absorption(NamedTuple):
    """Of isotropic light.

    Parameters
    ----------
    stack
        Y 1 of the stack below, at the nodes and at both beams.
    layer
        A 1 of the layer.
    mean
        Whether this is the azimuthal mean: 1 or 0.
    """

    stack: Vector
    layer: Vector
    mean: Float[Array, ""]

    def in_mean(self, function: Callable[..., Any], changed: tuple, *more: Any) -> tuple:
        """What `function` makes of `changed` and more in the mean, else `changed` as it is."""

        def as_it_is(changed, *_):
            return changed

        def of_mean(changed, *more):
            return function(*changed, *more)

        return jax.lax.cond(self.mean > 0, of_mean, as_it_is, changed, *more)


class HalfLayer(NamedTuple):
    """Y 1 and Z 1 of half a layer; without meaning in other modes than the mean."""

    absorbed: Vector
    impeded: Vector


def absorption(
    stack: Vector | None,
    layer: Layer,
    view_secant: Float[Array, "*batch"],
    order: Order,
    kernels: ModeKernels,
) -> Absorption | None:
    """What a layer with kernels of A absorbs, and the stack below it, where that is kept."""
    if stack is None:
        return None
    own = of_layer(layer.coalbedo, layer.secants(view_secant[None]), kernels)
    return Absorption(stack, own, order.mean)


def started(
    kept: Absorption | None,
    y: Bordered,
    h: Float[Array, "*batch"],
    b_inverse: Bordered,
    fraction: Bordered,
    z: Bordered,
    by_a: Quotient,
) -> tuple[Bordered, HalfLayer | None]:
    """The start of half a layer, of which C = `fraction` and U = `by_a` (`layer.climb`)."""
    if kept is None:
        return y, None
    return kept.in_mean(
        _started, (y, HalfLayer(*[kept.layer] * 2)), h, b_inverse, fraction, z, by_a
    )


def _started(y, half, h, b_inverse, fraction, z, by_a):
    square = h * h
    ones = h * (half.absorbed - square * through(fraction, z, by_a, half.absorbed))
    return absorbing(y, ones), HalfLayer(ones, impeded(b_inverse, fraction, square))


def doubled(
    kept: Absorption | None,
    y: Bordered,
    half: HalfLayer | None,
    quotient: Quotient,
    h: Float[Array, "*batch"],
) -> tuple[Bordered, HalfLayer | None, Quotient]:
    """A doubling of h, by whose quotient Y was found."""
    if kept is None:
        return y, None, quotient
    return kept.in_mean(_doubled, (y, half, quotient), h)


def _doubled(y, half, quotient, h):
    before = half.absorbed
    across = half.impeded + h * before
    quotient = refined(quotient, across, before)
    ones = 2.0 * less(before, h, quotient, before)
    return absorbing(y, ones), HalfLayer(ones, across), quotient


def stacked(
    kept: Absorption | None,
    stack: Bordered,
    half: HalfLayer | None,
    quotient: Quotient,
    h: Float[Array, "*batch"],
) -> tuple[Bordered, Vector | None, Quotient]:
    """A layer on the stack, by whose quotient that was found."""
    if kept is None:
        return stack, None, quotient
    assert half is not None
    changed = stack, half.absorbed, quotient
    return kept.in_mean(_stacked, changed, kept.stack, half.impeded, h)


def _stacked(stack, ones, quotient, below, across, h):
    middle = h * below + 0.5 * (across + h * ones)
    quotient = refined(quotient, middle, below + ones)
    ones = of_stack(below, ones, h, quotient)
    return absorbing(stack, ones), ones, quotient
