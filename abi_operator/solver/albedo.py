"""Fluxes that the azimuthal mean knows: plane albedo, and the ground's part in a reflectance."""

from collections.abc import Callable
from typing import Any, Unpack

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from .._keywords import with_keywords
from .column import Column, Options, promoted
from .door import solve
from .method.surface import AnySurface
from .program import (
    GroundResponse,
    back_to_ground,
    from_ground,
    ground_response,
    over_black_ground,
    plane_albedo,
)
from .settings import OfFluxes, OfViews, Settings
from .views import of_views


@with_keywords(OfFluxes, Settings())
def toa_albedo(
    tau: Float[ArrayLike, "*batch layer"],
    ssa: Float[ArrayLike, "*batch layer"],
    moments: Float[ArrayLike, "*batch layer moment"],
    albedo: Float[ArrayLike, "*batch"] | AnySurface,
    mu0: Float[ArrayLike, "*batch"],
    *,
    secant: Float[ArrayLike, "*batch layer"] | None = None,
    **settings: Unpack[OfFluxes],
) -> Float[Array, "*batch"]:
    r"""Plane albedo at the top: upward flux over :math:`\mu_0 F_0`. [-]

    One mode and no view are solved. Arguments, derivatives and errors are those of `toa_brf`.
    """
    no_view = np.zeros(0, bool)  # of no floating type
    column = promoted(
        tau=tau,
        ssa=ssa,
        moments=moments,
        albedo=albedo,
        mu0=mu0,
        mu=no_view,
        relative_azimuth=no_view,
        secant=secant,
    )
    how = Settings(**settings)
    how = how._replace(num_modes=1, single_scattering=None, multiple_views=True)
    return solve(plane_albedo, column, how, by_view=False)


class SurfaceCoupling(eqx.Module):
    r"""Reflectance of columns as a closed form in the albedo of a Lambertian ground.

    .. math:: BRF(a) = BRF(0) + \frac{c\,a}{1 - S a}

    Parameters
    ----------
    brf_black
        Reflectance over black ground, BRF(0). [-]
    coupling
        c, transmission from the sun to the ground times that from the ground to the view. [-]
    spherical_albedo
        S, the albedo of the atmosphere seen from below. [-]
    multiple_views
        Whether the last axis of `brf_black` and `coupling` is over views of the same columns, which
        `spherical_albedo` does not have.
    """

    brf_black: Float[Array, "*batch"]
    coupling: Float[Array, "*batch"]
    spherical_albedo: Float[Array, "*batch"]
    multiple_views: bool = eqx.field(static=True, default=False)

    def brf(self, albedo: Float[ArrayLike, "*batch"]) -> Float[Array, "*batch"]:
        """Reflectance over ground of this albedo; leading axes broadcast. [-]"""
        albedo = jnp.asarray(albedo).astype(self.brf_black.dtype)
        factor = albedo / (1 - self.spherical_albedo * albedo)
        if self.multiple_views:
            factor = factor[..., None]
        return self.brf_black + self.coupling * factor

    def albedo(self, brf: Float[ArrayLike, "*batch"]) -> Float[Array, "*batch"]:
        """Ground albedo that gives this reflectance: the inverse, for atmospheric correction. [-]

        Not limited to [0, 1]: a reflectance that no ground of such an albedo explains gives one
        outside.
        """
        spherical = self.spherical_albedo
        if self.multiple_views:
            spherical = spherical[..., None]
        excess = jnp.asarray(brf).astype(self.brf_black.dtype) - self.brf_black
        return excess / (self.coupling + spherical * excess)


@with_keywords(OfViews, Settings())
def surface_coupling(
    tau: Float[ArrayLike, "*batch layer"],
    ssa: Float[ArrayLike, "*batch layer"],
    moments: Float[ArrayLike, "*batch layer moment"],
    mu0: Float[ArrayLike, "*batch"],
    mu: Float[ArrayLike, "*batch"],
    relative_azimuth: Float[ArrayLike, "*batch"],
    *,
    phase_function: Float[ArrayLike, "*batch layer"] | None = None,
    secant: Float[ArrayLike, "*batch layer"] | None = None,
    **settings: Unpack[OfViews],
) -> SurfaceCoupling:
    """How a Lambertian ground of any albedo shows through these columns, in one solve.

    Columns that share atmosphere and angles and differ in albedo cost one solve, and an observed
    reflectance is corrected for the atmosphere without another. Arguments, derivatives and errors
    are those of `toa_brf`.

    References
    ----------
    .. [1] S. Chandrasekhar, "Radiative Transfer", Dover, 1960, section 72.
    """
    column = promoted(
        tau=tau,
        ssa=ssa,
        moments=moments,
        albedo=0,
        mu0=mu0,
        mu=mu,
        relative_azimuth=relative_azimuth,
        phase_function=phase_function,
        secant=secant,
    )
    how = Settings(**settings)
    by_view = GroundResponse._make([True, True, False])  # the spherical albedo has no view
    found = solve(ground_response, column, how, gradient=response_and_slopes, by_view=by_view)
    black, coupling, spherical = found
    return SurfaceCoupling(black, coupling, spherical, how.multiple_views)


def response_and_slopes(tile: Column, options: Options) -> tuple[GroundResponse, Column]:
    """Response and its slopes, of every view's reflectance and coupling and of what all share."""

    def slopes_of(function: Callable[..., Array], *others: Any) -> tuple[Array, Column]:
        value, pull_back = jax.vjp(lambda tile: function(tile, options, *others), tile)
        return value, pull_back(jnp.ones_like(value))[0]

    brf, of_brf = of_views(lambda seen: over_black_ground(seen, options)[0], tile)
    # Sunlight reaches the ground as light of the ground reaches the sun.
    beams = jnp.arange(tile.mu.shape[0] + 1)
    through, of_through = jax.lax.map(lambda beam: slopes_of(from_ground, beam), beams)
    back, of_back = slopes_of(back_to_ground)

    def rows(of_brf: Array, of_through: Array, of_back: Array) -> Array:
        expand = (slice(None), *(None,) * (of_back.ndim - 1))
        sun, views = through[0], through[1:][expand]
        coupling = sun * of_through[1:] + views * of_through[0]
        return jnp.concatenate([of_brf, coupling, of_back[None]])

    return GroundResponse(brf, through[0] * through[1:], back), jax.tree.map(
        rows, of_brf, of_through, of_back
    )
