"""Condensate as paths: masses, numbers that are the model's or assumed, and what is left out."""

import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator import Hydrometeor
from abi_operator.files import InputError
from abi_operator.microphysics import number_path
from abi_operator.optics import particle_radius
from abi_operator.scene import DropletNumber, classes_present
from abi_operator.scene.column_air import dry_air_path
from abi_operator.scene.hydrometeors import hydrometeor_paths

ROUNDING = 1e-12


def paths(model, droplet_number=None, **options):
    return hydrometeor_paths(model, droplet_number, **options)


def thickness(model):
    return -np.diff(model["height"].values, axis=0)


def test_mass_path_by_hand(make_model):
    """4 km of a quarter g/kg at 800 hPa, 280 K and 6 g/kg of vapour."""
    model = make_model(
        (1, 1), cloud_mixing_ratio=2.5e-4, vapour_mixing_ratio=6e-3, layer_temperature=280.0
    )
    model["layer_pressure"][-1] = 80000.0
    model["height"][-2] = 1000.0
    density = 80000.0 / (287.0 * 280.0 * (1 + 6e-3 * 461.6 / 287.0))
    mass = paths(model).paths["cloud"].mass
    np.testing.assert_allclose(mass[-1], density * 2.5e-4 * 1000.0, rtol=ROUNDING)
    np.testing.assert_allclose(mass[-1], 0.2465, atol=5e-5)


def test_number_is_the_models_where_it_has_one(make_model):
    model = make_model(
        cloud_number_mixing_ratio=1e8, rain_mixing_ratio=1e-4, rain_number_mixing_ratio=3e3
    )
    found = paths(model).paths
    cloudy = found["cloud"].mass > 0
    ratio = found["cloud"].number[cloudy] / found["cloud"].mass[cloudy]
    np.testing.assert_allclose(ratio, 1e8 / 3e-4, rtol=ROUNDING)
    np.testing.assert_allclose(found["rain"].number / found["rain"].mass, 3e7, rtol=ROUNDING)
    assert found["cloud"].num_assumed == found["rain"].num_assumed == 0


def test_droplet_number_is_assumed_where_the_model_has_mass_without(make_model):
    model = make_model(cloud_number_mixing_ratio=1e8)
    model["cloud_number_mixing_ratio"][:, 1] = 0.0
    cloud = paths(model, DropletNumber(water=5e7)).paths["cloud"]
    assert cloud.num_assumed == 1
    np.testing.assert_allclose(cloud.number[-2, 1, 0], 5e7 * 700.0, rtol=ROUNDING)
    assert cloud.number[-1, 1, 0] == 0.0


@pytest.mark.parametrize(
    ("land_mask", "number", "text"),
    [
        (1.0, 300e6, "100 cm-3 over water, 300 cm-3 over land"),
        (0.0, 100e6, "100 cm-3 over water, 300 cm-3 over land"),
        (None, 150e6, "150 cm-3 over water and land alike, as the model has no land mask"),
    ],
)
def test_assumed_droplet_number_depends_on_the_ground(make_model, land_mask, number, text):
    model = make_model(land_mask=land_mask)
    assumed = DropletNumber(unknown=150e6)
    cloud = paths(model, assumed).paths["cloud"]
    np.testing.assert_allclose(cloud.number[-2, :, 0], number * 700.0, rtol=ROUNDING)
    assert (cloud.number[cloud.mass == 0] == 0).all()
    assert cloud.num_assumed == 3
    assert assumed.describe(model) == text


