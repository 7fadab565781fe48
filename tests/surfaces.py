"""Grounds for the solver's tests."""

import jax
import jax.numpy as jnp

from abi_operator.solver import Surface


class Constant(Surface):
    """The same reflectance everywhere, integrated over azimuth like any other."""

    albedo: jax.Array

    def brdf(self, mu_out, mu_in, relative_azimuth):
        return self.albedo + 0 * (mu_out + mu_in + relative_azimuth)


class Bowl(Surface):
    """Reciprocal, darker at grazing angles and brightest in backscatter (after Minnaert, 1941).

    Its azimuth modes fall off as 0.4^m.
    """

    albedo: jax.Array
    backscatter: jax.Array

    def brdf(self, mu_out, mu_in, relative_azimuth):
        limb = (mu_out * mu_in * (mu_out + mu_in)) ** 0.2
        lobe = 1 / (1.16 - 0.8 * jnp.cos(relative_azimuth))
        slope = jnp.sqrt((1 - mu_out**2) * (1 - mu_in**2))
        return self.albedo * limb * (1 + self.backscatter * slope * (lobe - 0.5))
