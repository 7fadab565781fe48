"""Four standard atmospheres: tropical, midlatitude summer and winter, US standard.

Pressure, temperature, water vapour and ozone of Anderson et al. (1986) [1]_ as one `Atmosphere` on
any levels. Between the published levels temperature is linear in height, pressure and number
densities are exponential, and the gas in a layer is the exact integral of that: however the levels
lie, layers that cover the same heights hold the same gas.

References
----------
.. [1] G. P. Anderson, S. A. Clough, F. X. Kneizys, J. H. Chetwynd and E. P. Shettle, "AFGL
   atmospheric constituent profiles (0-120 km)", AFGL-TR-86-0110, Air Force Geophysics Laboratory,
   Hanscom AFB, 1986
"""

from collections.abc import Mapping
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from .atmosphere import Atmosphere, Gases, Hydrometeor, LiquidCloud, MiePlume, Plume

_AVOGADRO = 6.02214076e23  # [mol-1]
_MOLAR_MASS_OF_WATER = 18.015e-3  # [kg mol-1]
_DOBSON_UNIT = 2.6867e20  # molecules of ozone in 1 DU [m-2]


class _Profile(NamedTuple):
    """Pressure, temperature, and number densities at `_HEIGHT`. [hPa], [K], [cm-3], [cm-3]"""

    pressure: tuple[float, ...]
    temperature: tuple[float, ...]
    vapour: tuple[float, ...]
    ozone: tuple[float, ...]


def standard_atmosphere(
    name: str,
    height: ArrayLike | None = None,
    *,
    precipitable_water: float | None = None,
    ozone_column: float | None = None,
    carbon_dioxide: float = 400e-6,
    methane: float = 1.85e-6,
    nitrous_oxide: float = 0.33e-6,
    liquid: LiquidCloud | None = None,
    plumes: Mapping[str, Plume | MiePlume] | None = None,
    hydrometeors: Mapping[str, Hydrometeor] | None = None,
) -> Atmosphere:
    """Build a standard atmosphere, by default the 49 layers between its published levels.

    It is evaluated in NumPy and float64, and given as JAX arrays of the default precision. Whole
    columns hold 41.2, 29.2, 8.5 and 14.2 kg m-2 of vapour and 282, 334, 378 and 344 DU of ozone in
    the order of the names below.

    Parameters
    ----------
    name
        ``"tropical"``, ``"midlatitude_summer"``, ``"midlatitude_winter"`` or ``"us_standard"``.
    height
        Height of the levels above sea level, top first, 0 to 120 km. Above the first there is air,
        but neither vapour nor ozone, and nothing is below the last, which is the ground. [m]
    precipitable_water, ozone_column
        What the layers hold in all, by which the profile is scaled; None for the published amount.
        [kg m-2], [DU]
    carbon_dioxide, methane, nitrous_oxide
        Mole fractions; the defaults are those of about 2015. [-]
    liquid, plumes, hydrometeors
        What else is in the column; None for nothing.

    Returns
    -------
    Atmosphere
        Of one column, with gases and temperatures.

    Raises
    ------
    ValueError
        Where there is no such atmosphere, or heights are not falling, beyond the table or in km.
    """
    if name not in _PROFILES:
        raise ValueError(f"no standard atmosphere {name!r}; choose from {list(_PROFILES)}.")
    levels = 1e3 * np.array(_HEIGHT) if height is None else _checked_levels(height)
    profile = _PROFILES[name]
    above = np.interp(-levels, -1e3 * np.array(_HEIGHT), np.arange(len(_HEIGHT)))
    pressure = 100 * np.exp(_interpolate(np.log(profile.pressure), above))
    temperature = _interpolate(np.array(profile.temperature), above)
    vapour = _layer_amounts(profile.vapour, above) * (_MOLAR_MASS_OF_WATER / _AVOGADRO)
    ozone = _layer_amounts(profile.ozone, above) / _DOBSON_UNIT
    if precipitable_water is not None:
        vapour = vapour * (precipitable_water / vapour.sum())
    if ozone_column is not None:
        ozone = ozone * (ozone_column / ozone.sum())
    empty = jnp.zeros(levels.size - 1)
    return Atmosphere(
        pressure=jnp.asarray(pressure, float),
        height=jnp.asarray(levels, float),
        liquid=LiquidCloud(empty, empty) if liquid is None else liquid,
        plumes=dict(plumes or {}),
        temperature=jnp.asarray(temperature, float),
        gases=Gases(
            vapour=jnp.asarray(vapour, float),
            ozone=jnp.asarray(ozone, float),
            carbon_dioxide=jnp.asarray(carbon_dioxide, float),
            methane=jnp.asarray(methane, float),
            nitrous_oxide=jnp.asarray(nitrous_oxide, float),
        ),
        hydrometeors=dict(hydrometeors or {}),
    )


