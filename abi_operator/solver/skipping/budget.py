r"""The error budget: what of it each way of skipping may spend.

A budget b is a relative error of the reflectance that may be made on top of what the streams leave:
of max(brf, `LEAST_BRF`), in 99 of 100 columns. Layers are merged until b times `OF_MERGING` is
estimated to be lost at a group of them (`grouping`), a column's azimuth modes end where they count
less than b times `OF_MODES` (`mode_sum`), and a layer's doublings leave b times `OF_DOUBLINGS` of
its own response (`doublings`). These shares were fitted on columns of other seeds than those that
`benchmarks/skipping.py` judges them by.

Groups and modes are each column's own. Of doublings a layer has as many as that column of its tile
asks for that needs most: what a column gets depends on those that it is solved with by about a
thousandth of the budget.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

LEAST_BRF = 0.01
"""Smallest reflectance that an error is compared with. [-]"""
OF_MERGING = 0.5
"""Share of the budget that one group of merged layers may be estimated to lose."""
OF_MODES = 1.0
"""Share of the budget below which an azimuth mode is the last one."""
OF_DOUBLINGS = 0.2
"""Share of the budget that a layer's response may be off by."""
DECAY = 0.15
"""Ratio of neighbouring modes' sizes, to see a small one by chance for what it is."""
OF_SLOPES = 2e-3
"""The budget of programs for slopes, at most: a column's slopes keep about 1 % whatever else."""
THICKEST = 2.0
"""Optical depth on the way down and up of a group of layers of which slopes are wanted. [-]"""


class Expected(NamedTuple):
    """What is known of the reflectance of columns before they are solved; without derivatives.

    Parameters
    ----------
    added
        Part of it that is added exactly to that of the modes, for each view. [-]
    least
        A careful estimate of all of it, for the view that sees least. [-]
    """

    added: Float[Array, "view *batch"]
    least: Float[Array, "*batch"]


def expected(
    added: Float[Array, "view *batch"],
    ground: Float[Array, "view *batch"],
    tau: Float[Array, "layer *batch"],
    coalbedo: Float[Array, "layer *batch"],
    backward: Float[Array, "layer *batch"],
) -> Expected:
    r"""Estimate the reflectance of a column from what is scattered once and diffused.

    .. math:: added + ground + \frac12\frac{t}{(1 + t)(1 + a)}, \qquad
       t = \tfrac34\sum\omega(1-g)\tau, \quad a = \sum(1-\omega)\tau,

    half of what a conservative atmosphere of that depth would send back, less what absorbs: seldom
    more than the reflectance, so that what is allowed as a share of it is seldom too much.

    Parameters
    ----------
    added, ground
        Light scattered once, and sent back by the ground alone. [-]
    tau, coalbedo, backward
        Layers' optical depth, 1 - ssa, and ssa (1 - g). [-]
    """
    t = 0.75 * jnp.sum(backward * tau, axis=0)
    absorbed = jnp.sum(coalbedo * tau, axis=0)
    diffused = 0.5 * t / ((1 + t) * (1 + absorbed))
    least = jnp.maximum(LEAST_BRF, jnp.min(added + ground, axis=0) + diffused)
    added, least = jax.lax.stop_gradient((added, least))
    return Expected(added, least)
