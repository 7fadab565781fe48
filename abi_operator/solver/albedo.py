"""Fluxes that the azimuthal mean knows: plane albedo, and the ground's part in a reflectance."""

from typing import Unpack

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from .._keywords import with_keywords
from .column import promoted
from .door import solve
from .method.surface import AnySurface
from .program import GroundResponse, ground_response, plane_albedo
from .settings import OfFluxes, OfViews, Settings


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
    no_view = np.zeros(0, np.float16)
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
    black, coupling, spherical = solve(ground_response, column, how, by_view=by_view)
    return SurfaceCoupling(black, coupling, spherical, how.multiple_views)