def _checked_levels(height: ArrayLike) -> np.ndarray:
    levels = np.asarray(height, np.float64)
    if levels.ndim != 1 or levels.size < 2 or np.any(np.diff(levels) >= 0):
        raise ValueError(f"height must fall from level to level, top first; got {height}.")
    if levels[0] > 1e3 * _HEIGHT[0] or levels[-1] < 1e3 * _HEIGHT[-1]:
        raise ValueError(f"height must lie in 0-120000 m; got {levels[-1]} to {levels[0]}.")
    if levels[0] - levels[-1] <= _HEIGHT[0]:
        raise ValueError(
            f"height is in m; the levels reach over {levels[0] - levels[-1]:g} m, as those of "
            "heights in km do."
        )
    return levels


def _interpolate(values: np.ndarray, above: np.ndarray) -> np.ndarray:
    """Linear between published levels; `above` counts those above, with a fraction."""
    return np.interp(above, np.arange(len(_HEIGHT)), values)


def _layer_amounts(density: tuple[float, ...], above: np.ndarray) -> np.ndarray:
    """Molecules in layers, from a number density that is exponential in pieces. [m-2], [cm-3]"""
    published = np.log(1e6 * np.array(density))
    height = 1e3 * np.array(_HEIGHT)
    between = _between(published[:-1], published[1:], height[:-1] - height[1:])
    whole = np.concatenate([[0.0], np.cumsum(between)])
    piece = np.minimum(above.astype(int), len(_HEIGHT) - 2)
    inside = _interpolate(published, above)
    part = _between(published[piece], inside, height[piece] - _interpolate(height, above))
    return np.diff(whole[piece] + part)


def _between(log_above: np.ndarray, log_below: np.ndarray, thickness: np.ndarray) -> np.ndarray:
    """Integral of an exponential between two levels, from its logarithms there."""
    ratio = log_below - log_above
    steep = np.abs(ratio) > 1e-8
    safe = np.where(steep, ratio, 1.0)
    mean = np.where(steep, np.expm1(safe) / safe, 1 + ratio / 2)
    return thickness * np.exp(log_above) * mean


