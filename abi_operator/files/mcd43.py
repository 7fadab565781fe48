"""MODIS albedo, MCD43A1, as the AppEEARS service of the LP DAAC delivers it in NetCDF."""

import warnings
from collections.abc import Sequence

import netCDF4
import numpy as np
import xarray as xr

from ..bands import check_bands
from ..nomenclature import MODEL
from ..surface.modis_to_abi import MODIS_TO_ABI, BandRegression
from ..surface.ross_li import WHITE_SKY
from .errors import InputError
from .nearest_date import nearest_date
from .netcdf import FilePath, cf_attributes, load, open_netcdf, require_dims, require_variables
from .plausible import check_values, plausible

VARIABLE_MAP = {
    "BRDF_Albedo_Parameters_": "surface_albedo",
    "BRDF_Albedo_Band_Mandatory_Quality_": "albedo_quality",
}
"""Beginning of a variable's name in the file, before the MODIS band: ours."""

BROADBAND_STAND_IN: dict[str, str] = {"C01": "vis", "green": "vis", "C02": "vis", "C03": "nir"}
"""Broadband that may stand in for an ABI band where a file has no spectral bands."""

KERNELS = {"volume_kernel_weight": 1, "geometric_kernel_weight": 2}
"""Weights of kernels that are not constant: ours, and their place in the file."""

_PARAMETERS, _QUALITY = VARIABLE_MAP
_GRID = ("time", "lat", "lon")
_NO_INVERSION = 255
# Regressions have constants, and dark ground may fall below 0 by them: down to here, two standard
# errors of the one for C06 and five of that for C05, it is black. [-]
_LOWEST_BLACK = -0.005
_ADVICE = (
    "request MCD43A1 from AppEEARS as an area sample in NetCDF-4 with the projection Geographic"
)
_QUALITY_ATTRIBUTES = {
    "flag_values": np.array([0, 1, _NO_INVERSION], np.uint8),
    "flag_meanings": "full_inversion magnitude_inversion no_inversion",
}


def read_white_sky(path: FilePath, modis_bands: Sequence[str]) -> xr.Dataset:
    """Read white-sky albedo in bands of MODIS itself from an AppEEARS file of MCD43A1.

    Parameters
    ----------
    path
        The file.
    modis_bands
        ``"Band1"`` to ``"Band7"``, ``"vis"``, ``"nir"`` or ``"shortwave"``.

    Returns
    -------
    xarray.Dataset
        ``white_sky_albedo`` (modis_band, time, lat, lon) [-], f_iso + 0.189184 f_vol - 1.377622
        f_geo, NaN where the file has none, and ``albedo_quality``, the mandatory quality, if the
        file has that of all of these bands.

    Raises
    ------
    InputError
        Where the file cannot be read or lacks one of the bands.
    """
    with open_netcdf(path, advice=_ADVICE) as file:
        _check_projection(file, path)
        lacking = [_PARAMETERS + name for name in modis_bands if _PARAMETERS + name not in file]
        if lacking:
            raise InputError(f"{path} has no {', '.join(lacking)}; request them from AppEEARS.")
        weights, quality, coordinates, num_invalid = _read(file, tuple(modis_bands), path)
    white_sky = {name: x @ np.array(WHITE_SKY) for name, x in weights.items()}
    dims = ("modis_band", *_GRID)
    attributes = {
        "units": "1",
        "long_name": "white-sky albedo of the ground",
        "num_outside_valid_range": num_invalid,
    }
    fields = {"white_sky_albedo": (dims, np.stack([white_sky[n] for n in modis_bands]), attributes)}
    if set(modis_bands) <= set(quality):
        worst = np.stack([quality[n] for n in modis_bands])
        fields["albedo_quality"] = (dims, worst, _QUALITY_ATTRIBUTES)
    return xr.Dataset(
        fields,
        coords={"modis_band": list(modis_bands), **coordinates},
    )