@pytest.mark.parametrize(
    ("scheme", "over_water", "over_land", "source"),
    [
        ("thompson", 100e6, 100e6, "as the microphysics thompson does"),
        ("morrison", 250e6, 250e6, "as the microphysics morrison does"),
        ("wsm6", 300e6, 300e6, "as the microphysics wsm6 does"),
        # Neither assumes a number: the one needs none, of the other nothing is known.
        ("kessler", 100e6, 300e6, "typical of stratiform cloud; the microphysics kessler assumes"),
        ("p3", 100e6, 300e6, "typical of stratiform cloud; the microphysics p3 assumes none"),
    ],
)
def test_the_schemes_own_droplet_number_comes_first(
    make_model, scheme, over_water, over_land, source
):
    for land_mask, number in ((0.0, over_water), (1.0, over_land)):
        model = make_model(land_mask=land_mask).assign_attrs(microphysics_scheme=scheme)
        found = paths(model)
        np.testing.assert_allclose(
            found.paths["cloud"].number[-2, :, 0], number * 700.0, rtol=ROUNDING
        )
        assert found.droplets.source.startswith(source)
    chosen = paths(model, DropletNumber.from_text("50,70"))
    np.testing.assert_allclose(chosen.paths["cloud"].number[-2, :, 0], 7e7 * 700.0, rtol=ROUNDING)
    assert chosen.droplets.source == "as asked for"
    assert chosen.droplets.number.describe(model) == "50 cm-3 over water, 70 cm-3 over land"


def test_numbers_of_droplets_from_text(make_model):
    assert DropletNumber.from_text("80") == DropletNumber(80e6, 80e6, 80e6)
    for text in ("many", "1,2,3", ""):
        with pytest.raises(InputError, match="is N or WATER,LAND, in droplets per cm3; got "):
            DropletNumber.from_text(text)
    for text in ("0", "-5", "1e8", "nan", "100,inf"):
        with pytest.raises(InputError, match="must be above 0 and at most 10000 cm-3"):
            DropletNumber.from_text(text)
    both = DropletNumber.from_text("50,70")
    with pytest.raises(InputError, match="has no land mask .* not 50 and 70 cm-3"):
        paths(make_model(land_mask=None), both)
    same = DropletNumber.from_text("60")
    assert same.describe(make_model(land_mask=None)) == "60 cm-3"


def test_effective_radii_of_the_model_come_before_its_numbers(make_model):
    """Number is such that optics see the model's radius; where that is 0 the number counts."""
    model = make_model(
        ice_mixing_ratio=1e-5,
        ice_number_mixing_ratio=1e5,
        ice_effective_radius=3e-5,
        cloud_effective_radius=8e-6,
    )
    model["ice_effective_radius"][0] = 0.0
    found = paths(model).paths
    for name, radius in (("ice", 3e-5), ("cloud", 8e-6)):
        mass, number, assumed = found[name]
        seen = particle_radius(Hydrometeor(jnp.asarray(mass), jnp.asarray(number)), name)
        expected = radius * (mass > 0)
        if name == "ice":
            np.testing.assert_allclose(number[0] / mass[0], 1e10, rtol=ROUNDING)
            seen, expected = seen[1:], expected[1:]
        np.testing.assert_allclose(seen, expected, rtol=1e-10)
        assert assumed == 0


def test_single_moment_schemes_imply_numbers(make_model):
    ratios = {f"{x}_mixing_ratio": 1e-4 for x in ("rain", "ice", "snow", "graupel")}
    model = make_model(layer_temperature=250.0, **ratios)
    model = model.assign_attrs(microphysics_scheme="wsm6")
    assert classes_present(model) == ("rain", "ice", "snow", "graupel")
    found = paths(model)
    depth, temperature = jnp.asarray(thickness(model)), jnp.asarray(model["layer_temperature"])
    for name in classes_present(model):
        mass, number, assumed = found.paths[name]
        np.testing.assert_allclose(mass, dry_air_path(model) * 1e-4, rtol=ROUNDING)
        expected = number_path("wsm6", name, jnp.asarray(mass), depth, temperature)
        np.testing.assert_allclose(number, expected, rtol=ROUNDING)
        assert assumed == mass.size
    assert found.scheme == "wsm6" and found.condensate.left_out == {}


