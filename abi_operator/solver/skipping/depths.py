"""What the layers of columns add up to: all that is known of their light before they are solved
hangs on it (`budget`, `faint`)."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.kernels import one_kernel
from ..method.mode_layers import read

DIFFUSE = 1.66
"""Mean secant of diffuse light: W. M. Elsasser, 1942, Harvard Meteorol. Stud. 6. [-]"""


class Depths(NamedTuple):
    """Sums over all layers; without derivatives.

    Parameters
    ----------
    tau, absorbed, scattered
        Optical depth, and what of it absorbs and scatters, each a sum of its own: under 1e5 that
        absorb their difference does not see what little scatters, in single precision. [-]
    backward
        Of what scatters, times 1 - g. [-]
    slant
        Optical depth along the sun's beam. [-]
    """

    tau: Float[Array, "*batch"]
    absorbed: Float[Array, "*batch"]
    scattered: Float[Array, "*batch"]
    backward: Float[Array, "*batch"]
    slant: Float[Array, "*batch"]


def depths(
    tau: Float[Array, "layer *batch"],
    coalbedo: Float[Array, "layer *batch"],
    ssa: Float[Array, "layer *batch"],
    backward: Float[Array, "layer *batch"],
    sun_secants: Float[Array, "layer *batch"],
) -> Depths:
    """In one pass over the layers.

    Parameters
    ----------
    tau, coalbedo, ssa, backward
        Layers' optical depth, 1 - ssa, ssa, and ssa (1 - g). [-]
    sun_secants
        Of each layer's beam. [-]
    """
    return Depths(*sums(tau, coalbedo, ssa, backward, sun_secants))


def sums(
    tau: Float[Array, "layer *batch"], *numbers: Float[Array, "layer *batch"]
) -> tuple[Float[Array, "*batch"], ...]:
    """Optical depth of all layers, and sums of each of some numbers times it; in one pass, without
    derivatives."""
    return one_kernel(_sums, 1)(*jax.lax.stop_gradient((tau, *numbers)))


def _sums(*layers):
    def one(k, found):
        tau, *numbers = (read(x, k) for x in layers)
        terms = tau, *(x * tau for x in numbers)
        return tuple(x + term for x, term in zip(found, terms, strict=True))

    return jax.lax.fori_loop(0, len(layers[0]), one, (jnp.zeros_like(layers[0][0]),) * len(layers))
