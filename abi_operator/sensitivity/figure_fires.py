"""When a fire shows in C06: by the ground it burns in, the time of day and its temperature."""

from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np
import xarray as xr

from ..atmosphere import Fire
from ..files import InputError
from ..scene import SATELLITE_LONGITUDE, classes_of
from ..scene.angles import find_angles
from .figure import Figure
from .outputs import FIRE_BAND, output_function
from .panels import curves
from .result_checks import check_result, of_columns
from .scene_study import chosen_pixels, settings_of_result, states_of, sun_distance_of

ALBEDOS = (0.05, 0.1, 0.2, 0.3, 0.5)
TEMPERATURES = np.arange(400.0, 1201.0, 25.0)
SHOWS = 0.1
"""Contrast from which a fire is said to show here; grounds differ by as much. [-]"""
_LOWEST_SUN = 85.0  # [degree]
_FIRE = "fire_contrast"


class ByHour(NamedTuple):
    """Contrasts of fires in one column in the course of a day.

    Parameters
    ----------
    hours
        Times of day in UTC, 0 to below 24, from morning to evening at the place: where its day
        holds a midnight of UTC they begin again at 0. [h]
    solar_zenith
        At these hours. [degree]
    contrast
        By hour, albedo (`ALBEDOS`) and temperature (`TEMPERATURES`). [-]
    """

    hours: np.ndarray
    solar_zenith: np.ndarray
    contrast: np.ndarray

    @property
    def lowest(self) -> np.ndarray:
        """Temperature (hour, albedo) from which contrast exceeds `SHOWS`. [K]

        NaN where not even the hottest fire does, and -inf where the coolest does: from which on
        below it nothing tells.
        """
        found = np.full(self.contrast.shape[:2], np.nan)
        for index in np.ndindex(*found.shape):
            rising = np.log(np.maximum(self.contrast[index], 1e-12))
            if rising[0] > np.log(SHOWS):
                found[index] = -np.inf
            elif rising[-1] > np.log(SHOWS):
                found[index] = np.interp(np.log(SHOWS), rising, TEMPERATURES)
        return found


def fires_by_hour(image: xr.Dataset, fire: Fire) -> ByHour:
    """Contrast of fires over grounds of several albedos, on the day of a result.

    Parameters
    ----------
    image
        Result of a simulation at one time, with C06. Its column nearest the middle that has no
        cloud and no plume is taken, with the sun where it is there at every hour, a low one through
        layers of a sphere.
    fire
        Whose share of the pixel counts.

    Raises
    ------
    InputError
        Where there is no C06, no time, no such column, or another part of the result is missing.
    """
    check_result(image, of_columns(image))
    if FIRE_BAND not in image["band"].values or "time" not in image.variables:
        raise InputError(f"this figure is of {FIRE_BAND} at a time, which the result lacks.")
    with jax.enable_x64(True):
        place = _clear_place(image)
        column = states_of(image, place, (_FIRE,), fire)
        hours, zenith, azimuth = _sun(image, place)
        shape = len(hours), len(ALBEDOS), len(TEMPERATURES)
        hour, albedo, hot = (x.ravel() for x in np.indices(shape))
        states = jax.tree.map(lambda x: np.repeat(np.asarray(x), hour.size, axis=0), column)
        angles: Any = {
            "solar_zenith": np.radians(zenith)[hour],
            "relative_azimuth": np.radians(azimuth)[hour],
        }
        ground: Any = {FIRE_BAND: np.array(ALBEDOS)[albedo]}
        flames: Any = TEMPERATURES[hot]
        states = replace(
            states,
            albedo=ground,
            geometry=replace(states.geometry, spherical=True, **angles),
            fire=Fire(states.fire.fraction, flames),
        )
        seen = output_function((_FIRE,), settings_of_result(image), sun_distance_of(image))
        contrast = np.asarray(seen(states))[:, 0].reshape(shape)
    return ByHour(hours, zenith, contrast)


