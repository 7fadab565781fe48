"""Taking the air out of a picture: the reflectance that the ground would show without it."""

from typing import Any

import numpy as np
from jaxtyping import Array, Float

from ..constants import STANDARD_PRESSURE
from ..optics.rayleigh import BETA2, STANDARD_DEPTH
from ._arrays import cast, floats
from .air_response import AirResponse
from .crefl import crefl_air
from .rayleigh_table import STANDARD_BETA2, rayleigh_air

METHODS = ("operator", "crefl")


def rayleigh_corrected(
    band: str,
    brf: Float[Array | np.ndarray, "*#shape"],
    mu0: float | Float[Array | np.ndarray, "*#shape"],
    mu: float | Float[Array | np.ndarray, "*#shape"],
    relative_azimuth: float | Float[Array | np.ndarray, "*#shape"],
    *,
    pressure: float | Float[Array | np.ndarray, "*#shape"] = STANDARD_PRESSURE,
    tau: float | Float[Array | np.ndarray, "*#shape"] | None = None,
    method: str = "operator",
    gas_transmittance: float | Float[Array | np.ndarray, "*#shape"] = 1.0,
    vapour_transmittance: float | Float[Array | np.ndarray, "*#shape"] = 1.0,
) -> Float[Array | np.ndarray, "*shape"]:
    """Albedo of a Lambertian ground under pure air that gives the reflectance seen. [-]

    Only air is taken out: an aerosol or a cloud stays, as if it lay on the ground. With the angles
    filled in it is the correction that `corrected_colors` and `natural_color` take::

        correction = functools.partial(rayleigh_corrected, mu0=mu0, mu=mu, relative_azimuth=phi)

    Parameters
    ----------
    band
        Name of the band, such as ``"C01"``, ``"green"`` (0.555 um), ``"C02"`` or ``"C03"``.
    brf
        Bidirectional reflectance factor at the top of the atmosphere. [-]
    mu0, mu
        Cosines of the solar and view zenith angle. [-]
    relative_azimuth
        0 with sun and satellite on the same side (backscatter). [rad]
    pressure
        At the ground, by which the band's optical depth at 1013.25 hPa is scaled. [Pa]
    tau
        Rayleigh optical depth to use instead. [-]
    method
        ``"operator"``: `rayleigh_air`, consistent with this package's reflectances, up to zenith
        angles of 84.3 degrees and NaN beyond. ``"crefl"``: `crefl_air`.
    gas_transmittance, vapour_transmittance
        Along the path down and up; see `AirResponse.through_gas`. [-]

    Returns
    -------
    Not limited to [0, 1]: what is darker than the air alone gives a negative value.

    Raises
    ------
    ValueError
        If the band has no depth and none is given, or the method is unknown.
    """
    response = air_response(
        band,
        mu0,
        mu,
        relative_azimuth,
        pressure=pressure,
        tau=tau,
        method=method,
        dtype=getattr(brf, "dtype", None),
    )
    dtype = response.path_brf.dtype
    brf, gas, vapour = cast(dtype, brf, gas_transmittance, vapour_transmittance)
    return response.through_gas(gas, vapour).albedo(brf)


def air_response(
    band: str,
    mu0: Any,
    mu: Any,
    relative_azimuth: Any,
    *,
    pressure: Any = STANDARD_PRESSURE,
    tau: Any = None,
    method: str = "operator",
    dtype: Any = None,
) -> AirResponse:
    """Path reflectance, transmittance and spherical albedo of the air of a band.

    Parameters
    ----------
    band, mu0, mu, relative_azimuth, pressure, tau, method
        As in `rayleigh_corrected`, which raises the same errors.
    dtype
        Floating type to compute in; None for that of the arguments.
    """
    if method not in METHODS:
        raise ValueError(f"no Rayleigh correction {method!r}; choose from {METHODS}.")
    if tau is None:
        if band not in STANDARD_DEPTH:
            raise ValueError(
                f"no Rayleigh depth for band {band!r}: give tau, or one of {list(STANDARD_DEPTH)}."
            )
        tau = STANDARD_DEPTH[band] / STANDARD_PRESSURE * pressure
    _, angles = floats(tau, mu0, mu, relative_azimuth)
    if dtype is not None:
        angles = cast(np.result_type(dtype, np.float16), *angles)  # of whole numbers, too
    if method == "crefl":
        return crefl_air(*angles)
    return rayleigh_air(*angles, beta2=BETA2.get(band, STANDARD_BETA2))
