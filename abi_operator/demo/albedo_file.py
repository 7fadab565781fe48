"""Write MODIS albedo as the AppEEARS service delivers MCD43A1."""

from pathlib import Path

import netCDF4
import numpy as np

from .grid import EXTENT, east_north, latitude_longitude
from .ground import make_ground
from .landscape import Landscape

DATES = ("2007-10-08", "2007-10-16", "2007-10-24")

# The file reaches this far beyond the scene [m], in cells this much finer [-].
_MARGIN = 16.0e3
_REFINEMENT = 1.4
# Cells up to this many spacings off shore are inverted, as MODIS does in shallow water. [-]
_SHALLOWS = 1.5
_SCALE = 0.001
_FILL, _QUALITY_FILL = 32767, 255
_EPOCH = "2000-01-01"
_GRID = ("time", "lat", "lon")


def write_albedo(path: Path, landscape: Landscape, spacing: float) -> None:
    """Write kernel weights and quality in MODIS bands 1 to 7, missing over the sea.

    Parameters
    ----------
    path
        The file.
    landscape
        What the ground is like.
    spacing
        That of the scene's grid. [m]
    """
    latitude, longitude = _axes(spacing)
    east, north = east_north(*np.meshgrid(latitude, longitude, indexing="ij"))
    distance = landscape.coast_distance(east, north)
    at_sea = distance < -_SHALLOWS * spacing
    magnitude_inversion = landscape.plants(north, east, spacing) > 1.0
    quality = np.where(at_sea, _QUALITY_FILL, magnitude_inversion)
    ground = make_ground(landscape, east, north, distance, spacing / _REFINEMENT)
    dryness = 0.02 * np.arange(len(DATES))
    weights = np.stack([ground.kernel_weights(share) for share in dryness], axis=1)
    packed = np.where(at_sea[..., None], _FILL, np.rint(weights / _SCALE))
    with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
        file.setncatts(
            {
                "title": "MCD43A1.061 for a demonstration",
                "Conventions": "CF-1.6",
                "source": "synthetic, in the layout of AppEEARS",
            }
        )
        _define_axes(file, latitude, longitude)
        for band in range(7):
            _write_quality(file, f"Band{band + 1}", quality)
            _write_weights(file, f"Band{band + 1}", packed[band])


def _axes(spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Latitudes, north first, and longitudes of cells that cover the scene and its margin."""
    edges = np.array([-1, 1]) * (EXTENT / 2 + _MARGIN)
    latitude, longitude = latitude_longitude(edges, edges)
    step = np.ptp(longitude) / np.ptp(edges) * spacing / _REFINEMENT
    return np.arange(latitude[1], latitude[0], -step), np.arange(longitude[0], longitude[1], step)


def _define_axes(file: netCDF4.Dataset, latitude: np.ndarray, longitude: np.ndarray) -> None:
    file.createVariable("crs", "i1").setncatts(
        {
            "grid_mapping_name": "latitude_longitude",
            "epsg_code": 4326,
            "horizontal_datum_name": "WGS84",
            "semi_major_axis": 6378137,
            "inverse_flattening": 298.257223563,
            "longitude_of_prime_meridian": 0.0,
        }
    )
    for name, size in zip(_GRID, (len(DATES), len(latitude), len(longitude)), strict=True):
        file.createDimension(name, size)
    file.createDimension("Num_Parameters", 3)
    time = file.createVariable("time", "i4", ("time",))
    time.setncatts({"standard_name": "time", "axis": "T"})
    time.setncatts({"units": f"days since {_EPOCH} 00:00:00", "calendar": "julian"})
    time[:] = (np.array(DATES, "datetime64[D]") - np.datetime64(_EPOCH)).astype(int)
    for name, standard_name, units, values in (
        ("lat", "latitude", "degrees_north", latitude),
        ("lon", "longitude", "degrees_east", longitude),
    ):
        axis = file.createVariable(name, "f8", (name,))
        axis.setncatts({"standard_name": standard_name, "units": units})
        axis[:] = values


def _write_quality(file: netCDF4.Dataset, band: str, values: np.ndarray) -> None:
    name = f"BRDF_Albedo_Band_Mandatory_Quality_{band}"
    quality = file.createVariable(name, "i2", _GRID, fill_value=_QUALITY_FILL, compression="zlib")
    quality.setncatts(
        {
            "coordinates": "time lat lon",
            "grid_mapping": "crs",
            "valid_min": np.int16(0),
            "valid_max": np.int16(254),
            "long_name": name,
            "units": "concatenated flags",
        }
    )
    quality.set_auto_maskandscale(False)
    quality[:] = np.broadcast_to(values, quality.shape)


def _write_weights(file: netCDF4.Dataset, band: str, packed: np.ndarray) -> None:
    name = f"BRDF_Albedo_Parameters_{band}"
    dims = (*_GRID, "Num_Parameters")
    weights = file.createVariable(name, "i2", dims, fill_value=_FILL, compression="zlib")
    weights.setncatts(
        {
            "coordinates": "time lat lon Num_Parameters",
            "grid_mapping": "crs",
            "valid_min": np.int16(0),
            "valid_max": np.int16(32767),
            "long_name": name,
            "units": "reflectance, no units",
            "scale_factor": _SCALE,
            "add_offset": 0.0,
        }
    )
    weights.set_auto_maskandscale(False)
    weights[:] = packed