def test_cold_cloud_water_and_rain_of_wsm3_are_ice_and_snow(make_model):
    model = make_model(rain_mixing_ratio=1e-4).assign_attrs(microphysics_scheme="wsm3")
    model["layer_temperature"][-2, 0] = 280.0
    assert classes_present(model) == ("rain", "ice", "snow")
    found = paths(model).paths
    warm = model["layer_temperature"].values > 273.15
    for liquid, frozen in (("cloud", "ice"), ("rain", "snow")):
        assert (found[liquid].mass[~warm] == 0).all() and (found[frozen].mass[warm] == 0).all()
        whole = dry_air_path(model) * model[f"{liquid}_mixing_ratio"].values
        np.testing.assert_allclose(found[liquid].mass + found[frozen].mass, whole, rtol=ROUNDING)


def test_another_scheme_can_be_named_for_what_is_warm_in_wsm3(make_model):
    model = make_model(rain_mixing_ratio=1e-4).assign_attrs(microphysics_scheme="wsm3")
    assert classes_present(model, "kessler") == ("rain",)
    found = paths(model, microphysics="kessler")
    assert list(found.paths) == ["cloud", "rain"] and found.scheme == "kessler"


def test_an_unknown_scheme_is_refused_by_name_unless_another_is_assumed(make_model):
    model = make_model(snow_mixing_ratio=1e-4).assign_attrs(microphysics_scheme="p3")
    with pytest.raises(
        InputError, match="no number of particles of snow, and nothing is known of .* 'p3'; name a"
    ):
        paths(model)
    assert paths(model, microphysics="thompson").paths["snow"].num_assumed > 0
    assert list(paths(model, classes=()).paths) == ["cloud"]
    with pytest.raises(InputError, match="nothing is known of microphysics 'p3'; choose from kess"):
        paths(model, microphysics="p3")
    with pytest.raises(
        InputError, match=r"hydrometeors \['sleet'\] are not known; choose from rai"
    ):
        paths(model, classes=("sleet",))


@pytest.mark.parametrize(
    ("scheme", "name", "why"),
    [
        ("morrison", "rain", "rain, which its microphysics 'morrison' predicts; name"),
        ("wsm5", "hail", "hail, of which its microphysics 'wsm5' has none; name"),
    ],
)
def test_numbers_that_nothing_implies_are_refused(make_model, scheme, name, why):
    model = make_model(**{f"{name}_mixing_ratio": 1e-4}).assign_attrs(microphysics_scheme=scheme)
    with pytest.raises(InputError, match=why):
        paths(model)


def test_traces_without_number_are_left_out_and_weighed(make_model):
    """Where a scheme predicts numbers, advection leaves mass without any here and there."""
    model = make_model(rain_mixing_ratio=1e-4, rain_number_mixing_ratio=1e3)
    model["rain_number_mixing_ratio"][0] = 0.0
    found = paths(model)
    assert (found.paths["rain"].mass[0] == 0).all() and (found.paths["rain"].mass[1:] > 0).all()
    lost = (dry_air_path(model)[0] * 1e-4).sum()
    assert list(found.condensate.left_out) == ["rain without number"]
    np.testing.assert_allclose(found.condensate.left_out["rain without number"], lost, rtol=1e-9)


def test_condensate_that_is_left_out_is_weighed(make_model):
    model = make_model(rain_mixing_ratio=1e-4, snow_mixing_ratio=0.0, hail_mixing_ratio=2e-4)
    found = paths(model, classes=())
    total, left_out = found.condensate
    assert list(left_out) == ["rain", "hail"]
    np.testing.assert_allclose(left_out["hail"], 2 * left_out["rain"], rtol=ROUNDING)
    liquid = found.paths["cloud"].mass.sum()
    np.testing.assert_allclose(total, liquid + sum(left_out.values()), rtol=ROUNDING)


def test_ice_of_further_categories_is_weighed_and_not_simulated(make_model):
    model = make_model(ice_mixing_ratio=1e-4, ice_number_mixing_ratio=1e4)
    model["other_ice_mixing_ratio"] = 3 * model["ice_mixing_ratio"]
    found = paths(model)
    assert list(found.paths) == ["cloud", "ice"]
    lost = found.condensate.left_out
    assert list(lost) == ["ice of further categories"]
    ice = found.paths["ice"].mass.sum()
    np.testing.assert_allclose(lost["ice of further categories"], 3 * ice, rtol=ROUNDING)
