"""What air does to the reflectance of a Lambertian ground, and how that is undone."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float


class AirResponse(NamedTuple):
    r"""Reflectance at the top of the atmosphere as a closed form in the albedo a of the ground.

    .. math:: BRF(a) = BRF(0) + \frac{c\,a}{1 - S a}

    Parameters
    ----------
    path_brf
        BRF(0): light that the air sends back by itself. [-]
    transmittance
        c: transmission from the sun to the ground times that from the ground to the view. [-]
    spherical_albedo
        S: the albedo of the air seen from below. [-]

    References
    ----------
    .. [1] S. Chandrasekhar, "Radiative Transfer", Dover, 1960, section 72.
    """

    path_brf: Float[Array | np.ndarray, "*shape"]
    transmittance: Float[Array | np.ndarray, "*shape"]
    spherical_albedo: Float[Array | np.ndarray, "*shape"]

    def brf(self, albedo: Float[Array | np.ndarray, "*shape"]) -> Array | np.ndarray:
        """Bidirectional reflectance factor over ground of this albedo. [-]"""
        return self.path_brf + self.transmittance * albedo / (1 - self.spherical_albedo * albedo)

    def albedo(self, brf: Float[Array | np.ndarray, "*shape"]) -> Array | np.ndarray:
        """Albedo of the ground that gives this reflectance: the exact inverse of `brf`. [-]

        Not limited to [0, 1]: what is darker than the air alone gives a negative one.
        """
        excess = brf - self.path_brf
        return excess / (self.transmittance + self.spherical_albedo * excess)

    def through_gas(
        self,
        gas_transmittance: float | Float[Array | np.ndarray, "*#shape"],
        vapour_transmittance: float | Float[Array | np.ndarray, "*#shape"],
    ) -> "AirResponse":
        """The same air below an absorbing gas, and with water vapour near the ground.

        Parameters
        ----------
        gas_transmittance
            Along the path down and up, of gases that lie above the scattering air, such as ozone:
            all the light passes them. [-]
        vapour_transmittance
            Along the path down and up, of water vapour, which lies so low that only light from the
            ground passes it. [-]
        """
        return AirResponse(
            self.path_brf * gas_transmittance,
            self.transmittance * gas_transmittance * vapour_transmittance,
            self.spherical_albedo,
        )
