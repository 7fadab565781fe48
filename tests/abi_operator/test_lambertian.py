"""A ground of one albedo."""

import jax.numpy as jnp
import numpy as np

from abi_operator import solver, surface
from abi_operator.surface import Lambertian


def test_it_reflects_its_albedo_in_mode_zero_alone():
    ground = Lambertian(jnp.asarray([0.2, 0.5]))
    mu = jnp.full((3, 2), 0.4)
    np.testing.assert_array_equal(ground.brdf(mu, mu, mu), [[0.2, 0.5]] * 3)
    np.testing.assert_array_equal(ground.modes(0, mu, mu), [[0.2, 0.5]] * 3)
    np.testing.assert_array_equal(ground.modes(jnp.asarray(2), mu, mu), 0)
    np.testing.assert_array_equal(ground.white_sky_albedo(), ground.albedo)


def test_solver_and_grounds_have_the_same_one():
    assert solver.Lambertian is surface.Lambertian
    assert isinstance(Lambertian(jnp.asarray(0.2)), solver.AnySurface)
