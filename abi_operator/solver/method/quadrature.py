r"""Directions of the streams.

A hemisphere's :math:`\int_0^1 f\,d\mu` is a sum over n nodes. Energy is conserved where the phase
function's degrees 1 to 2n - 1 integrate to 0 over both hemispheres. Odd degrees do so whatever the
nodes, so that energy asks of a hemisphere for no more than powers up to :math:`\mu^{2n-2}`.
Gauss's nodes are exact for :math:`\mu^{2n-1}` too. What light really does is less smooth: in thin
air radiances near the horizon go like powers of tau times log tau, and sources are functions of mu
with :math:`\mu^k \log\mu` in them. Here the degree that energy does not need is given up for one
of these. Rules that are exact to degree 2n - 2 have their nodes where

.. math:: P_n(2\mu - 1) + a P_{n-1}(2\mu - 1) = 0, \qquad -1 < a < 1,

and positive weights ([1]_): Gauss's has a = 0, Radau's, with a node at the horizon, a = 1. The one
that is exact for :math:`\mu^2\log\mu` lies between, at
:math:`1/(1 - a) = 0.30574n + 0.5015 + 0.0613/n`, a fit that leaves at most 6e-4 of Gauss's
error for that function (`benchmarks/fit_quadrature.py`).

At equal streams reflectances of clear air are twice as near the truth as on Gauss's nodes, and
those of clouds, whose sharp phase functions ask for other things, up to a sixth further off
(`benchmarks/fit_streams.py` and its ``--double-gauss``; `benchmarks/quadrature.py`).

References
----------
.. [1] F. Peherstorfer, "Linear combinations of orthogonal polynomials generating positive
   quadrature formulas", Math. Comp., 55, 231-241, 1990, Zbl 0708.65022
.. [2] J. B. Sykes, "Approximate integration of the equation of transfer", Mon. Not. R. Astron.
   Soc., 111, 377-386, 1951, doi:10.1093/mnras/111.4.377 (one set of nodes for each hemisphere)
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

import jax
import numpy as np

_on_double_gauss = False


def half_range(num_streams: int) -> tuple[np.ndarray, np.ndarray]:
    r"""Directions that the solver uses, one set for each hemisphere.

    Parameters
    ----------
    num_streams
        Number of streams in both hemispheres together, even.

    Returns
    -------
    Cosines, rising, and weights of one hemisphere, ``num_streams / 2`` of each, float64; exact
    for the powers 0 to ``num_streams - 2`` and for :math:`\mu^2 \log\mu`. Two streams are
    Gauss's, as fluxes need :math:`\mu`. [-]

    Raises
    ------
    ValueError
        If `num_streams` is odd or below 2.
    """
    n = num_streams // 2
    if n < 2 or _on_double_gauss:
        return double_gauss(num_streams)
    return _rule(num_streams, 1 - 1 / (0.30574 * n + 0.5015 + 0.0613 / n))


def node_scales(num_streams: int) -> np.ndarray:
    r""":math:`\sqrt{w\mu}`, by which nodes are scaled (`bordered`), float64: what radiance 1 of all
    directions is there. [-]"""
    mu, weight = half_range(num_streams)
    return np.sqrt(weight * mu)


def double_gauss(num_streams: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights on (0, 1), which other solvers use: as `half_range`."""
    return _rule(num_streams, 0.0)


@contextmanager
def on_double_gauss() -> Iterator[None]:
    """Solve on the nodes of `double_gauss` while this lasts, as DISORT does at as many streams.

    With the same nodes two solvers of the same equations agree to rounding. It holds for the whole
    process, in which JAX forgets all compiled programs on entry and on exit; no other thread may
    solve meanwhile.
    """
    global _on_double_gauss
    before = _on_double_gauss
    try:
        _on_double_gauss = True
        jax.clear_caches()
        yield
    finally:
        _on_double_gauss = before
        jax.clear_caches()


@lru_cache
def _rule(num_streams: int, a: float) -> tuple[np.ndarray, np.ndarray]:
    """Zeros of P_n + a P_(n-1) as a matrix's eigenvalues, with Christoffel's weights."""
    if num_streams < 2 or num_streams % 2:
        raise ValueError(f"num_streams must be even and at least 2; got {num_streams}.")
    n = num_streams // 2
    k = np.arange(1, n)
    beside = k / np.sqrt(4 * k**2 - 1)
    matrix = np.diag(beside, 1) + np.diag(beside, -1)
    matrix[-1, -1] = -a * n / (2 * n - 1)
    x = np.linalg.eigvalsh(matrix)
    own, slope = np.append(np.zeros(n - 1), [a, 1]), np.polynomial.legendre.legder
    x -= np.polynomial.legendre.legval(x, own) / np.polynomial.legendre.legval(x, slope(own))
    squares = np.polynomial.legendre.legvander(x, n - 1) ** 2
    return (1 + x) / 2, 1 / (squares @ (2 * np.arange(n) + 1))
