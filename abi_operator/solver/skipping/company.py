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
has columns that are alike in their modes. The order only costs time where it is wrong.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from . import budget
from .grouping import group_labels

_STRAIGHT = 1e-6  # product of the tangents of half the zenith angles, which is 0 for either at 0


def need(
    tau: Float[Array, "layer *batch"],
    scattered: Float[Array, "layer *batch"],
    forward: Float[Array, "layer *batch"],
    albedo: Float[Array, "*batch"],
    mu0: Float[Array, "*batch"],
    mu: Float[Array, "*batch"],
    error_budget: float,
) -> Float[Array, "*batch"]:
    """A number that is near for columns of which nearly as much is solved. [-]

    Parameters
    ----------
    tau, scattered, forward
        Optical depth, omega and omega g of each layer as it is solved. [-]
    albedo
        Of the ground. [-]
    mu0, mu
        Cosines of the sun's and the view's zenith angle. [-]
    error_budget
        As in `plan.planned`.
    """
    tau, scattered, forward, albedo, mu0, mu = jax.lax.stop_gradient(
        (tau, scattered, forward, albedo, mu0, mu)
    )
    secants = 1 / mu0 + 1 / mu
    ground = albedo * jnp.exp(-secants * jnp.sum(tau, axis=0))
    nothing = jnp.zeros_like(mu)[None]
    known = budget.expected(nothing, ground[None], tau, 1 - scattered, scattered - forward)
    allowed = budget.OF_MERGING * error_budget * known.least
    labels = group_labels(tau, scattered, forward, 0.5 * secants, allowed, float("inf"))
    depth = jnp.sum(scattered * tau, axis=0)
    twice = (depth / (1 + depth)) ** 2 * secants / (error_budget * known.least)
    tangents = jnp.sqrt((1 - mu0) / (1 + mu0) * (1 - mu) / (1 + mu))
    modes = jnp.log(jnp.maximum(twice, 1)) / -jnp.log(jnp.clip(tangents, _STRAIGHT, 1 - _STRAIGHT))
    share = modes / (1 + modes)
    groups = labels[-1]
    return groups + jnp.where(groups % 2 == 0, share, 1 - share)