def read_mcd43a1(
    path: FilePath,
    bands: Sequence[str],
    *,
    broadband: bool = False,
    kernels: bool = False,
    times: np.ndarray | None = None,
) -> xr.Dataset:
    """Read white-sky albedo in bands of ABI from an AppEEARS file of MCD43A1.

    White-sky albedo of a MODIS band is f_iso + 0.189184 f_vol - 1.377622 f_geo; that of an ABI
    band is a regression on one or two of them, `surface.MODIS_TO_ABI`.

    Parameters
    ----------
    path
        The file.
    bands
        Bands of ABI, such as ``"C01"``.
    kernels
        Whether the weights of the volume and the geometric kernel are returned, too; that of the
        constant one follows from them and the albedo.
    broadband
        Whether a broadband (vis, nir) may stand in for spectral bands that the file lacks; each
        such band is warned of.
    times
        Times of a scene (time,), UTC: only the dates that they have, the nearest to each
        (`nearest_date`), are read; None for all dates of the file.

    Returns
    -------
    xarray.Dataset
        ``surface_albedo`` (band, time, lat, lon) [-], NaN where the file has none; attributes
        count valid inversions that were held at 0 because the regression gave -0.005 or more, but
        less than 0 (``num_held_at_zero``), that were made NaN because it gave what else is outside
        0..1 (``num_outside_unit_interval``), and kernel weights outside the file's valid range
        (``num_outside_valid_range``). ``albedo_quality``, same dimensions, uint8: the worst
        mandatory quality among the MODIS bands used; 0 full inversion, 1 magnitude inversion, 255
        none; it is there if the file has that of all of them, and albedo of any quality is taken.
        ``volume_kernel_weight`` and ``geometric_kernel_weight``, likewise, of `kernels`: by
        the same regression without its constant, NaN where the albedo is. The order of ``lat`` is
        the file's.
    """
    bands = check_bands(bands, MODIS_TO_ABI)
    with open_netcdf(path, advice=_ADVICE) as file:
        _check_projection(file, path)
        regressions = _choose_regressions(file, bands, broadband, path)
        used = tuple(dict.fromkeys(name for r in regressions for name in r.weights))
        weights, quality, coordinates, num_invalid = _read(file, used, path, times)
    white_sky = {name: x @ np.array(WHITE_SKY) for name, x in weights.items()}
    albedo = np.stack(
        [r.offset + sum(w * white_sky[n] for n, w in r.weights.items()) for r in regressions]
    )
    held = (albedo >= _LOWEST_BLACK) & (albedo < 0)
    albedo[held] = 0.0
    outside = (albedo < 0) | (albedo > 1)
    albedo[outside] = np.nan
    albedo_attributes = cf_attributes("surface_albedo") | {
        "num_held_at_zero": int(held.sum()),
        "num_outside_unit_interval": int(outside.sum()),
        "num_outside_valid_range": num_invalid,
        "comment": "; ".join(
            f"{band} from {' and '.join(r.weights)}"
            for band, r in zip(bands, regressions, strict=True)
        ),
    }
    quality_attributes = _QUALITY_ATTRIBUTES | {
        "long_name": "worst mandatory quality of the MODIS bands used"
    }
    beside = {}
    if set(used) <= set(quality):
        worst = np.stack([np.maximum.reduce([quality[n] for n in r.weights]) for r in regressions])
        beside["albedo_quality"] = (("band", *_GRID), worst, quality_attributes)
    for name, kernel in KERNELS.items() if kernels else ():
        values = np.stack(
            [sum(w * weights[n][..., kernel] for n, w in r.weights.items()) for r in regressions]
        )
        values[outside] = np.nan
        beside[name] = (("band", *_GRID), values, cf_attributes(name))
    return xr.Dataset(
        {
            "surface_albedo": (("band", *_GRID), albedo, albedo_attributes),
            **beside,
        },
        coords={"band": list(bands), **coordinates},
        attrs={key: file.attrs[key] for key in ("title", "source") if key in file.attrs},
    )


def _read(
    file: xr.Dataset, names: tuple[str, ...], path: FilePath, times: np.ndarray | None = None
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict, int]:
    """Kernel weights of MODIS bands, quality of those that have it, coordinates, and how many
    weights are invalid.

    Of the dates that `times` have, in the order of the file, or of all.
    """
    advice = "request the area from AppEEARS in NetCDF format"
    require_variables(file, ["time", "lat", "lon"], path, advice)
    coordinates: dict = {name: _axis(file, name, path) for name in ("lat", "lon")}
    dates = _times(file, path)
    if times is not None:
        chosen = sorted({nearest_date(dates, time)[0] for time in times})
        file, dates = file.isel(time=chosen), dates[chosen]
    coordinates["time"] = ("time", dates, {"standard_name": "time"})
    weights, quality, num_invalid = {}, {}, 0
    for name in names:
        weights[name], invalid = _kernel_weights(file, name, path)
        if _QUALITY + name in file:
            quality[name] = _quality(file, name, path)
        num_invalid += invalid
    return weights, quality, coordinates, num_invalid


def _check_projection(file: xr.Dataset, path: FilePath) -> None:
    """Refuse a grid that is regular in metres, as that of MODIS itself is, not in degrees."""
    if "lat" in file.variables and file["lat"].dims == ("lat",):
        return
    mappings = (array.attrs.get("grid_mapping_name") for array in file.variables.values())
    projections = [str(name) for name in mappings if name is not None]
    if not projections and {str(dim).lower() for dim in file.dims} >= {"xdim", "ydim"}:
        projections = ["sinusoidal"]
    if projections and projections[0] != "latitude_longitude":
        raise InputError(f"{path} is in {projections[0]} projection; {_ADVICE}.")


