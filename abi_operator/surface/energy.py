"""What a ground makes of the light that falls on it, and where a model of one is no ground."""

from typing import NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

# Nodes in the cosine of reflected light and in its azimuth: the glint of a calm sea is integrated
# to 1e-6, the kernels of vegetation to 1e-4.
_NUM_COSINES, _NUM_AZIMUTHS = 64, 37


@runtime_checkable
class Ground(Protocol):
    """Any ground of this room."""

    def brdf(self, mu_out: Array, mu_in: Array, relative_azimuth: Array, /) -> Array:
        """Reflectance factor between two directions; see `solver.Surface`."""
        ...

    def modes(self, m: int | Int[Array, ""], mu_out: Array, mu_in: Array, /) -> Array:
        """Its azimuth mode m."""
        ...


class Report(NamedTuple):
    """Extremes of a ground under one sun, column by column; see `reported`. [-]"""

    lowest_brdf: Float[Array, "*batch"]
    albedo: Float[Array, "*batch"]

    @property
    def below_zero(self) -> Bool[Array, "*batch"]:
        """Whether the reflectance is below 0 towards some view."""
        return self.lowest_brdf < 0

    @property
    def above_one(self) -> Bool[Array, "*batch"]:
        """Whether more light leaves than falls in."""
        return self.albedo > 1


def directional_albedo(surface: Ground, mu0: Float[Array, "*#batch"]) -> Float[Array, "*batch"]:
    r"""Share of a beam that is reflected to anywhere, :math:`2\int_0^1 \rho_0\, \mu\, d\mu`. [-]

    Parameters
    ----------
    surface
        Ground; its fields and `mu0` broadcast.
    mu0
        Cosine of the beam's zenith angle, above 0. [-]
    """
    mu0 = _with_batch(surface, mu0)
    x, weight = np.polynomial.legendre.leggauss(_NUM_COSINES)
    shape = (x.size,) + (1,) * mu0.ndim
    mu_out = jnp.asarray((1 + x) / 2, mu0.dtype).reshape(shape)
    weight = jnp.asarray(weight, mu0.dtype).reshape(shape)
    return jnp.sum(weight * mu_out * surface.modes(0, mu_out, mu0[None]), axis=0)


def reported(surface: Ground, mu0: Float[Array, "*#batch"]) -> Report:
    """Report where kernel weights describe no ground: below 0 somewhere, or above 1 in all.

    The views are 64 zenith angles between 0 and 90 degrees at azimuths of every 5 degrees; what
    lies between them goes unseen. A reflectance factor above 1 is no fault (the glint has one).

    Parameters
    ----------
    surface
        Ground; its fields and `mu0` broadcast.
    mu0
        Cosine of the solar zenith angle, above 0. [-]
    """
    mu0 = _with_batch(surface, mu0)
    nodes = (1 + np.polynomial.legendre.leggauss(_NUM_COSINES)[0]) / 2
    azimuth = np.linspace(0, np.pi, _NUM_AZIMUTHS)
    mu_out, relative_azimuth = (
        jnp.asarray(x, mu0.dtype).reshape(-1, *(1,) * mu0.ndim)
        for x in (np.repeat(nodes, azimuth.size), np.tile(azimuth, nodes.size))
    )
    brdf = surface.brdf(mu_out, mu0[None], relative_azimuth)
    return Report(jnp.min(brdf, axis=0), directional_albedo(surface, mu0))


def _with_batch(surface: Ground, mu0: Array) -> Array:
    """Cosines broadcast to the batch of the ground's fields."""
    shapes = [x.shape for x in jax.tree.leaves(surface)]
    return jnp.broadcast_to(mu0, jnp.broadcast_shapes(mu0.shape, *shapes))
