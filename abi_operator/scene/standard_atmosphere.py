"""Pressure of the US Standard Atmosphere 1976."""

import numpy as np

from ..constants import STANDARD_PRESSURE

# Geopotential heights between which temperature changes linearly [m], temperature at the lower one
# [K] and its gradient [K m-1]. (NOAA-S/T 76-1562, Table 4)
_LAYERS = (
    (0.0, 11e3, 288.15, -6.5e-3),
    (11e3, 20e3, 216.65, 0.0),
    (20e3, 32e3, 216.65, 1.0e-3),
    (32e3, 47e3, 228.65, 2.8e-3),
    (47e3, 51e3, 270.65, 0.0),
    (51e3, 71e3, 270.65, -2.8e-3),
    (71e3, 84.852e3, 214.65, -2.0e-3),
)
# Hydrostatic constant, g0 M0 / R*. [K m-1] (NOAA-S/T 76-1562, Table 2)
_HYDROSTATIC = 9.80665 * 28.9644e-3 / 8.31432


def standard_pressure(height: np.ndarray) -> np.ndarray:
    r"""Pressure of the US Standard Atmosphere 1976 [1]_ (Eq. 33a and 33b). [Pa]

    .. math:: p = p_b \left(\frac{T_b}{T_b + L_b (h - h_b)}\right)^{g_0 M_0 / (R^* L_b)}, \qquad
       p = p_b \exp\left(-\frac{g_0 M_0 (h - h_b)}{R^* T_b}\right) \text{ where } L_b = 0

    Parameters
    ----------
    height
        Geopotential height above sea level, 0 to 84.852 km. [m]

    References
    ----------
    .. [1] U.S. Standard Atmosphere, 1976, NOAA-S/T 76-1562, Washington, D.C.
    """
    height = np.asarray(height, dtype=np.float64)
    pressure = np.full(height.shape, STANDARD_PRESSURE)
    for base, top, temperature, lapse in _LAYERS:
        above = np.clip(height, base, top) - base
        if lapse == 0:
            pressure *= np.exp(-_HYDROSTATIC * above / temperature)
        else:
            pressure *= (1 + lapse * above / temperature) ** (-_HYDROSTATIC / lapse)
    return pressure
