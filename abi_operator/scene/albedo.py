"""Albedo of the ground under a block of columns."""

import numpy as np
import xarray as xr

from ..files import InputError
from ..radiance import THERMAL
from ..ranges import SHARE
from .albedo_file import albedo_of_file, check_extent
from .emissivity import Emissivity, check_emissivity, thermal_albedo
from .grounds import FROM_MODEL, OceanWind, check_ocean_wind, limited_wind, sea_albedo
from .land import LandAlbedo, check_land_albedo, with_last_resort
from .snow_and_ice import IceAlbedo, check_ice_albedo, sea_ice_cover, with_snow_and_ice


def surface_albedo(
    model: xr.Dataset,
    bands: tuple[str, ...],
    albedo: xr.Dataset | None,
    ocean_albedo: float | None,
    emissivity: Emissivity | None = None,
    *,
    ocean_wind: OceanWind | None = None,
    land_albedo: LandAlbedo | None = None,
    sea_ice_albedo: IceAlbedo | None = None,
    snow_albedo: IceAlbedo | None = None,
) -> tuple[np.ndarray, dict[str, str | int]]:
    """Albedo by band (band, y, x), NaN where there is none [-]; and attributes that say whence.

    In C07 it is 1 - `emissivity` (`thermal_albedo`). In the other bands it is that of the albedo
    file (`albedo_of_file`); over water of the model's land mask `ocean_albedo`. Without a land
    mask, `ocean_albedo` fills what the file leaves missing in all of the bands. Land that still
    lacks an albedo in some band has `land_albedo` there (`with_last_resort`). What the model has of
    sea ice and snow lies over all of it (`with_snow_and_ice`).

    Parameters
    ----------
    model
        A model Dataset.
    bands
        Bands to look up.
    albedo
        ``surface_albedo`` (band, time, lat, lon), as `files.read_mcd43a1` returns. [-]
    ocean_albedo
        One albedo for all bands but C07. [-]
    emissivity
        Of the ground in C07; see `thermal_albedo`.
    ocean_wind
        Wind by which open water has the white-sky albedo of a sea (`sea_albedo`), in place of
        `ocean_albedo`.
    land_albedo
        Of land that the file, if any, knows no albedo of, in all bands but C07. [-]
    sea_ice_albedo, snow_albedo
        Of sea ice without snow, and of snow, in all bands but C07, where it lies. [-]

    Raises
    ------
    InputError
        Where an albedo is missing, where land and water have one and no land mask tells them apart,
        or where the file does not reach as far as the columns that need it.
    """
    solar = tuple(band for band in bands if band not in THERMAL)
    check_ground(model, bands, albedo, ocean_albedo, emissivity, land_albedo, ocean_wind)
    check_ice_albedo(sea_ice_albedo, "sea ice")
    check_ice_albedo(snow_albedo, "snow")
    attributes: dict[str, str | int] = {}
    found = {}
    if solar:
        of_water = _albedo_of_water(model, solar, ocean_albedo, ocean_wind)
        values, sources, counts = _solar_albedo(model, solar, albedo, of_water, land_albedo)
        ice = with_snow_and_ice(values, model, solar, sea_ice_albedo, snow_albedo)
        values = ice[0]
        attributes |= {"surface_albedo_source": "; ".join(sources + ice[1]), **counts, **ice[2]}
        found |= dict(zip(solar, values, strict=True))
    for band in bands:
        if band in THERMAL and emissivity is not None:
            found[band], attributes["emissivity_source"] = thermal_albedo(model, emissivity)
    return np.stack([found[band] for band in bands]), attributes


