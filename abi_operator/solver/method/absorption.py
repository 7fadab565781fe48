r"""What layers absorb of isotropic light, kept beside their matrices in single precision.

With the vector 1 of isotropic light, Y 1 is what a layer or a stack absorbs of it, hence emits.
Where next to nothing is absorbed it is a difference of numbers of order 1, of which rounding leaves
a false co-albedo that doubles with every doubling: in single precision layers of 500 that absorb
nothing emitted 1e-4 of what a black body does, sunlight that layers of 1e3 send back was off by as
much, and its slopes in what little they absorb by a fiftieth. So single precision carries
:math:`y = Y1` along,

.. math::
   y = ha - h^3 C Z^{-1} a, \quad a = A1, \qquad y \leftarrow 2(y - hYZ^{-1}y), \qquad
   y \leftarrow y + 2y_e - h(Y + Y_e)S^{-1}(y + y_e)

for the start of half a layer, a doubling, and a layer that is put on a stack (`layer`, `adding`).
It is the azimuthal mean's alone. All are proportional to the co-albedo, but at a sun through a
sphere (`of_layer`), and Y's diagonal and its beams' rows are set by y: Y is wrong by what rounding
leaves of numbers of order 1, whatever the depth. It is made symmetric as well, since what is not
would double, too.

With y light that is emitted is found from what absorbs it alone. As :math:`Z - B^{-1} = hz` with a
finite z, a layer across which the Planck function increases by D, J = D 1, changes e of `adding` to

.. math::
   e \leftarrow e + 2D(y + y_e) - h(Y + Y_e)S^{-1}(e + D(2y + y_e + z1)), \qquad
   z1 = hC1, \qquad z1 \leftarrow (z1 + y)/2

at the start and with a doubling. `adding`'s own way is through :math:`S^{-1}j`, J twice but for
rounding times the spread of the cosines. Double precision goes without all of this.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...machine.algebra import Rows, fenced, total, transpose
from .bordered import Bordered, Vector, combined
from .doublings import Doublings, repeated
from .ground import isotropic
from .layer import ModeKernels, rational_start
from .quadrature import half_range, node_scales
from .quotient import Quotient, minus_and_quotient


class Absorbed(NamedTuple):
    """Of half a layer.

    Parameters
    ----------
    ones
        y.
    lag
        z 1; None where nothing is emitted.
    """

    ones: Vector
    lag: Vector | None


def of_ground(ground: Bordered, absorbed: Float[Array, "*batch"] | None = None) -> Vector | None:
    """y of the ground in the azimuthal mean; None in precisions that go without it.

    Its matrix gives that but for rounding of numbers of order 1, which slopes under layers that
    absorb nothing are as many times off by as those are deep: of a Lambertian ground it is known
    better (`ground.absorbed_by_lambertian`).
    """
    if ground.core.dtype != jnp.float32:
        return None
    one = isotropic(2 * ground.core.shape[0], jnp.ones_like(ground.diagonal))
    return ground @ one if absorbed is None else absorbed.astype(jnp.float32) * one


def of_layer(
    coalbedo: Float[Array, "*batch"], secants: Float[Array, "beam *batch"], kernels: ModeKernels
) -> Vector:
    r"""``A 1`` of a layer in the azimuthal mean, whose kernels of A tell where the beams are.

    :math:`(1-\omega)/\mu` and, of a sun through a sphere, what its secant has over 1 / mu0:
    light of a beam whose secant is not 1 / mu is lost or won without being absorbed. In a plane
    that is nothing, and must be nothing to the last digit where layers absorb nothing at depths of
    1e5, so that what rounding leaves of the difference does not count.
    """
    mu, weight = half_range(2 * kernels.nodes.shape[0])
    of_nodes = np.sqrt(weight / mu).reshape(-1, *(1,) * coalbedo.ndim)
    over_cosines = kernels.beams[:, 0]  # The first Legendre function is 1.
    more = secants - over_cosines
    # What is left out has a slope all the same.
    rounding = jnp.where(jnp.abs(more) <= 4 * jnp.finfo(more.dtype).eps * secants, more, 0)
    more = more - jax.lax.stop_gradient(rounding)
    return Vector(jnp.asarray(of_nodes, coalbedo.dtype) * coalbedo, coalbedo * over_cosines + more)


def absorbing_half_layer(
    a: Bordered,
    b_inverse: Bordered,
    tau: Float[Array, "*batch"],
    doublings: Doublings,
    ones: Vector,
    one: Vector | None = None,
) -> tuple[Bordered, Bordered, Absorbed]:
    """`layer.half_layer` of the mean, and what it absorbs, from A 1; its lag from 1 as well."""
    return _half_layer(a, b_inverse, tau, ones, one, doublings)


@jax.custom_jvp
def _half_layer(a, b_inverse, tau, ones, one, doublings):
    number, step, start = doublings.of_layer()
    h = tau * step
    square = h * h
    fraction, impedance = rational_start(a, b_inverse, h, start)
    admittance, quotient = minus_and_quotient([(h, a)], h * square, a, impedance, fraction)
    ones = h * less(ones, square, quotient, ones)
    absorbed = Absorbed(ones, None if one is None else h * (fraction @ one))
    carry = absorbing(admittance, ones), impedance, absorbed, h
    admittance, impedance, absorbed, _ = repeated(_doubled, number, carry)
    return admittance, impedance, absorbed


@_half_layer.defjvp
def _half_layer_jvp(primals, tangents):
    *primals, doublings = primals
    written_out = partial(_half_layer.fun, doublings=doublings.written_out())
    return jax.jvp(written_out, tuple(primals), tangents[:5])


def _doubled(_, carry):
    admittance, impedance, (ones, lag), h = carry
    impedance = combined([1.0, h], [impedance, admittance])
    twice = [(2.0, admittance)]
    admittance, quotient = minus_and_quotient(twice, 2 * h, admittance, impedance, admittance)
    lag = None if lag is None else 0.5 * (lag + ones)
    ones = 2.0 * less(ones, h, quotient, ones)
    return absorbing(admittance, ones), impedance, Absorbed(ones, lag), 2 * h


def of_stack(below: Vector, layer: Vector, h: Float[Array, "*batch"], quotient: Quotient) -> Vector:
    """y of a stack with a layer on it, from those of both and the quotient of `adding`."""
    return less(below + 2.0 * layer, h, quotient, below + layer)


def emitted(
    column: Vector,
    planck_jump: Float[Array, "*batch"],
    below: Vector,
    layer: Absorbed,
    h: Float[Array, "*batch"],
    quotient: Quotient,
) -> Vector:
    """e of a stack with a layer on it, from e and y of the stack; see the head of this file."""
    assert layer.lag is not None
    both = below + layer.ones
    driving = column + planck_jump * (below + both + layer.lag)
    return less(column + 2 * planck_jump * both, h, quotient, driving)


def less(
    base: Vector, factor: Float[Array, "*batch"], quotient: Quotient, vector: Vector
) -> Vector:
    """``base - factor quotient^T vector``."""
    core, border = (_rows(x) for x in (quotient.core, quotient.border))
    nodes = _less(base.nodes, factor, core, vector.nodes)
    passed = quotient.ratio, vector.beams
    return Vector(nodes, _less(base.beams, factor, border, vector.nodes, passed))


def _rows(matrix):
    """As arrays, however many there are of each."""
    return matrix.blocks if isinstance(matrix, Rows) else (matrix,)


@fenced
def _less(base, factor, blocks, nodes, passed=None):
    rows = [block[k] for block in blocks for k in range(block.shape[0])]
    terms = [row * nodes[k] for k, row in enumerate(rows)]
    if passed is not None:
        terms.append(passed[0] * passed[1])
    return base - factor * total(terms)


def through(left: Bordered, middle: Bordered, quotient: Quotient, vector: Vector) -> Vector:
    """``left middle^-1 vector``, of a quotient that was found with the vector's nodes."""
    nodes = quotient.responses[0].joined()[:, 0]
    return left @ Vector(nodes, _beams(vector.beams, middle.border, quotient.over, nodes))


