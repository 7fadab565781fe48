"""A result as the imager would report it: footprints, noise, ceilings and counts.

What is simulated is the light of columns, without any limit. `observed` puts it through the
instrument (`abi_operator.instrument`), in its order: the mean of radiance over each pixel's
columns, noise, ceiling, counts, and only then reflectance factor and brightness temperature.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..bands import BANDS
from ..files import InputError
from ..files.netcdf import cf_attributes
from ..geometry import is_up
from ..instrument import Imager, observe_mean
from ..radiance import THERMAL
from .angles import sun_distance
from .pixels import pixel_means


def observed(
    result: xr.Dataset,
    imager: Imager,
    *,
    footprint: int = 1,
    seed: int | None = None,
    calibration: bool = False,
) -> xr.Dataset:
    """Observe a result, in float64.

    Parameters
    ----------
    result
        Of `simulate` or `files.read_result`, with one time or several.
    imager
        The instrument; its satellite should be the result's.
    footprint
        Columns that a pixel sees along each axis. Those at the ends of rows and columns that fill
        no pixel are left out. [-]
    seed
        Of the noise, and of the calibration error; None for none.
    calibration
        Whether each band has an error of its gain, one for all pixels and times.

    Returns
    -------
    xarray.Dataset
        The result with what is reported in place of ``radiance``, ``reflectance_factor``, ``brf``
        and ``brightness_temperature``, and ``saturated`` (band, y, x). Of pixels of several columns
        it has means of all else that has neither layers nor levels, and the flags of any of them.

    Raises
    ------
    InputError
        Where the result lacks radiance or the sun's angle or was observed before, or the footprint
        is none.
    """
    if "saturated" in result.variables:
        raise InputError("the result was observed before; give the one that a simulation wrote.")
    missing = [x for x in ("radiance", "solar_zenith_angle") if x not in result.variables]
    if missing:
        raise InputError(
            f"the result has no {', '.join(missing)}; simulate it without --variables."
        )
    smallest = min(result.sizes["y"], result.sizes["x"])
    if not 1 <= footprint <= smallest:
        raise InputError(f"a footprint is 1 to {smallest} columns wide here; got {footprint}.")
    if calibration and seed is None:
        raise InputError("an error of the calibration is drawn by a seed; give one.")
    with jax.enable_x64(True):
        seen = result if footprint == 1 else pixel_means(result, footprint)
        fields = _reported(seen, imager, seed, calibration)
    how: dict[str, Any] = {
        "footprint_columns": footprint,
        "noise": "none" if seed is None else f"of the instrument, seed {seed}",
        "calibration_error": "none" if not calibration else f"of the instrument, seed {seed}",
        "quantised": int(imager.quantised),
    }
    if imager.fire_saturation_temperature is not None:
        how["fire_saturation_temperature"] = float(imager.fire_saturation_temperature)
    return seen.assign(fields).assign_attrs(how)


def _reported(
    seen: xr.Dataset, imager: Imager, seed: int | None, calibration: bool
) -> dict[str, xr.DataArray]:
    """Variables of the light, of all bands and times."""
    dims = tuple(d for d in ("time", "band", "y", "x") if d in seen["radiance"].dims)
    radiance = seen["radiance"].transpose(*dims).astype(np.float64)
    times = np.atleast_1d(seen["time"].values) if "time" in seen.variables else [None]
    shape = (len(times), seen.sizes["band"], seen.sizes["y"], seen.sizes["x"])
    names = ("radiance", "reflectance_factor", "temperature", "saturated")
    found = {name: np.full(shape, np.nan) for name in names}
    values = radiance.values.reshape(shape)
    for t, time in enumerate(times):
        distance = 1.0 if time is None else sun_distance(time)
        for b, band in enumerate(map(str, seen["band"].values)):
            noise, gain = _keys(seed, t, band)
            report = observe_mean(
                jnp.asarray(values[t, b]),
                band,
                imager,
                sun_distance=distance,
                key=noise,
                calibration_key=gain if calibration else None,
            )
            found["radiance"][t, b] = report.radiance
            found["saturated"][t, b] = report.saturated
            if report.reflectance_factor is not None:
                found["reflectance_factor"][t, b] = report.reflectance_factor
            if report.brightness_temperature is not None:
                found["temperature"][t, b] = report.brightness_temperature
    sun = np.radians(seen["solar_zenith_angle"].values).reshape(-1, 1, *shape[2:])
    brf = found["reflectance_factor"] / np.where(is_up(sun), np.cos(sun), np.nan)

    def variable(name: str, x: np.ndarray) -> xr.DataArray:
        values = x.reshape(radiance.shape)
        return xr.DataArray(values, radiance.coords, radiance.dims, attrs=cf_attributes(name))

    fields = {
        "radiance": variable("radiance", found["radiance"]),
        "reflectance_factor": variable("reflectance_factor", found["reflectance_factor"]),
        "brf": variable("brf", brf),
        "saturated": variable("saturated", found["saturated"] == 1).astype(np.int8),
    }
    for band in set(THERMAL) & set(map(str, seen["band"].values)):
        hot = variable("brightness_temperature", found["temperature"])
        fields["brightness_temperature"] = hot.sel(band=band).drop_vars(
            [name for name in hot.coords if "band" in str(name)]
        )
    return fields


def _keys(seed: int | None, time: int, band: str) -> tuple[Any, Any]:
    """Keys of the noise, of a time and band of its own, and of the calibration, of a band alone.

    There is none without a seed, nor of the green that the imager lacks.
    """
    if seed is None or band == "green":
        return None, None
    of_band = jax.random.fold_in(jax.random.key(seed), list(BANDS).index(band))
    noise, gain = jax.random.split(of_band)
    # Of C07 no calibration error is specified.
    return jax.random.fold_in(noise, time), None if band in THERMAL else gain
