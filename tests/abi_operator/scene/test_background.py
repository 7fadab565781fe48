"""A background aerosol is part of a scenario, and of the states that come of it."""

import numpy as np
import pytest

from abi_operator import background_aerosol
from abi_operator.files import InputError
from abi_operator.nomenclature import BACKGROUND
from abi_operator.scene import column_states, scenario, species_of
from abi_operator.scene.checks import check_scenario


@pytest.fixture
def made(make_model):
    return scenario(make_model(land_mask=None), ocean_albedo=0.06, background_aerosol=0.1)


def test_a_scenario_has_it_where_it_is_asked_for(made, make_model):
    names = set(BACKGROUND) - {"background_optical_depth"}
    assert names <= set(made.variables)
    for name in names:
        assert made[name].dims == BACKGROUND[name].dims
        assert made[name].attrs["units"] == BACKGROUND[name].units
    assert made.attrs["background_aerosol"].startswith("optical depth 0.1 at 550 nm")
    assert species_of(made) == ()  # it is no plume
    without = scenario(make_model(land_mask=None), ocean_albedo=0.06)
    assert not [name for name in without.variables if str(name).startswith("background")]
    assert column_states(without).atmosphere.background is None


def test_states_have_it_as_it_was_made(made):
    found = column_states(made, ("C01", "C06")).atmosphere.background
    aerosol = background_aerosol(0.1, bands=("C01", "C06"))
    np.testing.assert_allclose(found.aod_550, np.full(6, 0.1))
    np.testing.assert_allclose(found.scale_height, 2000.0)
    for name in ("relative_extinction", "ssa", "asymmetry"):
        for band, values in getattr(found, name).items():
            np.testing.assert_allclose(values, getattr(aerosol, name)[band])


def test_what_cannot_be_is_refused(made, make_model):
    for depth in (-0.1, 1e6, np.nan):
        with pytest.raises(
            InputError, match=f"is {depth:g}; it must be 0 or more".replace("+", ".")
        ):
            scenario(make_model(), ocean_albedo=0.06, background_aerosol=depth)
    with pytest.raises(InputError, match="background_ssa is 1.5 at band=0"):
        check_scenario(made.assign(background_ssa=0 * made["background_ssa"] + 1.5))
