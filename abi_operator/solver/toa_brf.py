"""The solver's door for reflectances: plane-parallel columns seen from the top."""

from jaxtyping import Array, ArrayLike, Float

from .column import Column, Options, promoted
from .door import prepare, solve
from .method.surface import AnySurface
from .program import emerging
from .views import of_views


def toa_brf(
    tau: Float[ArrayLike, "*batch layer"],
    ssa: Float[ArrayLike, "*batch layer"],
    moments: Float[ArrayLike, "*batch layer moment"],
    albedo: Float[ArrayLike, "*batch"] | AnySurface,
    mu0: Float[ArrayLike, "*batch"],
    mu: Float[ArrayLike, "*batch"],
    relative_azimuth: Float[ArrayLike, "*batch"],
    *,
    num_streams: int = 16,
    num_modes: int | None = None,
    delta_m: bool = True,
    single_scattering: str | None = "tms",
    phase_function: Float[ArrayLike, "*batch layer"] | None = None,
    secant: Float[ArrayLike, "*batch layer"] | None = None,
    multiple_views: bool = False,
    num_doublings: int | None = None,
    check_values: bool | None = None,
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
        Lambertian albedo of the ground [-], or a `Surface`: anything with its two methods.
    mu0, mu
        Cosines of the solar and view zenith angles, both above 0. At 1, where the derivative in
        the cosine is infinite, the one with the sine held at 0 is returned, so that by a zenith
        angle it is 0; from 1e-5 rad on the latter is right (to 1e-4 of the slope at the vertical,
        to 1e-6 from 1e-3 rad on). [-]
    relative_azimuth
        Azimuth between satellite and sun: 0 on the same side (backscatter), pi in the glint. [rad]
    num_streams
        Streams in both hemispheres together, even.
    num_modes
        Azimuth modes of the multiple scattering; None for all `num_streams` of them. The exact
        single scattering is untouched by it.
    delta_m
        Whether to scale forward peaks away.
    single_scattering
        ``"tms"`` replaces light scattered once by its exact value; None leaves it to the streams.
    phase_function
        Exact phase function of each layer at the scattering angle (`cos_scattering_angle`), mean 1
        over the sphere, from a closed form or a table (`interpolate_phase_function`); None sums
        all the moments given, which must then be enough of them: 64 or more for a cloud. [-]
    secant
        Replaces 1 / mu0 in the attenuation of the sun's beam, layer by layer, for a sun low over a
        spherical Earth (`slant_path_secant`). [-]
    multiple_views
        Whether `mu`, `relative_azimuth` and `phase_function` have one more axis, the last, over
        views of the same columns; the result keeps it. Many views cost little more than one.
    num_doublings
        Doublings of a layer at most (see `layer.half_layer`): each has as many as it needs up to
        that, and too small a number is an error that nothing reports. None sets no limit; in
        programs for slopes it is what the largest layer needs where the arguments are concrete,
        and where they are traced what one of 1e5 needs under a sun at a cosine of 1e-3: columns
        with a layer that needs more are NaN there, values and slopes.
    check_values
        Whether to refuse values out of range; see `checks`. None checks what lies in memory, which
        takes a hundredth of the time that solving does: not what is traced inside `jax.jit`, nor
        what lies on another device. True insists, which needs concrete arguments, and refuses
        series of moments too that end too early to sum a phase function from. False checks nothing.

    Returns
    -------
    Reflectance, in the arguments' common floating type (float32 if x64 is disabled). [-]

    Raises
    ------
    ValueError
        If shapes do not match, there are too few moments, or an option or a value is out of range.
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
    options = prepare(
        column,
        num_streams=num_streams,
        num_modes=num_modes,
        delta_m=delta_m,
        single_scattering=single_scattering,
        multiple_views=multiple_views,
        num_doublings=num_doublings,
        check_values=check_values,
    )
    gradient = _view_by_view if multiple_views else None
    return solve(_brf, column, options, multiple_views, gradient, check_values=check_values)


def _brf(tile: Column, options: Options) -> Array:
    return emerging(tile, options).brf


def _view_by_view(tile: Column, options: Options) -> tuple[Array, Column]:
    return of_views(lambda seen: emerging(seen, options).brf[0], tile)
