"""Cloud water as paths, assumed numbers, and what is left out."""

import numpy as np
import pytest

from abi_operator.scene import DropletNumber
from abi_operator.scene.liquid import condensate, liquid_paths

ROUNDING = 1e-12


def test_mass_path_by_hand(make_model):
    """4 km of a quarter g/kg at 800 hPa, 280 K and 6 g/kg of vapour."""
    model = make_model(
        (1, 1), cloud_mixing_ratio=2.5e-4, vapour_mixing_ratio=6e-3, temperature=280.0
    )
    model["layer_pressure"][-1] = 80000.0
    model["height"][-2] = 1000.0
    density = 80000.0 / (287.0 * 280.0 * (1 + 6e-3 * 461.6 / 287.0))
    paths = liquid_paths(model, DropletNumber())
    np.testing.assert_allclose(paths.mass[-1], density * 2.5e-4 * 1000.0, rtol=ROUNDING)
    np.testing.assert_allclose(paths.mass[-1], 0.2465, atol=5e-5)


def test_number_is_the_models_where_it_has_one(make_model):
    model = make_model(cloud_number_mixing_ratio=1e8)
    paths = liquid_paths(model, DropletNumber())
    cloudy = paths.mass > 0
    ratio = paths.number[cloudy] / paths.mass[cloudy]
    np.testing.assert_allclose(ratio, 1e8 / 3e-4, rtol=ROUNDING)
    assert paths.num_assumed == 0


def test_number_is_assumed_where_the_model_has_mass_without(make_model):
    model = make_model(cloud_number_mixing_ratio=1e8)
    model["cloud_number_mixing_ratio"][:, 1] = 0.0
    paths = liquid_paths(model, DropletNumber(water=5e7))
    assert paths.num_assumed == 1
    np.testing.assert_allclose(paths.number[-2, 1, 0], 5e7 * 700.0, rtol=ROUNDING)
    assert paths.number[-1, 1, 0] == 0.0


@pytest.mark.parametrize(
    ("land_mask", "number", "text"),
    [
        (1.0, 300e6, "100 cm-3 over water, 300 cm-3 over land"),
        (0.0, 100e6, "100 cm-3 over water, 300 cm-3 over land"),
        (None, 150e6, "150 cm-3"),
    ],
)
def test_assumed_number_depends_on_the_ground(make_model, land_mask, number, text):
    model = make_model(land_mask=land_mask)
    assumed = DropletNumber(unknown=150e6)
    paths = liquid_paths(model, assumed)
    np.testing.assert_allclose(paths.number[-2, :, 0], number * 700.0, rtol=ROUNDING)
    assert (paths.number[paths.mass == 0] == 0).all()
    assert paths.num_assumed == 3
    assert assumed.describe(model) == text


def test_condensate_that_is_left_out_is_weighed(make_model):
    model = make_model(rain_mixing_ratio=1e-4, snow_mixing_ratio=0.0, hail_mixing_ratio=2e-4)
    weighed = condensate(model)
    assert list(weighed.left_out) == ["rain", "hail"]
    np.testing.assert_allclose(
        weighed.left_out["hail"], 2 * weighed.left_out["rain"], rtol=ROUNDING
    )
    liquid = liquid_paths(model, DropletNumber()).mass.sum()
    np.testing.assert_allclose(
        weighed.total, liquid + sum(weighed.left_out.values()), rtol=ROUNDING
    )
    assert weighed.ice_as_droplets == 0.0


@pytest.mark.parametrize(("scheme", "temperature", "ice"), [(3, 270, 1), (3, 280, 0), (10, 270, 0)])
def test_cold_cloud_water_of_wsm3_is_ice(make_model, scheme, temperature, ice):
    model = make_model(temperature=temperature).assign_attrs(microphysics_scheme=scheme)
    weighed = condensate(model)
    np.testing.assert_allclose(weighed.ice_as_droplets, ice * weighed.total, rtol=ROUNDING)
