r"""Response of pure air, tabulated once: equal to that of this package's solver.

The reflectance of pure air over black ground is a cosine series of three terms in the azimuth,

.. math:: BRF(0) = \sum_{m=0}^{2} P_m \left[\frac{1 - e^{-\tau(1/\mu_0+1/\mu)}}{4(\mu_0+\mu)} +
   (1 - e^{-\tau/\mu_0})(1 - e^{-\tau/\mu})\,F_m(\mu_0, \mu, \tau)\right] \cos m\Delta\phi,

with P_m those of the phase function. Light scattered once is exact; F_m, of all light scattered
more than once, varies slowly and is a cubic spline fitted to `air_layer`. So are the share of the
scattered light that is lost on the way to the ground, (1 - T) / (1 - exp(-tau/mu)), whose products
are c = T(mu0) T(mu), and S / tau.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Array, Float

from ._arrays import floats, sine
from .air_response import AirResponse
from .rayleigh_doubling import air_layer

# Coefficient of P_2 in the middle of the bands'; those differ by 0.2 %, which changes light
# scattered twice by less than 1e-5. [-]
STANDARD_BETA2 = 0.4793

LOWEST_COSINE = 0.1
"""Cosine of the largest zenith angle of `rayleigh_air`, 84.3 degrees: beyond, the Earth's curvature
spoils plane-parallel air. [-]"""

_THINNEST, _THICKEST = 1e-3, 0.4  # optical depths between which F_m follows ln(tau)
_COSINE_CELLS, _DEPTH_CELLS = 12, 8


class _Tables(NamedTuple):
    """Coefficients of the splines, float64, as `_beside` lays them out."""

    multiple: Float[np.ndarray, "cosine cosine cell spline mode"]
    lost: Float[np.ndarray, "cosine cell spline one"]
    backscattered: Float[np.ndarray, "cell spline one"]


def rayleigh_air(
    tau: float | Float[Array | np.ndarray, "*#shape"],
    mu0: Float[Array | np.ndarray, "*#shape"],
    mu: Float[Array | np.ndarray, "*#shape"],
    relative_azimuth: Float[Array | np.ndarray, "*#shape"],
    beta2: float = STANDARD_BETA2,
) -> AirResponse:
    """Response of pure air by interpolation: a fast stand-in for `solver.surface_coupling`.

    Light without polarisation, as in all of this package. Within 3e-6 of the solver with many
    streams at zenith angles up to 65 degrees, and within 3e-5 to 84. Twice continuously
    differentiable in mu0, mu and (from 1e-3 on) tau between the ends of the tables, which the first
    call of a process computes.

    Parameters
    ----------
    tau
        Rayleigh optical depth, 0 to 0.4. Below 1e-3 the F_m of 1e-3 are used, an error below 1e-6
        of reflectance. [-]
    mu0, mu
        Cosines of the solar and view zenith angle, 0.1 (84.3 degrees) to 1. [-]
    relative_azimuth
        0 with sun and satellite on the same side (backscatter). [rad]
    beta2
        Coefficient of P_2 in the phase function, near 0.479. [-]

    Returns
    -------
    NaN, with derivative 0, where a depth or a cosine is off the tables.
    """
    xp, (tau, mu0, mu, relative_azimuth) = floats(tau, mu0, mu, relative_azimuth)
    inside = (tau >= 0) & (tau <= _THICKEST)
    for cosine in (mu0, mu):
        inside = inside & (cosine >= LOWEST_COSINE) & (cosine <= 1)
    tau, mu0, mu = (xp.where(inside, x, safe) for x, safe in ((tau, 0.1), (mu0, 0.5), (mu, 0.5)))
    tables, dtype = _tables(), mu.dtype
    depth = _cell(xp, _depth_position(xp, tau), _DEPTH_CELLS)
    sun, view = (_cell(xp, _cosine_position(x), _COSINE_CELLS) for x in (mu0, mu))

    multiple = _interpolated(xp, tables.multiple, (sun, view, depth), dtype)
    path = _path(xp, tau, mu0, mu, relative_azimuth, beta2, multiple)
    transmittance = 1.0
    for cosine, place in ((mu0, sun), (mu, view)):
        lost = _interpolated(xp, tables.lost, (place, depth), dtype)[..., 0]
        transmittance = transmittance * (1 + xp.expm1(-tau / cosine) * lost)
    spherical = tau * _interpolated(xp, tables.backscattered, (depth,), dtype)[..., 0]
    return AirResponse(*(xp.where(inside, x, xp.nan) for x in (path, transmittance, spherical)))


def _path(
    xp: Any, tau: Any, mu0: Any, mu: Any, relative_azimuth: Any, beta2: Any, multiple: Any
) -> Any:
    once, again = _once_and_again(xp, tau, mu0, mu)
    phase = _phase_modes(mu0, mu, sine(xp, mu0) * sine(xp, mu), beta2)
    return sum(
        phase[m] * (once + again * multiple[..., m]) * xp.cos(m * relative_azimuth)
        for m in range(3)
    )


def _once_and_again(xp: Any, tau: Any, mu0: Any, mu: Any) -> tuple[Any, Any]:
    """The factors of light scattered once and more than once."""
    once = -xp.expm1(-tau * (1 / mu0 + 1 / mu)) / (4 * (mu0 + mu))
    return once, xp.expm1(-tau / mu0) * xp.expm1(-tau / mu)


def _phase_modes(mu0: Any, mu: Any, sines: Any, beta2: Any) -> tuple[Any, Any, Any]:
    r"""Factors of :math:`\cos m\Delta\phi` in 1 + beta2 P_2."""
    mean = 1 + beta2 / 4 * (3 * mu0**2 - 1) * (3 * mu**2 - 1)
    return mean, 3 * beta2 * mu0 * mu * sines, 0.75 * beta2 * sines**2


def _cosine_position(cosine: Any) -> Any:
    return (cosine - LOWEST_COSINE) * (_COSINE_CELLS / (1 - LOWEST_COSINE))


def _depth_position(xp: Any, tau: Any) -> Any:
    """From 0 at the thinnest depth to the number of cells at the thickest, along ln(tau)."""
    scale = _DEPTH_CELLS / np.log(_THICKEST / _THINNEST).item()
    thick = tau > _THINNEST
    return xp.where(thick, xp.log(xp.where(thick, tau, _THINNEST) / _THINNEST) * scale, 0)


def _cell(xp: Any, position: Any, cells: int) -> tuple[Any, list[Any]]:
    """First of the four cubic B-splines that are not 0 at a position, and the values of the four.

    Cells have unit length; spline k of cells + 3 is not 0 from k - 3 to k + 1.
    """
    first = xp.clip(xp.floor(position), 0, cells - 1)
    t = position - first
    values = [
        (1 - t) ** 3 / 6,
        (3 * t**3 - 6 * t**2 + 4) / 6,
        (-3 * t**3 + 3 * t**2 + 3 * t + 1) / 6,
        t**3 / 6,
    ]
    return first.astype(np.int32), values


def _interpolated(xp: Any, rows: np.ndarray, places: tuple, dtype: Any) -> Any:
    """Sum of products of splines, one place for each leading axis of `rows`.

    The last place is a cell of depth, whose four splines stand beside each other in `rows`, before
    the last axis, which is kept.
    """
    *cosines, (first_depth, by_depth) = places
    shape, kept = rows.shape, rows.shape[-1]
    table = xp.asarray(rows.reshape(-1, 4 * kept), dtype=dtype)

    def total(row: Any, axis: int) -> Any:
        if axis == len(cosines):
            found = table[row * shape[axis] + first_depth]
            parts = [found[..., kept * k : kept * (k + 1)] for k in range(4)]
            return sum(by_depth[k][..., None] * parts[k] for k in range(4))
        first, values = cosines[axis]
        return sum(
            values[k][..., None] * total(row * shape[axis] + first + k, axis + 1) for k in range(4)
        )

    return total(0, 0)


def _beside(coefficients: np.ndarray) -> np.ndarray:
    """From ``... depth kept`` to ``... cell spline kept``: the four splines of every cell."""
    cells = [coefficients[..., k : k + _DEPTH_CELLS, :] for k in range(4)]
    return np.stack(cells, axis=-2)


@lru_cache(maxsize=1)
def _tables() -> _Tables:
    """Solve the layers of the tables and fit the splines."""
    cosines, depths = _sites(_COSINE_CELLS), _sites(_DEPTH_CELLS)
    cosines = LOWEST_COSINE + (1 - LOWEST_COSINE) * cosines / _COSINE_CELLS
    depths = _THINNEST * (_THICKEST / _THINNEST) ** (depths / _DEPTH_CELLS)
    layer = air_layer(depths, cosines, STANDARD_BETA2)
    tau, mu0, mu = depths[:, None, None], cosines[:, None], cosines
    once, again = _once_and_again(np, tau, mu0, mu)
    multiple = (layer.modes - once) / again
    lost = (layer.transmission - 1) / np.expm1(-depths[:, None] / mu)
    by_cosine, by_depth = _fit(_COSINE_CELLS), _fit(_DEPTH_CELLS)
    along = "is,jv,kt,mtsv->ijkm"
    return _Tables(
        _beside(np.einsum(along, by_cosine, by_cosine, by_depth, multiple, optimize=True)),
        _beside((by_cosine @ (by_depth @ lost).T)[..., None]),
        _beside((by_depth @ (layer.spherical_albedo / depths))[:, None]),
    )


def _sites(cells: int) -> np.ndarray:
    """Positions from 0 to `cells` to which that many cubic cells are fitted, denser at the ends."""
    number = cells + 7
    return cells * (1 - np.cos(np.pi * (np.arange(number) + 0.5) / number)) / 2


def _fit(cells: int) -> np.ndarray:
    """Matrix from values at the sites to the coefficients of the splines, by least squares."""
    sites = _sites(cells)
    first, values = _cell(np, sites, cells)
    splines = np.zeros((sites.size, cells + 3))
    for k in range(4):
        splines[np.arange(sites.size), first + k] = values[k]
    return np.linalg.pinv(splines)