def _choose_regressions(
    file: xr.Dataset, bands: tuple[str, ...], broadband: bool, path: FilePath
) -> list[BandRegression]:
    """For each ABI band its regression on MODIS bands, or a broadband in their stead."""
    chosen, lacking, stand_ins = [], [], []
    for band in bands:
        regression = MODIS_TO_ABI[band]
        missing = [name for name in regression.weights if _PARAMETERS + name not in file]
        stand_in = BROADBAND_STAND_IN.get(band)
        if stand_in is not None and _PARAMETERS + stand_in not in file:
            stand_in = None
        if missing and broadband and stand_in is not None:
            warnings.warn(
                f"{path} has no {_PARAMETERS}{missing[0]}; the albedo of {band} is that of the "
                f"broadband {stand_in}.",
                UserWarning,
                stacklevel=3,
            )
            regression = BandRegression({stand_in: 1.0}, 0.0)
        elif missing:
            lacking += missing
            stand_ins.append(stand_in)
        chosen.append(regression)
    if lacking:
        remedy = ""
        if None not in stand_ins:
            remedy = (
                f", or let its broadband albedo ({', '.join(dict.fromkeys(stand_ins))}) stand in "
                "for them: --broadband (in Python, broadband=True)"
            )
        names = ", ".join(_PARAMETERS + name for name in dict.fromkeys(lacking))
        raise InputError(
            f"{path} has no {names}; request these layers of MCD43A1 from AppEEARS{remedy}."
        )
    return chosen


def _kernel_weights(file: xr.Dataset, name: str, path: FilePath) -> tuple[np.ndarray, int]:
    """Kernel weights (time, lat, lon, kernel) of a MODIS band, and how many were out of range."""
    parameters = file[_PARAMETERS + name]
    require_dims(parameters, (*_GRID, "Num_Parameters"), path)
    if parameters.sizes["Num_Parameters"] != len(WHITE_SKY):
        raise InputError(
            f"{parameters.name} in {path} has {parameters.sizes['Num_Parameters']} kernel weights "
            f"where {len(WHITE_SKY)} are expected; request MCD43A1 from AppEEARS."
        )
    packed = np.issubdtype(parameters.encoding.get("dtype", np.float64), np.integer)
    if packed and "scale_factor" not in parameters.encoding:
        raise InputError(
            f"{parameters.name} in {path} has no scale_factor; give the file as AppEEARS wrote it."
        )
    values = load(parameters, path)
    invalid = _outside_valid_range(values, parameters)
    values[invalid] = np.nan
    return values, int(invalid.sum())


def _outside_valid_range(values: np.ndarray, array: xr.DataArray) -> np.ndarray:
    """Where unpacked values lie outside the range that the file states for packed ones."""
    scale = float(array.encoding.get("scale_factor", 1.0))
    offset = float(array.encoding.get("add_offset", 0.0))
    tolerance = 0.5 * scale  # half a count: packed values are whole
    lowest = float(array.attrs.get("valid_min", -np.inf)) * scale + offset - tolerance
    highest = float(array.attrs.get("valid_max", np.inf)) * scale + offset + tolerance
    return (values < lowest) | (values > highest)


def _quality(file: xr.Dataset, name: str, path: FilePath) -> np.ndarray:
    """Mandatory quality of a MODIS band, 255 where there is none."""
    quality = file[_QUALITY + name]
    require_dims(quality, _GRID, path)
    return np.nan_to_num(load(quality, path), nan=_NO_INVERSION).astype(np.uint8)


def _axis(file: xr.Dataset, name: str, path: FilePath) -> xr.DataArray:
    """Latitude or longitude of the grid: finite and monotonic."""
    axis = file[name]
    require_dims(axis, (name,), path)
    values = load(axis, path)
    steps = np.diff(values)
    if not np.isfinite(values).all() or not ((steps > 0).all() or (steps < 0).all()):
        raise InputError(f"{name} in {path} is not monotonic; give the file as AppEEARS wrote it.")
    ours = {"lat": "latitude", "lon": "longitude"}[name]
    units = MODEL[ours].units
    check_values(
        values, plausible(ours), units, f"{name} in {path}", lambda index: f"{name}={index[0]}"
    )
    return xr.DataArray(values, dims=(name,), attrs=cf_attributes(ours))


def _times(file: xr.Dataset, path: FilePath) -> np.ndarray:
    """Dates of a file; AppEEARS counts days in the julian calendar and means the usual one."""
    time = file["time"]
    require_dims(time, ("time",), path)
    try:
        dates = netCDF4.num2date(
            time.values, time.attrs["units"], time.attrs.get("calendar", "standard")
        )
    except (KeyError, ValueError) as error:
        raise InputError(
            f"time in {path} cannot be read as dates ({error}); give the file as AppEEARS wrote it."
        ) from error
    texts = [
        f"{date.year:04d}-{date.month:02d}-{date.day:02d}" for date in np.asarray(dates, object)
    ]
    return np.array(texts, dtype="datetime64[ns]")
