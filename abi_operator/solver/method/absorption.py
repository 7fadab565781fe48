r"""What layers absorb of isotropic light, kept beside their matrices in single precision.

With the vector 1 of isotropic light, Y 1 is what a layer or a stack absorbs of it, hence emits.
Where next to nothing is absorbed it is a difference of numbers of order 1, of which rounding leaves
a false co-albedo that doubles with every doubling: in single precision layers of 500 that absorb
nothing emitted 1e-4 of what a black body does. So single precision carries :math:`y = Y1` along,

.. math::
   y = ha - h^3 C Z^{-1} a, \quad a = A1, \qquad y \leftarrow 2(y - hYZ^{-1}y), \qquad
   y \leftarrow y + 2y_e - h(Y + Y_e)S^{-1}(y + y_e)

for the start of half a layer, a doubling, and a layer that is put on a stack (`layer`, `adding`).
All are proportional to the co-albedo, and Y's diagonal and its beams' rows are set by y: Y is wrong
by what rounding leaves of numbers of order 1, whatever the depth. It is made symmetric as well,
since what is not would double, too.

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

from ...machine.algebra import fenced, total
from .bordered import Bordered, Vector, combined
from .doublings import Doublings, repeated
from .layer import half_layer, rational_start
from .quadrature import half_range
from .quotient import Quotient, minus_and_quotient


class Absorbed(NamedTuple):
    """Of half a layer.

    Parameters
    ----------
    ones
        y.
    lag
        z 1.
    """

    ones: Vector
    lag: Vector


def is_kept(dtype: jnp.dtype) -> bool:
    """Whether y is carried along in this precision."""
    return dtype == jnp.float32


def absorbed(
    coalbedo: Float[Array, "*batch"], secants: Float[Array, "beam *batch"], num_nodes: int
) -> Vector:
    """``A 1`` of the azimuthal mean."""
    mu, weight = half_range(2 * num_nodes)
    of_nodes = np.sqrt(weight / mu).reshape(-1, *(1,) * coalbedo.ndim)
    return Vector(jnp.asarray(of_nodes, coalbedo.dtype) * coalbedo, coalbedo * secants)


def emitting_half_layer(
    a: Bordered,
    b_inverse: Bordered,
    tau: Float[Array, "*batch"],
    doublings: Doublings,
    ones: Vector,
    one: Vector,
) -> tuple[Bordered, Bordered, Absorbed | None]:
    """`layer.half_layer` of the mean, and what it absorbs where that is kept, from A 1 and 1."""
    if not is_kept(tau.dtype):
        return *half_layer(a, b_inverse, tau, doublings), None
    return _half_layer(a, b_inverse, tau, ones, one, doublings)


@jax.custom_jvp
def _half_layer(a, b_inverse, tau, ones, one, doublings):
    number, step, start = doublings.of_layer()
    h = tau * step
    square = h * h
    fraction, impedance = rational_start(a, b_inverse, h, start)
    admittance, quotient = minus_and_quotient([(h, a)], h * square, a, impedance, fraction)
    ones = h * less(ones, square, quotient, ones)
    absorbed = Absorbed(ones, h * (fraction @ one))
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
    lag = 0.5 * (lag + ones)
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
    both = below + layer.ones
    driving = column + planck_jump * (below + both + layer.lag)
    return less(column + 2 * planck_jump * both, h, quotient, driving)


def less(
    base: Vector, factor: Float[Array, "*batch"], quotient: Quotient, vector: Vector
) -> Vector:
    """``base - factor quotient^T vector``."""
    return base - factor * quotient.transposed_action(vector)


def through(left: Bordered, middle: Bordered, quotient: Quotient, vector: Vector) -> Vector:
    """``left middle^-1 vector``, of a quotient that was found with the vector's nodes."""
    nodes = quotient.responses[0].joined()[:, 0]
    return left @ Vector(nodes, _beams(vector.beams, middle.border, quotient.over, nodes))


@fenced
def _beams(beams, border, over, nodes):
    return (beams - total(border * nodes[:, None])) * over


def absorbing(matrix: Bordered, ones: Vector) -> Bordered:
    """The same matrix with ``matrix 1 = ones``, as it is but for rounding."""
    core, border = _absorbing(matrix.core, matrix.border, matrix.diagonal, ones)
    return Bordered(core, border, matrix.diagonal, matrix.corner)


@fenced
def _absorbing(core, border, diagonal, ones):
    mu, weight = half_range(2 * core.shape[0])
    s = np.sqrt(weight * mu).tolist()
    share = (np.sqrt(weight * mu) / np.sum(weight * mu)).tolist()
    number = range(len(s))
    core = 0.5 * (core + jnp.swapaxes(core, 0, 1))
    beams = ones.beams - diagonal - total([s[i] * border[i] for i in number])
    nodes = [ones.nodes[i] - total([s[j] * core[i, j] for j in number]) for i in number]
    # Where nearly all is absorbed the matrix is the nearer of both: what it leaves is small itself.
    beams = jnp.clip(1 - ones.beams, 0, 1) * beams
    nodes = [jnp.clip(1 - ones.nodes[i] / s[i], 0, 1) * nodes[i] for i in number]
    nodes = [x / s[i] for i, x in enumerate(nodes)]
    rows = [[core[i, j] + nodes[i] if i == j else core[i, j] for j in number] for i in number]
    border = jnp.stack([border[i] + share[i] * beams for i in number])
    return jnp.stack([jnp.stack(row) for row in rows]), border
