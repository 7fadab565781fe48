"""How often a layer must be doubled for the rational start to be exact, and by which numbers.

The number is data: every layer of a tile has its own, for the column of the tile that asks for most
(`layer_doublings`), so that one program serves all columns, and a thin layer does not pay for a
thick one. A program for slopes has room for so many, which is part of it (`sufficient_doublings`):
what it keeps on the way up is as much as there are doublings.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .quadrature import half_range

# Largest z = tau' / (2 mu_min) of a layer for which the start of `layer.half_layer`, doubled
# 0, 1, 2, 3, 4 times, errs by 1e-12 or less; four times as much for each doubling after that.
_REACH = (0.0356, 0.0713, 0.142, 0.287, 179.0)
# Largest z of a layer's 2^K-th part in single precision. The start of a thicker one is a difference
# of numbers z^2 / 10 times as large as itself, of which rounding leaves so much less: at cosines of
# 1e-3 layers of 1e5 came out wrong by a third.
_SINGLE_START = 40.0
# Doublings and values of z among which `reaches` looks.
_LOOKED_AT, _DEPTHS = 8, np.geomspace(1e-3, 1e5, 4001)

# Largest numbers that `num_doublings=None` chooses from for slopes: few, so that few programs
# compile.
_BUCKETS = (4, 6, 8, 14)

# What a program must be right for when its layers are not known as it is traced.
_UNKNOWN_TAU, _UNKNOWN_MU = 1e5, 1e-3

# Doublings of a layer whose number is data, at most: enough for z = 1e37, near float32's largest.
_MOST = 64


class Doublings(eqx.Module):
    """Doublings of a layer, or of all layers on a first axis.

    Parameters
    ----------
    numbers
        The number of doublings; the part of the layer's thickness that is half of what the start is
        made for; the start's d (`start_coefficient`). Not integers, which have no tangents in a
        kernel. None where they are those of `most`, written out one by one.
    most
        No number is larger; None where nothing depends on it. JAX takes derivatives of so many
        doublings written out, since reverse mode goes through no loop of a length that is data.
    """

    numbers: Float[Array, "*layer 3"] | None
    most: int | None = eqx.field(static=True)

    def of_layer(self) -> tuple[Any, Any, Any]:
        """The three numbers of one layer."""
        if self.numbers is None:
            assert self.most is not None
            return _numbers(self.most)
        return self.numbers[0].astype(jnp.int32), self.numbers[1], self.numbers[2]

    def written_out(self) -> "Doublings":
        """As many for every layer, for JAX to take derivatives of."""
        if self.most is None:
            raise TypeError("doublings without a largest number cannot be written out.")
        return Doublings(None, self.most)


def repeated(body: Callable[[Any, Any], Any], number: Any, carry: Any) -> Any:
    """``carry = body(k, carry)`` for k below a number, which may be data."""
    if isinstance(number, int):
        for k in range(number):
            carry = body(k, carry)
        return carry
    return jax.lax.fori_loop(jnp.zeros_like(number), number, body, carry)


def start_coefficient(num_doublings: int) -> float:
    r"""The number d in the start of `layer.half_layer`.

    The start agrees with :math:`\sqrt x\coth\sqrt x` to the second order for any d. From four
    doublings on d = 10/21, the continued fraction, right to one order more. Below, d = 11/30 keeps
    the start near 1 up to larger x, so that doubling, which pulls everything there to 1, settles
    one or two steps earlier: for layers up to tau = 3 and one of 30, two doublings are right to
    6e-6 of the reflectance at 4 and 8 streams and to 3e-5 at 16 (`benchmarks/solver.py`).
    """
    return 11 / 30 if num_doublings <= 3 else 10 / 21


@cache
def reaches(error: float) -> tuple[float, ...]:
    r"""Largest z for which the start, doubled 0, 1, 2, ... times, errs by `error` or less. [-]

    z is the optical depth of half a layer on its way, for which the layer's admittance and
    impedance are z tanh(z) / z and z coth(z); the start and its doublings are those of
    `layer.half_layer` for a matrix of one number.
    """
    return tuple(_reach_of(k, error) for k in range(_LOOKED_AT))


def _reach_of(number: int, error: float) -> float:
    z = _DEPTHS
    h, d = z / 2**number, start_coefficient(number)
    fraction = 1 / 3 - (h * h / 9) / (5 + d * h * h)
    impedance = 1 + h * h * fraction
    admittance = h - h**3 * fraction / impedance
    for _ in range(number):
        impedance = impedance + h * admittance
        admittance = 2 * (admittance - h * admittance**2 / impedance)
        h = 2 * h
    wrong = np.maximum(abs(admittance / np.tanh(z) - 1), abs(impedance * np.tanh(z) / z - 1))
    beyond = np.flatnonzero(wrong > error)
    return float(z[beyond[0] - 1] if beyond.size and beyond[0] else z[-1 if not beyond.size else 0])


def layer_doublings(
    tau: Float[Array, "layer *batch"],
    secants: Float[Array, "beam layer *batch"],
    num_streams: int,
    most: int | None,
    error: float | None = None,
    single: bool = False,
) -> Doublings:
    """Doublings of every layer of a tile: the fewest that suffice for all its columns.

    Parameters
    ----------
    tau
        Optical depth of the layers as they are solved. [-]
    secants
        By which the beams are attenuated. [-]
    num_streams
        Number of streams; their smallest cosine counts as well.
    most
        Doublings of a layer, at most; None for no limit but `_MOST`.
    error
        Of a layer's response that may be left (`reaches`); None for rounding's.
    single
        Whether single precision is to do, too, where the layers are given in double.

    Columns that are not finite do not count.
    """
    limit = _MOST if most is None else most
    z = _half_thickness(tau, secants, num_streams)
    z = jnp.where(jnp.isfinite(z), z, 0).reshape(tau.shape[0], -1)
    thickest = jnp.max(z, axis=1, initial=0)
    single = single or tau.dtype == jnp.float32
    reach = np.array([_reach(k, error, single) for k in range(limit)])
    reach = jnp.asarray(np.minimum(reach, np.finfo(tau.dtype).max), tau.dtype)
    count = jnp.sum(thickest[:, None] > reach, axis=1)
    table = np.array([_numbers(k) for k in range(limit + 1)])
    return Doublings(jnp.asarray(table, tau.dtype)[count], most)


def within_reach(
    tau: Float[Array, "layer *batch"],
    secants: Float[Array, "beam layer *batch"],
    num_streams: int,
    most: int,
) -> Float[Array, "layer *batch"]:
    """1 where so many doublings of a layer are enough, else NaN: a factor of its optical depth.

    Parameters
    ----------
    tau, secants, num_streams, most
        As in `layer_doublings`.
    """
    z = _half_thickness(tau, secants, num_streams)
    reach = _reach(most, single=tau.dtype == jnp.float32)
    return jnp.where(z > reach, jnp.nan, 1).astype(tau.dtype)


def _half_thickness(tau: Array, secants: Array, num_streams: int) -> Array:
    """Optical depth of half a layer on the steepest path through it, without a derivative."""
    tau, secants = jax.lax.stop_gradient((tau, secants))
    steepest = jnp.maximum(jnp.max(secants, axis=0), 1 / half_range(num_streams)[0][0].item())
    return 0.5 * tau * steepest


def _reach(doublings: int, error: float | None = None, single: bool = False) -> float:
    known = _REACH if error is None else reaches(error)
    last = len(known) - 1
    reach = known[min(doublings, last)] * 4.0 ** max(0, doublings - last)
    return min(reach, _SINGLE_START * 2.0**doublings) if single else reach


def _numbers(doublings: int) -> tuple[int, float, float]:
    return doublings, 0.5 / 2**doublings, start_coefficient(doublings)


def sufficient_doublings(
    max_tau: float, min_mu: float, num_streams: int, dtype: Any = np.float64
) -> int:
    """Smallest offered number of doublings that is exact for layers up to `max_tau`.

    Parameters
    ----------
    max_tau
        Largest (delta-M scaled or not) optical depth of a single layer. [-]
    min_mu
        Smallest cosine of the sun's and the view's zenith angle. [-]
    num_streams
        Number of streams; their smallest cosine counts as well.
    dtype
        Precision in which they are solved: single precision needs more for thick ones.
    """
    z = max_tau / (2 * min(min_mu, half_range(num_streams)[0][0]))
    single = np.dtype(dtype) == np.float32
    further = range(_BUCKETS[-1], _MOST)
    enough = (k for k in (*_BUCKETS, *further) if z <= _reach(k, single=single))
    return next(enough, _MOST)


def unknown_doublings(num_streams: int, dtype: Any = np.float64) -> int:
    """Doublings for layers that nobody knows yet: enough for tau = 1e5 at a cosine of 1e-3."""
    return sufficient_doublings(_UNKNOWN_TAU, _UNKNOWN_MU, num_streams, dtype)
