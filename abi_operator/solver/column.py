"""A column as the solver takes it: the arguments of its doors, promoted, checked and aligned."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from ..machine.algebra import converted
from .method.doublings import sufficient_doublings
from .method.legendre import legendre_series
from .method.single_scatter import cos_scattering_angle
from .method.surface import AnySurface, Lambertian


class Column(NamedTuple):
    """Arguments of `toa_brf` and `toa_radiance` by name, None where not given.

    `around` is what `surroundings` keeps of other layers above and below.
    Outside, batch axes lead and broadcast; `OWN_AXES` tells the axes that belong to one column.
    """

    tau: jax.Array
    ssa: jax.Array
    moments: jax.Array
    albedo: jax.Array | AnySurface
    mu0: jax.Array
    mu: jax.Array
    relative_azimuth: jax.Array
    phase_function: jax.Array | None = None
    secant: jax.Array | None = None
    planck_levels: jax.Array | None = None
    surface_emission: jax.Array | None = None
    isotropic_top: jax.Array | None = None
    solar_irradiance: jax.Array | None = None
    around: jax.Array | None = None


OWN_AXES = {
    "tau": ("layer",),
    "ssa": ("layer",),
    "moments": ("layer", "moment"),
    "mu": ("view",),
    "relative_azimuth": ("view",),
    "phase_function": ("layer", "view"),
    "secant": ("layer",),
    "planck_levels": ("level",),
    "around": ("number",),
}
"""Axes of one column's arguments; those not named here are one number."""


class Options(NamedTuple):
    """What is static in a program of the solver; see `Settings`.

    Without a number of doublings every layer of a value has its own (`doublings`). Where the number
    is for layers that nobody has read (`unread`), columns with one that it does not suffice for are
    NaN.
    """

    num_streams: int
    num_modes: int
    delta_m: bool
    tms: bool
    num_doublings: int | None
    unread: bool = False
    error_budget: float | None = None


def promoted(**arguments: Any) -> Column:
    """Give all arguments their common floating type, before any JAX operation.

    Python numbers have no type of their own and follow the arrays; integers become floating. A
    Lambertian surface is its albedo, for which there is a closed form.
    """
    if isinstance(arguments["albedo"], Lambertian):
        arguments["albedo"] = arguments["albedo"].albedo
    arguments = {k: _array(x) if isinstance(x, list | tuple) else x for k, x in arguments.items()}
    leaves, structure = jax.tree.flatten(Column(**arguments))
    dtype = common_type(leaves, lambda: names(structure))
    return jax.tree.unflatten(structure, [converted(x, dtype) for x in leaves])


def common_type(leaves: Sequence[Any], labels: Callable[[], Sequence[str]]) -> np.dtype:
    """Floating type that numbers and arrays have in common.

    What has no type of its own follows the others: truth values, and Python's numbers, also where a
    transformation of JAX has made arrays of them. It is float32 at least: of float16 a solution
    would have neither digits nor range left.

    Parameters
    ----------
    leaves
        Numbers and arrays.
    labels
        What each of them is called, if one is refused.

    Raises
    ------
    TypeError
        For what is no real number of up to 64 bits, bfloat16 among it: of it and float16 there is
        nothing in common.
    """
    arrays = [x if isinstance(x, jax.Array) else np.asarray(x) for x in leaves]
    for place, array in enumerate(arrays):
        kind = getattr(array.dtype, "kind", "")
        if kind not in ("b", "i", "u", "f") or array.dtype.itemsize > 8:
            raise TypeError(
                f"{labels()[place]} is of the type {array.dtype}; allowed are real numbers of up "
                "to 64 bits: float16, float32, float64, integers and bool."
            )
    own = [a.dtype for x, a in zip(leaves, arrays, strict=True) if not _is_weak(x, a)]
    types = own or [x.dtype for x in arrays]
    return jax.dtypes.canonicalize_dtype(np.result_type(np.float32, *types))


def _is_weak(leaf: Any, array: jax.Array | np.ndarray) -> bool:
    """Whether it has no floating type of its own."""
    of_python = isinstance(leaf, int | float) and not isinstance(leaf, np.generic)
    return of_python or array.dtype == bool or bool(getattr(array, "weak_type", False))


def _array(x: Any) -> Any:
    """A list of numbers is an array here, although a pytree of many leaves to JAX."""
    if isinstance(x, AnySurface):  # a NamedTuple may be one
        return x
    traced = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(x))
    return jnp.asarray(x) if traced else np.asarray(x)


def check_shapes(column: Column, num_moments: int, multiple_views: bool) -> None:
    """Refuse arguments whose own axes are missing or disagree, or whose others do not broadcast."""
    shapes = tuple((name, leaf.shape) for name, leaf in _leaves(column))
    _check_these(shapes, num_moments, multiple_views)


