r"""Tables over the logarithm of effective radius, read by cubics.

The radii are equidistant in their logarithm. With t from 0 to 1 between the nodes 0 and 1 lies the
cubic that takes the values f there and the slopes

.. math:: f'_k = \frac{f_{k-2} - 8 f_{k-1} + 8 f_{k+1} - f_{k+2}}{12}

(per interval) of the quartic through five nodes. It is a sum over the six nodes -2 to 3 whose
weights depend on t alone: one set of weights serves all quantities, and any number of columns, of a
table. The slope is continuous everywhere, and 0 at the first and the last node, beyond which all is
constant; what that costs in accuracy stays within the first and the last interval.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

_NODES = 6
# Powers of t (rows) in the weights of the six nodes: Hermite's cubics, with the slopes above.
_VALUES = np.zeros((4, _NODES))
_VALUES[:, 2:4] = [[1, 0], [0, 0], [-3, 3], [2, -2]]
_SLOPE = np.array([1, -8, 0, 8, -1]) / 12
_POWERS = (
    _VALUES
    + np.outer([0, 1, -2, 1], np.append(_SLOPE, 0))
    + np.outer([0, 0, -1, 1], np.append(0, _SLOPE))
)


def padded(values: Float[np.ndarray, "radius *column"]) -> Float[np.ndarray, "row *column"]:
    """Table with the two rows before and after that its cubics read.

    The nearer one continues the table as a cubic, the other makes the slope at the end 0.

    Parameters
    ----------
    values
        The table, at least 4 radii. [any]
    """

    def beyond(end: np.ndarray) -> np.ndarray:
        near = 4 * end[0] - 6 * end[1] + 4 * end[2] - end[3]
        return np.stack([8 * near - 8 * end[1] + end[2], near])

    return np.concatenate([beyond(values), values, beyond(values[::-1])[::-1]])


def locate(
    radius_um: Float[Array, "*n"], nodes_um: Float[np.ndarray, " radius"]
) -> tuple[Int[Array, "*n"], Float[Array, "*n node"]]:
    """First of the six rows of a `padded` table that a radius needs, and their weights.

    Parameters
    ----------
    radius_um
        Effective radius. [um]
    nodes_um
        Radii of the table, equidistant in their logarithm. [um]
    """
    dtype = radius_um.dtype
    last = len(nodes_um) - 1
    step = float(np.log(nodes_um[-1] / nodes_um[0])) / last
    # Held before its logarithm is taken: weights and derivatives are finite even at a radius of 0.
    # (Not by `jnp.clip`, which would be a kernel of its own within a fence.)
    held = jax.lax.clamp(dtype.type(nodes_um[0]), radius_um, dtype.type(nodes_um[-1]))
    x = jnp.log(held / dtype.type(nodes_um[0])) / dtype.type(step)
    whole = jax.lax.stop_gradient(x).astype(jnp.int32)
    row = jax.lax.clamp(np.int32(0), whole, np.int32(last - 1))
    t = x - row.astype(dtype)
    c0, c1, c2, c3 = jnp.asarray(_POWERS, dtype)
    t = t[..., None]
    return row, c0 + t * (c1 + t * (c2 + t * c3))


def read(
    table: Float[Array, "row *column"], row: Int[Array, "*n"], weights: Float[Array, "*n node"]
) -> Array:
    """Values of a `padded` table at the radii that were given to `locate`, (\\*n, \\*column)."""
    weights = weights.reshape(*weights.shape, *(1,) * (table.ndim - 1))
    total = jnp.zeros((), table.dtype)
    for k in range(_NODES):
        weight = jax.lax.index_in_dim(weights, k, row.ndim, keepdims=False)
        total = total + weight * table.at[row + k].get(mode="promise_in_bounds")
    return total