@fenced
def _beams(beams, border, over, nodes):
    return (beams - total(border * nodes[:, None])) * over


def absorbing(matrix: Bordered, ones: Vector) -> Bordered:
    """The same matrix with ``matrix 1 = ones``, as it is but for rounding."""
    core = _absorbing_core(matrix.core, _missing_at_nodes(matrix.core, ones.nodes))
    missing = _missing_at_beams(matrix.border, matrix.diagonal, ones.beams)
    return Bordered(core, _absorbing_border(matrix.border, missing), matrix.diagonal, matrix.corner)


# Where nearly all is absorbed the matrix is the nearer of both, since what it leaves is small
# itself: less of what is missing is made up for.
@fenced
def _missing_at_nodes(core, ones):
    s, expand = _isotropic(core)
    both = [float(s[j]) * (core[:, j] + core[j]) for j in range(len(s))]
    own = (1 / s).reshape(expand).astype(core.dtype)
    return jnp.clip(1 - ones * own, 0, 1) * (ones - 0.5 * total(both)) * own


@fenced
def _missing_at_beams(border, diagonal, ones):
    s, _ = _isotropic(border)
    given = [float(s[i]) * border[i] for i in range(len(s))]
    return jnp.clip(1 - ones, 0, 1) * (ones - diagonal - total(given))


@fenced
def _absorbing_core(core, missing):
    one = np.eye(len(missing)).reshape(*core.shape[:2], *(1,) * (missing.ndim - 1))
    return 0.5 * (core + transpose(core)) + one.astype(core.dtype) * missing[:, None]


@fenced
def _absorbing_border(border, missing):
    s, expand = _isotropic(border)
    share = (s / np.sum(s * s)).reshape(*expand[:1], 1, *expand[1:])
    return border + share.astype(border.dtype) * missing


def _isotropic(like):
    """Nodes of the vector 1, and their shape with a batch."""
    scales = node_scales(2 * like.shape[0])
    return scales, (scales.size, *(1,) * (like.ndim - 2))
