"""Snow on the ground and ice on the sea: how much of a column they cover, and their albedo."""

import warnings

import numpy as np
import xarray as xr

from ..files import InputError
from ..ranges import SHARE
from ..surface import SNOW_AND_ICE_ALBEDO, snow_and_ice_albedo

IceAlbedo = float | str
"""Albedo of snow or ice: a number [-] for all bands, or a type in `SNOW_AND_ICE_ALBEDO`."""

# A smaller share of a column is not looked at; its albedo is wrong by less than that.
LEAST_COVER = 0.01

# Snow of this mass covers the ground, less of it a proportional share: 0.1 m, of new snow at 100
# kg m-3. [kg m-2] (D. L. Verseghy, "CLASS - a Canadian land surface scheme for GCMs. I. Soil
# model", Int. J. Climatol., 11, 111-133, 1991, doi:10.1002/joc.3370110202)
_FULL_COVER = 10.0

_TYPES = ", ".join(SNOW_AND_ICE_ALBEDO)
_SNOW_TYPES = ", ".join(name for name in SNOW_AND_ICE_ALBEDO if name.endswith("snow"))
_NO_ICE = (
    "the model has sea ice (SEAICE in WRF's files) and no albedo of it was named: its columns are "
    "not simulated but where snow of known albedo covers it (sea_ice_count tells how many have "
    "ice); name one (--sea-ice-albedo), a number or "
    f"{_TYPES}."
)
_BARE = (
    "snow lies on the ground of the model (SNOWC or SNOW in WRF's files; snow_count tells in how "
    "many columns), and no albedo of it was named: that of an albedo file may be of bare ground, "
    "and the regressions from MODIS's bands to the imager's do not hold for snow; name one "
    f"(--snow-albedo), a number or {_SNOW_TYPES}."
)
_WITHOUT_TREES = (
    "snow on the ground is simulated as if nothing stood in it (snow_count tells in how many "
    "columns); under trees it is darker."
)

# Shares in files are float32, and sums of such. [-]
_ROUNDING = 1e-3


def sea_ice_cover(model: xr.Dataset) -> np.ndarray:
    """Share of a column's water that is ice (y, x), 0 where the model does not say. [-]"""
    return _share(model, "sea_ice")


def snow_cover(model: xr.Dataset) -> np.ndarray:
    """Share of a column's ground that lies under snow (y, x), 0 where the model does not say. [-]

    It is the model's own, or else follows from the mass of its snow: not all of a model's schemes
    for the ground tell of the share. None lies on open water.
    """
    cover = _share(model, "snow_cover")
    if "snow_mass" in model:
        by_mass = np.clip(model["snow_mass"].values / _FULL_COVER, 0.0, 1.0)
        cover = np.where((cover > 0) | (by_mass < LEAST_COVER), cover, by_mass)
    if "land_mask" not in model:
        return cover
    open_water = (model["land_mask"].values == 0) & (sea_ice_cover(model) == 0)
    return np.where(open_water, 0.0, cover)


def _share(model: xr.Dataset, name: str) -> np.ndarray:
    """A share that a model Dataset has, checked, without what is too little to matter."""
    if name not in model:
        return np.zeros(model["latitude"].shape)
    values = model[name].values
    bad = ~((values >= -_ROUNDING) & (values <= 1 + _ROUNDING))
    if bad.any():
        raise InputError(
            f"{name} of the model is {values[bad][0]:g} in {bad.sum()} of the {bad.size} columns "
            "read; it is a share and must be 0 to 1."
        )
    return np.where(values < LEAST_COVER, 0.0, np.minimum(values, 1.0))


def check_ice_albedo(albedo: IceAlbedo | None, whose: str) -> None:
    """Raise `InputError` where an albedo of snow or ice is neither a share nor a known type."""
    if isinstance(albedo, str):
        if albedo not in SNOW_AND_ICE_ALBEDO:
            raise InputError(
                f"no albedo of {whose} is known by the name of {albedo!r}; name a number, or one "
                f"of {', '.join(SNOW_AND_ICE_ALBEDO)}."
            )
    elif albedo is not None and not SHARE.holds(albedo):
        raise InputError(f"the albedo of {whose} is {albedo:g}; it must be {SHARE.words}.")


def with_snow_and_ice(
    values: np.ndarray,
    model: xr.Dataset,
    bands: tuple[str, ...],
    sea_ice_albedo: IceAlbedo | None,
    snow_albedo: IceAlbedo | None,
) -> tuple[np.ndarray, list[str], dict[str, int]]:
    """Albedo (band, y, x) of columns of which snow and ice cover a part; sources; counts.

    A column's albedo is the mean of what is covered and what is not, by area. Without an albedo of
    its own sea ice has none, and the columns that have some are NaN, as it is nothing like water;
    snow leaves the albedo as it is. Both are warned of. Snow lies on sea ice, too, where its albedo
    is known.

    Parameters
    ----------
    values
        Albedo of the ground, and of water, without either (band, y, x). [-]
    model
        A model Dataset.
    bands
        Of `values`.
    sea_ice_albedo, snow_albedo
        Albedo of ice without snow, and of snow, checked.
    """
    ice, snow = sea_ice_cover(model), snow_cover(model)
    sources, counts = [], {}
    of_ice, of_snow = _by_band(sea_ice_albedo, bands), _by_band(snow_albedo, bands)
    if snow.any():
        counts["snow_count"] = int(np.count_nonzero(snow))
        _warn(_BARE if snow_albedo is None else _WITHOUT_TREES)
    if snow.any() and snow_albedo is not None:
        sources.append(f"snow {_name(snow_albedo)}")
        of_ice, values = _mixed(of_ice, of_snow, snow), _mixed(values, of_snow, snow * (ice == 0))
    if ice.any():
        counts["sea_ice_count"] = int(np.count_nonzero(ice))
        if sea_ice_albedo is not None:
            sources.append(f"sea ice {_name(sea_ice_albedo)}")
        elif np.isnan(_mixed(np.zeros_like(values), of_ice, ice)).any():
            _warn(_NO_ICE)
        values = _mixed(values, of_ice, ice)
    return values, sources, counts


def _warn(sentence: str) -> None:
    warnings.warn(sentence, UserWarning, stacklevel=4)


def _name(albedo: IceAlbedo) -> str:
    return f"({albedo})" if isinstance(albedo, str) else f"{albedo:g}"


def _by_band(albedo: IceAlbedo | None, bands: tuple[str, ...]) -> np.ndarray:
    """Albedo (band, 1, 1), NaN where there is none."""
    if isinstance(albedo, str):
        values = np.array([snow_and_ice_albedo(albedo, band) for band in bands])
    else:
        values = np.full(len(bands), np.nan if albedo is None else albedo)
    return values[:, None, None]


def _mixed(values: np.ndarray, cover: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Albedo of columns of which a share (y, x) has another; what has no share does not matter."""
    under, over = np.where(share == 1, 0.0, values), np.where(share == 0, 0.0, cover)
    return (1 - share) * under + share * over
