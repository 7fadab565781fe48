r"""Which columns are solved side by side: those that need as much.

A tile solves as many groups of layers and as many modes as that of its columns that needs most.
Columns are therefore put in an order in which neighbours need alike before they are cut into tiles.
The order only costs time where it is wrong: it follows from a rough count of a column's groups, and
among equals from how fast its azimuth modes will decay, which they do the slower the more obliquely
sun and satellite look at the more scattering.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from . import budget
from .grouping import group_labels


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
    sines = jnp.sqrt(jnp.maximum(0, (1 - mu0 * mu0) * (1 - mu * mu)))
    oblique = sines * secants * jnp.sum(forward * tau / (1 + tau), axis=0) / known.least
    return labels[-1] + oblique / (1 + oblique)
