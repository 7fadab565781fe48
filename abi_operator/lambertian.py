"""The plainest ground, for the solver and for all that has grounds."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int


class Lambertian(eqx.Module):
    """A ground that reflects the same radiance in all directions.

    Of an anisotropic ground it takes the white-sky albedo, the share of isotropic light that is
    reflected (`RossLi.white_sky_albedo`).

    Parameters
    ----------
    albedo
        Share of the incident light that is reflected. [-]
    """

    albedo: Float[Array, "*batch"]

    def brdf(
        self,
        mu_out: Float[Array, "*#shape"],
        mu_in: Float[Array, "*#shape"],
        relative_azimuth: Float[Array, "*#shape"],
    ) -> Float[Array, "*shape"]:
        """Bidirectional reflectance factor: the albedo, whatever the angles. [-]"""
        angles = (mu_out.shape, mu_in.shape, relative_azimuth.shape)
        return jnp.broadcast_to(self.albedo, jnp.broadcast_shapes(self.albedo.shape, *angles))

    def modes(
        self,
        m: int | Int[Array, ""],
        mu_out: Float[Array, "*#shape"],
        mu_in: Float[Array, "*#shape"],
    ) -> Float[Array, "*shape"]:
        """Azimuth mode m of `brdf`: the albedo in mode 0, nothing in the others. [-]"""
        shape = jnp.broadcast_shapes(self.albedo.shape, mu_out.shape, mu_in.shape)
        return jnp.broadcast_to(jnp.where(jnp.asarray(m) == 0, self.albedo, 0), shape)

    def white_sky_albedo(self) -> Float[Array, "*batch"]:
        """Share of isotropic light that is reflected. [-]"""
        return self.albedo
