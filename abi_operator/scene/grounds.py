"""Grounds of a scene that are not Lambertian: land by MODIS's kernels, open water by its wind.

Both keep the white-sky albedo that the scenario has of every column. Land reflects it as the
weights of the kernels in the albedo file distribute it over directions, water as a sea of that wind
does, whose white-sky albedo is the column's. In C07 all grounds are Lambertian.
"""

import warnings
from dataclasses import replace
from functools import cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..files import InputError
from ..files.mcd43 import KERNELS
from ..radiance import THERMAL
from ..ranges import WEATHER
from ..surface import WHITE_SKY, LandAndSea, RossLi, ocean
from .account import Attribute
from .albedo_file import albedo_of_file
from .snow_and_ice import sea_ice_cover, snow_cover

OceanWind = float | str
"""Wind over water, a number [m s-1], or `FROM_MODEL`."""

FROM_MODEL = "model"
"""What to name where the model's own wind is meant."""

_COMPONENTS = "wind_along_x", "wind_along_y"
_STRONGEST = WEATHER["wind_speed"].high
# Winds between which the white-sky albedo of the sea is interpolated, closest in a calm. [m s-1]
_WINDS = _STRONGEST * np.linspace(0, 1, 301) ** 2


def check_ocean_wind(wind: OceanWind, model: xr.Dataset) -> None:
    """Raise `InputError` where a wind is none, or where the model does not tell of wind or water.

    Parameters
    ----------
    wind
        What was asked for.
    model
        A model Dataset.
    """
    if isinstance(wind, str) and wind != FROM_MODEL:
        raise InputError(
            f"no wind is known by the name of {wind!r}; name a number in m/s, or {FROM_MODEL!r} "
            "for the model's own."
        )
    if not isinstance(wind, str) and not WEATHER["wind_speed"].holds(wind):
        raise InputError(f"the wind is {wind:g} m/s; it must be {WEATHER['wind_speed'].words}.")
    missing = [name for name in _COMPONENTS if name not in model]
    if wind == FROM_MODEL and missing:
        raise InputError(
            "the model has no wind at 10 m (U10 and V10 in WRF's files); name a number in m/s."
        )
    if "land_mask" not in model:
        raise InputError(
            "the model does not tell water from land (LANDMASK or XLAND in WRF's files), and only "
            "water glints; name an albedo of the ocean instead."
        )


def wind_speed(model: xr.Dataset, wind: OceanWind) -> tuple[np.ndarray, int]:
    """Wind speed (y, x) [m s-1], and in how many columns with water it was too strong.

    Where it blows harder than 37 m/s all the sea is foam by the law that `surface.Ocean` follows,
    and 37 m/s are taken, which is warned of.
    """
    if wind != FROM_MODEL:
        return limited_wind(model, wind), 0
    strong = _of_model(model) > _STRONGEST
    too_strong = int(np.count_nonzero(strong & (water_share(model) > 0)))
    if too_strong:
        warnings.warn(
            f"the wind is above {_STRONGEST:g} m/s over water, where all of it is foam: it is "
            "taken to be that (strongest_wind_count tells in how many columns).",
            UserWarning,
            stacklevel=2,
        )
    return limited_wind(model, wind), too_strong


def limited_wind(model: xr.Dataset, wind: OceanWind) -> np.ndarray:
    """The same wind speed (y, x), of which nothing is told. [m s-1]"""
    if wind != FROM_MODEL:
        return np.full(model["latitude"].shape, float(wind))
    return np.minimum(_of_model(model), _STRONGEST)


def _of_model(model: xr.Dataset) -> np.ndarray:
    return np.hypot(*(model[name].values for name in _COMPONENTS))


def water_share(model: xr.Dataset) -> np.ndarray:
    """Share of a column's ground that is open water (y, x). [-]"""
    ice = sea_ice_cover(model)
    return np.where((model["land_mask"].values == 0) | (ice > 0), 1 - ice, 0.0)


def sea_albedo(band: str, wind: np.ndarray) -> np.ndarray:
    """White-sky albedo of a sea under winds of any shape, interpolated to 1e-4 of itself. [-]"""
    if band in THERMAL:
        raise ValueError(f"{band} has no anisotropic ground.")
    return np.interp(wind, *_sea_albedos(band))


@cache
def _sea_albedos(band: str) -> tuple[np.ndarray, np.ndarray]:
    with jax.enable_x64(True):
        albedo = jax.jit(lambda x: ocean(x, band).white_sky_albedo())(jnp.asarray(_WINDS))
    return _WINDS, np.asarray(albedo)


