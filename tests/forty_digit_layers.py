"""One homogeneous layer between black walls, in ball arithmetic.

A and B are those of dt/dtau = A s and ds/dtau = B t with s = up + down and t = up - down.
"""

from math import ceil, log2

from flint import arb, arb_mat

# The series starts where h / mu is at most START, so that the norm of X = h^2 B A is about 1/16 and
# the first neglected term, X^24 / 48!, about 1e-90: less than balls of 77 digits lose by rounding.
# The exponential is squared until h / mu reaches EXPONENT, which costs 21 digits; from there
# reflection and transmission are doubled.
START = 1 / 8
TERMS = 24
EXPONENT = 16


def identity(size: int) -> arb_mat:
    return arb_mat([[int(i == j) for j in range(size)] for i in range(size)])


def _cosh_sinh(x: arb_mat, one: arb_mat) -> tuple[arb_mat, arb_mat]:
    """Sums over k of X^k / (2k)! and X^k / (2k + 1)!, four powers at a time.

    What is neglected is less than twice its first term, of which the largest sum over a row of X
    gives a bound; every ball is widened by it.
    """
    square = x * x
    norm = max((sum((abs(v) for v in row), arb(0)).upper() for row in x.tolist()), default=arb(0))
    neglected = arb(0, 2 * norm**TERMS / arb.fac_ui(2 * TERMS))
    powers, fourth = [one, x, square, square * x], square * square
    out = []
    for odd in (0, 1):
        total = one * 0
        for start in reversed(range(0, TERMS, 4)):
            total = total * fourth
            for k in range(4):
                total += powers[k] * (1 / arb.fac_ui(2 * (start + k) + odd))
        out.append(arb_mat([[v + neglected for v in row] for row in total.tolist()]))
    return out[0], out[1]


def scattering(a: arb_mat, b: arb_mat, half: arb, steepest: float) -> tuple[arb_mat, arb_mat]:
    """Reflection and transmission of a layer 2 `half` thick, the same from both sides."""
    one = identity(a.nrows())
    thickness = float(half) * steepest
    squarings = max(0, ceil(log2(max(min(thickness, EXPONENT), START) / START)))
    doublings = max(0, ceil(log2(max(thickness, EXPONENT) / EXPONENT)))
    half = half / 2**doublings
    h = half / 2**squarings
    x = (b * a) * (h * h)
    cosh, sinh = _cosh_sinh(x, one)
    for _ in range(squarings):
        cosh, sinh = 2 * (cosh * cosh) - one, cosh * sinh
    # About the layer's middle, even fields have s = cosh, t = h A sinh, odd ones the reverse.
    even = 2 * (cosh * (cosh + (a * sinh) * half).inv()) - one
    odd = one - 2 * (cosh + (sinh * b) * half).solve(cosh)
    reflection, transmission = (even + odd) * arb(0.5), (even - odd) * arb(0.5)
    for _ in range(doublings):
        through = (one - reflection * reflection).solve(transmission)
        between = reflection * through
        reflection += transmission * between
        transmission = transmission * through
    return reflection, transmission


def emitting(
    a: arb_mat, b: arb_mat, tau: arb, steepest: float, source: list[arb]
) -> tuple[arb_mat, arb_mat, arb_mat, arb_mat]:
    """Reflection, transmission and what is emitted at the top and bottom of a layer.

    The last two as of `_emission`, which is evaluated across a part of the layer that is thin
    enough for its exponential, and doubled from there with reflection and transmission: the lower
    half of two begins with the Planck function that the upper one ends with.
    """
    one = identity(a.nrows())
    doublings = max(0, ceil(log2(float(tau) * steepest / EXPONENT)))
    tau = tau / 2**doublings
    reflection, transmission = scattering(a, b, tau / 2, steepest)
    up, down = _emission(a, b, tau, source)
    for _ in range(doublings):
        lower = arb_mat([[1, tau], [0, 1]])
        up_of_lower, down_of_lower = up * lower, down * lower
        between = (one - reflection * reflection).inv()
        risen = between * (up_of_lower + reflection * down)
        fallen = between * (down + reflection * up_of_lower)
        up, down = up + transmission * risen, down_of_lower + transmission * fallen
        through = between * transmission
        reflection += transmission * (reflection * through)
        transmission, tau = transmission * through, 2 * tau
    return reflection, transmission, up, down


def _emission(a: arb_mat, b: arb_mat, tau: arb, source: list[arb]) -> tuple[arb_mat, arb_mat]:
    """What a layer sends up at its top and down at its bottom by emission.

    First column: if the Planck function B is 1; second: if it is the optical depth from the top.
    `source` is what B adds to dt/dtau. The state (s, t, B, 1) obeys one linear system, which is
    exponentiated across the layer.
    """
    size = len(source)
    rows = [[arb(0)] * (2 * size + 2) for _ in range(2 * size + 2)]
    for i in range(size):
        rows[i][size : 2 * size] = [b[i, j] for j in range(size)]
        rows[size + i][:size] = [a[i, j] for j in range(size)]
        rows[size + i][2 * size] = source[i]
    rows[2 * size][2 * size + 1] = arb(1)
    across = (arb_mat(rows) * tau).exp().tolist()
    # Nothing falls in: s = t = up at the top, s + t = 0 and s = down at the bottom.
    both = [[row[j] + row[j + size] for j in range(size)] for row in across[: 2 * size]]
    s_of_up, t_of_up = arb_mat(both[:size]), arb_mat(both[size:])
    s_own = arb_mat([row[2 * size :] for row in across[:size]])
    t_own = arb_mat([row[2 * size :] for row in across[size : 2 * size]])
    up = (s_of_up + t_of_up).solve((s_own + t_own) * -1)
    return up, s_of_up * up + s_own
