r"""Quotients as exact along isotropic light as what is absorbed of it, in single precision.

Where next to nothing is absorbed, the smallest eigenvalue of :math:`S` in a quotient
:math:`N = S^{-1}R` is as many times below the others as the layer is deep, and lies along the
vector 1 of isotropic light. There elimination leaves N wrong by rounding times that ratio. The
value of a reflectance does not ask for N along 1, but slopes do: it is the light at depth. As S and
R are symmetric,

.. math:: (S1)^T N = (R1)^T,

and S 1 and R 1 are known from what is kept of isotropic light (`absorption`): y, and

.. math::
   Z1 = B^{-1}1 + h^2C1, \qquad Z1 \leftarrow Z1 + hy, \qquad
   S1 = hy + \tfrac12(Z1 + hy_e)

at the start of half a layer, with a doubling, and where a layer is put on a stack. So N is moved
along 1 until that holds, an equation a column of N. Slopes alone need it (`gradient.isotropic`).
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.algebra import Rows, fenced, total
from .bordered import Bordered, Vector
from .ground import isotropic
from .quadrature import node_scales
from .quotient import Quotient


def impeded(b_inverse: Bordered, fraction: Bordered, square: Float[Array, "*batch"]) -> Vector:
    """Z 1 of the start of half a layer, `square` being its h^2."""
    one = isotropic(2 * b_inverse.core.shape[0], jnp.ones_like(b_inverse.diagonal))
    return b_inverse @ one + square * (fraction @ one)


def refined(quotient: Quotient, middle: Vector, right: Vector) -> Quotient:
    """The quotient, right along 1, from ``middle 1`` and ``right 1``.

    Of a beam's column b of N, whose source is without what passes (`quotient.Quotient`), the
    equation is ``(S1)^T N_b = (R1)_b - (S1)_b ratio_b``: the beam's own entries cancel.
    """
    core, border = quotient.core.blocks, quotient.border.blocks
    passed = quotient.ratio, middle.beams
    of_nodes = _missing(right.nodes, core, middle.nodes)
    of_beams = _missing(right.beams, border, middle.nodes, passed)
    parts = _moved(core, of_nodes), _moved(border, of_beams)
    return eqx.tree_at(lambda q: (q.core, q.border), quotient, parts)


@fenced
def _missing(wanted, blocks, nodes, passed=None):
    """Of the equation above, over 1^T S 1."""
    rows = [block[k] for block in blocks for k in range(block.shape[0])]
    terms = [row * nodes[k] for k, row in enumerate(rows)]
    if passed is not None:
        terms.append(passed[0] * passed[1])
    one = [float(x) * nodes[k] for k, x in enumerate(node_scales(2 * len(rows)))]
    return (wanted - total(terms)) / total(one)


def _moved(blocks, missing):
    moved, start, one = [], 0, node_scales(2 * sum(len(x) for x in blocks))
    for block in blocks:
        own = one[start : start + len(block)].reshape(-1, *(1,) * (block.ndim - 1))
        moved.append(_plus(block, own.astype(block.dtype), missing))
        start += len(block)
    return Rows(tuple(moved))


@fenced
def _plus(block, own, missing):
    return block + own * missing
