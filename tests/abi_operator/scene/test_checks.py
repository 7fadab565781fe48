"""One range for a quantity, whether a scenario, a state, a plume or the solver is given it."""

import equinox as eqx
import numpy as np
import pytest
from states import column

from abi_operator import check_state, smoke
from abi_operator.scene import PlumeSpecification, scenario
from abi_operator.scene.checks import check_scenario
from abi_operator.solver.checks import check_arguments


@pytest.fixture
def made(make_model):
    """A scenario with smoke."""
    plumes = {"smoke": PlumeSpecification(smoke(1.2), np.full((3, 2), 0.5))}
    return scenario(make_model(land_mask=None), ocean_albedo=0.06, plumes=plumes)


def refused(check, *arguments):
    try:
        check(*arguments)
    except ValueError:
        return True
    return False


@pytest.mark.parametrize("value", [-1.0, np.nextafter(-1.0, 0), np.nextafter(1.0, 0), 1.0])
def test_particles_that_scatter_in_one_direction_are_refused_everywhere(value, made):
    """There is no phase function of an asymmetry factor of 1 or -1: it would divide 0 by 0."""
    state = eqx.tree_at(lambda s: s.atmosphere.plumes["smoke"].asymmetry["C01"], column(), value)
    made["smoke_asymmetry"] = made["smoke_asymmetry"] * 0 + value
    found = {
        refused(check_state, state),
        refused(lambda: smoke(asymmetry={"C01": value})),
        refused(check_scenario, made),
    }
    assert found == {abs(value) == 1}


@pytest.mark.parametrize("value", [np.nextafter(0.0, -1), 0.0, 1.0, np.nextafter(1.0, 2)])
def test_shares_are_shares_everywhere(value, made):
    state = eqx.tree_at(lambda s: s.atmosphere.plumes["smoke"].ssa["C01"], column(), value)
    made["smoke_ssa"] = made["smoke_ssa"] * 0 + value
    found = {
        refused(check_state, state),
        refused(lambda: smoke(ssa={"C01": value})),
        refused(check_scenario, made),
        refused(lambda: check_arguments({"ssa": value}, series_summed=False)),
    }
    assert found == {not 0 <= value <= 1}
