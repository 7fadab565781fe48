"""Air of a column at its levels, from the ground to the top of the atmosphere."""

import numpy as np
import xarray as xr

from ..constants import DRY_AIR_GAS_CONSTANT, GRAVITY, VAPOUR_GAS_CONSTANT
from ..files import InputError
from .standard_atmosphere import standard_pressure

# Heights at which levels may be added above a model's top. [m]
_HEIGHTS = np.array([80e3, 50e3, 30e3, 20e3, 15e3, *np.arange(12e3, 0, -1e3)])
# Thinner layers are not added. [m]
_CLEARANCE = 500.0


def completion_heights(highest_top: float) -> tuple[float, ...]:
    """Heights of the levels that complete the columns of a scene, top first. [m]

    Every kilometre up to 12 km, then 15, 20, 30, 50 and 80 km, of which those are taken that lie
    500 m or more above every column.

    Parameters
    ----------
    highest_top
        Height above sea level of the model's top, where in the scene it is highest. [m]
    """
    return tuple(float(h) for h in _HEIGHTS if h >= highest_top + _CLEARANCE)


def highest_top(model: xr.Dataset) -> float:
    """Height of the model's top where it is highest. [m]"""
    return float(model["height"].isel(level=0).max())


def complete_air(
    model: xr.Dataset, heights: tuple[float, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""Pressure and height at the levels, down from the top of the atmosphere.

    Above the model's top, at height :math:`h_t`, pressure is that of the US Standard Atmosphere
    scaled to be continuous, :math:`p(h) = p_t\, p_{76}(h) / p_{76}(h_t)`. The uppermost level has
    pressure 0, so that the column holds all air above the ground.

    Parameters
    ----------
    model
        A model Dataset.
    heights
        Of the levels to add, above sea level, top first. [m]

    Returns
    -------
    Pressure and height at the levels (level, y, x), top first, and pressure at the model's top
    (y, x). [Pa], [m], [Pa]
    """
    pressure, height = level_pressure(model), model["height"].values
    top_pressure, top_height = pressure[0], height[0]
    if heights and heights[-1] <= top_height.max():
        raise InputError(
            f"the model's top is at {top_height.max():.0f} m, above the level to be added at "
            f"{heights[-1]:.0f} m; choose completion heights for the scene's highest column."
        )
    added = np.broadcast_to(np.reshape(heights, (-1, 1, 1)), (len(heights), *top_height.shape))
    above = top_pressure * standard_pressure(added) / standard_pressure(top_height)
    pressure, height = np.concatenate([above, pressure]), np.concatenate([added, height])
    pressure[0] = 0.0
    return pressure, height, top_pressure


def level_pressure(model: xr.Dataset) -> np.ndarray:
    """Pressure at the levels of a model that has it at mid-layer (level, y, x). [Pa]

    Its logarithm is linear in height between mid-layers. At the ground it is the model's surface
    pressure or, if that is not known, hydrostatic under the lowest mid-layer with that layer's
    virtual temperature; at the model's top likewise, above the uppermost mid-layer.
    """
    layer_pressure, height = model["layer_pressure"].values, model["height"].values
    middle = (height[1:] + height[:-1]) / 2
    weight = (height[1:-1] - middle[1:]) / (middle[:-1] - middle[1:])  # of the layer above
    log_pressure = np.log(layer_pressure)
    inner = np.exp(weight * log_pressure[:-1] + (1 - weight) * log_pressure[1:])
    scale_height = DRY_AIR_GAS_CONSTANT * virtual_temperature(model)[[0, -1]] / GRAVITY
    top = layer_pressure[0] * np.exp((middle[0] - height[0]) / scale_height[0])
    if "surface_pressure" in model:
        ground = model["surface_pressure"].values
    else:
        ground = layer_pressure[-1] * np.exp((middle[-1] - height[-1]) / scale_height[1])
    return np.concatenate([top[None], inner, ground[None]])


def virtual_temperature(model: xr.Dataset) -> np.ndarray:
    """Temperature at which dry air is as light as the model's moist air (layer, y, x). [K]"""
    vapour = model["vapour_mixing_ratio"].values
    moisture = (1 + vapour * (VAPOUR_GAS_CONSTANT / DRY_AIR_GAS_CONSTANT)) / (1 + vapour)
    return model["layer_temperature"].values * moisture


def dry_air_path(model: xr.Dataset) -> np.ndarray:
    r"""Mass of dry air in each layer, per horizontal area (layer, y, x). [kg m-2]

    .. math:: \rho_d\, \Delta z, \qquad \rho_d = \frac{p}{R_d T (1 + q_v R_v / R_d)}
    """
    moist = 1 + model["vapour_mixing_ratio"].values * (VAPOUR_GAS_CONSTANT / DRY_AIR_GAS_CONSTANT)
    temperature = DRY_AIR_GAS_CONSTANT * model["layer_temperature"].values * moist
    return model["layer_pressure"].values / temperature * -np.diff(model["height"].values, axis=0)
