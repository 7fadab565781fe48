"""The layers as every azimuth mode sees them, read and written inside kernels."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .bordered import Bordered
from .layer import ModeKernels, conservative, layer_matrix


class Order(NamedTuple):
    """What tells one mode's layers from another's: 1 or 0, and not integers, which have no tangents
    in a kernel.

    Parameters
    ----------
    odd
        Whether the order is odd.
    mean
        Whether this is the azimuthal mean, the only mode in which energy is kept.
    """

    odd: Float[Array, "*mode"]
    mean: Float[Array, "*mode"]


class Layer(NamedTuple):
    """What one mode sees of a layer; moments of even and of odd l + m."""

    tau: Float[Array, "*batch"]
    coalbedo: Float[Array, "*batch"]
    sun_secant: Float[Array, "*batch"]
    even: Float[Array, "degree *batch"]
    odd: Float[Array, "degree *batch"]

    def secants(self, views: Float[Array, "view *batch"]) -> Float[Array, "beam *batch"]:
        """Of all beams."""
        return jnp.concatenate([self.sun_secant[None], views])

    def matrices(
        self,
        mean: Float[Array, ""] | bool,
        kernels: tuple[ModeKernels, ModeKernels],
        view_secants: Float[Array, "view *batch"],
        single_scattering: bool,
    ) -> tuple[Bordered, Bordered]:
        """A and the inverse of B; whether the mode is the mean may be known or a number."""
        secants = self.secants(view_secants)
        a = layer_matrix(kernels[0], self.even, secants, single_scattering)
        if isinstance(mean, bool):
            a = conservative(a, self.coalbedo) if mean else a
        else:
            a = jax.lax.cond(mean > 0, conservative, lambda a, _: a, a, self.coalbedo)
        return a, layer_matrix(kernels[1], self.odd, secants, single_scattering).inverse()


class Layers(NamedTuple):
    """All layers, top first, as every mode sees them.

    Moments of even degrees come first, then those of odd ones: a mode of odd m has them the other
    way round, and finds them by their place.
    """

    tau: Float[Array, "layer *batch"]
    coalbedo: Float[Array, "layer *batch"]
    sun_secant: Float[Array, "layer *batch"]
    moments: Float[Array, "parity_and_layer degree *batch"]

    def layer(self, number: Array, odd: Array) -> Layer:
        """One of them; neither argument is an integer (see `Order`)."""
        even_place, odd_place = self._places(number, odd)
        return Layer(
            read(self.tau, number),
            read(self.coalbedo, number),
            read(self.sun_secant, number),
            read(self.moments, even_place),
            read(self.moments, odd_place),
        )

    def plus(self, number: Array, odd: Array, new: Layer) -> "Layers":
        """The same with `new` added to one of them."""
        moments = self.moments
        for place, added in zip(self._places(number, odd), (new.even, new.odd), strict=True):
            moments = added_to(moments, place, added)
        return Layers(
            added_to(self.tau, number, new.tau),
            added_to(self.coalbedo, number, new.coalbedo),
            added_to(self.sun_secant, number, new.sun_secant),
            moments,
        )

    def _places(self, number, odd):
        count = self.tau.shape[0]
        return number + count * odd, number + count * (1 - odd)


def read(stack: Float[Array, "layer *own"], place: Array) -> Float[Array, "*own"]:
    """One entry of an array."""
    # Not `jax.lax.dynamic_index_in_dim`, which as a `jax.jit` would be a kernel and a copy: what
    # is read is part of the kernel that uses it, what `added_to` writes must be a kernel.
    start = place.astype(jnp.int32), *(jnp.int32(0) for _ in stack.shape[1:])
    return jax.lax.dynamic_slice(stack, start, (1, *stack.shape[1:]))[0]


def added_to(
    stack: Float[Array, "layer *own"], place: Array, new: Float[Array, "*own"]
) -> Float[Array, "layer *own"]:
    """The same array with `new` added to one entry."""
    new = read(stack, place) + new
    return jax.lax.dynamic_update_index_in_dim(stack, new, place.astype(jnp.int32), 0)