@lru_cache(1024)  # calls with columns of the same shapes follow each other
def _check_these(
    shapes: tuple[tuple[str, tuple[int, ...]], ...], num_moments: int, multiple_views: bool
) -> None:
    leading, sizes = [], {}
    for name, shape in shapes:
        axes = own_axes(name, multiple_views)
        if len(shape) < len(axes):
            needs = " and a ".join(f"{axis} axis" for axis in axes)
            raise ValueError(f"{name} needs a {needs}; got shape {shape}.")
        split = len(shape) - len(axes)
        leading.append((name, shape[:split]))
        for axis, size in zip(axes, shape[split:], strict=True):
            sizes.setdefault(axis, []).append((name, size))
    if "level" in sizes:
        name, levels = sizes.pop("level")[0]
        num_layers = max(size for _, size in sizes["layer"])
        if levels - 1 != num_layers:  # levels are not stretched as a single layer is
            raise ValueError(
                f"{name} must have one level more than there are layers; got {levels} levels for "
                f"{num_layers} layers."
            )
    if empty := [name for name, size in sizes["layer"] if size == 0]:
        raise ValueError(f"a column has one layer or more; there is none in {', '.join(empty)}.")
    for axis in ("layer", "view"):
        found = sizes.get(axis, [])
        if len({size for _, size in found} - {1}) > 1:
            raise ValueError(
                f"arguments must have the same number of {axis}s; got "
                + ", ".join(f"{size} in {name}" for name, size in found)
                + "."
            )
    given = sizes["moment"][0][1]
    if given < num_moments:
        raise ValueError(
            f"this many streams need at least {num_moments} moments a layer (num_streams + 1 with "
            f"delta-M, num_streams without); got {given} in moments of shape "
            f"{dict(shapes)['moments']}. Pad Rayleigh with zeros."
        )
    try:
        np.broadcast_shapes(*(shape for _, shape in leading))
    except ValueError:
        listed = ", ".join(f"{shape} of {name}" for name, shape in leading)
        raise ValueError(f"leading axes do not broadcast: {listed}.") from None


def own_axes(name: str, multiple_views: bool) -> tuple[str, ...]:
    """Axes of an argument that belong to one column, as they are outside."""
    axes = OWN_AXES.get(name, ())
    return axes if multiple_views else tuple(axis for axis in axes if axis != "view")


def _leaves(column: Column) -> list[tuple[str, jax.Array]]:
    """Arrays of a column with the argument's name; every array of a surface is an albedo."""
    return [
        (name, leaf) for name, value in column._asdict().items() for leaf in jax.tree.leaves(value)
    ]


def names(structure: Any) -> tuple[str, ...]:
    """Argument that each leaf of a column belongs to."""
    places = jax.tree.unflatten(structure, list(range(structure.num_leaves)))
    return tuple(name for name, _ in _leaves(places))


def whole_moments(column: Column) -> Float[Array, "layer moment *batch"]:
    """Moments of an aligned column, the zeroth of which is 1 and not read."""
    moments = column.moments
    return jnp.concatenate([jnp.ones_like(moments[:, :1]), moments[:, 1:]], axis=1)


def phase_functions(column: Column) -> Float[Array, "layer view *batch"]:
    """Of an aligned column, at the scattering angles: as given, else the sum of all moments. [-]"""
    if column.phase_function is not None:
        return column.phase_function
    angle = cos_scattering_angle(column.mu0, column.mu, column.relative_azimuth)
    return legendre_series(whole_moments(column), angle)


def choose_doublings(column: Column, num_streams: int) -> int:
    """Smallest number offered that suffices for the largest of concrete layers.

    Columns that are not finite do not count.
    """
    sun = column.mu0 if column.secant is None else 1 / np.asarray(column.secant)
    beams = [np.asarray(column.mu), np.asarray(sun)]
    min_mu = min(float(np.min(x, where=x > 0, initial=1)) for x in beams)
    tau = np.asarray(column.tau)
    max_tau = float(np.max(tau, where=np.isfinite(tau), initial=0))
    return sufficient_doublings(max_tau, min_mu, num_streams, column.tau.dtype)


def longest(column: Column, multiple_views: bool, after: int = 0) -> dict[str, int]:
    """Size of each axis of one column: that of the argument that has most there.

    Of arguments as they are outside, or with so many more axes `after` a column's own.
    """
    sizes: dict[str, int] = {}
    for name in OWN_AXES:
        if (x := getattr(column, name)) is not None:
            axes, end = own_axes(name, multiple_views), x.ndim - after
            for axis, size in zip(axes, x.shape[end - len(axes) : end], strict=True):
                sizes[axis] = max(size, sizes.get(axis, 0))
    return sizes


def aligned(column: Column, multiple_views: bool) -> Column:
    """A column whose batch is last in every leaf, with all its own axes.

    A single view gets its axis; an argument shared by layers or views gets one entry for each.
    """
    sizes = {"view": 1} | longest(column, multiple_views, after=1)

    def inward(name: str, x: jax.Array) -> jax.Array:
        axes = OWN_AXES.get(name, ())
        if "view" in axes and not multiple_views:
            x = x[..., None, :]
        own = [sizes.get(axis, size) for axis, size in zip(axes, x.shape, strict=False)]
        return jnp.broadcast_to(x, (*own, x.shape[-1]))

    fields = {
        name: jax.tree.map(lambda leaf, name=name: inward(name, leaf), value)
        for name, value in column._asdict().items()
    }
    return Column(**fields)
