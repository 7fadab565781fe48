"""A small scene of ash over sea, land and cloud, at 2 streams."""

import pytest

from abi_operator.demo import write_demo
from abi_operator.files import read_result
from abi_operator.simulation import RESULT, Request, Species, open_scene, simulate_scene

BANDS = ("C01", "C02", "C03", "C06", "green")


@pytest.fixture(scope="package")
def result_file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ash")
    inputs = write_demo(folder, size=16)
    ash = {"plume": inputs.plume, "plume_species": Species.ASH}
    how = {"bands": BANDS, "gases": (), "num_streams": 2, "error_budget": None}
    request = Request(inputs.wrf, inputs.albedo, 0.03, **ash, **how)
    simulate_scene(open_scene(request), folder)
    return folder / RESULT


@pytest.fixture(scope="package")
def image(result_file):
    with read_result(result_file) as result:
        return result.isel(time=0).load()
