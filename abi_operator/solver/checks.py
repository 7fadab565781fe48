"""Checks of the values of the solver's arguments, outside any compilation.

`check_in_memory` is made of every call whose arguments lie in memory, so it must take next to no
time: it reads each array once, as integers, and looks closer only where that leaves a doubt.
`check_arguments` is what looks closer. The first argument that offends is reported, in the order of
`column.Column`.
"""

from functools import cache
from typing import Any

import jax
import numpy as np
from jax.core import Tracer

from ..ranges import FINITE, SOLVER, Range

# Largest last term (2l + 1) |chi_l| of a series from which a phase function is summed.
LAST_TERM = 1e-3


def check_arguments(arguments: dict[str, Any], *, series_summed: bool) -> None:
    r"""Refuse values that are not finite or lie outside their physical range.

    The ranges are those of `ranges.SOLVER`. Exceptions: chi_0, which the solver does not read, need
    only be finite, and so need mu0 where solar_irradiance is 0, and all arrays of a surface.

    Parameters
    ----------
    arguments
        Arguments of the solver by name, with shapes that broadcast as the solver has them; None
        for one that is not given. `albedo` is an array or a surface.
    series_summed
        Whether phase functions are summed from the moments given. Then the last of them must have
        :math:`(2l+1)|\chi_l| \le` 1e-3 in every layer that scatters.

    Raises
    ------
    ValueError
        Naming the argument, the index of the first offender, its value, the number of others and
        the allowed range; or the argument that is traced (under `jax.jit`, `jax.vmap` or a
        derivative) and so has no values.
    """
    arguments = {name: value for name, value in arguments.items() if value is not None}
    for name, value in arguments.items():
        for label, leaf in _leaves(name, value):
            if isinstance(leaf, Tracer):
                raise ValueError(
                    f"{label} is traced, so its values cannot be checked: call outside jax.jit, "
                    "jax.vmap and derivatives, or with check_values=False."
                )
    surface = "albedo" in arguments and _is_surface(arguments["albedo"])
    for name, value in arguments.items():
        if name == "albedo" and surface:
            for label, leaf in _leaves(name, value):
                _check_range(label, np.asarray(leaf), FINITE)
        elif name == "moments":
            moments = np.asarray(value)
            _check_range(name, moments, FINITE)
            read = np.arange(moments.shape[-1]) > 0
            _check_range(name, moments, SOLVER[name], judged=read)
        elif name == "mu0" and "solar_irradiance" in arguments:
            mu0 = np.asarray(value)
            _check_range(name, mu0, FINITE)
            lit = _reduced(np.not_equal(arguments["solar_irradiance"], 0), mu0.shape)
            _check_range(name, mu0, SOLVER[name], judged=lit)
        else:
            _check_range(name, np.asarray(value), SOLVER[name])
    if series_summed:
        _check_series(*(np.asarray(arguments[name]) for name in ("tau", "ssa", "moments")))


def check_in_memory(arguments: dict[str, Any]) -> None:
    """`check_arguments` of arrays that can be read at once; others are let pass.

    Those are traced ones and those on another device than the CPU. Series are not judged.
    """
    given = {name: x for name, x in arguments.items() if x is not None}
    others = [x for x in given.values() if type(x) is not np.ndarray]
    if others and not all(map(_is_on_host, jax.tree.leaves(others))):
        return
    if not all(_surely_inside(name, x) for name, x in given.items()):
        check_arguments(arguments, series_summed=False)


def _is_on_host(x: Any) -> bool:
    if isinstance(x, jax.Array):
        return not isinstance(x, Tracer) and all(d.platform == "cpu" for d in x.devices())
    return isinstance(x, np.ndarray)


def _surely_inside(name: str, value: Any) -> bool:
    """Whether all numbers are in the range of an argument; False where it takes a closer look.

    Floating numbers from 0 on are ordered as their bits are, read as integers; negative ones and
    NaN come after all others. So one integer tells, and is found in one pass.
    """
    if not isinstance(value, np.ndarray | jax.Array):
        return False
    x = np.asarray(value)
    if x.size == 0:
        return True
    limits = _bits(name, x.dtype)
    if limits is not None and x.flags.c_contiguous:
        integers, largest = limits
        return bool(x.view(integers).max() <= largest)
    return bool(SOLVER[name].holds(x.min()) and SOLVER[name].holds(x.max()))


