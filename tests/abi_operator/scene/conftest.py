"""A small model Dataset, whole and hydrostatic, and the albedo under it."""

import numpy as np
import pytest
import xarray as xr

from abi_operator.constants import DRY_AIR_GAS_CONSTANT, GRAVITY

TIME = np.datetime64("2007-10-23T18:00:00", "ns")
HEIGHTS = np.array([9000.0, 6000.0, 3000.0, 1500.0, 800.0, 0.0])
TEMPERATURE = 270.0
SURFACE_PRESSURE = 100000.0


@pytest.fixture
def make_model():
    """Builder of dry isothermal air over sloping ground, cloud in the second layer from below.

    Keywords replace variables or, being None, remove them; numbers fill them.
    """

    def make(shape=(3, 2), **replaced):
        rows, columns = np.meshgrid(np.arange(shape[0]), np.arange(shape[1]), indexing="ij")
        height = HEIGHTS[:, None, None] + 30.0 * rows
        middle = (height[1:] + height[:-1]) / 2
        scale_height = DRY_AIR_GAS_CONSTANT * TEMPERATURE / GRAVITY
        layers, levels, horizontal = ("layer", "y", "x"), ("level", "y", "x"), ("y", "x")
        cloud = np.zeros_like(middle)
        cloud[-2] = 3e-4 * (columns == 0)
        variables = {
            "height": (levels, height),
            "layer_pressure": (layers, SURFACE_PRESSURE * np.exp(-middle / scale_height)),
            "surface_pressure": (horizontal, SURFACE_PRESSURE * np.exp(-height[-1] / scale_height)),
            "layer_temperature": (layers, np.full_like(middle, TEMPERATURE)),
            "vapour_mixing_ratio": (layers, np.zeros_like(middle)),
            "cloud_mixing_ratio": (layers, cloud),
            "land_mask": (horizontal, (columns > 0).astype(float)),
        }
        coords = {
            "time": TIME,
            "latitude": (horizontal, 33.0 + 0.1 * rows),
            "longitude": (horizontal, -117.0 + 0.1 * columns),
        }
        model = xr.Dataset(variables, coords, {"title": "test", "microphysics_scheme": "morrison"})
        for name, value in replaced.items():
            if value is None:
                model = model.drop_vars(name)
            else:
                layered = name.endswith(("ratio", "layer_temperature", "radius"))
                dims = layers if layered else horizontal
                values = np.broadcast_to(np.asarray(value, float), [model.sizes[d] for d in dims])
                model[name] = (dims, values.copy())
        return model

    return make


@pytest.fixture
def make_albedo():
    """Builder of an albedo Dataset: 0.1, 0.2 and on by longitude, 0.01 more in every next band."""

    def make(
        bands=("C01", "C02", "C03", "C06"),
        dates=("2007-10-16", "2007-10-24"),
        lat=(33.4, 33.2, 33.0, 32.8),
        lon=(-117.1, -117.0, -116.9),
    ):
        shape = (len(bands), len(dates), len(lat), len(lon))
        values = 0.1 * (1 + np.arange(len(lon))) + 0.01 * np.arange(len(bands))[:, None, None, None]
        return xr.Dataset(
            {
                "surface_albedo": (
                    ("band", "time", "lat", "lon"),
                    np.broadcast_to(values, shape).copy(),
                )
            },
            {"band": list(bands), "time": np.array(dates, "datetime64[ns]")}
            | {"lat": list(lat), "lon": list(lon)},
        )

    return make
