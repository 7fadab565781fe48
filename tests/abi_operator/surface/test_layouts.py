"""One column, a batch that is last, a batch under `jax.vmap`: the same grounds."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

KINDS = ("lambertian", "ross_li", "ocean")


@pytest.mark.parametrize(
    "kind", ["lambertian", "ross_li", pytest.param("ocean", marks=pytest.mark.slow)]
)
def test_trailing_batch_vmap_and_columns_agree(make_ground, kind):
    ground = make_ground(kind, (4,))
    ground = jax.tree.map(lambda x: jnp.broadcast_to(x, (4,)), ground)
    rng = np.random.default_rng(8)
    mu_out, mu_in = (
        jnp.asarray(x) for x in (rng.uniform(0.1, 1, (3, 1, 4)), rng.uniform(0.1, 1, (2, 4)))
    )
    azimuth = jnp.asarray(rng.uniform(0, np.pi, (3, 2, 4)))

    @jax.jit
    def column(ground, mu_out, mu_in, azimuth):
        return ground.brdf(mu_out, mu_in, azimuth), ground.modes(2, mu_out, mu_in)

    last = column(ground, mu_out, mu_in, azimuth)
    mapped = jax.jit(jax.vmap(column, in_axes=(0, -1, -1, -1), out_axes=-1))
    first = mapped(ground, mu_out, mu_in, azimuth)
    for i in range(4):
        one = jax.tree.map(lambda x, i=i: x[i], ground)
        alone = column(one, mu_out[..., i], mu_in[..., i], azimuth[..., i])
        for a, b, c in zip(alone, last, first, strict=True):
            assert b.shape == (3, 2, 4)
            # Sums over azimuth in another order.
            np.testing.assert_allclose(a, b[..., i], rtol=1e-12, atol=1e-15)
            np.testing.assert_allclose(a, c[..., i], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("kind", KINDS)
def test_order_may_be_traced(make_ground, kind):
    ground = make_ground(kind)
    mu = jnp.asarray([0.3, 0.7])

    @jax.jit
    def both():
        mode = lambda m: ground.modes(m, mu[:, None], mu[None])  # noqa: E731
        return jax.vmap(mode)(jnp.arange(3)), jnp.stack([mode(m) for m in range(3)])

    traced, known = both()
    np.testing.assert_allclose(traced, known, rtol=1e-12, atol=1e-15)
