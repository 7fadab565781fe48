"""The standard atmospheres: published totals, hydrostatic balance, any levels, doors."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.atmosphere import Gases, LiquidCloud
from abi_operator.optics import smoke
from abi_operator.standard_atmospheres import standard_atmosphere

# Precipitable water and ozone that are quoted for these atmospheres (Kneizys et al., "Users guide
# to LOWTRAN 7", AFGL-TR-88-0177, 1988). [kg m-2], [DU]
TOTALS = {
    "tropical": (41.2, 282),
    "midlatitude_summer": (29.2, 334),
    "midlatitude_winter": (8.5, 378),
    "us_standard": (14.2, 344),
}

ROUNDING = 0.006  # of the quoted totals
HYDROSTATIC = 0.006  # of layers up to 5 km thick: gravity and molar mass of air are constants here


def gases_in(*args, **options) -> Gases:
    gases = standard_atmosphere(*args, **options).gases
    assert gases is not None
    return gases


@pytest.mark.parametrize("name", TOTALS)
def test_totals_are_those_published(name):
    gases = gases_in(name)
    np.testing.assert_allclose(gases.vapour.sum(), TOTALS[name][0], rtol=ROUNDING)
    np.testing.assert_allclose(gases.ozone.sum(), TOTALS[name][1], rtol=ROUNDING)


@pytest.mark.parametrize("name", TOTALS)
def test_published_levels_come_back(name):
    atmosphere = standard_atmosphere(name)
    at = np.array([0.0, 5e3, 20e3])
    again = standard_atmosphere(name, at[::-1])
    rows = [int(np.flatnonzero(np.asarray(atmosphere.height) == z)[0]) for z in at[::-1]]
    np.testing.assert_allclose(again.pressure, atmosphere.pressure[np.array(rows)], rtol=1e-14)
    published = np.asarray(atmosphere.temperature)[rows]
    np.testing.assert_allclose(np.asarray(again.temperature), published, rtol=1e-14)


def test_us_standard_is_the_standard_atmosphere():
    """NOAA-S/T 76-1562: 1013.25 hPa and 288.15 K at 0 km, 264.99 hPa and 223.25 K at 10 km."""
    atmosphere = standard_atmosphere("us_standard", np.array([10e3, 0.0]))
    np.testing.assert_allclose(atmosphere.pressure, [26499, 101325], rtol=4e-4)
    np.testing.assert_allclose(np.asarray(atmosphere.temperature), [223.25, 288.15], atol=0.06)


@pytest.mark.parametrize("name", TOTALS)
def test_air_is_in_hydrostatic_balance(name):
    atmosphere = standard_atmosphere(name, np.arange(30e3, -1, -1e3))
    thickness = -np.diff(atmosphere.height)
    levels = np.asarray(atmosphere.temperature)
    temperature = (levels[1:] + levels[:-1]) / 2
    gravity = 9.806 * (1 - 2 * atmosphere.height[1:] / 6.371e6)
    scale = 287.05 * temperature / gravity
    expected = np.sum(thickness / scale)
    got = np.log(atmosphere.pressure[-1] / atmosphere.pressure[0])
    np.testing.assert_allclose(got, expected, rtol=HYDROSTATIC)


@pytest.mark.parametrize("name", ["tropical", "us_standard"])
def test_amounts_do_not_depend_on_levels(name):
    rng = np.random.default_rng(3)
    inner = np.sort(rng.uniform(300, 70e3, 40))[::-1]
    few = gases_in(name, np.array([80e3, 11.3e3, 1234.5, 200.0]))
    height = np.sort(np.concatenate([[80e3, 11.3e3, 1234.5, 200.0], inner]))[::-1]
    many = gases_in(name, height)
    for gas in ("vapour", "ozone"):
        fine = np.asarray(getattr(many, gas))
        edges = np.searchsorted(-height, [-80e3, -11.3e3, -1234.5, -200.0])
        summed = [fine[a:b].sum() for a, b in zip(edges[:-1], edges[1:], strict=True)]
        np.testing.assert_allclose(summed, getattr(few, gas), rtol=1e-12)


def test_path_of_an_exponential_piece():
    """From 0 to 1 km vapour falls by a constant factor per metre: its mean is logarithmic."""
    gases = gases_in("us_standard", np.array([1000.0, 0.0]))
    above, below = 1.404e17, 1.973e17  # [cm-3] (1 and 0 km)
    molecules = 1e6 * (below - above) / np.log(below / above) * 1000.0
    np.testing.assert_allclose(gases.vapour[0], molecules * 18.015e-3 / 6.02214076e23, rtol=1e-12)


def test_amounts_can_be_set():
    gases = gases_in(
        "us_standard",
        np.array([100e3, 10e3, 0.0]),
        precipitable_water=10.0,
        ozone_column=280.0,
        carbon_dioxide=4.2e-4,
    )
    np.testing.assert_allclose(gases.vapour.sum(), 10.0)
    np.testing.assert_allclose(gases.ozone.sum(), 280.0)
    assert gases.carbon_dioxide == 4.2e-4
    assert (gases.methane, gases.nitrous_oxide) == (1.85e-6, 0.33e-6)


def test_cloud_and_plumes_are_what_is_given():
    height = np.array([20e3, 5e3, 0.0])
    clear = standard_atmosphere("tropical", height)
    assert not clear.plumes and not clear.hydrometeors
    np.testing.assert_array_equal(clear.liquid.mass_path, [0, 0])
    liquid = LiquidCloud(jnp.asarray([0.0, 0.1]), jnp.asarray([0.0, 1e11]))
    plume = smoke(0.3)
    full = standard_atmosphere("tropical", height, liquid=liquid, plumes={"smoke": plume})
    assert full.liquid is liquid and full.plumes["smoke"] is plume


def test_doors():
    with pytest.raises(ValueError, match="no standard atmosphere 'subarctic'; choose from"):
        standard_atmosphere("subarctic")
    with pytest.raises(ValueError, match="must fall from level to level"):
        standard_atmosphere("tropical", np.array([0.0, 1e3]))
    with pytest.raises(ValueError, match="0-120000 m; got -10.0 to 1000.0"):
        standard_atmosphere("tropical", np.array([1e3, -10.0]))


@pytest.mark.float32
def test_heights_in_km_are_refused():
    with pytest.raises(ValueError, match="height is in m; the levels reach over 80 m"):
        standard_atmosphere("us_standard", np.linspace(80, 0, 41))


def test_default_precision():
    dtype = jnp.zeros(()).dtype
    leaves = jax.tree.leaves(standard_atmosphere("midlatitude_winter"))
    assert {leaf.dtype for leaf in leaves} == {dtype}
    assert all(np.all(np.isfinite(leaf)) for leaf in leaves)
