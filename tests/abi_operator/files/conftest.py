"""Synthetic twins of the files that users bring, small, with every quirk on request."""

import os
from pathlib import Path

import netCDF4
import numpy as np
import pytest

SURFACE = ("Time", "south_north", "west_east")
LAYERS = ("Time", "bottom_top", "south_north", "west_east")
LEVELS = ("Time", "bottom_top_stag", "south_north", "west_east")
SIZES = {"Time": 2, "bottom_top": 4, "bottom_top_stag": 5, "south_north": 3, "west_east": 2}
TIMES = ("2007-10-23_18:00:00", "2007-10-23_18:30:00")


def wrf_fields() -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """Dimensions and values of a WRF twin's variables, float32."""
    rng = np.random.default_rng(20071023)
    shape = {dims: tuple(SIZES[d] for d in dims) for dims in (SURFACE, LAYERS, LEVELS)}
    column = (1, -1, 1, 1)
    base = np.array([950e2, 800e2, 500e2, 200e2]).reshape(column)
    geopotential = 9.81 * np.array([0.0, 900.0, 3000.0, 8000.0, 15000.0]).reshape(column)
    latitude = np.broadcast_to(33.0 + 0.1 * np.arange(3)[:, None], (2, 3, 2))
    longitude = np.broadcast_to(-118.0 + 0.1 * np.arange(2), (2, 3, 2))
    fields = {
        "P": (LAYERS, rng.uniform(-500, 500, shape[LAYERS])),
        "PB": (LAYERS, np.broadcast_to(base, shape[LAYERS])),
        "PH": (LEVELS, rng.uniform(-50, 50, shape[LEVELS])),
        "PHB": (LEVELS, np.broadcast_to(geopotential, shape[LEVELS])),
        "T": (LAYERS, rng.uniform(-10, 60, shape[LAYERS])),
        "THM": (LAYERS, np.full(shape[LAYERS], 1e3)),  # must not be read
        "QVAPOR": (LAYERS, rng.uniform(0, 0.01, shape[LAYERS])),
        "QCLOUD": (LAYERS, rng.uniform(0, 0.001, shape[LAYERS])),
        "PSFC": (SURFACE, np.full(shape[SURFACE], 1000e2)),
        "XLAT": (SURFACE, latitude),
        "XLONG": (SURFACE, longitude),
    }
    return {name: (dims, np.array(values, np.float32)) for name, (dims, values) in fields.items()}


@pytest.fixture
def write_wrf_twin(tmp_path):
    """A function that writes a WRF twin, altered as its arguments say, and returns its path."""

    def write(
        *,
        without: tuple[str, ...] = (),
        extra: dict | None = None,
        timeless: tuple[str, ...] = (),
        times: str | None = "DateStrLen",
        time_texts: tuple[str, ...] = TIMES,
        xtime: tuple[float, ...] = (),
        xtime_units: str = "",
        name: str = "wrfout_d01_2007-10-23_18:00:00",
    ) -> Path:
        fields = {n: f for n, f in (wrf_fields() | (extra or {})).items() if n not in without}
        path = tmp_path / name
        with netCDF4.Dataset(path, "w", format="NETCDF3_64BIT_OFFSET") as file:
            file.setncatts({"TITLE": " OUTPUT FROM WRF V4.2 MODEL", "MP_PHYSICS": 10})
            file.setncatts({"START_DATE": TIMES[0], "BOTTOM-TOP_GRID_DIMENSION": 30})
            for dim, size in SIZES.items():
                file.createDimension(dim, None if dim == "Time" else size)
            for variable, (dims, values) in fields.items():
                if variable in timeless:
                    dims, values = dims[1:], values[0]
                file.createVariable(variable, "f4", dims)[:] = values
            if times is not None:
                file.createDimension(times, 19)
                characters = np.array([list(text) for text in time_texts], "S1")
                file.createVariable("Times", "S1", ("Time", times))[:] = characters
            if xtime:
                variable = file.createVariable("XTIME", "f4", ("Time",))
                variable[:] = xtime
                variable.units = xtime_units
        return path

    return write


@pytest.fixture
def write_albedo_twin(tmp_path):
    """A function that writes an AppEEARS twin and returns its path.

    Its argument holds, by MODIS band, packed weights (time, lat, lon, 3); quality is 1 where they
    are valid.
    """

    def write(
        packed: dict[str, np.ndarray],
        *,
        quality: dict[str, np.ndarray] | None = None,
        calendar: str = "julian",
        scale_factor: float | None = 0.001,
        latitude: tuple[float, ...] = (34.0, 33.5),
    ) -> Path:
        path = tmp_path / "MCD43A1.nc"
        num_times, num_lat, num_lon, num_weights = next(iter(packed.values())).shape
        with netCDF4.Dataset(path, "w") as file:
            file.setncatts({"title": "MCD43A1.061", "source": "AppEEARS"})
            sizes = {"time": num_times, "lat": num_lat, "lon": num_lon}
            for dim, size in (sizes | {"Num_Parameters": num_weights}).items():
                file.createDimension(dim, size)
            time = file.createVariable("time", "i4", ("time",))
            time.setncatts({"units": "days since 2000-01-01 00:00:00", "calendar": calendar})
            time[:] = 2844 + 8 * np.arange(num_times)  # 15 October 2007 and every 8 days
            file.createVariable("lat", "f8", ("lat",))[:] = latitude
            file.createVariable("lon", "f8", ("lon",))[:] = -118.0 + 0.5 * np.arange(num_lon)
            for band, values in packed.items():
                name = f"BRDF_Albedo_Parameters_{band}"
                dims = (*sizes, "Num_Parameters")
                weights = file.createVariable(name, "i2", dims, fill_value=32767)
                weights.setncatts({"valid_min": np.int16(0), "valid_max": np.int16(32766)})
                if scale_factor is not None:
                    weights.setncatts({"scale_factor": scale_factor, "add_offset": 0.0})
                weights.set_auto_maskandscale(False)
                weights[:] = values
                name = f"BRDF_Albedo_Band_Mandatory_Quality_{band}"
                flags = file.createVariable(name, "i2", tuple(sizes), fill_value=255)
                flags.set_auto_maskandscale(False)
                default = np.where((values == 32767).any(axis=-1), 255, 1)
                flags[:] = (quality or {}).get(band, default)
        return path

    return write


@pytest.fixture
def sample_data() -> Path:
    """Folder of real files, named by ABI_OPERATOR_SAMPLE_DATA."""
    folder = os.environ.get("ABI_OPERATOR_SAMPLE_DATA")
    if not folder:
        pytest.skip("ABI_OPERATOR_SAMPLE_DATA names no folder of real files")
    return Path(folder)
