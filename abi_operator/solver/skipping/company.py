r"""Which columns are solved side by side: those that need as much.

A tile solves as many groups of layers and as many modes as that of its columns that needs most.
Columns are therefore put in an order in which neighbours need alike before they are cut into tiles:
by the number of their groups and, among equals, by that of their modes,

.. math::
   m = \frac{\ln\left(S^2 s / (b R)\right)}{-\ln(\tan\frac\theta2 \tan\frac{\theta_0}2)},
   \qquad S = \frac{\sum\omega\tau}{1 + \sum\omega\tau},

as if light scattered twice, of which there is S^2 s, lost the same share of itself from mode to
mode until it counts less than the budget b times the reflectance R; s is the sum of the secants.
Every other number of groups begins with the columns of most modes, so that a tile of two numbers
has columns that are alike in their modes. The order only costs time where it is wrong, and with few
streams (`SORTED_FROM`) it costs more than it saves. Of slopes more groups are made, and other
columns need most of them: their order is one of its own, and that of columns that emit, of which
slopes are solved layer by layer, one of modes alone.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from . import budget
from .grouping import Alike, Limits, group_labels

SORTED_FROM = 6
"""Streams from which columns are put in order (``benchmarks/skipping.py --streams`` has rows with
and without)."""
_STRAIGHT = 1e-6  # product of the tangents of half the zenith angles, which is 0 for either at 0


def need(
    alike: Alike,
    known: budget.Expected,
    mu0: Float[Array, "*batch"],
    mu: Float[Array, "*batch"],
    error_budget: float,
    slopes: bool,
) -> Float[Array, "*batch"]:
    """A number that is near for columns of which nearly as much is solved. [-]

    Parameters
    ----------
    alike, known
        Layers, and what is known of the light.
    mu0, mu
        Cosines of the sun's and the view's zenith angle. [-]
    error_budget
        As in `plan.planned`.
    slopes
        Whether these are wanted.
    """
    alike, known, mu0, mu = jax.lax.stop_gradient((alike, known, mu0, mu))
    secants = 1 / mu0 + 1 / mu
    of_groups, thickest = error_budget, float("inf")
    if slopes:
        of_groups, thickest = min(error_budget, budget.OF_SLOPES), budget.THICKEST
    depth = jnp.sum(alike.scattered * alike.tau, axis=0)
    twice = (depth / (1 + depth)) ** 2 * secants / (error_budget * known.least)
    if alike.light is not None:
        twice = alike.light * twice
    tangents = jnp.sqrt((1 - mu0) / (1 + mu0) * (1 - mu) / (1 + mu))
    modes = jnp.log(jnp.maximum(twice, 1)) / -jnp.log(jnp.clip(tangents, _STRAIGHT, 1 - _STRAIGHT))
    share = modes / (1 + modes)
    if slopes and alike.light is not None:
        return share  # all their layers are solved
    allowed = budget.OF_MERGING * of_groups * known.least * jnp.minimum(mu0 + mu, 1)
    groups = group_labels(alike, Limits(0.5 * secants, allowed, thickest))[-1]
    return groups + jnp.where(groups % 2 == 0, share, 1 - share)
