"""How much scattering without absorption single precision can tell from none.

A stack's admittance falls as one over its depth where nothing is absorbed (`adding`), and is there
a difference of numbers of order 1. So its relative error is that of rounding times the depth:
reflectances in single precision are right to 5e-4 at a depth of 1,000, and mean nothing from some
30,000 on, where the difference has neither a right digit nor a sign. In double precision they are
right to 1e-9 at 1e7.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

# Co-albedo up to which light is scattered so often that depth counts: where more is absorbed than
# this, what lies deeper than a few hundred is not seen. [-]
_CONSERVATIVE = 1e-5
_DEEPEST = 1e4


def within_single_precision(
    tau: Float[Array, "layer *batch"], coalbedo: Float[Array, "layer *batch"]
) -> Float[Array, "*batch"]:
    """1 where single precision is enough for a column, else NaN: a factor of its optical depths.

    Parameters
    ----------
    tau, coalbedo
        Optical depth and 1 - ssa of the layers as they are solved. [-]
    """
    deep = jnp.sum(jnp.where(coalbedo < _CONSERVATIVE, tau, jnp.zeros_like(tau)), axis=0)
    number = tau.dtype.type  # which Python's numbers would not have
    return jnp.where(deep > number(_DEEPEST), number(jnp.nan), number(1))