# fmt: off
# Levels of the tables of Anderson et al. (1986). [km]
_HEIGHT = (
    120, 115, 110, 105, 100, 95, 90, 85, 80, 75, 70, 65, 60, 55, 50, 47.5, 45, 42.5, 40, 37.5, 35,
    32.5, 30, 27.5, 25, 24, 23, 22, 21, 20, 19, 18, 17, 16, 15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5,
    4, 3, 2, 1, 0,
)
# Tables of Anderson et al. (1986), to four digits; vapour and ozone, there in parts per million,
# are here times the density of air. [hPa], [K], [cm-3], [cm-3]
_PROFILES: dict[str, _Profile] = {
    "tropical": _Profile(
        pressure=(
            2e-5, 4e-5, 6e-5, 0.00013, 0.00029, 0.00069, 0.00172, 0.0044, 0.011, 0.026, 0.058,
            0.121, 0.239, 0.456, 0.854, 1.16, 1.59, 2.2, 3.05, 4.26, 6, 8.52, 12.2, 17.63, 25.7,
            30, 35, 40.9, 48, 56.5, 66.6, 78.9, 93.7, 111, 132, 156, 182, 213, 247, 286, 329, 378,
            432, 492, 559, 633, 715, 805, 904, 1013,
        ),
        temperature=(
            380, 299.7, 241.6, 212, 190.7, 184.3, 177, 177.1, 184.8, 201.8, 218.9, 236, 253.1,
            263.4, 270.2, 269.6, 264.8, 259.4, 254, 248.5, 243.1, 237.7, 232.3, 227, 221.4, 219.2,
            217, 214.6, 210.7, 206.7, 202.7, 198.8, 194.8, 197, 203.7, 210.3, 217, 223.6, 230.1,
            237, 243.6, 250.3, 257, 263.6, 270.3, 277, 283.7, 287.7, 293.7, 299.7,
        ),
        vapour=(
            8.45e4, 2.089e5, 5.435e5, 1.511e6, 4.392e6, 1.461e7, 5.987e7, 2.341e8, 9.059e8,
            3.082e9, 8.64e9, 2.007e10, 4.106e10, 7.53e10, 1.375e11, 1.84e11, 2.481e11, 3.381e11,
            4.526e11, 6.091e11, 8.229e11, 1.117e12, 1.523e12, 2.026e12, 2.734e12, 3.174e12,
            3.39e12, 3.867e12, 4.375e12, 5.151e12, 6.191e12, 7.912e12, 1.011e13, 1.225e13,
            1.879e13, 3.344e13, 6.018e13, 2.006e14, 5.684e14, 1.672e15, 4.012e15, 8.363e15,
            1.57e16, 2.843e16, 5.016e16, 7.354e16, 1.571e17, 3.111e17, 4.348e17, 6.353e17,
        ),
        ozone=(
            211.2, 4353, 9.705e4, 8.89e5, 4.392e6, 1.353e7, 3.662e7, 9.005e7, 1.424e8, 1.681e8,
            5.76e8, 2.415e9, 7.528e9, 2.259e10, 6.415e10, 1.076e11, 1.958e11, 3.627e11, 6.527e11,
            1.094e12, 1.735e12, 2.559e12, 3.541e12, 4.391e12, 4.543e12, 4.266e12, 3.975e12,
            3.314e12, 2.972e12, 2.773e12, 2.262e12, 1.438e12, 8.715e11, 5.897e11, 5.899e11,
            5.646e11, 5.647e11, 5.395e11, 5.145e11, 4.894e11, 4.894e11, 4.896e11, 5.144e11,
            5.397e11, 5.647e11, 5.897e11, 6.402e11, 6.778e11, 7.028e11, 7.029e11,
        ),
    ),
    "midlatitude_summer": _Profile(
        pressure=(
            2e-5, 4e-5, 6e-5, 0.00012, 0.00026, 0.00062, 0.00164, 0.00448, 0.012, 0.03, 0.067,
            0.139, 0.272, 0.515, 0.951, 1.29, 1.76, 2.41, 3.33, 4.64, 6.52, 9.3, 13.2, 19.07, 27.7,
            32.2, 37.6, 43.7, 51, 59.5, 69.5, 81.2, 95, 111, 130, 153, 179, 209, 243, 281, 324,
            372, 426, 487, 554, 628, 710, 802, 902, 1013,
        ),
        temperature=(
            380, 316.8, 262.4, 222.2, 190.5, 178.3, 165, 165.1, 174.1, 196.1, 218.1, 240.1, 257.1,
            269.3, 275.7, 275.2, 269.9, 263.7, 257.5, 251.3, 245.2, 239, 233.7, 228.4, 225.1,
            223.9, 222.8, 221.6, 220.4, 219.2, 217.9, 216.8, 215.7, 215.7, 215.7, 215.7, 215.8,
            222.3, 228.8, 235.3, 241.7, 248.2, 254.7, 261.2, 267.2, 273.2, 279.2, 285.2, 289.7,
            294.2,
        ),
        vapour=(
            8.66e4, 1.955e5, 4.726e5, 1.297e6, 3.926e6, 1.372e7, 6.123e7, 2.616e8, 1.049e9,
            3.272e9, 8.24e9, 1.846e10, 3.834e10, 7.415e10, 1.375e11, 1.869e11, 2.576e11, 3.511e11,
            4.78e11, 6.69e11, 9.539e11, 1.368e12, 1.924e12, 2.692e12, 3.746e12, 4.168e12, 4.709e12,
            5.144e12, 5.786e12, 6.491e12, 7.398e12, 8.552e12, 1.021e13, 1.231e13, 1.485e13,
            2.57e13, 4.81e13, 2.006e14, 7.356e14, 2.14e15, 4.012e15, 7.02e15, 1.236e16, 2.04e16,
            3.344e16, 6.352e16, 1.103e17, 1.973e17, 3.11e17, 4.682e17,
        ),
        ozone=(
            216.5, 4072, 8.44e4, 7.632e5, 3.926e6, 1.779e7, 5.403e7, 1.121e8, 9.992e7, 2.107e8,
            8.908e8, 3.357e9, 9.968e9, 2.495e10, 7e10, 1.189e11, 2.127e11, 3.908e11, 7.077e11,
            1.164e12, 1.715e12, 2.284e12, 2.866e12, 3.63e12, 4.281e12, 4.168e12, 4.158e12,
            4.144e12, 4.025e12, 3.934e12, 3.468e12, 2.715e12, 2.234e12, 2.238e12, 2.184e12,
            2.262e12, 1.804e12, 1.52e12, 1.38e12, 1.129e12, 1.079e12, 9.911e11, 9.41e11, 8.657e11,
            8.285e11, 8.032e11, 7.781e11, 7.528e11, 7.532e11, 7.53e11,
        ),
    ),
    "midlatitude_winter": _Profile(
        pressure=(
            4e-5, 6e-5, 0.00011, 0.0002, 0.00041, 0.00088, 0.00198, 0.00456, 0.0103, 0.0222, 0.047,
            0.095, 0.188, 0.362, 0.683, 0.94, 1.29, 1.8, 2.53, 3.6, 5.18, 7.56, 11.1, 16.46, 24.4,
            28.6, 33.4, 39.1, 45.8, 53.7, 62.8, 73.6, 86.1, 100.7, 117.8, 137.8, 161.1, 188.2,
            219.9, 256.8, 299.3, 347.3, 401.6, 462.7, 531.3, 608.1, 693.8, 789.7, 897.3, 1018,
        ),
        temperature=(
            333, 293, 259.5, 237.1, 218.6, 208.3, 199.5, 199.8, 210.1, 220.4, 230.7, 240.9, 250.8,
            260.6, 265.7, 265.1, 258.5, 250.8, 243.2, 235.5, 227.9, 220.4, 217.4, 215.5, 215.2,
            215.2, 215.2, 215.2, 215.2, 215.2, 215.2, 215.7, 216.2, 216.7, 217.2, 217.7, 218.2,
            218.7, 219.2, 219.7, 225.7, 231.7, 237.7, 243.7, 249.7, 255.7, 261.7, 265.2, 268.7,
            272.2,
        ),
        vapour=(
            1.567e5, 3.55e5, 8.266e5, 2.079e6, 5.404e6, 1.648e7, 6.115e7, 2.2e8, 7.106e8, 1.971e9,
            4.874e9, 1.143e10, 2.445e10, 4.884e10, 9.222e10, 1.285e11, 1.808e11, 2.601e11,
            3.732e11, 5.429e11, 7.988e11, 1.193e12, 1.758e12, 2.602e12, 3.821e12, 4.431e12,
            5.119e12, 5.966e12, 6.944e12, 8.14e12, 9.518e12, 1.113e13, 1.299e13, 1.549e13,
            1.848e13, 2.202e13, 2.676e13, 3.742e13, 7.271e13, 2.508e14, 5.35e14, 1.17e15, 2.843e15,
            7.022e15, 1.271e16, 2.207e16, 4.013e16, 6.016e16, 8.359e16, 1.17e17,
        ),
        ozone=(
            391.8, 7395, 1.476e5, 1.223e6, 5.404e6, 2.442e7, 5.755e7, 9.097e7, 8.172e7, 1.825e8,
            4.726e8, 1.572e9, 5.433e9, 1.712e10, 5.123e10, 9.509e10, 1.664e11, 3.069e11, 5.203e11,
            7.978e11, 1.169e12, 1.69e12, 2.258e12, 3.1e12, 4.191e12, 4.528e12, 4.838e12, 5.136e12,
            5.4e12, 5.246e12, 4.864e12, 4.451e12, 4.04e12, 3.705e12, 3.538e12, 3.67e12, 3.765e12,
            3.263e12, 2.635e12, 2.008e12, 1.506e12, 1.128e12, 9.666e11, 8.032e11, 7.278e11,
            6.15e11, 6.15e11, 6.148e11, 6.776e11, 7.531e11,
        ),
    ),
    "us_standard": _Profile(
        pressure=(
            3e-5, 4e-5, 7e-5, 0.00014, 0.00032, 0.00076, 0.00184, 0.00446, 0.0105, 0.024, 0.0522,
            0.109, 0.219, 0.425, 0.7978, 1.09, 1.491, 2.06, 2.871, 4.041, 5.746, 8.257, 11.97,
            17.43, 25.49, 29.72, 34.67, 40.47, 47.29, 55.29, 64.67, 75.65, 88.5, 103.5, 121.1,
            141.7, 165.8, 194, 227, 265, 308, 356.5, 411.1, 472.2, 540.5, 616.6, 701.2, 795, 898.8,
            1013,
        ),
        temperature=(
            360, 300, 240, 208.8, 195.1, 188.4, 186.9, 188.9, 198.6, 208.4, 219.6, 233.3, 247,
            260.8, 270.7, 270.6, 264.2, 257.3, 250.4, 243.4, 236.5, 229.6, 226.5, 224, 221.6,
            220.6, 219.6, 218.6, 217.6, 216.7, 216.7, 216.7, 216.7, 216.7, 216.7, 216.7, 216.7,
            216.7, 216.8, 223.3, 229.7, 236.2, 242.7, 249.2, 255.7, 262.2, 268.7, 275.2, 281.7,
            288.2,
        ),
        vapour=(
            1.023e5, 2.325e5, 6.003e5, 1.711e6, 4.756e6, 1.579e7, 6.066e7, 2.276e8, 7.856e8,
            2.358e9, 6.03e9, 1.422e10, 3.052e10, 6.023e10, 1.116e11, 1.533e11, 2.137e11, 2.989e11,
            4.176e11, 6.128e11, 8.629e11, 1.218e12, 1.81e12, 2.58e12, 3.689e12, 4.199e12, 4.805e12,
            5.455e12, 6.261e12, 7.211e12, 8.328e12, 9.677e12, 1.14e13, 1.367e13, 2.025e13,
            2.809e13, 6.017e13, 1.237e14, 2.742e14, 6.018e14, 1.539e15, 4.012e15, 7.024e15,
            1.271e16, 2.14e16, 3.677e16, 6.017e16, 9.697e16, 1.404e17, 1.973e17,
        ),
        ozone=(
            255.7, 4844, 1.072e5, 1.007e6, 4.756e6, 2.047e7, 4.995e7, 8.555e7, 1.15e8, 2.087e8,
            5.169e8, 2.37e9, 7.069e9, 2.126e10, 6.622e10, 1.197e11, 2.147e11, 3.598e11, 6.066e11,
            9.656e11, 1.38e12, 1.861e12, 2.51e12, 3.273e12, 4.267e12, 4.518e12, 4.768e12, 4.894e12,
            4.769e12, 4.769e12, 4.391e12, 4.015e12, 3.514e12, 3.012e12, 2.635e12, 2.384e12,
            2.133e12, 2.008e12, 1.631e12, 1.129e12, 8.91e11, 6.527e11, 6.151e11, 5.646e11,
            5.773e11, 5.771e11, 6.274e11, 6.778e11, 6.779e11, 6.778e11,
        ),
    ),
}
# fmt: on
