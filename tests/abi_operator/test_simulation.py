"""What is found out of a whole scene, and refused, before anything of it is simulated."""

import netCDF4
import numpy as np
import pytest
from demonstration import SIZE

from abi_operator import simulation
from abi_operator.files import InputError
from abi_operator.simulation import Request, open_scene


@pytest.mark.parametrize("hot", [True, False])
def test_ground_that_is_hot_in_any_block_is_of_the_whole_scene(inputs, monkeypatch, hot):
    """All blocks of a file have the same variables."""
    monkeypatch.setattr(simulation, "_BLOCK_COLUMNS", SIZE)
    with netCDF4.Dataset(inputs.wrf, "a") as file:
        assert np.ptp(file["TSK"][:]) < 50
        file["TSK"][0, 5, 5] = 600.0 if hot else 350.0
    assert open_scene(Request(inputs.wrf, inputs.albedo, 0.03)).hot_ground == hot


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("brf", "vapour"), "the result has no vapour; choose of brf, height, liquid_mass_path, "),
        (("smokee_aod_550",), "the result has no smokee_aod_550; choose of .*smoke_aod_550, "),
        (("rain_optical_depth",), "the result has no rain_optical_depth"),
    ],
)
def test_variables_that_the_result_will_not_have_are_refused_at_once(inputs, names, message):
    """And not when the first block has been simulated."""
    request = Request(inputs.wrf, inputs.albedo, 0.03, inputs.plume, gases=())
    with pytest.raises(InputError, match=message):
        open_scene(request._replace(variables=names))
    assert open_scene(request._replace(variables=("brf", "smoke_aod_550")))