def anisotropic_fields(
    model: xr.Dataset,
    bands: tuple[str, ...],
    albedo: xr.Dataset | None,
    ocean_wind: OceanWind | None,
    *,
    snow_has_albedo: bool,
) -> tuple[dict[str, np.ndarray], dict[str, Attribute]]:
    """Variables of `nomenclature.GROUND` that a scenario has, and what it says of them.

    Parameters
    ----------
    model
        A model Dataset.
    bands
        Bands of the scenario.
    albedo
        As `files.read_mcd43a1` returns it; land reflects by kernels if it has their weights.
    ocean_wind
        Checked; None where water is Lambertian.
    snow_has_albedo
        Whether snow lies over the kernels, which reflects evenly.
    """
    fields: dict[str, np.ndarray] = {}
    attributes: dict[str, Attribute] = {}
    if albedo is not None and set(KERNELS) <= set(albedo.data_vars):
        fields |= _kernel_weights(model, bands, albedo, snow_has_albedo=snow_has_albedo)
        count = np.count_nonzero(np.any([x != 0 for x in fields.values()], axis=(0, 1)))
        attributes["kernel_count"] = int(count)
    if ocean_wind is not None:
        check_ocean_wind(ocean_wind, model)
        fields["water_share"] = water_share(model)
        fields["wind_speed"], strongest = wind_speed(model, ocean_wind)
        attributes["water_count"] = int(np.count_nonzero(fields["water_share"]))
        attributes["strongest_wind_count"] = strongest
    return fields, attributes


def _kernel_weights(
    model: xr.Dataset, bands: tuple[str, ...], albedo: xr.Dataset, *, snow_has_albedo: bool
) -> dict[str, np.ndarray]:
    """Weights of kernels (band, y, x), 0 where the ground has none of the file."""
    solar = tuple(band for band in bands if band not in THERMAL)
    uncovered = np.ones(model["latitude"].shape)
    if "land_mask" in model:
        uncovered = uncovered * (water_share(model) == 0) * (sea_ice_cover(model) == 0)
    if snow_has_albedo:
        uncovered = uncovered * (1 - snow_cover(model))
    found = {}
    for name in KERNELS:
        found[name] = np.zeros((len(bands), *uncovered.shape))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what there is to be said was said of the albedo
            of_file = albedo.assign(surface_albedo=albedo[name])
            values, *_ = albedo_of_file(model, solar, of_file, uncovered > 0)
        for band, weights in zip(solar, values, strict=True):
            found[name][bands.index(band)] = np.where(
                np.isfinite(weights) & (uncovered > 0), weights * uncovered, 0.0
            )
    return found


def land_and_sea(
    band: str,
    albedo: np.ndarray,
    weights: dict[str, np.ndarray],
    water: np.ndarray,
    wind: np.ndarray,
    num_streams: int,
) -> LandAndSea:
    """Ground of columns in a band of sunlight, from a scenario's variables (column,).

    Parameters
    ----------
    band
        Name of the band.
    albedo
        White-sky albedo of the whole ground. [-]
    weights
        Of the kernels in `files.mcd43.KERNELS`, of the land's part times its share. [-]
    water, wind
        Share of open water [-] and its wind. [m s-1]
    num_streams
        Streams that they are to be solved with, which read as many azimuth modes: kernels are
        integrated from twice as many azimuths and the glint from 3/2 as many, 16 and 12 at least
        (`RossLi`, `Ocean`).
    """
    volume, geometric = (weights[name] for name in KERNELS)
    dry = np.where(water < 1, 1 - water, 1.0)
    of_land = np.where(water < 1, (albedo - water * sea_albedo(band, wind)) / dry, albedo)
    constant = of_land - WHITE_SKY[1] * volume - WHITE_SKY[2] * geometric
    with jax.enable_x64(True):
        none = jnp.zeros(())
        land = RossLi(none, none, none, num_azimuths=max(16, 2 * num_streams))
        sea = replace(ocean(none, band), num_azimuths=max(12, 3 * num_streams // 2))
        one = LandAndSea(land, sea, none)
    columns = jax.tree.map(lambda x: np.full(wind.shape, float(x)), one)
    return eqx.tree_at(
        lambda x: (x.land.f_iso, x.land.f_vol, x.land.f_geo, x.sea.wind_speed, x.water_share),
        columns,
        (constant, volume, geometric, wind, water),
    )
