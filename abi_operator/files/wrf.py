"""Output of the WRF-ARW model, read one time and one block of rows at a time.

WRF counts levels from the ground up and splits pressure and geopotential into a base state and a
perturbation; the **model Dataset** returned here counts from the top down and has their sums.
"""

import numpy as np
import xarray as xr

from ..constants import GRAVITY, KAPPA
from ..nomenclature import MODEL
from .cell_bounds import cell_bounds
from .errors import InputError
from .netcdf import FilePath, cf_attributes, load, open_netcdf, require_dims, require_variables
from .plausible import plausible, without_traces
from .projection import projection_attributes
from .wrf_run import ADVICE, moves, run_attributes, times_of
from .wrf_run import SCHEMES as SCHEMES
from .wrf_values import DIMENSIONS, SUMS, check_block, check_stated_units

VARIABLE_MAP = {
    "XLAT": "latitude",
    "XLONG": "longitude",
    "P": "layer_pressure",  # perturbation of
    "PB": "layer_pressure",  # the base state
    "PH": "height",  # perturbation of
    "PHB": "height",  # the base state's geopotential
    "T": "layer_temperature",  # potential temperature less 300 K
    "PSFC": "surface_pressure",
    "QVAPOR": "vapour_mixing_ratio",
    "QCLOUD": "cloud_mixing_ratio",
    "QRAIN": "rain_mixing_ratio",
    "QICE": "ice_mixing_ratio",
    "QSNOW": "snow_mixing_ratio",
    "QGRAUP": "graupel_mixing_ratio",
    "QHAIL": "hail_mixing_ratio",
    "QICE2": "other_ice_mixing_ratio",  # P3 with more than one category, Ishmael
    "QICE3": "other_ice_mixing_ratio",
    "QNDROP": "cloud_number_mixing_ratio",  # NSSL schemes
    "QNCLOUD": "cloud_number_mixing_ratio",  # all others
    "QNRAIN": "rain_number_mixing_ratio",
    "QNICE": "ice_number_mixing_ratio",
    "QNSNOW": "snow_number_mixing_ratio",
    "QNGRAUPEL": "graupel_number_mixing_ratio",
    "QNHAIL": "hail_number_mixing_ratio",
    "RE_CLOUD": "cloud_effective_radius",
    "RE_ICE": "ice_effective_radius",
    "RE_SNOW": "snow_effective_radius",
    "TSK": "surface_temperature",
    "EMISS": "surface_emissivity",
    "XLAND": "land_mask",  # 1 land, 2 water
    "LANDMASK": "land_mask",  # 1 land, 0 water
    "SEAICE": "sea_ice",
    "SNOWC": "snow_cover",
    "SNOW": "snow_mass",  # as liquid water
    "U10": "wind_along_x",
    "V10": "wind_along_y",
    "ALBEDO": "broadband_albedo",
    "IVGTYP": "land_use",
    "LU_INDEX": "land_use",
}
"""WRF's name of a variable: ours. Of two that are alternatives the latter is preferred; further
categories of ice are added up."""

REQUIRED = ("P", "PB", "PH", "PHB", "T", "QVAPOR", "QCLOUD", "XLAT", "XLONG")

# Potential temperature is stored less this, whatever the file's T00. [K]
_THETA_OFFSET = 300.0
# Pressure at which temperature and potential temperature agree. [Pa]
_THETA_PRESSURE = 1.0e5

# Endings of our names of variables that need no arithmetic.
_TAKEN_AS_THEY_ARE = (
    "mixing_ratio",
    "effective_radius",
    "surface_pressure",
    "surface_temperature",
    "surface_emissivity",
    "sea_ice",
    "snow_cover",
    "snow_mass",
    "broadband_albedo",
    "land_use",
    "wind_along_x",
    "wind_along_y",
)

_FURTHER_ICE = "other_ice_mixing_ratio"
_FORMAT_ADVICE = "give a WRF output file (wrfout_*) in NetCDF"


