"""Nodes and weights of one hemisphere with as many digits as `flint` is told to use."""

import numpy as np
from flint import arb

NEWTON_STEPS = 4  # from float64 to 256 bits, and one more


def gauss(count: int) -> list[tuple[arb, arb]]:
    """Of Gauss and Legendre on 0 to 1."""
    pairs = [arb.legendre_p_root(count, k, weight=True) for k in range(count)]
    return [((1 + x) / 2, w / 2) for x, w in pairs]


def leaning(count: int) -> list[tuple[arb, arb]]:
    """The zeros of P_n + a P_(n-1) on 0 to 1, as the solver has them; one node is Gauss's.

    Weights are 1 / sum (2k + 1) P_k^2 over the degrees below n.
    """
    if count == 1:
        return gauss(1)
    return quasi_gauss(count, arb(1 - 1 / (0.30574 * count + 0.5015 + 0.0613 / count)))


def quasi_gauss(count: int, a: arb) -> list[tuple[arb, arb]]:
    """The same for any a between -1 and 1."""
    series = np.append(np.zeros(count - 1), [float(a), 1])
    return [_polished(x, a, count) for x in np.polynomial.legendre.legroots(series).real]


def _polished(start: float, a: arb, count: int) -> tuple[arb, arb]:
    """One zero, by Newton's method, and its weight."""
    x = arb(float(start))
    for _ in range(NEWTON_STEPS):
        p = _polynomials(x, count)
        own, below = (k * (x * p[k] - p[k - 1]) / (x * x - 1) for k in (count, count - 1))
        x = (x - (p[count] + a * p[count - 1]) / (own + a * below)).mid()
    p = _polynomials(x, count)
    total = sum(((2 * k + 1) * p[k] ** 2 for k in range(count)), arb(0))
    return (1 + x) / 2, 1 / total


def _polynomials(x: arb, count: int) -> list[arb]:
    """Legendre polynomials of degrees 0 to `count`."""
    p = [arb(1), x]
    for k in range(1, count):
        p.append(((2 * k + 1) * x * p[k] - k * p[k - 1]) / (k + 1))
    return p
