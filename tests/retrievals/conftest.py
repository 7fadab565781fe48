"""Small scenes with every kind of ground, and a cloud, under smoke."""

import numpy as np
import pytest
import xarray as xr

from abi_operator import smoke
from abi_operator.nomenclature import SCENARIO
from abi_operator.scene import column_states, gases_of, simulate
from retrievals.declarations import plume as plume_vector
from retrievals.forward import ForwardModel, prepared
from retrievals.kinds import BANDS
from retrievals.observation import observe

HEIGHT = np.array([60e3, 20e3, 8e3, 3e3, 2e3, 1e3, 500.0, 0.0])
DARK, BRIGHT, CLOUDY = 0, 1, 2  # rows of a scene: dark ground, bright ground, dark under cloud


def scenario(aod_550=(0.05, 0.3, 0.9, 2.0), ssa_shift=0.0):
    """Scenario (y, x): three kinds of ground, and smoke of each optical depth over each of them.

    `ssa_shift` is added to the logit of the smoke's single-scattering albedo.
    """
    shape = (3, len(aod_550))
    fields = {
        "latitude": np.full(shape, 33.0),
        "longitude": np.full(shape, -117.0),
        "pressure": _columns(101325 * np.exp(-HEIGHT / 8000), shape),
        "height": _columns(HEIGHT, shape),
        "liquid_mass_path": np.zeros((len(HEIGHT) - 1, *shape)),
        "liquid_number_path": np.zeros((len(HEIGHT) - 1, *shape)),
        "surface_albedo": np.full((len(BANDS), *shape), 0.05),
        "solar_zenith_angle": np.full(shape, 48.0),
        "view_zenith_angle": np.full(shape, 55.0),
        "relative_azimuth_angle": np.full(shape, 70.0),
        "quality_flag": np.zeros(shape, np.uint8),
    }
    fields["surface_albedo"][:, BRIGHT] = np.array([0.16, 0.27, 0.36])[:, None]
    fields["liquid_mass_path"][-2, CLOUDY] = 0.06
    fields["liquid_number_path"][-2, CLOUDY] = 100e6 * 500
    plume = smoke(max(aod_550), bands=BANDS)
    ssa = np.array([float(plume.ssa[band]) for band in BANDS])
    specified = {
        "brightness": (("y", "x"), np.broadcast_to(np.array(aod_550) / max(aod_550), shape)),
        "base": ((), float(plume.base)),
        "top": ((), float(plume.top)),
        "extinction_550": ((), float(plume.extinction_550)),
        "ssa": (("band",), shifted(ssa, ssa_shift)),
    }
    for name in ("relative_extinction", "asymmetry"):
        specified[name] = (("band",), [float(getattr(plume, name)[band]) for band in BANDS])
    variables = {name: (SCENARIO[name].dims, values) for name, values in fields.items()}
    variables |= {f"smoke_{name}": value for name, value in specified.items()}
    return xr.Dataset(variables, {"band": list(BANDS)}).set_coords(["latitude", "longitude"])


def result(aod_550=(0.05, 0.3, 0.9, 2.0), ssa_shift=0.0):
    """Result of `scenario`, at 2 streams."""
    return simulate(scenario(aod_550, ssa_shift), num_streams=2, error_budget=None)


@pytest.fixture(scope="session")
def make_scenario():
    """Builder of a scene that is not simulated yet."""
    return scenario


@pytest.fixture(scope="session")
def make_result():
    """Builder of a simulated scene."""
    return result


def shifted(ssa, shift):
    """Single-scattering albedo with `shift` added to its logit."""
    return 1 / (1 + (1 - ssa) / ssa * np.exp(-shift))


def _columns(profile, shape):
    return np.broadcast_to(profile[:, None, None], (len(profile), *shape)).copy()


@pytest.fixture(scope="session")
def simulated():
    """A simulated scene (y, x)."""
    return result()


@pytest.fixture(scope="session")
def columns(simulated):
    """Its columns in one row: observations, states and true optical depths."""
    stacked = simulated.stack(column=("y", "x"))
    states = column_states(stacked, BANDS)
    return observe(stacked, BANDS), states, np.asarray(stacked["smoke_aod_550"])


@pytest.fixture(scope="session")
def forward(simulated, columns):
    """Forward model with the settings of the simulation: that of `retrieve_smoke`."""
    settings = {"num_streams": simulated.attrs["num_streams"], "gases": gases_of(simulated)}
    return prepared(ForwardModel(plume_vector("smoke"), BANDS, **settings), columns[1])
