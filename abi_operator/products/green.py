"""The green band that the imager does not have."""

import numpy as np
from jaxtyping import Array, Float


def derived_green(
    red: Float[Array | np.ndarray, "*shape"],
    blue: Float[Array | np.ndarray, "*shape"],
    near_infrared: Float[Array | np.ndarray, "*shape"],
) -> Float[Array | np.ndarray, "*shape"]:
    """Reflectance at 0.555 um derived from the bands at hand. [-]

    G = 0.416 R + 0.523 B + 0.065 NIR - 0.005, Eq. (1) of Grasso et al. [1]_.

    Parameters
    ----------
    red, blue, near_infrared
        Bidirectional reflectance factors in C02, C01 and C03. [-]

    References
    ----------
    .. [1] L. D. Grasso et al., "Use of MODIS 16-day albedos in generating GOES-R Advanced Baseline
       Imager imagery", J. Appl. Remote Sens., 7, 2013
    """
    return 0.416 * red + 0.523 * blue + 0.065 * near_infrared - 0.005
