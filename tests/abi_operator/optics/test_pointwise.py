"""Slopes that are computed beside values, against those of the same function left as it is."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.optics.pointwise import choose, pointwise


def plain(x, constants, kind):
    """Two outputs of two arrays, of which one is a single number for all, and a number."""
    power, number = constants
    power = power if kind == "powers" else 2 * power
    high = choose(x > 1, jnp.log(x), 0.0)
    return {"sum": high + power * x, "product": number * jnp.exp(power * jnp.sin(x))}


X = jnp.asarray([0.2, 0.9, 1.7, 3.0])
CONSTANTS = (jnp.asarray(1.3), 2.5)


@pytest.mark.parametrize("kind", ["powers", "squares"])
def test_values_and_derivatives_of_both_orders(kind):
    function = pointwise(plain)

    def derivatives(f, x, power):
        def total(x, power):
            return sum(jnp.sum(y**2) for y in f(x, (power, CONSTANTS[1]), kind).values())

        first = jax.value_and_grad(total, argnums=(0, 1))(x, power)
        change = jax.jvp(lambda x: jax.grad(total, argnums=1)(x, power), (x,), (x,))[1]
        return first, change, jax.hessian(total)(x, power)

    found, expected = (
        jax.jit(lambda x, p, f=f: derivatives(f, x, p))(X, CONSTANTS[0]) for f in (function, plain)
    )
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-13, atol=1e-13)


def test_mapped_and_of_single_precision():
    function = pointwise(plain)
    x, power = X.astype(jnp.float32), CONSTANTS[0].astype(jnp.float32)

    def slope(x):
        return jax.grad(lambda x: function(x, (power, CONSTANTS[1]), "powers")["product"])(x)

    slopes = jax.vmap(slope)(x)
    assert slopes.dtype == jnp.float32
    expected = 2.5 * 1.3 * np.cos(X) * np.exp(1.3 * np.sin(X))
    np.testing.assert_allclose(slopes, expected, rtol=1e-6)
