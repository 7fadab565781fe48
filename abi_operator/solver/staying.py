"""What is kept of layers that stay, for `surroundings`: found for a tile, as one row of numbers.

Layers above and layers below are two columns of their own, over a black ground and over theirs, of
which each azimuth mode is summarised (`method.around`), light scattered once added up, and what an
error budget hangs on.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .all_modes import grounds_of
from .column import OWN_AXES, Column, Options
from .foreknown import depths_of
from .gradient.modes import Mode, every_mode
from .lit import weights_of_modes
from .method.around import Above, HalfLayer, above, put_on
from .method.azimuth import legendre_tables, weighted_moments
from .method.bordered import Bordered
from .method.doublings import Doublings
from .method.ground import black
from .method.layer import ModeKernels, half_layer
from .method.mode_layers import Layers, Order, read
from .method.rounding import DEEPEST_THAT_STAYS
from .method.single_scatter import direct_transmission
from .method.surface import AnySurface
from .problem import Problem, seen_at_once
from .skipping.depths import Depths
from .skipping.plan import LayersOfModes, peaked_columns


class Parts(NamedTuple):
    """What is kept of a tile.

    Parameters
    ----------
    above
        Layers above, in every mode.
    core, border, corner
        Admittance of what lies below, likewise; its diagonal is 1.
    once
        Light scattered once above; how much passes there, down and up; and what is scattered or
        reflected once below, seen from its top. [-]
    depths
        `skipping.depths.Depths` of all that stays, and `skipping.plan.Plan.peaked`.
    """

    above: Above
    core: Float[Array, "mode node node *batch"]
    border: Float[Array, "mode node beam *batch"]
    corner: Float[Array, "mode view *batch"]
    once: Float[Array, "3 *batch"]
    depths: Float[Array, "6 *batch"]

    def below(self) -> Bordered:
        """What lies below, in every mode."""
        own = jnp.ones_like(self.above.own)
        return jax.vmap(Bordered)(self.core, self.border, own, self.corner)


def _shapes(num_streams: int, num_modes: int) -> list[tuple[int, ...]]:
    """Of the leaves of `Parts` of one column."""
    m, n = num_modes, num_streams // 2
    on_top = (m, n, n), (m, n, 2), (m, 2), (m, 1)
    return [*on_top, (m, n, n), (m, n, 2), (m, 1), (3,), (6,)]


def numbers_a_column(num_streams: int, num_modes: int) -> int:
    """How many are kept of a column."""
    return sum(math.prod(shape) for shape in _shapes(num_streams, num_modes))


def _packed(parts: Parts) -> Float[Array, "number batch"]:
    leaves = jax.tree.leaves(parts)
    return jnp.concatenate([x.reshape(-1, x.shape[-1]) for x in leaves])


def unpacked(numbers: Float[Array, "number batch"], options: Options) -> Parts:
    """`Parts` of what is kept of a tile."""
    shapes = _shapes(options.num_streams, options.num_modes)
    ends = np.cumsum([math.prod(shape) for shape in shapes])[:-1]
    parts = jnp.split(numbers, ends)
    leaves = [x.reshape(*shape, -1) for x, shape in zip(parts, shapes, strict=True)]
    return Parts(Above(*leaves[:4]), *leaves[4:])


class Kept(NamedTuple):
    """Maps columns whose batch is last to what is kept of them; equal ones are one program."""

    num_above: int

    def __call__(self, tile: Column, options: Options) -> Float[Array, "number batch"]:
        """Numbers that are kept of each column, in one row each."""
        num_above, num_layers = self.num_above, tile.tau.shape[0]
        upper = lower = None
        if num_above > 0:
            over_black = tile._replace(albedo=jnp.zeros_like(tile.mu0))
            upper = Problem(_some_layers(over_black, slice(num_above)), options, DEEPEST_THAT_STAYS)
        if num_above < num_layers:
            lower = Problem(_some_layers(tile, slice(num_above, None)), options, DEEPEST_THAT_STAYS)
        return _packed(_parts(tile, upper, lower, options))


def _some_layers(column: Column, some: slice) -> Column:
    layers = {
        name: x[some]
        for name, x in column._asdict().items()
        if x is not None and "layer" in OWN_AXES.get(name, ())
    }
    return column._replace(**layers)


def _parts(tile: Column, upper: Problem | None, lower: Problem | None, options: Options) -> Parts:
    any_of_both = upper or lower
    assert any_of_both is not None
    directions = any_of_both.directions
    cosines, num_streams = directions.cosines, options.num_streams
    mean, others, _ = grounds_of(tile.albedo, directions, options)
    weights = weights_of_modes(options.num_modes, tile.relative_azimuth)
    beams = legendre_tables(num_streams, options.num_modes, cosines).beams

    half = _half_layer(not options.tms)
    numbers_above, numbers_below = (_numbers(x, cosines) for x in (upper, lower))

    def of_mode(mode: Mode) -> tuple[Above, Bordered]:
        # Of a part without layers those of the other are looked at, and none is solved.
        on_top, beneath = (_of_mode(x or any_of_both, mode) for x in (upper, lower))
        nothing = black(cosines, num_streams)
        found = above(nothing, half, on_top, numbers_above)
        return found, put_on(mode.below(mean), half, beneath, numbers_below[::-1])

    every = every_mode(mean, others, weights, beams, num_streams // 2)
    on_top, below = jax.lax.map(of_mode, every)
    depths, peaked = zip(*(_sums(x) for x in (upper, lower) if x is not None), strict=True)
    return Parts(
        on_top,
        below.core,
        below.border,
        below.corner,
        jnp.stack(_once(tile, upper, lower)),
        jnp.stack(
            [*(sum(x) for x in zip(*depths, strict=True)), jnp.max(jnp.stack(peaked), axis=0)]
        ),
    )


class _OfMode(NamedTuple):
    """What one mode sees of layers."""

    layers: Layers
    doublings: Doublings
    order: Order
    kernels: tuple[ModeKernels, ModeKernels]
    view_secants: Float[Array, "view *batch"]


def _of_mode(problem: Problem, mode: Mode) -> _OfMode:
    view_secants = 1 / problem.directions.cosines[1:]
    layers = _layers(problem).as_layers()
    return _OfMode(layers, problem.doublings, mode.order, mode.kernels(), view_secants)


def _half_layer(single_scattering: bool) -> HalfLayer:
    def of_one(of: _OfMode, number: Array) -> tuple[Bordered, Bordered, Array]:
        layer = of.layers.layer(number, of.order.odd)
        how = of.order.mean, of.kernels, of.view_secants, single_scattering
        own = jax.tree.map(lambda x: read(x, number), of.doublings)
        return *half_layer(*layer.matrices(*how), layer.tau, own), layer.tau

    return of_one


def _numbers(problem: Problem | None, like: Array) -> Float[Array, " layer"]:
    return jnp.arange(0 if problem is None else problem.layers.tau.shape[0], dtype=like.dtype)


def _layers(problem: Problem) -> LayersOfModes:
    even, odd = weighted_moments(problem.layers)
    tau, coalbedo = problem.layers.tau, problem.layers.coalbedo
    return LayersOfModes(tau, coalbedo, problem.directions.sun_secants, (even, odd))


def _sums(problem: Problem) -> tuple[Depths, Array]:
    """What layers add up to, and the peaks of their phase functions."""
    return depths_of(problem.layers, problem.directions), peaked_columns(_layers(problem))


def _once(tile: Column, upper: Problem | None, lower: Problem | None) -> list[Array]:
    """`Parts.once`, of the one view."""
    zero = jnp.zeros_like(tile.mu0)
    scattered, passed, below = zero, zero + 1, zero
    if upper is not None:
        scattered = seen_at_once(upper)[0]
        sun = upper.directions.sun_secants
        passed = direct_transmission(upper.layers.tau, tile.mu, sun)[0]
    if lower is not None:
        below = seen_at_once(lower)[0]
    elif isinstance(tile.albedo, AnySurface):
        below = tile.albedo.brdf(tile.mu, tile.mu0[None], tile.relative_azimuth)[0]
    return [scattered, passed, below]
