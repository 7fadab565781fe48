r"""A whole image at once: neighbours are alike, and what one measures tells of the others.

With z, x whitened by the prior of single pixels (`inverse`), each of its elements is a field over
the pixels, of which the prior is one of Matern's with smoothness 1: its precision over a grid is

.. math:: Q = c\,(1 - \ell^2 \Delta)^2

(F. Lindgren, H. Rue and J. Lindstrom [1]_, section 2.2), with the Laplacian :math:`\Delta` over
neighbours in x and y, the correlation length :math:`\ell` in pixels, at which the correlation has
fallen to 0.60 (0.58 on a grid of three pixels a length), and c such that the variance is 1 amid a
large image: single pixels keep their own prior. Next to pixels that are not retrieved the slope is
zero and the variance larger.

Minimised is the sum over all pixels,

.. math:: \sum_p |r_p(z_p)|^2 + \sum_k z_k^T Q z_k,

by steps of Gauss and Newton, damped where they would not descend, from the solutions of single
pixels. As each pixel's residuals depend on its own z alone, :math:`J^T J` is a small block for each
of them, and :math:`A = J^T J + Q` is never stored: conjugate gradients (lineax), preconditioned by
A's diagonal blocks, ask for products with it.

The diagonal blocks of the posterior covariance :math:`A^{-1}` are estimated from draws s of it,

.. math:: A s = J^T \epsilon + Q^{1/2} \eta, \qquad
   A^{-1}_{pp} \approx A_{pp}^{-1} + \overline{m_p m_p^T}, \qquad
   m_p = -A_{pp}^{-1} (A s - A_{pp} s)_p,

where of each draw only the mean of a pixel given its neighbours is used (P. Siden et al. [2]_).

References
----------
.. [1] "An explicit link between Gaussian fields and Gaussian Markov random fields: the stochastic
   partial differential equation approach", J. R. Stat. Soc. B, 73, 423-498, 2011,
   doi:10.1111/j.1467-9868.2011.00777.x
.. [2] "Efficient covariance approximations for large sparse precision matrices", J. Comput. Graph.
   Stat., 27, 898-909, 2018, doi:10.1080/10618600.2018.1473782
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from abi_operator import State
from abi_operator.machine.speed import Kept

from .chunks import map_chunks
from .forward import ForwardModel
from .input_checks import checked
from .inverse import DEFAULT_MINIMISER, Inversion, Minimiser, value_and_jacobian
from .observation import Observation
from .pixels import Retrieved, retrieve_pixels
from .prior import Prior
from .quality import result_codes
from .results import ResultCode

NUM_DRAWS = 32
"""Draws of the posterior from which its covariance is estimated. [-]"""

# Conjugate gradients end at this share of the right side, far below a step's own tolerance.
_RELATIVE_RESIDUAL = 1e-6
_MAX_CG_STEPS = 2000
_DAMPING = 10.0  # by which the damping grows where a step fails, and shrinks where one succeeds
_KEPT = (ResultCode.INVALID_INPUT, ResultCode.NONFINITE, ResultCode.TOO_FEW_BANDS)


class Smoothness(eqx.Module):
    """The precision Q of one field over the pixels that are retrieved.

    Parameters
    ----------
    one, other
        Ends of each pair of neighbours, as rows of the pixels.
    length
        Correlation length. [pixel]
    scale
        c. [-]
    """

    one: Int[Array, " pair"]
    other: Int[Array, " pair"]
    length: Float[Array, ""]
    scale: Float[Array, ""]

    def root(self, z: Float[Array, "pixel *x"]) -> Float[Array, "pixel *x"]:
        """The symmetric root of Q times fields. [-]"""
        slope = z[self.other] - z[self.one]
        laplacian = jnp.zeros_like(z).at[self.one].add(slope).at[self.other].add(-slope)
        return jnp.sqrt(self.scale) * (z - self.length**2 * laplacian)

    def __call__(self, z: Float[Array, "pixel *x"]) -> Float[Array, "pixel *x"]:
        """Q times fields. [-]"""
        return self.root(self.root(z))

    def diagonal(self, num_pixels: int) -> Float[Array, " pixel"]:
        """Of Q: of the root r the squares of a row, r_pp and one of each neighbour. [-]"""
        nothing = jnp.zeros(num_pixels, self.scale.dtype)
        neighbours = nothing.at[self.one].add(1).at[self.other].add(1)
        far = self.length**2
        return self.scale * ((1 + far * neighbours) ** 2 + far**2 * neighbours)


def smoothness(chosen: Bool[np.ndarray, "*image y x"], length: float) -> Smoothness:
    """The precision over the pixels of images.

    Parameters
    ----------
    chosen
        Pixels that are retrieved, whose rows are in this order; those of several images are none
        of each other's neighbours.
    length
        Correlation length, above 0. [pixel]

    Raises
    ------
    ValueError
        If the length is not above 0 and finite.
    """
    if not (length > 0 and np.isfinite(length)):
        raise ValueError(f"the length of smoothness must be above 0 pixels; got {length}.")
    rows = np.full(chosen.shape, -1)
    rows[chosen] = np.arange(np.count_nonzero(chosen))
    pairs = [
        (rows[..., :, :-1], rows[..., :, 1:]),
        (rows[..., :-1, :], rows[..., 1:, :]),
    ]
    one, other = (np.concatenate([pair[i].ravel() for pair in pairs]) for i in (0, 1))
    both = (one >= 0) & (other >= 0)
    dtype = jax.dtypes.canonicalize_dtype(np.float64)
    return Smoothness(
        jnp.asarray(one[both]),
        jnp.asarray(other[both]),
        jnp.asarray(length, dtype),
        jnp.asarray(_scale(length), dtype),
    )


def _scale(length: float) -> float:
    """c: the mean over all waves of a grid of the variance that each has with c = 1. [-]"""
    size = int(np.clip(2 ** np.ceil(np.log2(32 * length)), 64, 2048))
    wave = 2 - 2 * np.cos(2 * np.pi * np.arange(size) / size)
    return float(np.mean((1 + length**2 * (wave[:, None] + wave)) ** -2.0))


class Linearised(NamedTuple):
    """Whitened residuals of the measurements and their Jacobians in z, block by block."""

    residual: Float[Array | np.ndarray, "pixel band"]
    jacobian: Float[Array | np.ndarray, "pixel band x"]


def linearised(
    forward: ForwardModel,
    observations: Observation,
    states: State,
    prior: Prior,
    z: Float[np.ndarray, "pixel x"],
) -> Linearised:
    """Linearise the measurements of all pixels; one that is not finite tells nothing.

    Parameters
    ----------
    forward, observations, states
        As of `retrieve_pixels`, with measurements that can be used.
    prior
        One of each pixel.
    z
        Where. [-]
    """
    found = map_chunks(partial(_linearise_chunk, forward), prior, observations, states, z)
    fine = np.isfinite(found.residual).all(axis=1) & np.isfinite(found.jacobian).all(axis=(1, 2))
    return Linearised(
        np.where(fine[:, None], found.residual, 0),
        np.where(fine[:, None, None], found.jacobian, 0),
    )


@Kept
def _linearise_chunk(
    forward: ForwardModel,
    priors: Prior,
    observations: Observation,
    states: State,
    z: jax.Array,
) -> Linearised:
    def of_one(prior: Prior, observation: Observation, state: State, z: Array) -> Linearised:
        def residual(z: Array) -> Array:
            x = jnp.asarray(prior.x_prior) + prior.root @ z
            return observation.departure(forward, x, state)

        return Linearised(*value_and_jacobian(residual, z))

    return jax.vmap(of_one)(priors, observations, states, z)


def joint_cost(
    here: Linearised, smooth: Smoothness, z: Float[Array | np.ndarray, "pixel x"]
) -> float:
    """The sum that is minimised. [-]"""
    return float(jnp.sum(here.residual**2) + jnp.sum(smooth.root(jnp.asarray(z)) ** 2))


def joint_gradient(
    here: Linearised, smooth: Smoothness, z: Float[Array, "pixel x"]
) -> Float[Array, "pixel x"]:
    """Half of the derivative of the sum: J^T r + Q z. [-]"""
    return jnp.einsum("pbx,pb->px", here.jacobian, here.residual) + smooth(z)


def retrieve_smooth(
    forward: ForwardModel,
    observations: Observation,
    states: State,
    *,
    prior: Prior,
    smooth: Smoothness,
    minimiser: Minimiser = DEFAULT_MINIMISER,
    seed: int = 0,
) -> Retrieved:
    """Retrieve all pixels together.

    Parameters
    ----------
    forward, observations, states, prior
        As of `retrieve_pixels`; the prior is that of single pixels.
    smooth
        How neighbours are alike.
    minimiser
        That of the single pixels with which it begins; its tolerance is that of the joint steps,
        too: their root mean square in posterior standard deviations.
    seed
        Of the draws for the posterior covariance.

    Returns
    -------
    Retrieved
        As `retrieve_pixels`: a pixel's own share of the joint cost, its block of the posterior
        covariance and of the averaging kernel. What single pixels found as a second solution is
        not followed up.
    """
    alone = retrieve_pixels(forward, observations, states, prior=prior, minimiser=minimiser)
    num_values = observations.num_values
    _, usable, own = checked(forward, observations, prior)
    assert own is not None
    root = np.linalg.cholesky(own.S_prior)
    departure = np.asarray(alone.inversion.x) - np.asarray(own.x_prior)
    z = np.linalg.solve(root, departure[..., None])[..., 0]
    z = np.where(np.isfinite(z).all(axis=1, keepdims=True), z, 0)
    how = minimiser.chosen(True)
    z, here, steps, converged = _descended(
        partial(linearised, forward, usable, states, own),
        smooth,
        z,
        how.tolerance or 1e-2,
        how.max_steps,
    )
    blocks = _posterior_blocks(here, smooth, jax.random.key(seed))
    inversion = _inversion(own, root, z, here, smooth, np.asarray(blocks))
    inversion = eqx.tree_at(
        lambda i: (i.num_steps, i.converged),
        inversion,
        (np.asarray(alone.inversion.num_steps) + steps, np.full(len(z), converged)),
    )
    codes = result_codes(forward.vector, inversion, inversion, num_values, exact=False)
    codes = np.where(np.isin(alone.codes, _KEPT), alone.codes, codes).astype(np.int8)
    return Retrieved(inversion, codes, inversion)


def _descended(
    linearise: partial[Linearised],
    smooth: Smoothness,
    z: np.ndarray,
    tolerance: float,
    max_steps: int,
) -> tuple[np.ndarray, Linearised, int, bool]:
    """z at the minimum, what is linear there, evaluations, and whether it was reached."""
    here = linearise(z)
    cost, damping = joint_cost(here, smooth, z), 0.0
    for evaluation in range(1, max_steps + 1):
        step, square = _step(here, smooth, jnp.asarray(z), jnp.asarray(damping, z.dtype))
        if not np.isfinite(float(square)):
            return z, here, evaluation, False
        if damping < 1 and float(square) <= tolerance**2 * z.size:
            return z, here, evaluation, True
        there = z + np.asarray(step)
        moved = linearise(there)
        new = joint_cost(moved, smooth, there)
        if new <= cost:
            z, here, cost = there, moved, new
            damping = damping / _DAMPING if damping > 1e-3 else 0.0
        else:
            damping = max(damping * _DAMPING, 1e-2)
    return z, here, max_steps, False


@eqx.filter_jit
def _step(
    here: Linearised, smooth: Smoothness, z: Array, damping: Float[Array, ""]
) -> tuple[Float[Array, "pixel x"], Float[Array, ""]]:
    """A damped step of Gauss and Newton, and its square in the metric of A. [-]"""
    matrix, inverse_blocks, _ = _system(here, smooth, damping)
    step = _solved(matrix, inverse_blocks, -joint_gradient(here, smooth, z))
    return step, jnp.sum(step * matrix(step))


Product = Callable[[Float[Array, "pixel x"]], Float[Array, "pixel x"]]


def _system(
    here: Linearised, smooth: Smoothness, damping: Float[Array, ""] | float = 0.0
) -> tuple[Product, Float[Array, "pixel x x"], Float[Array, "pixel x x"]]:
    """Products with A, the inverses of its diagonal blocks, and these; damped by shares of them."""
    normal = jnp.einsum("pbx,pby->pxy", here.jacobian, here.jacobian)
    unit = jnp.eye(normal.shape[-1], dtype=normal.dtype)
    blocks = normal + smooth.diagonal(len(normal))[:, None, None] * unit
    damped = normal + damping * blocks

    def matrix(v: Float[Array, "pixel x"]) -> Float[Array, "pixel x"]:
        return jnp.einsum("pxy,py->px", damped, v) + smooth(v)

    return matrix, jnp.linalg.inv(blocks + damping * blocks), blocks


def _solved(matrix: Product, inverse_blocks: Array, right: Float[Array, "pixel x"]) -> Array:
    shape = jax.ShapeDtypeStruct(right.shape, right.dtype)
    tag = lx.positive_semidefinite_tag
    operator = lx.FunctionLinearOperator(matrix, shape, tag)
    precondition = lx.FunctionLinearOperator(
        lambda v: jnp.einsum("pxy,py->px", inverse_blocks, v), shape, tag
    )
    solver = lx.CG(_RELATIVE_RESIDUAL, 1e-12, max_steps=_MAX_CG_STEPS)
    options = {"preconditioner": precondition}
    return lx.linear_solve(operator, right, solver, options=options, throw=False).value


@eqx.filter_jit
def _posterior_blocks(
    here: Linearised, smooth: Smoothness, key: Array
) -> Float[Array, "pixel x x"]:
    """Diagonal blocks of the inverse of A, estimated. [-]"""
    matrix, inverse_blocks, blocks = _system(here, smooth)

    def conditional_mean(key: Array) -> Float[Array, "pixel x"]:
        one, two = jax.random.split(key)
        noise = jax.random.normal(one, here.residual.shape, here.residual.dtype)
        field = jax.random.normal(two, blocks.shape[:2], blocks.dtype)
        right = jnp.einsum("pbx,pb->px", here.jacobian, noise) + smooth.root(field)
        draw = _solved(matrix, inverse_blocks, right)
        others = matrix(draw) - jnp.einsum("pxy,py->px", blocks, draw)
        return -jnp.einsum("pxy,py->px", inverse_blocks, others)

    means = jax.lax.map(conditional_mean, jax.random.split(key, NUM_DRAWS))
    return inverse_blocks + jnp.einsum("dpx,dpy->pxy", means, means) / NUM_DRAWS


def _inversion(
    prior: Prior,
    root: np.ndarray,
    z: np.ndarray,
    here: Linearised,
    smooth: Smoothness,
    blocks: np.ndarray,
) -> Inversion:
    """Of x, pixel by pixel."""
    normal = np.einsum("pbx,pby->pxy", here.jacobian, here.jacobian)
    kernel = root @ blocks @ normal @ np.linalg.inv(root)
    rough = np.asarray(smooth.root(jnp.asarray(z)))
    covariance: Any = root @ blocks @ np.swapaxes(root, 1, 2)
    nothing: Any = np.zeros(len(z), int)  # whoever calls knows
    return Inversion(
        x=prior.x_prior + np.einsum("pxy,py->px", root, z),
        covariance=covariance,
        averaging_kernel=kernel,
        measurement_cost=np.sum(np.asarray(here.residual) ** 2, axis=1),
        prior_cost=np.sum(rough**2, axis=1),
        num_steps=nothing,
        converged=nothing == 0,
    )
