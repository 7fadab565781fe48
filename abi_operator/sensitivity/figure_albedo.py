"""Constant against MODIS albedo: how fires and plumes stand out from the ground.

Grasso et al. (2013) brought MODIS albedo into their imagery since over a ground of one albedo every
fire and every plume stands out as if there were no other ground. The same scene is simulated twice,
with the albedo of each pixel and with the mean of the land in each band, and each time without its
plume and with a fire in every pixel. Land that reflects by kernels has the mean of its white-sky
albedo, and reflects it to all sides alike.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..atmosphere import Fire, Plume, State
from ..files import InputError
from ..scene import species_of
from .figure import Figure
from .ground_albedo import white_sky_albedo
from .outputs import output_function
from .panels import change_map, histogram
from .pixel_kinds import CLOUD, cloud_depth, depths_of, even_ground, ground_kinds
from .result_checks import check_result, of_columns
from .scene_study import chosen_pixels, settings_of_result, states_of, sun_distance_of

_BANDS = ("C01", "C02", "C03", "C06")
_FIRE = "fire_contrast"


def albedo_figure(image: xr.Dataset, fire: Fire) -> Figure:
    """Contrast of a plume and of fires over land, with MODIS and with constant albedo.

    Land is what is known to be land (`pixel_kinds.ground_kinds`) and has an albedo that differs
    between bands, as that of a map does: what was given one number (``--land-albedo``) has no
    albedo by MODIS, and may not be told from water.

    Parameters
    ----------
    image
        Result of a simulation at one time, with the bands of the paper and one plume.
    fire
        What burns in every pixel.

    Raises
    ------
    InputError
        Where there is no plume, a band is missing or another part of the result, or no land
        without cloud.
    """
    check_result(image, [*depths_of(image), *of_columns(image)])
    there = species_of(image)
    lacking = sorted(set(_BANDS) - set(image["band"].values.tolist()))
    if lacking or len(there) != 1:
        raise InputError(
            "this figure is of one plume and of C01, C02, C03 and C06; the result has plumes of "
            f"{', '.join(there) or 'nothing'} and lacks {', '.join(lacking) or 'no band'}."
        )
    land = chosen_pixels(image, None, "all") & ground_kinds(image)["land"] & ~even_ground(image)
    land &= cloud_depth(image, "C06") < CLOUD
    if not land.any():
        raise InputError(
            "there is no land without cloud that the sun shines on and whose albedo differs "
            "between bands, as that of an albedo file does."
        )
    with jax.enable_x64(True):
        states = states_of(image, land, (*_BANDS, _FIRE), fire)
        own = {band: np.asarray(white_sky_albedo(x)) for band, x in states.albedo.items()}
        mean = {band: np.full(land.sum(), x.mean()) for band, x in own.items()}
        grounds = {"MODIS": states, "constant": replace(states, albedo=mean)}
        how = settings_of_result(image), sun_distance_of(image)
        found = {name: _contrasts(x, there[0], how) for name, x in grounds.items()}
    inside = image[f"{there[0]}_brightness"].values[land] > 0
    lines, panels = [], []
    for k, what in enumerate([f"{there[0]} in {band}" for band in _BANDS] + ["fires in C06"]):
        chosen = inside if k < len(_BANDS) else np.ones_like(inside)
        for name, values in found.items():
            lines.append(_line(what, name, values[chosen, k]))
    for k, what in ((2, f"{there[0]} in C03"), (len(_BANDS), "Fires in C06")):
        both = {name: values[:, k] for name, values in found.items()}
        largest = float(np.percentile(np.abs(np.concatenate(list(both.values()))), 98))
        for name, values in both.items():
            field = np.full(land.shape, np.nan)
            field[land] = values
            panels.append(change_map(f"{what}, {name} albedo", field, largest, ""))
        chosen = inside if k < len(_BANDS) else np.ones_like(inside)
        series = {name: values[chosen] for name, values in both.items()}
        panels.append(histogram(f"{what}: contrast", series, -largest, largest, ""))
    fields = {}
    for name, values in found.items():
        for k, what in enumerate([f"plume_contrast_{band}" for band in _BANDS] + [_FIRE]):
            fields[f"{what}_{name}"] = np.full(land.shape, np.nan)
            fields[f"{what}_{name}"][land] = values[:, k]
    burnt = f"{float(fire.fraction):g} of each pixel at {float(fire.temperature):g} K"
    caption = f"Contrast over the same pixel without, land without cloud alone; fires: {burnt}."
    return Figure(panels, 3, lines, fields, caption)


def _contrasts(states: State, species: str, how: tuple) -> np.ndarray:
    """Contrast (column, of) of the plume in each band, without the fire, and of the fire under it.

    In C06 light of the fire would drown the plume's.
    """
    plume = states.atmosphere.plumes[species]
    assert isinstance(plume, Plume)
    none = replace(plume, brightness=jnp.zeros_like(plume.brightness))
    plumes = {**states.atmosphere.plumes, species: none}
    clear = replace(states, atmosphere=replace(states.atmosphere, plumes=plumes))
    seen = output_function(_BANDS, *how)
    with_plume, without = (np.asarray(seen(replace(x, fire=None))) for x in (states, clear))
    of_fire = np.asarray(output_function((_FIRE,), *how)(states))
    return np.concatenate([with_plume / without - 1, of_fire], axis=-1)


def _line(what: str, name: str, values: np.ndarray) -> str:
    if not values.size:
        return f"{what:>14}, {name:8} albedo: no pixel"
    low, middle, high = np.percentile(values, [5, 50, 95])
    return (
        f"{what:>14}, {name:8} albedo: contrast median {middle:+8.3f}, 5th to 95th percentile "
        f"{low:+8.3f} to {high:+8.3f}, {values.size} pixels"
    )
