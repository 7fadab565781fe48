"""The forward model is the operator."""

from dataclasses import replace

import equinox as eqx
import jax
import numpy as np

from abi_operator import reflectance_factor
from abi_operator.scene import column_states, gases_of, simulate
from retrievals.declarations import plume
from retrievals.declarations.plumes import height_shift
from retrievals.forward import ForwardModel, prepared
from retrievals.images import forward_model
from retrievals.kinds import BANDS
from retrievals.observation import observe
from retrievals.state_vector import StateVector
from retrievals.transforms import Bounded
from retrievals.tuning import plume_numbers

ROUNDING = 1e-11


def test_the_true_x_gives_what_was_simulated(columns, forward):
    observation, states, truth = columns
    value = forward(forward.vector.x(truth), states)
    np.testing.assert_allclose(value, observation.measured, rtol=ROUNDING)


def test_the_state_is_what_is_seen(columns, forward):
    _, states, truth = columns
    model = replace(forward, vector=plume("smoke", ssa=True))
    x = model.vector.x(np.full(len(truth), 1.3), -0.5)
    state = model.state(x, states)
    np.testing.assert_allclose(state.atmosphere.plumes["smoke"].aod_550, 1.3, rtol=ROUNDING)
    settings = {name: getattr(forward, name) for name in ("gases", "num_streams", "num_doublings")}
    expected = reflectance_factor(state, BANDS, **settings)
    np.testing.assert_allclose(model(x, states), expected, rtol=ROUNDING)


def test_where_x_moves_a_plume_levels_go_with_it(columns, forward):
    """So that slopes in its height do not change in steps; of other unknowns nobody needs them."""
    _, states, _ = columns
    lifted = StateVector((*forward.vector.quantities, height_shift("smoke")))
    assert lifted.moves_plumes(states) and not forward.vector.moves_plumes(states)
    assert prepared(forward, states).plume_edges is None
    assert prepared(replace(forward, vector=lifted), states).plume_edges
    assert prepared(replace(forward, vector=lifted, plume_edges=False), states).plume_edges is False


def test_gases_and_ice_of_the_simulation_are_those_of_the_forward_model(make_scenario):
    """What absorbs and scatters in the truth does so in the retrieval, and nothing else."""
    made = make_scenario((0.3, 0.9))
    layer = made["liquid_mass_path"]
    levels = made["pressure"]
    ice = layer * 0
    ice[1] = 0.01
    gases = {name: 400e-6 for name in ("carbon_dioxide", "methane", "nitrous_oxide")}
    made = made.assign(
        temperature=levels * 0 + 270.0,
        vapour=layer * 0 + 2.0,
        ozone=layer * 0 + 40.0,
        ice_mass_path=ice,
        ice_number_path=ice * 1e9,
        **gases,
    ).assign_attrs(gases="O3")
    simulated = simulate(made, num_streams=2, error_budget=None)
    assert simulated.attrs["gases"] == "O3"
    stacked = simulated.stack(column=("y", "x"))
    states, truth = column_states(stacked, BANDS), stacked["smoke_aod_550"].values
    model = ForwardModel(plume("smoke"), BANDS, num_streams=2, gases=gases_of(stacked))
    value = model(model.vector.x(truth), states)
    np.testing.assert_allclose(value, observe(stacked, BANDS).measured, rtol=ROUNDING)
    none = replace(states.atmosphere.gases, ozone=0 * states.atmosphere.gases.ozone)
    without = replace(states, atmosphere=replace(states.atmosphere, gases=none))
    others = model(model.vector.x(truth), without)
    assert (np.abs(others - value)[:, 1] > 1e-3).all()  # ozone absorbs in C02


def test_it_is_as_exact_as_what_made_the_image(simulated):
    """Streams and error budget are those of the image; one that was solved whole has none.

    What `simulate` says of itself is tested with it.
    """
    vector, budget = plume("smoke"), simulated.assign_attrs(error_budget=1e-2)
    assert forward_model(simulated, vector, BANDS, None).error_budget is None
    found = forward_model(budget, vector, BANDS, None)
    assert (found.num_streams, found.error_budget) == (2, 1e-2)


def test_prepared_doublings_suffice_at_the_limit(columns, forward):
    _, states, truth = columns
    x = forward.vector.x(np.full(len(truth), 9.999))
    many = replace(forward, num_doublings=13)
    np.testing.assert_allclose(forward(x, states), many(x, states), rtol=ROUNDING)


def test_a_column_that_is_no_number_asks_for_no_doublings(columns, forward):
    """All columns would have as many as the solver offers, for one of which nothing comes."""
    _, states, _ = columns
    pressure = np.array(states.atmosphere.pressure)
    pressure[3] = np.nan
    holed = eqx.tree_at(lambda s: s.atmosphere.pressure, states, pressure)
    assert prepared(forward, holed).num_doublings == prepared(forward, states).num_doublings


def test_an_extreme_without_a_number_leaves_a_clouds_doublings(columns, forward):
    """A plume of no thickness has infinite extinction, and its clouds are as thick as ever."""
    _, states, _ = columns
    thick = jax.tree.map(lambda path: 40 * path, states.atmosphere.liquid)
    cloudy = eqx.tree_at(lambda s: s.atmosphere.liquid, states, thick)
    smoke = jax.tree.map(lambda leaf: leaf[0], states.atmosphere.plumes["smoke"])

    def doublings(vector, states):
        return prepared(replace(forward, vector=vector), states).num_doublings

    strength, top = (plume_numbers([name], "smoke", smoke) for name in ("strength", "top"))
    (edge,) = top.quantities
    to_the_base = StateVector((replace(edge, transform=Bounded(float(smoke.base), 2e4)),))
    many = doublings(strength, cloudy)
    assert many > doublings(strength, states)
    assert doublings(top, cloudy) == doublings(to_the_base, cloudy) == many
