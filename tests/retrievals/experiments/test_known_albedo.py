"""Smoke over a ground that is known, or is not."""

import numpy as np
import pytest

from retrievals.experiments import known_albedo, scenes
from retrievals.experiments.known_albedo import RELATIVE_ERROR

# As many as the scene of the other retrievals has, whose programs serve here as well; what is
# tested holds for any number.
NUM_LAYERS = 7


@pytest.fixture(scope="module")
def table():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scenes, "NUM_LAYERS", NUM_LAYERS)
        return known_albedo(size=10, seed=1, num_streams=2)


def test_errors_grow_with_what_is_not_known_of_the_ground(table):
    assert (table["num_pixels"] == 100).all()
    rmse = table["rmse"]
    right = rmse.sel(known_albedo="as it is")
    assert (rmse.sel(known_albedo="its mean") > 1.2 * right).all()
    wrong = rmse.sel(ground="land") / right.sel(ground="land")
    assert wrong.sel(known_albedo="its mean") > 10 and wrong.sel(known_albedo="10 % errors") > 2
    # Where all is known the truth is drawn from the prior: 4 binomial standard deviations.
    right = table["coverage_68"].sel(known_albedo="as it is")
    assert (np.abs(right - 0.683) < 4 * np.sqrt(0.683 * 0.317 / 100)).all()
    assert (table["coverage_68"].sel(ground="land", known_albedo="its mean") < 0.3).all()


def test_the_grounds_are_what_their_names_say(table):
    albedo = table["albedo"]
    true, mean, wrong = (albedo.sel(known_albedo=name) for name in table["known_albedo"].values)
    np.testing.assert_allclose(true.mean(["y", "x"]), mean.isel(y=0, x=0), rtol=1e-12)
    assert (mean.std(["y", "x"]) < 1e-12).all()
    spread = (wrong / true - 1).std(["y", "x"])
    assert (np.abs(spread / RELATIVE_ERROR - 1) < 0.3).all()  # of 100 draws: 4 sigma
    land, water = (true.sel(ground=name) for name in ("land", "water"))
    assert land.sel(band="C03").min() > 0.15 > 0.1 > water.max() > water.min() > 0
    assert (land.std(["y", "x"]) > water.std(["y", "x"])).all()
