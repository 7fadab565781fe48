"""Ground of which one part is land and the other sea, each with a reflectance of its own."""

import equinox as eqx
import jax
from jaxtyping import Array, Float, Int

from .ocean import Ocean
from .ross_li import RossLi


class LandAndSea(eqx.Module):
    r"""The mean of land and sea by area, :math:`\rho = (1 - w)\,\rho_{land} + w\,\rho_{sea}`.

    So that the columns of a scene are alike: land without kernels is Lambertian, a column inland
    has no water. Scenes make it (`scene.column_states`); where a column is one of its parts alone
    that is solved, as `land` and `sea` are grounds themselves (`scene.kinds_of_ground`).

    Parameters
    ----------
    land
        Of the part that is not open water.
    sea
        Of the open water.
    water_share
        Share of open water, w. [-]
    """

    land: RossLi
    sea: Ocean
    water_share: Float[Array, "*#batch"]

    def brdf(
        self,
        mu_out: Float[Array, "*#shape"],
        mu_in: Float[Array, "*#shape"],
        relative_azimuth: Float[Array, "*#shape"],
    ) -> Float[Array, "*shape"]:
        """Bidirectional reflectance factor; arguments as of `RossLi.brdf`. [-]"""
        directions = mu_out, mu_in, relative_azimuth
        return self._mean(self.land.brdf(*directions), self.sea.brdf(*directions))

    def modes(
        self,
        m: int | Int[Array, ""],
        mu_out: Float[Array, "*#shape"],
        mu_in: Float[Array, "*#shape"],
    ) -> Float[Array, "*shape"]:
        """Azimuth mode m of `brdf`. [-]"""
        return self._mean(self.land.modes(m, mu_out, mu_in), self.sea.modes(m, mu_out, mu_in))

    def white_sky_albedo(self) -> Float[Array, "*batch"]:
        """Share of isotropic light that is reflected. [-]"""
        return self._mean(self.land.white_sky_albedo(), self.sea.white_sky_albedo())

    def _mean(self, land: jax.Array, sea: jax.Array) -> jax.Array:
        return land + self.water_share * (sea - land)
