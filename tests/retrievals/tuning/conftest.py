"""A small scene, its own image with noise, and files of what was observed of it."""

import numpy as np
import pytest
import xarray as xr

from retrievals.observation import add_noise
from retrievals.tuning import numbers_of

NUMBERS = ("strength", "ssa", "height")


@pytest.fixture(scope="session")
def image(make_scenario):
    """A scene at one time, with little smoke and much, on a grid 4 km wide.

    Its reflectances are made up: what is compared need not be simulated.
    """
    scenario = make_scenario(aod_550=tuple(np.linspace(0.1, 2.0, 8)))
    y, x = np.meshgrid(np.arange(3), np.arange(8), indexing="ij")
    factor = 0.1 + 0.2 * np.random.default_rng(0).random((3, 3, 8))
    result = scenario.assign(reflectance_factor=(("band", "y", "x"), factor))
    return result.assign_attrs(num_streams=2, gases="none").assign_coords(
        latitude=(("y", "x"), 33 + 0.036 * y),
        longitude=(("y", "x"), -117 + 0.043 * x),
        time=np.datetime64("2007-10-23T18:00", "ns"),
    )


@pytest.fixture(scope="session")
def observe_as():
    """Builder of observations as `read_observed` returns them."""

    def build(factor: xr.DataArray, seed: int | None = None) -> xr.Dataset:
        seen = factor if seed is None else add_noise(factor, seed)
        dims = ("band", "y", "x")
        values = seen.transpose(*dims).values
        return xr.Dataset(
            {
                "reflectance_factor": (dims, values),
                "saturated": (dims, np.zeros(values.shape, np.int8)),
            },
            {"band": factor["band"].values},
            {"observed_files": "a.nc", "observed_variables": "C01", "regridding": "none"},
        )

    return build


@pytest.fixture(scope="session")
def numbers(image):
    """State vector of the plume's numbers."""
    return numbers_of(image, NUMBERS)
