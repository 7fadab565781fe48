"""What is seen of a few columns, band by band: all that outputs are made of."""

from collections.abc import Mapping
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..radiance import of_white_ground, sunlight
from ..reflectance import with_the_suns_cosine


class Seen(NamedTuple):
    """Values of columns by band, and where sun and satellite stand.

    Parameters
    ----------
    value
        Bidirectional reflectance factor [-] or radiance [W m-2 sr-1 um-1], by band; NaN where a
        column has none.
    is_brf
        Which of the two, by band.
    solar_zenith, view_zenith, relative_azimuth
        Of each column. [rad]
    """

    value: Mapping[str, Float[Array, " column"]]
    is_brf: Mapping[str, Bool[np.ndarray, " column"]]
    solar_zenith: Float[np.ndarray, " column"]
    view_zenith: Float[np.ndarray, " column"]
    relative_azimuth: Float[np.ndarray, " column"]

    def beside(self, other: "Seen") -> "Seen":
        """These columns and then others, of which the same bands are seen."""
        return Seen(
            {x: jnp.concatenate([self.value[x], other.value[x]]) for x in self.value},
            {x: np.concatenate([self.is_brf[x], other.is_brf[x]]) for x in self.value},
            *(np.concatenate(both) for both in zip(self[2:], other[2:], strict=True)),
        )

    @property
    def mu0(self) -> Float[np.ndarray, " column"]:
        """Cosine of the solar zenith angle. [-]"""
        return np.cos(self.solar_zenith)

    @property
    def mu(self) -> Float[np.ndarray, " column"]:
        """Cosine of the view zenith angle. [-]"""
        return np.cos(self.view_zenith)

    def brf(self, band: str) -> Float[Array, " column"]:
        """Bidirectional reflectance factor; NaN where the band emits. [-]"""
        return jnp.where(self.is_brf[band], self.value[band], jnp.nan)

    def reflectance_factor(self, band: str) -> Float[Array, " column"]:
        """As `reflectance_factor` has it; NaN where the band emits and by night. [-]"""
        value = self.brf(band)[:, None]
        return with_the_suns_cosine(value, self.solar_zenith, self.view_zenith)[:, 0]

    def radiance(self, band: str, satellite: str) -> Float[Array, " column"]:
        """As `radiance` has it, with the sun at 1 AU. [W m-2 sr-1 um-1]"""
        mu0 = jnp.asarray(self.mu0)
        white = of_white_ground(mu0, sunlight(mu0, (band,), satellite)[band])
        return self.value[band] * jnp.where(self.is_brf[band], white, 1)