def fires_figure(image: xr.Dataset, fire: Fire) -> Figure:
    """Contrast by temperature at noon, and the lowest temperature that shows by hour.

    Parameters
    ----------
    image, fire
        As of `fires_by_hour`.
    """
    found = fires_by_hour(image, fire)
    lowest, names = found.lowest, [f"a = {albedo:g}" for albedo in ALBEDOS]
    noon = int(np.argmin(found.solar_zenith))
    lines = [
        f"Lowest temperature [K] of a fire on {float(fire.fraction):g} of the pixel with a "
        f"contrast of {SHOWS:g} in {FIRE_BAND}, by the ground's albedo a:",
        f"{'UTC':>6} {'sun':>6} " + " ".join(f"{name:>9}" for name in names),
    ]
    for hour, zenith, row in zip(found.hours, found.solar_zenith, lowest, strict=True):
        lines.append(f"{hour:6.1f} {zenith:6.1f} " + " ".join(f"{_said(x):>9}" for x in row))
    log = np.log10(np.maximum(found.contrast[noon], 1e-6))
    highest = f"sun {found.solar_zenith[noon]:.0f}° from the zenith"
    by_heat = dict(zip(names, log, strict=True))
    by_hour = dict(zip(names, np.maximum(lowest, TEMPERATURES[0]).T, strict=True))
    panels = [
        curves(f"By temperature [K], {highest}", TEMPERATURES, by_heat, -2, 2, "log10 of contrast"),
        curves(
            "Lowest temperature that shows, by hour (UTC)",
            np.unwrap(found.hours, period=24.0),
            by_hour,
            float(TEMPERATURES[0]),
            700.0,
            "K",
            period=24.0,
        ),
    ]
    caption = f"One column without cloud or plume; a fire shows from a contrast of {SHOWS:g} on."
    return Figure(panels, 2, lines, {}, caption)


def _said(temperature: float) -> str:
    """One of `ByHour.lowest` in words."""
    return f"<{TEMPERATURES[0]:.0f}" if temperature == -np.inf else f"{temperature:.0f}"


def _clear_place(image: xr.Dataset) -> np.ndarray:
    """The pixel (y, x) nearest the middle of those without cloud and plume."""
    good = chosen_pixels(image, None, "all")
    for name in image.data_vars:
        if str(name).endswith("_brightness"):
            good &= ~(image[name].values > 0)
    for name in ("liquid", *classes_of(image)):
        good &= ~(image[f"{name}_mass_path"].sum("layer").values > 0)
    if not good.any():
        raise InputError("the result has no column without cloud and plume that the sun shines on.")
    y, x = np.indices(good.shape)
    far = np.hypot(y - good.shape[0] / 2, x - good.shape[1] / 2)
    place = np.zeros_like(good)
    place.flat[np.argmin(np.where(good, far, np.inf))] = True
    return place


def _sun(image: xr.Dataset, place: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hours with the sun up, every half, its zenith angle and relative azimuth. [h], [degree]

    Hours are times of day in UTC, of the day that it is at the place by the sun, from midnight to
    midnight there.
    """
    latitude, longitude = (image[x].values[place][0] for x in ("latitude", "longitude"))
    satellite = str(image.attrs.get("satellite", "GOES-16"))
    stands = float(image.attrs.get("satellite_longitude", SATELLITE_LONGITUDE[satellite]))
    ahead = np.timedelta64(30 * round(2 * longitude / 15), "m")  # of UTC, as its sun is
    midnight = (image["time"].values + ahead).astype("datetime64[D]") - ahead
    hours, found = [], []
    for half in range(48):
        time = (midnight + np.timedelta64(30 * half, "m")).astype("datetime64[ns]")
        angles = find_angles(time, np.array([latitude]), np.array([longitude]), stands)
        hours.append((time - time.astype("datetime64[D]")) / np.timedelta64(1, "h"))
        found.append((angles.solar_zenith[0], angles.relative_azimuth[0]))
    zenith, azimuth = np.array(found).T
    up = zenith < _LOWEST_SUN
    return np.array(hours)[up], zenith[up], azimuth[up]
