"""Where the solver's nodes integrate mu^2 log mu exactly: the formula of `method.quadrature`.

    python benchmarks/fit_quadrature.py [--nodes 2 3 4 5 6 7 8 10 12 16 24 32 48]

The rules whose nodes are the zeros of P_n + a P_(n-1) are exact to degree 2n - 2 for any a. Printed
is, by n, the a for which mu^2 log mu is exact, found with 77 digits, as 1 / (1 - a); what the
formula c n + d + e / n has for it; and by how much less than Gauss's rule that of the formula
misses. The last line has the c, d and e that fit best, relative errors squared. Needs the extra
`test` (python-flint).
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from flint import arb, ctx
from rounds import table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from forty_digit_nodes import gauss, leaning, quasi_gauss  # noqa: E402

NODES = (2, 3, 4, 5, 6, 7, 8, 10, 12, 16, 24, 32, 48)
FORMULA = 0.30574, 0.5015, 0.0613


def missed(rule):
    """Error of a rule for mu^2 log mu, whose integral is -1/9."""
    return sum((w * x * x * x.log() for x, w in rule), arb(0)) + arb(1) / 9


def exact(count, start, steps=12):
    """The a of the rule that misses nothing, by secants from a number near it."""
    a, b = arb(start - 1e-3), arb(start + 1e-3)
    at_a, at_b = missed(quasi_gauss(count, a)), missed(quasi_gauss(count, b))
    for _ in range(steps):
        if a == b or at_a == at_b:
            break
        a, b = b, (b - at_b * (b - a) / (at_b - at_a)).mid()
        at_a, at_b = at_b, missed(quasi_gauss(count, b))
        if abs(float(b - a)) < 1e-20:
            break
    return float(1 / (1 - b))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--nodes", type=int, nargs="+", default=NODES)
    options = parser.parse_args()
    ctx.prec = 256
    n = np.array(options.nodes, float)
    columns = np.stack([n, np.ones_like(n), 1 / n], axis=1)
    formula = columns @ FORMULA
    found = np.array([exact(k, 1 - 1 / x) for k, x in zip(options.nodes, formula, strict=True)])
    less = [float(missed(leaning(k)) / missed(gauss(k))) for k in options.nodes]
    rows = [
        [k, f"{x:.7f}", f"{y:.7f}", f"{abs(z):.1e}"]
        for k, x, y, z in zip(options.nodes, found, formula, less, strict=True)
    ]
    table(["nodes", "exact", "formula", "error, of Gauss's"], rows)
    if len(n) >= len(FORMULA):
        best, *_ = np.linalg.lstsq(columns / found[:, None], np.ones_like(n), rcond=None)
        print("best c, d, e:", *(f"{x:.5f}" for x in best))


if __name__ == "__main__":
    main()
