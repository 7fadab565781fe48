"""The solver's door for reflectances: plane-parallel columns seen from the top."""

from typing import Unpack

from jaxtyping import Array, ArrayLike, Float

from .._keywords import with_keywords
from . import glimpse
from .column import Column, Options, promoted
from .door import solve
from .method.surface import AnySurface
from .program import emerging
from .settings import OfReflectances, Settings
from .views import of_views


@with_keywords(OfReflectances, Settings())
def toa_brf(
    tau: Float[ArrayLike, "*batch layer"],
    ssa: Float[ArrayLike, "*batch layer"],
    moments: Float[ArrayLike, "*batch layer moment"],
    albedo: Float[ArrayLike, "*batch"] | AnySurface,
    mu0: Float[ArrayLike, "*batch"],
    mu: Float[ArrayLike, "*batch"],
    relative_azimuth: Float[ArrayLike, "*batch"],
    *,
    phase_function: Float[ArrayLike, "*batch layer"] | None = None,
    secant: Float[ArrayLike, "*batch layer"] | None = None,
    **settings: Unpack[OfReflectances],
) -> Float[Array, "*batch"]:
    r"""Bidirectional reflectance factor :math:`\pi I/(\mu_0 F_0)` at the top of the atmosphere.

    Scalar discrete ordinates, differentiable (forward and reverse) in every floating argument.
    Leading axes broadcast by NumPy's rules; layers are numbered from the top. A
    reflectance may be slightly negative at few streams: it is reported as it is.

    Parameters
    ----------
    tau, ssa
        Extinction optical depth and single-scattering albedo of each layer. [-]
    moments
        Legendre moments of each layer's phase function, chi_0 = 1 (not read), without the factor
        2l + 1: `num_streams` + 1 at least, `num_streams` without delta-M. [-]
    albedo
        Lambertian albedo of the ground [-], or a `Surface`: a pytree with its two methods, such as
        an `equinox.Module`.
    mu0, mu
        Cosines of the solar and view zenith angles, both above 0. At 1, where the derivative in
        the cosine is infinite, the one with the sine held at 0 is returned, so that by a zenith
        angle it is 0; from 1e-5 rad on the latter is right (to 1e-4 of the slope at the vertical,
        to 1e-6 from 1e-3 rad on). [-]
    relative_azimuth
        Azimuth between satellite and sun: 0 on the same side (backscatter), pi in the glint. [rad]
    phase_function
        Exact phase function of each layer at the scattering angle (`cos_scattering_angle`), mean 1
        over the sphere, from a closed form or a table (`interpolate_phase_function`); None sums
        all the moments given, which must then be enough of them: 64 or more for a cloud. [-]
    secant
        Replaces 1 / mu0 in the attenuation of the sun's beam, layer by layer, for a sun low over a
        spherical Earth (`slant_path_secant`). [-]
    **settings
        How exactly to solve: the fields of `Settings`.

    Returns
    -------
    Reflectance, in the arguments' common floating type (float32 if x64 is disabled). In float32 it
    is NaN, with its slopes, where layers that absorb less than 1e-5 of what they scatter are deeper
    than 1e6 together, as they are solved; at 1e5 it is right to 1e-3 (`method.rounding`). [-]

    Raises
    ------
    ValueError
        If shapes do not match, there are too few moments, or a setting or a value is out of range.
    """
    column = promoted(
        tau=tau,
        ssa=ssa,
        moments=moments,
        albedo=albedo,
        mu0=mu0,
        mu=mu,
        relative_azimuth=relative_azimuth,
        phase_function=phase_function,
        secant=secant,
    )
    how = Settings(**settings)
    gradient = _view_by_view if how.multiple_views else None
    return solve(_brf, column, how, gradient=gradient, faint=glimpse.reflectance)


def _brf(tile: Column, options: Options) -> Array:
    return emerging(tile, options).brf


def _view_by_view(tile: Column, options: Options) -> tuple[Array, Column]:
    return of_views(lambda seen: emerging(seen, options).brf[0], tile)
