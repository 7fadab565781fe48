"""How exactly to solve: what every door of the solver is told by name."""

from typing import NamedTuple, TypedDict


class Settings(NamedTuple):
    """How exactly to solve; a door takes the fields of this as keyword arguments.

    Parameters
    ----------
    num_streams
        Streams in both hemispheres together, even.
    num_modes
        Azimuth modes of the multiple scattering; None for all `num_streams` of them. The exact
        single scattering is untouched by it.
    delta_m
        Whether to scale forward peaks away.
    single_scattering
        ``"tms"`` replaces light scattered once by its exact value; None leaves it to the streams.
    multiple_views
        Whether `mu`, `relative_azimuth` and `phase_function` have one more axis, the last, over
        views of the same columns; the result keeps it. Many views cost little more than one.
    num_doublings
        Doublings of a layer at most (see `layer.half_layer`): each has as many as it needs up to
        that, and too small a number is an error that nothing reports. With an error budget it is
        one of groups of layers, which may be thicker than any that is given. None sets no limit; in
        programs for slopes it is what the largest layer needs where the arguments are concrete,
        and where they are traced what one of 1e5 needs under a sun at a cosine of 1e-3: columns
        with a layer that needs more are NaN there, values and slopes.
    error_budget
        Relative error of the reflectance (of 0.01 where it is less, in 99 of 100 columns) that may
        be made on top of what the streams leave: layers that are alike are solved as one, azimuth
        modes and doublings end where the rest is less, single precision does from 1e-4 on, and
        where hardly anything is scattered nothing is solved (`skipping`). 1e-3 is a good one. None
        solves everything, and so do second derivatives, and of columns that emit several views at
        once, and grounds other than Lambertian; slopes of columns that emit are those of every
        layer.
    check_values
        Whether to refuse values out of range (`ranges.SOLVER`; see `checks`). None checks what lies
        in memory, which takes a hundredth of the time that solving does: not what is traced inside
        `jax.jit`, nor what lies on another device. True insists, which needs concrete arguments,
        and refuses series of moments too that end too early to sum a phase function from. False
        checks nothing.
    """

    num_streams: int = 16
    num_modes: int | None = None
    delta_m: bool = True
    single_scattering: str | None = "tms"
    multiple_views: bool = False
    num_doublings: int | None = None
    error_budget: float | None = None
    check_values: bool | None = None


class OfFluxes(TypedDict, total=False):
    """Settings of a flux, which has no view and one mode."""

    num_streams: int
    delta_m: bool
    num_doublings: int | None
    check_values: bool | None


class OfViews(OfFluxes, total=False):
    """Settings of whatever is seen."""

    num_modes: int | None
    single_scattering: str | None
    multiple_views: bool


class OfReflectances(OfViews, total=False):
    """Settings of what is seen, some of which may be left out."""

    error_budget: float | None


def check_settings(settings: Settings) -> None:
    """Refuse settings out of range."""
    num_streams, num_modes = settings.num_streams, settings.num_modes
    single_scattering, num_doublings = settings.single_scattering, settings.num_doublings
    if num_streams < 2 or num_streams % 2:
        raise ValueError(f"num_streams must be even and at least 2; got {num_streams}.")
    if num_modes is not None and not 1 <= num_modes <= num_streams:
        raise ValueError(f"num_modes must be 1 to num_streams = {num_streams}; got {num_modes}.")
    if single_scattering not in ("tms", None):
        raise ValueError(f"single_scattering must be 'tms' or None; got {single_scattering!r}.")
    if num_doublings is not None and num_doublings < 0:
        raise ValueError(f"num_doublings must be 0 or more; got {num_doublings}.")
    error_budget = settings.error_budget
    if error_budget is not None and not 0 < error_budget < 1:
        raise ValueError(f"error_budget must be above 0 and below 1, or None; got {error_budget}.")
