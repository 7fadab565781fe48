"""Linear systems with A, the curvature of the joint sum, by conjugate gradients."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
from jaxtyping import Array, Float

from .linear import Linearised, joint_gradient
from .precision import Smoothness

NUM_DRAWS = 32
"""Draws of the posterior from which its covariance is estimated. [-]"""

# Conjugate gradients end at this share of the right side, far below a step's own tolerance.
_RELATIVE_RESIDUAL = 1e-6
_MAX_CG_STEPS = 2000

STUCK = 1e6
"""Damping of a pixel that is left where it is: a millionth of a step is none. [-]"""

Product = Callable[[Float[Array, "pixel x"]], Float[Array, "pixel x"]]


class JointStep(NamedTuple):
    """A damped step of Gauss and Newton.

    Parameters
    ----------
    step
        Of z; none of pixels that are `STUCK`. [-]
    square
        In the metric of A, of the step without damping as far as a pixel's own part tells. [-]
    own
        The same of each pixel alone, its neighbours where they are. [-]
    """

    step: Float[Array, "pixel x"]
    square: Float[Array, ""]
    own: Float[Array, " pixel"]


def system(
    here: Linearised, smooth: Smoothness, damping: Float[Array, " pixel"] | float = 0.0
) -> tuple[Product, Float[Array, "pixel x x"], Float[Array, "pixel x x"]]:
    """Products with A, the inverses of its diagonal blocks, and these; damped by shares of them,
    which each pixel may have of its own.
    """
    normal = jnp.einsum("pbx,pby->pxy", here.jacobian, here.jacobian)
    unit = jnp.eye(normal.shape[-1], dtype=normal.dtype)
    blocks = normal + smooth.diagonal()[:, None, None] * unit
    more = jnp.asarray(damping, normal.dtype)[..., None, None] * blocks
    damped = normal + more

    def matrix(v: Float[Array, "pixel x"]) -> Float[Array, "pixel x"]:
        return jnp.einsum("pxy,py->px", damped, v) + smooth(v)

    return matrix, jnp.linalg.inv(blocks + more), blocks


def solved(matrix: Product, inverse_blocks: Array, right: Float[Array, "pixel x"]) -> Array:
    """A^-1 times a vector, by conjugate gradients from the inverses of A's diagonal blocks."""
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
def joint_step(
    here: Linearised, smooth: Smoothness, z: Array, damping: Float[Array, " pixel"]
) -> JointStep:
    """The step from z where each pixel is damped by shares of its diagonal block. [-]"""
    matrix, inverse_blocks, blocks = system(here, smooth, damping)
    step = solved(matrix, inverse_blocks, -joint_gradient(here, smooth, z))
    step = jnp.where((damping < STUCK)[:, None], step, 0)
    whole = (1 + damping)[:, None] * step
    undamped, _, _ = system(here, smooth)
    own = jnp.einsum("px,pxy,py->p", whole, blocks, whole)
    return JointStep(step, jnp.sum(whole * undamped(whole)), own)


@eqx.filter_jit
def posterior_blocks(here: Linearised, smooth: Smoothness, key: Array) -> Float[Array, "pixel x x"]:
    """Diagonal blocks of the inverse of A, estimated. [-]"""
    matrix, inverse_blocks, blocks = system(here, smooth)

    def conditional_mean(key: Array) -> Float[Array, "pixel x"]:
        one, two = jax.random.split(key)
        noise = jax.random.normal(one, here.residual.shape, here.residual.dtype)
        field = jax.random.normal(two, blocks.shape[:2], blocks.dtype)
        right = jnp.einsum("pbx,pb->px", here.jacobian, noise) + smooth.transposed_root(field)
        draw = solved(matrix, inverse_blocks, right)
        others = matrix(draw) - jnp.einsum("pxy,py->px", blocks, draw)
        return -jnp.einsum("pxy,py->px", inverse_blocks, others)

    means = jax.lax.map(conditional_mean, jax.random.split(key, NUM_DRAWS))
    return inverse_blocks + jnp.einsum("dpx,dpy->pxy", means, means) / NUM_DRAWS
