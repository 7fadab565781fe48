"""The solver's door for radiances: sunlight, thermal emission, or both in one solve."""

from typing import Unpack

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from .._keywords import with_keywords
from . import glimpse
from .column import Column, Options, promoted
from .door import solve
from .method.surface import AnySurface
from .program import emerging, radiance_of_one_view
from .settings import OfReflectances, Settings
from .views import of_views

# A sun of irradiance 0 may stand anywhere; below this cosine it is moved to where it does no harm.
_LOWEST_SUN, _SOMEWHERE_ELSE = 1e-3, 0.5


@with_keywords(OfReflectances, Settings())
def toa_radiance(
    tau: Float[ArrayLike, "*batch layer"],
    ssa: Float[ArrayLike, "*batch layer"],
    moments: Float[ArrayLike, "*batch layer moment"],
    albedo: Float[ArrayLike, "*batch"] | AnySurface,
    mu0: Float[ArrayLike, "*batch"],
    mu: Float[ArrayLike, "*batch"],
    relative_azimuth: Float[ArrayLike, "*batch"],
    *,
    solar_irradiance: Float[ArrayLike, "*batch"],
    planck_levels: Float[ArrayLike, "*batch level"] | None = None,
    surface_emission: Float[ArrayLike, "*batch"] | None = None,
    isotropic_top: Float[ArrayLike, "*batch"] | float = 0.0,
    phase_function: Float[ArrayLike, "*batch layer"] | None = None,
    secant: Float[ArrayLike, "*batch layer"] | None = None,
    **settings: Unpack[OfReflectances],
) -> Float[Array, "*batch"]:
    r"""Radiance at the top of the atmosphere, in the units of its sources.

    Sunlight and thermal emission are one solve. Differentiable like `toa_brf`, in the sources too.

    Parameters
    ----------
    tau, ssa, moments, albedo, mu0, mu, relative_azimuth
        As in `toa_brf`. Where `solar_irradiance` is 0 the sun may stand anywhere, below the horizon
        too; the derivative in the irradiance is that of the sun's place for mu0 of 0.001 or more,
        and within an error budget the azimuthal mean's.
    solar_irradiance
        F0, on a plane across the beam. [radiance unit sr]
    planck_levels
        Planck function at the levels, one more than layers, top first; linear in tau between them.
        None for air that does not emit. [radiance unit]
    surface_emission
        Radiance that leaves the ground isotropically, (1 - albedo) B for a warm Lambertian one.
        None for 0. [radiance unit]
    isotropic_top
        Radiance that falls on the top from all directions alike. [radiance unit]
    phase_function, secant, **settings
        As in `toa_brf`.

    Returns
    -------
    Radiance, in the arguments' common floating type. [radiance unit]

    Raises
    ------
    ValueError
        As `toa_brf`.
    """
    # Nothing falls on the top unless something is given: no program for it then.
    dark = isinstance(isotropic_top, int | float) and isotropic_top == 0
    given = promoted(
        tau=tau,
        ssa=ssa,
        moments=moments,
        albedo=albedo,
        mu0=mu0,
        mu=mu,
        relative_azimuth=relative_azimuth,
        phase_function=phase_function,
        secant=secant,
        planck_levels=planck_levels,
        surface_emission=surface_emission,
        isotropic_top=None if dark else isotropic_top,
        solar_irradiance=solar_irradiance,
    )
    how = Settings(**settings)
    gradient = _view_by_view if how.multiple_views else None
    # Of several views that see thermal light at once nothing is known before they are solved.
    faint = None if how.multiple_views and _shines(given) else glimpse.radiance
    column = _with_harmless_sun(given)
    return solve(_radiance, column, how, gradient=gradient, faint=faint, given=given)


def _shines(column: Column) -> bool:
    """Whether there is light from elsewhere than the sun."""
    others = column.planck_levels, column.surface_emission, column.isotropic_top
    return any(x is not None for x in others)


def _with_harmless_sun(column: Column) -> Column:
    """A place above the horizon for suns that do not shine."""
    mu0, irradiance = column.mu0, column.solar_irradiance
    assert irradiance is not None
    # Arrays of NumPy stay so: the number of doublings is chosen from them.
    xp = np if isinstance(mu0, np.ndarray) and isinstance(irradiance, np.ndarray) else jnp
    away = (irradiance == 0) & (mu0 < _LOWEST_SUN)
    return column._replace(mu0=xp.where(away, xp.asarray(_SOMEWHERE_ELSE, mu0.dtype), mu0))


def _radiance(tile: Column, options: Options) -> Array:
    assert tile.solar_irradiance is not None
    if tile.mu.shape[0] == 1 and _shines(tile):
        return radiance_of_one_view(tile, options)[None]
    brf, emitted = emerging(tile, options)
    reflected = tile.solar_irradiance * tile.mu0 / np.pi * brf
    return reflected if emitted is None else reflected + emitted


def _view_by_view(tile: Column, options: Options) -> tuple[Array, Column]:
    return of_views(lambda seen: _radiance(seen, options)[0], tile)
