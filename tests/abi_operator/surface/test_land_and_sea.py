"""Ground of two parts, and grounds with more of an even reflectance."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.surface import LandAndSea, brightened, directional_albedo

DIRECTIONS = [jnp.array(x) for x in ([0.9, 0.5], [0.6, 0.7], [0.3, 2.5])]
BRDF = jax.jit(lambda ground: ground.brdf(*DIRECTIONS))
MODES = jax.jit(lambda ground: ground.modes(1, *DIRECTIONS[:2]))
WHITE_SKY_ALBEDO = jax.jit(lambda ground: ground.white_sky_albedo())
ALBEDO = jax.jit(directional_albedo)


@pytest.fixture
def coast(make_ground):
    return LandAndSea(make_ground("ross_li"), make_ground("ocean"), jnp.array(0.3))


def test_it_is_the_mean_of_its_parts_by_area(coast):
    for ask in (BRDF, MODES, WHITE_SKY_ALBEDO):
        mean = 0.7 * ask(coast.land) + 0.3 * ask(coast.sea)
        np.testing.assert_allclose(ask(coast), mean, rtol=1e-12)
    inland = replace(coast, water_share=jnp.array(0.0))
    np.testing.assert_array_equal(BRDF(inland), BRDF(coast.land))


def test_slope_in_the_share_is_the_contrast(coast):
    slope = jax.jacfwd(lambda w: BRDF(replace(coast, water_share=w)))(jnp.array(0.3))
    contrast = BRDF(coast.sea) - BRDF(coast.land)
    np.testing.assert_allclose(slope, contrast, rtol=1e-12)


@pytest.mark.parametrize("kind", ["lambertian", "ross_li", "ocean", "land_and_sea"])
def test_a_brightened_ground_reflects_more_to_all_sides(kind, coast, make_ground):
    ground = coast if kind == "land_and_sea" else make_ground(kind)
    brighter = brightened(ground, jnp.array(0.05))
    more = BRDF(brighter) - BRDF(ground)
    np.testing.assert_allclose(more, 0.05, rtol=1e-10)
    mu0 = jnp.array(0.7)
    albedo = ALBEDO(brighter, mu0) - ALBEDO(ground, mu0)
    assert float(albedo) == pytest.approx(0.05, rel=1e-10)


def test_an_albedo_is_a_ground_as_well():
    assert float(brightened(jnp.array(0.2), jnp.array(-0.05))) == pytest.approx(0.15)