@cache
def _bits(name: str, dtype: np.dtype) -> tuple[Any, Any] | None:
    """Integers of which a floating number is one, and the largest of a range from 0 on.

    None for ranges that begin elsewhere. That of moments does, but most are not negative.
    """
    allowed = SOLVER[name]
    integers = {4: np.uint32, 8: np.uint64}.get(dtype.itemsize)
    from_zero = (allowed.low == 0 and allowed.ends[0] == "[") or name == "moments"
    if integers is None or dtype.kind != "f" or not from_zero:
        return None
    end = np.asarray(allowed.high, dtype)
    largest = end if allowed.ends[1] == "]" else np.nextafter(end, np.zeros_like(end))
    return integers, largest.view(integers)[()]


def _is_surface(albedo: Any) -> bool:
    # A list of numbers is an array to the solver, although a pytree of many leaves to JAX.
    if isinstance(albedo, list | tuple):
        return False
    return not jax.tree_util.all_leaves([albedo])


def _leaves(name: str, value: Any) -> list[tuple[str, Any]]:
    """Arrays and numbers in an argument, each with its name."""
    return [
        (name + jax.tree_util.keystr(path), leaf)
        for path, leaf in jax.tree_util.tree_leaves_with_path(value)
        if isinstance(leaf, jax.Array | np.ndarray | np.generic | int | float)
    ]


def _check_range(
    name: str,
    x: np.ndarray,
    allowed: Range,
    judged: np.ndarray | bool = True,
) -> None:
    bad = np.asarray(~allowed.holds(x) & judged)
    if np.any(bad):
        index, others = _first(bad)
        label = f"{name}{_subscript(index)} = {x[index]!s}"
        raise ValueError(f"{label} is outside {allowed.interval}{others}.")


def _check_series(tau: np.ndarray, ssa: np.ndarray, moments: np.ndarray) -> None:
    degree = moments.shape[-1] - 1
    last = np.asarray((2 * degree + 1) * np.abs(moments[..., -1]))
    scatters = _reduced((tau != 0) & (ssa != 0), last.shape)
    bad = np.asarray((last > LAST_TERM) & scatters)
    if np.any(bad):
        index, others = _first(bad)
        layer = f"layer {index[-1]}" + (f" of column {index[:-1]}" if index[:-1] else "")
        raise ValueError(
            f"moments end too early to sum the phase function of {layer}: (2l + 1) |chi_l| = "
            f"{last[index]:.3g} at the last l = {degree} is above {LAST_TERM:g}{others}; pass the "
            "phase function itself as phase_function, from its closed form or a table "
            "(interpolate_phase_function), or more moments (zeros where the series ends there)."
        )


def _reduced(mask: np.ndarray | np.bool, shape: tuple[int, ...]) -> np.ndarray:
    """Whether `mask` is True for any of the elements that each element of `shape` meets."""
    mask = np.broadcast_to(mask, np.broadcast_shapes(np.shape(mask), shape))
    extra = mask.ndim - len(shape)
    mask = np.asarray(np.any(mask, axis=tuple(range(extra))))
    stretched = tuple(i for i, n in enumerate(shape) if n == 1 and mask.shape[i] != 1)
    return np.asarray(np.any(mask, axis=stretched, keepdims=True))


def _first(bad: np.ndarray) -> tuple[tuple[int, ...], str]:
    """Index of the first offender, and how many more there are in words."""
    index = tuple(int(i) for i in np.unravel_index(np.argmax(bad), bad.shape))
    more = int(np.count_nonzero(bad)) - 1
    return index, f" (and {more} more)" if more else ""


def _subscript(index: tuple[int, ...]) -> str:
    return f"[{', '.join(map(str, index))}]" if index else ""
