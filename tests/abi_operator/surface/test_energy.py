"""What leaves a ground, and grounds that are none."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.surface import Lambertian, RossLi, directional_albedo, reported

REPORTED = jax.jit(reported)


def test_albedo_of_a_lambertian_ground_from_all_sides():
    mu0 = jnp.asarray([0.05, 0.5, 1.0])
    albedo = jax.jit(directional_albedo)(Lambertian(jnp.asarray([0.3])), mu0)
    # Rounding of the 64 weights.
    np.testing.assert_allclose(albedo, 0.3, rtol=1e-14)


def test_report_by_column():
    weights = np.asarray([
        [0.3, 0.1, 0.02],  # bright soil: a ground
        [0.05, 0.0, 0.05],  # shadows that take away more than there is
        [1.1, 0.0, 0.0],  # more than all
        [0.9, 1.0, 0.0],  # below 0 nowhere, above 1 under a low sun
    ]).T  # fmt: skip
    ground = RossLi(*(jnp.asarray(x) for x in weights))
    high, low = (REPORTED(ground, jnp.asarray(mu0)) for mu0 in (0.9, 0.2))
    np.testing.assert_array_equal(high.below_zero, [False, True, False, False])
    np.testing.assert_array_equal(high.above_one, [False, False, True, False])
    np.testing.assert_array_equal(low.above_one, [False, False, True, True])
    # Nothing is clipped: the report has what the ground says.
    assert high.lowest_brdf[1] < 0 and low.albedo[3] > 1
    np.testing.assert_array_equal(high.lowest_brdf[2], 1.1)


@pytest.mark.parametrize("kind", ["lambertian", "ross_li"])
def test_fields_and_suns_broadcast(make_ground, kind):
    ground = make_ground(kind, (3,))
    mu0 = jnp.asarray([0.3, 0.6, 0.9])
    together = REPORTED(ground, mu0)
    for i in range(3):
        one = jax.tree.map(lambda x, i=i: x[i] if x.ndim else x, ground)
        alone = REPORTED(one, mu0[i])
        for a, b in zip(alone, together, strict=True):
            np.testing.assert_allclose(a, b[i], rtol=1e-12)
    assert jax.eval_shape(reported, ground, mu0[:, None]).albedo.shape == (3, 3)
