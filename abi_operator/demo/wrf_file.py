"""Write air and clouds as WRF does: float32, ground first, base state and perturbation apart."""

from pathlib import Path

import netCDF4
import numpy as np

from ..constants import DRY_AIR_GAS_CONSTANT, GRAVITY, KAPPA
from .air import TOP_PRESSURE, Air, column_pressure, eta_levels
from .grid import CENTRE_LATITUDE, CENTRE_LONGITUDE, Grid, latitude_longitude

TIME = "2007-10-23_18:00:00"
FILE_NAME = "wrfout_d01_2007-10-23_18-00-00.nc"

_SURFACE = ("Time", "south_north", "west_east")
_LAYERS = ("Time", "bottom_top", "south_north", "west_east")
_LEVELS = ("Time", "bottom_top_stag", "south_north", "west_east")
# Temperature of the base state, which WRF lets fall with the logarithm of pressure. [K]
_BASE_TEMPERATURE, _BASE_LAPSE = 290.0, 50.0
# By how much sunlit land is warmer than the air over it, in the morning. [K]
_SUNLIT = 8.0


def write_wrf(
    path: Path,
    grid: Grid,
    air: Air,
    cloud_water: np.ndarray,
    terrain: np.ndarray,
    land: np.ndarray,
    wind: tuple[np.ndarray, np.ndarray],
) -> None:
    """Write one time of a model run.

    Parameters
    ----------
    path
        The file.
    grid
        Where the columns are.
    air
        What they hold.
    cloud_water
        Cloud water per mass of dry air (layer, y, x). [kg kg-1]
    terrain
        Height of the ground (y, x). [m]
    land
        True over land (y, x).
    wind
        To the east and to the north, 10 m above the ground (y, x). [m s-1]
    """
    base_pressure = column_pressure(terrain)[1]
    base_geopotential = _base_geopotential(terrain)
    latitude, longitude = latitude_longitude(grid.east, grid.north)
    theta = air.temperature * (1.0e5 / air.pressure) ** KAPPA
    nothing = np.zeros_like(cloud_water)
    fields = (
        ("XLAT", _SURFACE, "degree_north", "LATITUDE, SOUTH IS NEGATIVE", latitude),
        ("XLONG", _SURFACE, "degree_east", "LONGITUDE, WEST IS NEGATIVE", longitude),
        ("HGT", _SURFACE, "m", "Terrain Height", terrain),
        ("LANDMASK", _SURFACE, "", "LAND MASK (1 FOR LAND, 0 FOR WATER)", land),
        ("TSK", _SURFACE, "K", "SURFACE SKIN TEMPERATURE", air.temperature[0] + _SUNLIT * land),
        ("EMISS", _SURFACE, "", "SURFACE EMISSIVITY", np.where(land, 0.95, 0.98)),
        ("U10", _SURFACE, "m s-1", "U at 10 M", wind[0]),
        ("V10", _SURFACE, "m s-1", "V at 10 M", wind[1]),
        ("PSFC", _SURFACE, "Pa", "SFC PRESSURE", air.level_pressure[0]),
        ("P", _LAYERS, "Pa", "perturbation pressure", air.pressure - base_pressure),
        ("PB", _LAYERS, "Pa", "BASE STATE PRESSURE", base_pressure),
        ("T", _LAYERS, "K", "perturbation potential temperature theta-t0", theta - 300.0),
        (
            "PH",
            _LEVELS,
            "m2 s-2",
            "perturbation geopotential",
            GRAVITY * air.height - base_geopotential,
        ),
        ("PHB", _LEVELS, "m2 s-2", "base-state geopotential", base_geopotential),
        ("QVAPOR", _LAYERS, "kg kg-1", "Water vapor mixing ratio", air.vapour),
        ("QCLOUD", _LAYERS, "kg kg-1", "Cloud water mixing ratio", cloud_water),
        ("QRAIN", _LAYERS, "kg kg-1", "Rain water mixing ratio", nothing),
        ("QICE", _LAYERS, "kg kg-1", "Ice mixing ratio", nothing),
        ("QSNOW", _LAYERS, "kg kg-1", "Snow mixing ratio", nothing),
        ("QGRAUP", _LAYERS, "kg kg-1", "Graupel mixing ratio", nothing),
    )
    with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
        _define(file, grid, num_layers=len(cloud_water))
        for name, dims, units, description, values in fields:
            variable = file.createVariable(name, "f4", dims, compression="zlib", complevel=1)
            variable.setncatts({"units": units, "description": description})
            variable.setncatts({"MemoryOrder": "XYZ" if len(dims) == 4 else "XY "})
            variable[0] = values


def _base_geopotential(terrain: np.ndarray) -> np.ndarray:
    """Geopotential of the base state at the levels. [m2 s-2]"""
    levels, layers = column_pressure(terrain)
    temperature = np.maximum(_BASE_TEMPERATURE + _BASE_LAPSE * np.log(layers / 1.0e5), 200.0)
    thickness = -np.diff(levels, axis=0) * DRY_AIR_GAS_CONSTANT * temperature / layers
    ground = GRAVITY * terrain[None]
    return np.concatenate([ground, ground + np.cumsum(thickness, axis=0)])


def _define(file: netCDF4.Dataset, grid: Grid, num_layers: int) -> None:
    """Dimensions, attributes and coordinates of a wrfout file."""
    rows, columns = grid.east.shape
    file.setncatts(
        {
            "TITLE": " OUTPUT FROM A DEMONSTRATION IN THE LAYOUT OF WRF",
            "START_DATE": TIME,
            "SIMULATION_START_DATE": TIME,
            "WEST-EAST_GRID_DIMENSION": columns + 1,
            "SOUTH-NORTH_GRID_DIMENSION": rows + 1,
            "BOTTOM-TOP_GRID_DIMENSION": num_layers + 1,
            "DX": np.float32(grid.spacing),
            "DY": np.float32(grid.spacing),
            "MP_PHYSICS": 10,
            "USE_THETA_M": 0,
            "CEN_LAT": np.float32(CENTRE_LATITUDE),
            "CEN_LON": np.float32(CENTRE_LONGITUDE),
            "TRUELAT1": np.float32(CENTRE_LATITUDE),
            "TRUELAT2": np.float32(0.0),
            "STAND_LON": np.float32(CENTRE_LONGITUDE),
            "MAP_PROJ": 3,
            "MAP_PROJ_CHAR": "Mercator",
        }
    )
    for name, size in (
        ("Time", None),
        ("DateStrLen", 19),
        ("west_east", columns),
        ("south_north", rows),
        ("bottom_top", num_layers),
        ("bottom_top_stag", num_layers + 1),
    ):
        file.createDimension(name, size)
    file.createVariable("Times", "S1", ("Time", "DateStrLen"))[0] = np.array(list(TIME), "S1")
    minutes = file.createVariable("XTIME", "f4", ("Time",))
    minutes.units = f"minutes since {TIME.replace('_', ' ')}"
    minutes[0] = 0.0
    eta = file.createVariable("ZNW", "f4", ("Time", "bottom_top_stag"))
    eta.setncatts({"units": "", "description": "eta values on full (w) levels"})
    eta[0] = eta_levels()
    top = file.createVariable("P_TOP", "f4", ("Time",))
    top.setncatts({"units": "Pa", "description": "PRESSURE TOP OF THE MODEL"})
    top[0] = TOP_PRESSURE
