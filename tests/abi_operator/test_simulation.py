"""What is found out of a whole scene, and refused, before anything of it is simulated."""

import netCDF4
import numpy as np
import pytest
from demonstration import SIZE

from abi_operator import simulation
from abi_operator.simulation import Request, open_scene


@pytest.mark.parametrize("hot", [True, False])
def test_ground_that_is_hot_in_any_block_is_of_the_whole_scene(inputs, monkeypatch, hot):
    """All blocks of a file have the same variables."""
    monkeypatch.setattr(simulation, "_BLOCK_COLUMNS", SIZE)
    with netCDF4.Dataset(inputs.wrf, "a") as file:
        assert np.ptp(file["TSK"][:]) < 50
        file["TSK"][0, 5, 5] = 600.0 if hot else 350.0
    assert open_scene(Request(inputs.wrf, inputs.albedo, 0.03)).hot_ground == hot
