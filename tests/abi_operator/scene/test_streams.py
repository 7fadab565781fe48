"""Streams by what is in a column, where an error is asked for."""

import numpy as np
import pytest

from abi_operator import smoke
from abi_operator.scene import PlumeSpecification, column_states, scenario, simulate
from abi_operator.scene import streams as rule
from abi_operator.scene.streams import ERRORS, KINDS, STREAMS, kinds_of, most_streams, streams_of
from retrievals.images import solved_whole

BANDS = ("C01", "C03")


@pytest.fixture
def made(make_model):
    """Three rows of cloud beside none, of which smoke covers the last two."""
    brightness = np.array([[0.0, 0.0], [0.5, 0.5], [1.0, 1.0]])
    plumes = {"smoke": PlumeSpecification(smoke(1.2, bands=BANDS), brightness)}
    model = make_model(land_mask=None)
    return scenario(model, ocean_albedo=0.06, plumes=plumes, bands=BANDS)


def test_columns_are_of_the_kind_of_what_is_in_them(made):
    kinds = kinds_of(column_states(made, BANDS).atmosphere).reshape(3, 2)
    assert (kinds[:, 0] == "cloud").all() and kinds[:, 1].tolist() == ["air", "plume", "plume"]


def test_aerosol_beside_plumes_counts_as_one(make_model):
    hazy = scenario(make_model(land_mask=None), ocean_albedo=0.06, background_aerosol=0.1)
    kinds = kinds_of(column_states(hazy, BANDS).atmosphere)
    assert set(kinds) == {"cloud", "plume"}


def test_fewer_errors_take_more_streams(made):
    air = column_states(made, BANDS).atmosphere
    assert (streams_of(air, 12) == 12).all() and most_streams(12) == 12
    before = streams_of(air, 0.5)
    assert (before == STREAMS[0]).all()
    for error in (1e-2, 5e-3, 4.5e-3, max(errors[-1] for errors in ERRORS.values())):
        now = streams_of(air, error)
        assert (now >= before).all() and most_streams(error) == now.max()
        for kind, streams in zip(kinds_of(air), now, strict=True):
            assert ERRORS[kind][STREAMS.index(streams)] <= error
        before = now
    with pytest.raises(ValueError, match=r"24 streams leave an error of .*, and got 1e-06"):
        most_streams(1e-6)
    for kind in KINDS:
        assert (np.diff(ERRORS[kind]) < 0).all()


def test_each_kind_is_solved_by_its_own_number(made, monkeypatch):
    """As if all were solved by that; the numbers stand for others, which would compile for long."""
    monkeypatch.setattr(rule, "STREAMS", (2, 4, 6, 8, 10))
    monkeypatch.setattr(rule, "ERRORS", {"air": (0.1,), "plume": (0.1,), "cloud": (0.5, 0.1)})
    found = simulate(made, num_streams=0.1, error_budget=None)
    assert found.attrs["num_streams"] == 4 and found.attrs["streams_error"] == 0.1
    assert not solved_whole(found) and solved_whole(found.drop_attrs())
    few, many = (simulate(made, num_streams=n, error_budget=None)["brf"] for n in (2, 4))
    assert "streams_error" not in simulate(made, num_streams=2).attrs
    assert (abs(many / few - 1) > 1e-6).all()
    expected = few.copy(data=np.where(np.array([True, False]), many, few))
    np.testing.assert_allclose(found["brf"], expected, rtol=1e-10)
