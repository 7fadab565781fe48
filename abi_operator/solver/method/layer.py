r"""One homogeneous layer and one azimuth mode, without eigenvalues.

With s = up + down and t = up - down, the discrete-ordinate equations of a layer are

.. math::
   dt/d\tau = A s, \quad A = M^{-1}(1 - P_e W), \qquad ds/d\tau = B t, \quad B = M^{-1}(1 - P_o W),

where P_e keeps the degrees with even l + m and P_o the odd ones. A layer of thickness tau = 2h acts
through the admittance Y and the impedance of its half,

.. math::
   Y = hA\,\varphi(h^2BA), \qquad Z = \varphi(h^2BA)^{-1} B^{-1}, \qquad
   \varphi(x) = \tanh(\sqrt x)/\sqrt x .

phi is even in the square root, hence smooth: there is nothing to diagonalise, nothing special about
ssa = 1 (a zero eigenvalue), and every derivative exists. A rational phi serves thin layers; a thick
one starts from its 2^K-th part and doubles K times by the addition theorem of tanh (`doublings`).
Nothing is divided by h, so that empty layers need no care.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...machine.algebra import matmul, total, weighted_sum
from .bordered import Bordered, combined
from .doublings import Doublings, repeated
from .legendre import associated_legendre
from .quadrature import half_range, node_scales
from .quotient import minus_quotient


class ModeKernels(eqx.Module):
    """Legendre functions from which one azimuth mode builds A or B of every layer.

    Only degrees of one parity are present: those with even l + m build A, the others build B.
    Nodes carry the factor sqrt(w / mu).

    Parameters
    ----------
    pairs
        Products for two nodes.
    nodes
        Functions at the nodes.
    beams
        Functions at the beams over their cosines: the sun first, then the views.
    """

    pairs: Float[Array, "node node degree"]
    nodes: Float[Array, "node degree"]
    beams: Float[Array, "beam degree *batch"]


def node_functions(num_streams: int, num_modes: int) -> np.ndarray:
    """Legendre functions of the nodes times sqrt(w / mu), axes ``mode degree node``, float64."""
    mu, weight = half_range(num_streams)
    return np.asarray(associated_legendre(num_modes, num_streams, mu)) * np.sqrt(weight / mu)


def layer_matrix(
    kernels: ModeKernels,
    moments: Float[Array, "degree *batch"],
    secants: Float[Array, "beam *batch"],
    single_scattering: bool,
) -> Bordered:
    r"""Build A (or B) of one layer from the moments of its parity.

    Parameters
    ----------
    kernels
        Legendre functions of the degrees of this parity.
    moments
        :math:`\omega(2l+1)\chi_l` of the same degrees.
    secants
        By which the beams are attenuated: 1 / mu0, or the layer's own for a sun over a spherical
        Earth, and 1 / mu of each view.
    single_scattering
        Whether sun -> view is scattered here; False where single scattering is added exactly.
    """
    num_nodes = kernels.nodes.shape[0]
    mu = jnp.asarray(half_range(2 * num_nodes)[0], moments.dtype)
    minus = -moments
    core = weighted_sum(kernels.pairs, minus, jnp.diag(1 / mu))
    weighted = jnp.swapaxes(minus * kernels.beams, 0, 1)
    border = weighted_sum(kernels.nodes, weighted)
    corner = jnp.zeros_like(secants[1:])
    if single_scattering:
        both = minus * kernels.beams[0] * kernels.beams[1:]
        corner = total([both[:, k] for k in range(both.shape[1])])
    return Bordered(core, border, secants, corner)


def conservative(matrix: Bordered, coalbedo: Float[Array, "*batch"]) -> Bordered:
    r"""Rebuild the diagonal of A's core in mode 0 from the co-albedo.

    The quadrature integrates the phase function exactly, so that the core's rows, weighted by
    :math:`s = \sqrt{w\mu}`, sum to :math:`(1-\omega)s/\mu`. Forming the diagonal as that sum
    minus the other entries keeps a co-albedo far below the rounding error of 1 - ssa P.
    """
    num_nodes = matrix.core.shape[0]
    mu = half_range(2 * num_nodes)[0]
    expand = (num_nodes,) + (1,) * coalbedo.ndim
    s = jnp.asarray(node_scales(2 * num_nodes), coalbedo.dtype).reshape(expand)
    diagonal = jnp.eye(num_nodes, dtype=bool).reshape(*expand[:1], *expand)
    others = jnp.where(diagonal, 0, matrix.core)
    row_sum = coalbedo / jnp.asarray(mu, coalbedo.dtype).reshape(expand)
    entry = row_sum - matmul(others, s[:, None])[:, 0] / s
    core = jnp.where(diagonal, entry[:, None], matrix.core)
    return eqx.tree_at(lambda m: m.core, matrix, core)


def half_layer(
    a: Bordered, b_inverse: Bordered, tau: Float[Array, "*batch"], doublings: Doublings
) -> tuple[Bordered, Bordered]:
    r"""Admittance Y and h-fold impedance Z of half a layer, from A and the inverse of B.

    The start is rational,

    .. math::
       \varphi(x)^{-1} = 1 + x\left(\frac13 - \frac{x/9}{5 + dx}\right),

    with d of `doublings.start_coefficient`. With x = h^2 BA and matrices that stay symmetric,
    :math:`C = A/3 - (h^2/9) A (5B^{-1} + dh^2A)^{-1}A`, Z = B^-1 + h^2 C and
    :math:`Y = hA - h^3 A Z^{-1} C`. Doubling is

    .. math:: Z_{2h} = Z_h + h Y_h, \qquad Y_{2h} = 2 (Y_h - h Y_h Z_{2h}^{-1} Y_h).

    Returns
    -------
    Y (tanh) and Z = h coth in the same units, with h = tau / 2.
    """
    return _half_layer(a, b_inverse, tau, doublings)


def rational_start(
    a: Bordered, b_inverse: Bordered, h: Float[Array, "*batch"], d: float | Float[Array, ""]
) -> tuple[Bordered, Bordered]:
    """C and Z of the start of `half_layer`."""
    square = h * h
    inner = combined([5.0, d * square], [b_inverse, a])
    fraction = minus_quotient([(1 / 3, a)], square / 9, a, inner, a)
    return fraction, combined([1.0, square], [b_inverse, fraction])


@jax.custom_jvp
def _half_layer(a, b_inverse, tau, doublings):
    number, step, start = doublings.of_layer()
    h = tau * step
    fraction, impedance = rational_start(a, b_inverse, h, start)
    admittance = minus_quotient([(h, a)], h * h * h, a, impedance, fraction)
    admittance, impedance, _ = repeated(_doubled, number, (admittance, impedance, h))
    return admittance, impedance


@_half_layer.defjvp
def _half_layer_jvp(primals, tangents):
    *primals, doublings = primals
    written_out = partial(_half_layer.fun, doublings=doublings.written_out())
    return jax.jvp(written_out, tuple(primals), tangents[:3])


def _doubled(_, carry):
    admittance, impedance, h = carry
    impedance = combined([1.0, h], [impedance, admittance])
    admittance = minus_quotient([(2.0, admittance)], 2 * h, admittance, impedance, admittance)
    return admittance, impedance, 2 * h