def _solar_albedo(
    model: xr.Dataset,
    bands: tuple[str, ...],
    albedo: xr.Dataset | None,
    of_water: tuple[float | np.ndarray, str] | None,
    land_albedo: LandAlbedo | None,
) -> tuple[np.ndarray, list[str], dict[str, int]]:
    """Albedo in bands of sunlight alone (band, y, x), whence it is, and of how many columns.

    That of water is known with what it is called, or not at all.
    """
    shape = (len(bands), model.sizes["y"], model.sizes["x"])
    values, sources, counts = np.full(shape, np.nan), [], {}
    water = _water(model)
    if albedo is not None:
        spared = water if water is not None and of_water is not None else np.zeros(1, bool)
        needed = np.broadcast_to(~spared, shape[1:])
        values, sources, counts = albedo_of_file(model, bands, albedo, needed)
    if of_water is not None:
        missing = np.isnan(values).all(axis=0)
        values = np.where(missing if water is None else water, of_water[0], values)
        place = "water" if water is not None else "all columns" if albedo is None else "the rest"
        sources.append(f"{place} {of_water[1]}")
    if land_albedo is not None:
        land = np.full(shape[1:], True) if water is None else ~water
        values, source, filled = with_last_resort(values, model, land, land_albedo)
        sources, counts = [*sources, source], counts | filled
    return values, sources, counts


def _albedo_of_water(
    model: xr.Dataset,
    bands: tuple[str, ...],
    ocean_albedo: float | None,
    ocean_wind: OceanWind | None,
) -> tuple[float | np.ndarray, str] | None:
    """Albedo of open water, one number or (band, y, x) [-], and what to call it."""
    if ocean_wind is None:
        return None if ocean_albedo is None else (ocean_albedo, f"{ocean_albedo:g}")
    check_ocean_wind(ocean_wind, model)
    wind = limited_wind(model, ocean_wind)
    name = "the model's" if ocean_wind == FROM_MODEL else f"{ocean_wind:g} m/s"
    return np.stack([sea_albedo(band, wind) for band in bands]), f"rough by a wind of {name}"


def check_ground(
    coordinates: xr.Dataset,
    bands: tuple[str, ...],
    albedo: xr.Dataset | None,
    ocean_albedo: float | None,
    emissivity: Emissivity | None = None,
    land_albedo: LandAlbedo | None = None,
    ocean_wind: OceanWind | None = None,
) -> None:
    """Raise `InputError` where there is no albedo, or two, of which nothing tells where which is
    meant, or the file's cells do not cover the scene.

    Parameters
    ----------
    coordinates
        ``latitude`` and ``longitude`` (y, x) [degree] and perhaps ``land_mask`` and ``sea_ice``, as
        in a model Dataset.
    bands
        Bands to be simulated.
    albedo
        As `files.read_mcd43a1` returns. [-]
    ocean_albedo
        If given, water of the land mask needs no file. [-]
    emissivity
        Of the ground in C07, needed there.
    land_albedo
        If given, what the file does not reach needs none; where water is known, too, a land mask
        has to tell them apart. [-]
    ocean_wind
        If given, that of water follows from it. [m s-1]
    """
    check_land_albedo(land_albedo)
    if ocean_albedo is not None and not SHARE.holds(ocean_albedo):
        raise InputError(f"the albedo of water is {ocean_albedo:g}; it must be {SHARE.words}.")
    if set(bands) & set(THERMAL):
        check_emissivity(emissivity)
    if set(bands) <= set(THERMAL):
        return
    if ocean_albedo is not None and ocean_wind is not None:
        raise InputError("water has an albedo or a wind from which it follows; give one of them.")
    water_known = ocean_albedo is not None or ocean_wind is not None
    if albedo is None and not water_known and land_albedo is None:
        raise InputError(
            "the ground has no albedo; name an albedo file, an albedo of the ocean, or both, or, "
            "for want of a file, an albedo of land."
        )
    if water_known and land_albedo is not None and "land_mask" not in coordinates:
        # What the file lacks would all be taken for water, and the albedo of land for nothing.
        raise InputError(
            "the model has no land mask (LANDMASK or XLAND in WRF's files), and nothing else tells "
            "water from land without an albedo; give an albedo of land or one of water, not both."
        )
    if albedo is None or land_albedo is not None:
        return
    water = _water(coordinates) if water_known else None
    needed = np.full(coordinates["latitude"].shape, True) if water is None else ~water
    if not needed.any():
        return
    check_extent(coordinates, albedo, needed)


def _water(dataset: xr.Dataset) -> np.ndarray | None:
    """True over water (y, x), also where it is frozen; None without a land mask.

    Models call frozen sea land while they have it.
    """
    if "land_mask" not in dataset:
        return None
    return (dataset["land_mask"].values == 0) | (sea_ice_cover(dataset) > 0)