def wrf_coordinates(path: FilePath, time: int = 0) -> xr.Dataset:
    """Read when and where the columns of a WRF file are, and check that it has what we need.

    Parameters
    ----------
    path
        A wrfout file.
    time
        Index of the time whose positions to return; it matters where a nest moves. [-]

    Returns
    -------
    xarray.Dataset
        Coordinates ``time``, of the whole file, and ``latitude`` and ``longitude`` (y, x)
        [degree]; ``land_mask`` and ``sea_ice`` if the file has them. Attributes ``title``,
        ``microphysics_scheme`` (a name of `wrf_run.SCHEMES`, or ``"MP_PHYSICS=99"`` for a number
        that is not there), ``bottom_top_levels_of_run`` (layers of the run, of which the file may
        hold fewer), ``land_use_scheme`` (MMINLU), ``moving_nest`` (1 where positions differ from
        time to time, else 0) and those of the map, as WRF names them (`projected`).
    """
    with open_netcdf(path, advice=_FORMAT_ADVICE) as file:
        require_variables(file, REQUIRED, path, ADVICE)
        times = times_of(file, path)
        place = {"time": time, "rows": slice(None), "path": path}
        dataset = xr.Dataset(
            coords={
                "time": ("time", times, {"standard_name": "time", "long_name": "time"}),
                "latitude": _field(file, "XLAT", **place),
                "longitude": _field(file, "XLONG", **place),
            },
            attrs=run_attributes(file)
            | {"moving_nest": int(moves(file))}
            | projection_attributes(file.attrs),
        )
        land_mask = _land_mask(file, **place)
        if land_mask is not None:
            dataset = dataset.assign(land_mask=land_mask)
        if "SEAICE" in file:
            dataset = dataset.assign(sea_ice=_field(file, "SEAICE", **place))
        return dataset


def read_wrf(path: FilePath, time: int, rows: slice = slice(None)) -> xr.Dataset:
    """Read one time and a block of rows of a WRF file; nothing else is read from disk.

    Pressure is P + PB, temperature (T + 300) (p / 1e5 Pa)^(2/7), with T and not the moist THM,
    and height (PH + PHB) / 9.81. Water of each kind, and the number of its particles, is per mass
    of dry air. Advection leaves small negative amounts; they are set to zero, and the variable's
    attributes ``num_negative_set_to_zero`` and ``smallest_negative`` tell how many there were, and
    how small. Whatever else is not in the range of `plausible.PLAUSIBLE` is an `InputError`.

    Parameters
    ----------
    path
        A wrfout file.
    time
        Index of the time, from 0. [-]
    rows
        The rows ``y`` to read, counted from the south. [-]

    Returns
    -------
    xarray.Dataset
        Variables of `abi_operator.nomenclature.MODEL`, float64, dimensions ``layer y x`` and
        ``level y x``, top first, with the scalar coordinate ``time`` and the corners of cells,
        which those of a block share with the rows beside it.
    """
    with opened_wrf(path) as file:
        return block_of_wrf(file, path, time, rows)


def opened_wrf(path: FilePath) -> xr.Dataset:
    """A WRF file for `block_of_wrf`, to be closed or used as a context manager."""
    return open_netcdf(path, advice=_FORMAT_ADVICE)


def block_of_wrf(file: xr.Dataset, path: FilePath, time: int, rows: slice) -> xr.Dataset:
    """`read_wrf` of a file that is open, of which the library unpacks a chunk once for all blocks
    of rows that it has a part of."""
    require_variables(file, REQUIRED, path, ADVICE)
    times = times_of(file, path)
    place = {"time": time, "rows": rows, "path": path}
    pressure = _field(file, "P", **place) + _field(file, "PB", **place)
    _check_sum(pressure, "layer_pressure", **place)
    theta = _field(file, "T", **place) + _THETA_OFFSET
    fields = {
        "layer_pressure": pressure,
        "layer_temperature": theta * (pressure / _THETA_PRESSURE) ** KAPPA,
        "height": (_field(file, "PH", **place) + _field(file, "PHB", **place)) / GRAVITY,
    }
    for name, ours in VARIABLE_MAP.items():
        if name in file and ours.endswith(_TAKEN_AS_THEY_ARE):
            field = _field(file, name, **place)
            adds = ours == _FURTHER_ICE and ours in fields
            fields[ours] = fields[ours] + field if adds else field
    _check_sum(fields["layer_temperature"], "layer_temperature", **place)
    _check_sum(fields["height"], "height", **place)
    land_mask = _land_mask(file, **place)
    if land_mask is not None:
        fields["land_mask"] = land_mask
    coords = {
        "time": times[time],
        "latitude": _field(file, "XLAT", **place),
        "longitude": _field(file, "XLONG", **place),
    } | _bounds(file, **place)
    attributes = run_attributes(file)
    dataset = xr.Dataset({n: _finish(f, n) for n, f in fields.items()}, coords, attributes)
    _check_columns(dataset, path)
    return dataset


