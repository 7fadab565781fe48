r"""The single-scattering albedo of a plume at which it is so many times brighter in a band.

Light that leaves a column has been scattered in the plume n times, n = 0, 1, 2, ..., so that its
reflectance is a power series in the plume's single-scattering albedo :math:`\omega` with
coefficients that are none of them negative: it rises with :math:`\omega`, ever more steeply.
Newton's steps from the right of a root therefore come down to it and never pass it, from 1 where
the plume has to be brighter and from where it is where it has to be darker; no step leaves the
interval between. (Few streams could break this, as their phase functions may be negative; steps are
held inside 0 to 1 all the same, and what comes out is put into the operator again.)
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from .plume_band import PlumeBand

MEAN_TOLERANCE = 1e-4
"""How near the mean must come to what is asked for, relative to it. [-]"""
REACHED, FALLS_SHORT, NOT_CONVERGED = 0, 1, 2
"""What became of a column: its brightness is as asked for; no single-scattering albedo from 0 to 1
makes it so, and that end is kept; no root was found, and it stays as it is."""

_MAX_STEPS = 30
_TIGHTEST = 1e-10  # of a step's size and of the relative residual


class SsaRoot(NamedTuple):
    """A single-scattering albedo that was looked for.

    Parameters
    ----------
    ssa
        Of the plume in the band, of each column. [-]
    brf
        What the operator makes of it. [-]
    code
        `REACHED`, `FALLS_SHORT` or `NOT_CONVERGED`, of each column.
    """

    ssa: np.ndarray
    brf: np.ndarray
    code: np.ndarray


def ssa_for_mean(plume: PlumeBand, factor: float, counted: np.ndarray) -> SsaRoot:
    """One shift of the single-scattering albedo for all columns, for a mean so many times larger.

    Parameters
    ----------
    plume
        The columns, and which plume and band.
    factor
        By how much to multiply the mean of brf. [-]
    counted
        Which columns the mean is of.

    Returns
    -------
    Of all columns. Where the shift at which some column gets to 0 or 1 falls short, it is that one.

    Raises
    ------
    ValueError
        Where no column is counted, or no shift was found to `MEAN_TOLERANCE`.
    """
    if not np.any(counted):
        raise ValueError("no column is counted, so that there is no mean to change.")
    ssa = np.asarray(plume.ssa)
    weight = (counted / np.count_nonzero(counted)).astype(ssa.dtype)

    def mean(brf: Any) -> float:
        return float(np.mean(np.asarray(brf)[counted]))

    lower, upper = -float(ssa.min()), 1 - float(ssa.max())
    base = mean(plume.brf(ssa))
    target, end = factor * base, upper if factor > 1 else lower
    farthest = mean(plume.brf(ssa + end))
    short = bool(target > farthest) if factor > 1 else bool(target < farthest)
    shift = end
    if not short:
        dtype = ssa.dtype.type
        start, bounds = dtype(upper if factor > 1 else 0), (dtype(lower), dtype(upper))
        shift = float(_root_of_mean(plume, start, dtype(target), bounds, weight))
    changed = np.asarray(plume.brf(ssa + shift))
    if not short and not abs(mean(changed) / target - 1) <= MEAN_TOLERANCE:
        raise ValueError(
            f"no shift of the single-scattering albedo multiplies the mean by {factor}: the last "
            f"one tried, {shift:.6f}, multiplies it by {mean(changed) / base:.6f}."
        )
    code = np.full(ssa.shape, FALLS_SHORT if short else REACHED, np.int8)
    return SsaRoot(ssa + shift, changed, code)


def ssa_of_each(plume: PlumeBand, factor: float) -> SsaRoot:
    """The single-scattering albedo that makes each column so many times brighter, one by one.

    Parameters
    ----------
    plume, factor
        As of `ssa_for_mean`.
    """
    ssa = np.asarray(plume.ssa)
    end = np.full_like(ssa, 1.0 if factor > 1 else 0.0)
    target, farthest = (np.asarray(x) for x in (factor * plume.brf(ssa), plume.brf(end)))
    short = target > farthest if factor > 1 else target < farthest
    start = end if factor > 1 else ssa
    # What falls short is given the end for its target, where it is at once or soon is.
    wanted = np.where(short, farthest, target)
    bounds = ssa.dtype.type(0), ssa.dtype.type(1)
    found = np.where(short, end, np.asarray(_roots(plume, start, wanted, bounds)))
    # What is no number is not given to the operator.
    changed = np.asarray(plume.brf(np.where(np.isfinite(found), found, ssa)))
    right = np.isfinite(found) & (np.abs(changed / wanted - 1) <= MEAN_TOLERANCE)
    code = np.where(short, FALLS_SHORT, np.where(right, REACHED, NOT_CONVERGED)).astype(np.int8)
    found = np.where(right, found, ssa)
    return SsaRoot(found, np.asarray(plume.brf(found)), code)


@jax.jit
def _root_of_mean(
    plume: PlumeBand, start: Array, target: Array, bounds: tuple[Array, Array], weight: Array
) -> Float[Array, ""]:
    """Shift for all columns."""

    def residual(shift: Array, _arguments: Any) -> Array:
        return jnp.sum(weight * plume.brf(plume.ssa + shift)) / target - 1

    return _newton(residual, start, bounds)


@jax.jit
def _roots(
    plume: PlumeBand, start: Array, target: Array, bounds: tuple[Array, Array]
) -> Float[Array, " column"]:
    """Single-scattering albedo of each column, all of them together until the last one ends."""

    def of_one(plume: PlumeBand, start: Array, target: Array) -> Array:
        return _newton(lambda ssa, _arguments: plume.brf(ssa) / target - 1, start, bounds)

    return jax.vmap(of_one)(plume, start, target)


def _newton(residual: Callable[[Array, Any], Array], start: Array, bounds: Any) -> Array:
    """The root of a relative residual; a step counts by its size, the unknown being of order 1."""
    tolerance = max(_TIGHTEST, 30 * float(jnp.finfo(start.dtype).eps))
    return optx.root_find(
        residual,
        optx.Newton(tolerance, tolerance),
        start,
        options=dict(zip(("lower", "upper"), bounds, strict=True)),
        max_steps=_MAX_STEPS,
        throw=False,
    ).value
