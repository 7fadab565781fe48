"""What single precision is enough for.

A stack's admittance falls as one over its depth where nothing is absorbed (`adding`), and is there
a difference of numbers of order 1, of which single precision has what is absorbed beside it
(`absorption`). So reflectances in single precision are as near at a depth of 1e5 as at 10, where
quotients end by substitution (`machine.elimination.Pair`), and slopes in what layers and ground
absorb are as near, too (`refinement`). Slopes in a layer's depth and moments are sums of terms as
many times as large as it is deep: of the change that doubling the depth makes, rounding leaves that
many times 1e-8 of the reflectance. Layers that stay (`staying`) go without what is absorbed:
reflectances over and under them are right to 5e-4 at 1,000, and mean nothing from some 30,000 on.
In double precision all are right to 1e-9 at 1e7.

Where an error budget allows for it (`skipping.budget.SINGLE_FROM`) values in sunlight and slopes
are solved in single precision, which holds twice as many columns in a vector
(`benchmarks/skipping.py`). The mean is not in values of columns that emit, nor between layers that
stay. What is absorbed counts in the mean alone: no other mode keeps energy. Rounding grows in other
modes of values with a layer's depth, too, and nothing is seen as deep as `DEEPEST_ASIDE`, which no
layer then exceeds. All of this needs delta-M: peaks that are cut off and not scaled away leave
matrices that single precision has no sign for, and such columns stay in double precision.
"""

from typing import TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

# Co-albedo up to which light is scattered so often that depth counts: where more is absorbed than
# this, what lies deeper than a few hundred is not seen. [-]
_CONSERVATIVE = 1e-5
DEEPEST, DEEPEST_THAT_STAYS = 1e6, 1e4
"""Optical depth of layers that do not absorb that single precision is enough for. [-]"""
DEEPEST_ASIDE = 1e3
"""Optical depth of a layer that looks like any deeper one in all modes but the mean. [-]"""

Arrays = TypeVar("Arrays")


def within_single_precision(
    tau: Float[Array, "layer *batch"],
    coalbedo: Float[Array, "layer *batch"],
    deepest: float = DEEPEST,
) -> Float[Array, "*batch"]:
    """1 where single precision is enough for a column, else NaN: a factor of its optical depths.

    Parameters
    ----------
    tau, coalbedo
        Optical depth and 1 - ssa of the layers as they are solved. [-]
    deepest
        Depth of those that do not absorb, together, for which it is. [-]
    """
    deep = jnp.sum(jnp.where(coalbedo < _CONSERVATIVE, tau, jnp.zeros_like(tau)), axis=0)
    number = tau.dtype.type  # which Python's numbers would not have
    return jnp.where(deep > number(deepest), number(jnp.nan), number(1))


def as_deep_as_seen(tau: Float[Array, "layer *batch"]) -> Float[Array, "layer *batch"]:
    """Optical depths as they count in modes but the mean. [-]"""
    return jnp.minimum(tau, DEEPEST_ASIDE)


def in_single_precision(arrays: Arrays) -> Arrays:
    """The same with float32 for float64."""
    return jax.tree.map(lambda x: x.astype(jnp.float32) if x.dtype == jnp.float64 else x, arrays)