def _field(file: xr.Dataset, name: str, *, time: int, rows: slice, path: FilePath) -> xr.DataArray:
    """One of WRF's variables in our dimensions, top first."""
    single = "Time" not in file.sizes  # one time, the dimension of which was squeezed out
    num_times = file.sizes.get("Time", 1)
    if not 0 <= time < num_times:
        raise InputError(f"{path} has {num_times} times; ask for one of them, from 0, not {time}.")
    array = file[name]
    ours = VARIABLE_MAP[name]
    dims = MODEL[ours].dims
    written_once = "Time" not in array.dims and dims == ("y", "x")  # for all times
    fixed = single or written_once
    theirs = tuple(theirs for dim in dims for theirs, own in DIMENSIONS.items() if own == dim)
    require_dims(array, theirs if fixed else ("Time", *theirs), path)
    check_stated_units(array, ours, path)
    block = array.isel(south_north=rows) if fixed else array.isel(Time=time, south_north=rows)
    values = load(block, path)
    if len(dims) == 3:
        values = values[::-1]
    check_block(values, ours, name, time=time, rows=rows, path=path)
    return xr.DataArray(values, dims=dims, attrs=cf_attributes(ours))


def _check_sum(array: xr.DataArray, ours: str, *, time: int, rows: slice, path: FilePath) -> None:
    check_block(array.values, ours, SUMS[ours], time=time, rows=rows, path=path)


def _bounds(file: xr.Dataset, *, time: int, rows: slice, path: FilePath) -> dict[str, xr.DataArray]:
    """Corners of the cells of some rows, from the columns' places in them and in the rows beside.

    None for a single row or line of columns, of which nothing tells how wide it is.
    """
    start, stop, _ = rows.indices(file.sizes["south_north"])
    first = max(start - 1, 0)
    place = {"time": time, "rows": slice(first, stop + 1), "path": path}
    latitude, longitude = (_field(file, name, **place).values for name in ("XLAT", "XLONG"))
    if min(latitude.shape) < 2:
        return {}
    names = "latitude_bounds", "longitude_bounds"
    corners = (x[start - first :][: stop - start] for x in cell_bounds(latitude, longitude))
    return {
        name: xr.DataArray(values, dims=MODEL[name].dims, attrs=cf_attributes(name))
        for name, values in zip(names, corners, strict=True)
    }


def _land_mask(file: xr.Dataset, *, time: int, rows: slice, path: FilePath) -> xr.DataArray | None:
    """1 over land, 0 over water; None where the file does not say."""
    for name in ("LANDMASK", "XLAND"):
        if name in file:
            values = _field(file, name, time=time, rows=rows, path=path)
            return (values == 1).astype(np.float64).assign_attrs(cf_attributes("land_mask"))
    return None


def _finish(array: xr.DataArray, name: str) -> xr.DataArray:
    """Give a variable its attributes, and a mixing ratio no negative values."""
    array = array.assign_attrs(cf_attributes(name))
    if name.endswith("mixing_ratio"):
        values, attributes = without_traces(array.values, plausible(name))
        array = array.copy(data=values).assign_attrs(attributes)
    return array


def _check_columns(dataset: xr.Dataset, path: FilePath) -> None:
    """Refuse columns whose pressure or height does not run from the top to the ground."""
    pressure, height = dataset["layer_pressure"].values, dataset["height"].values
    num_layers, num_levels = len(pressure), len(height)
    if num_levels != num_layers + 1:
        raise InputError(
            f"{path} has {num_layers} layers and {num_levels} staggered levels, which should be "
            "one more; cut levels out of bottom_top and bottom_top_stag alike."
        )
    if "surface_pressure" in dataset:
        pressure = np.concatenate([pressure, dataset["surface_pressure"].values[None]])
    bad = (pressure <= 0).any(axis=0) | (np.diff(pressure, axis=0) <= 0).any(axis=0)
    if bad.any():
        raise InputError(
            f"P + PB in {path} does not fall monotonically with height, from PSFC down to a "
            f"positive pressure, in {np.count_nonzero(bad)} of the {bad.size} columns read; "
            "the operator needs columns in which it does."
        )
    thin = (np.diff(height, axis=0) >= 0).any(axis=0)
    if thin.any():
        raise InputError(
            f"PH + PHB in {path} does not rise from level to level in {np.count_nonzero(thin)} of "
            f"the {thin.size} columns read; the operator needs layers of positive thickness."
        )
