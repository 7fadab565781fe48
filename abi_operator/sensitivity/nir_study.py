"""The near infrared of a plume 10 % up and down, on a scene: what the derived green makes of it.

Grasso et al. (2013) asked how much of their green is near infrared, which no eye sees: they changed
the single-scattering albedo of volcanic ash in C03 until the ash was about 10 % brighter there, and
then darker, with one value for the scene, and mapped the change of green by their Eqs. (2) and (3).
"About 10 %" is taken to be that of the mean over the pixels that are counted: those in sunlight
where the picture of the plume is at least 0.2 bright and hydrometeors have an optical depth below
0.01; other aerosol may be beside the plume. C03 in the plume is simulated anew, as it is and as it
becomes: where there is no plume, and in C01 and C02, all is as it was, to the last digit.
"""

from typing import Any

import jax
import numpy as np
import xarray as xr

from ..atmosphere import State
from ..files import InputError
from ..files.result import CONVENTIONS
from ..scene import gases_of, species_of, states_of_result
from ..settings import Settings, streams_of_attributes
from .green_change import NearInfrared, green_fields
from .pixel_kinds import CLOUD, cloud_depth, depths_of
from .place import with_place
from .plume_band import PlumeBand
from .result_checks import DARK, check_result, of_columns
from .ssa_root import ssa_for_mean, ssa_of_each

BAND = "C03"
"""The near infrared that green is derived from."""
_COLOURS = ("C01", "C02", BAND)


def nir_study(
    image: xr.Dataset,
    *,
    species: str = "ash",
    change: float = 0.1,
    pixel_by_pixel: bool = False,
    smallest_brightness: float = 0.2,
) -> xr.Dataset:
    r"""Make a plume brighter and darker in C03 and derive green, in float64.

    With N the reflectance of the plume in C03 as it is and N' as it becomes, in each pixel, and G
    and G' the green of each recipe,

    .. math:: \Delta = \frac{G' - G}{G'},

    Eqs. (2) and (3) of Grasso et al. (2013), in which the changed green stands below the line.

    Parameters
    ----------
    image
        Result of a simulation at one time, all of it, with C01, C02 and C03. Where it has green
        (0.555 um) as well, a table is made of its pixels and looked up beside the recipes.
    species
        Name of the plume.
    change
        By how much of itself C03 is to be larger, and then smaller. Where no single-scattering
        albedo from 0 to 1 does that, the end is taken, and ``ssa_code`` says so. [-]
    pixel_by_pixel
        Whether each pixel is changed by that, with a single-scattering albedo of its own, and not
        the mean, with one for the scene.
    smallest_brightness
        Of the plume's picture in pixels that are counted. [-]

    Returns
    -------
    xarray.Dataset
        Along y and x, what is of green along ``recipe`` and what is changed along ``change`` as
        well, reflectances being bidirectional reflectance factors: ``near_infrared`` and ``green``,
        the same ``_changed``, by ``_first_order`` what they are by the Jacobian with the same step
        of ``ssa``, ``green_change`` (as above), ``green_change_first_order`` and
        ``green_change_of_base`` (G below the line); ``ssa`` and ``ssa_changed`` (NaN outside the
        plume) and ``ssa_code`` of each pixel (0 outside); ``counted``.

    Raises
    ------
    InputError
        Where the change is not between 0 and 1, the result lacks something, no pixel is counted, or
        no albedo is found with which the mean changes so.
    """
    if not 0 < change < 1:
        raise InputError(f"the near infrared changes by more than 0 and less than 1; got {change}.")
    _check(image, species)
    with jax.enable_x64(True):
        return _study(image, species, (change, -change), pixel_by_pixel, smallest_brightness)


def _study(
    image: xr.Dataset,
    species: str,
    changes: tuple[float, float],
    pixel_by_pixel: bool,
    smallest_brightness: float,
) -> xr.Dataset:
    brf = brf_by_band(image)
    seen = (image["quality_flag"].values & DARK) == 0
    seen &= np.isfinite([brf[band] for band in _COLOURS]).all(axis=0)
    brightness = image[f"{species}_brightness"].values
    inside = (brightness > 0) & seen
    counted = inside & (brightness >= smallest_brightness) & (cloud_depth(image, BAND) < CLOUD)
    if not counted.any():
        raise InputError(
            f"no pixel is counted: none has {species} with a picture of {smallest_brightness:g} or "
            "brighter, sunlight and no cloud."
        )
    num_streams = streams_of_attributes(image.attrs)
    settings = Settings(gases=gases_of(image), num_streams=num_streams)
    plume = PlumeBand(_columns(image, inside), species, BAND, settings)
    try:
        roots = [
            ssa_of_each(plume, 1 + change)
            if pixel_by_pixel
            else ssa_for_mean(plume, 1 + change, counted[inside])
            for change in changes
        ]
    except ValueError as error:
        raise InputError(str(error)) from None
    near = NearInfrared.of(plume, brf[BAND], inside, roots)
    recipes, greens = green_fields(brf, near)
    words = {"long_name": "whether the pixel is counted"}
    fields = near.fields() | greens | {"counted": (("y", "x"), counted.astype(np.int8), words)}
    coordinates: dict[str, Any] = {
        "change": ("change", list(changes), {"units": "1", "long_name": f"change of {BAND}"}),
        "recipe": ("recipe", recipes, {"long_name": "how green is derived"}),
    }
    result = xr.Dataset(fields, coordinates)
    result = with_place(result, image)
    return result.assign_attrs(
        {
            "Conventions": CONVENTIONS,
            "title": "What the derived green makes of a plume's near infrared",
            "species": species,
            "band": BAND,
            "single_scattering_albedo": "of each pixel" if pixel_by_pixel else "one for the scene",
            "smallest_brightness": smallest_brightness,
            "num_streams": settings.num_streams,
        }
    )


def brf_by_band(image: xr.Dataset) -> dict[str, np.ndarray]:
    """Bidirectional reflectance factor (y, x) by band, in the precision of what is stored. [-]"""
    mu0 = np.cos(np.radians(image["solar_zenith_angle"].values))
    factor = image["reflectance_factor"].transpose("band", "y", "x")
    lit = np.where(mu0 > 0, mu0, np.nan)
    return {str(band): factor.sel(band=band).values / lit for band in image["band"].values}


def _columns(image: xr.Dataset, chosen: np.ndarray) -> State:
    y, x = (xr.DataArray(index, dims="column") for index in np.nonzero(chosen))
    return states_of_result(image.isel(y=y, x=x), (BAND,))


def _check(image: xr.Dataset, species: str) -> None:
    needed = ["reflectance_factor", *depths_of(image), *of_columns(image)]
    check_result(image, needed, _COLOURS)
    if species not in species_of(image):
        plumes = ", ".join(species_of(image)) or "none"
        raise InputError(
            f"the result has no plume of {species} (plumes: {plumes}); simulate a scene with one "
            "(abi-operator demo --plume ash, or simulate --plume --plume-species ash)."
        )
