"""Pixels of several columns each: means of everything that an image has."""

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..instrument import image_mean, overlap_lengths

_VERTICAL = {"layer", "level"}
_TURNS = "longitude"
# Of a mean over columns that burn and such that do not nothing is known.
_NO_MEAN = ("fire_temperature",)


def pixel_means(result: xr.Dataset, footprint: int) -> xr.Dataset:
    """Means over pixels of so many columns each way, of what has neither layers nor levels.

    Parameters
    ----------
    result
        With dimensions y and x, and others before them. Whole numbers are flags, of which a pixel
        has those of any column.
    footprint
        Columns along each side of a pixel; those at the ends that fill none are left out. [-]
    """
    kept = {axis: result.sizes[axis] // footprint for axis in ("y", "x")}
    whole = result.isel({axis: slice(0, n * footprint) for axis, n in kept.items()})
    weights = [
        overlap_lengths(jnp.arange(n * footprint + 1.0), footprint * jnp.arange(n + 1.0))
        for n in kept.values()
    ]
    mean = jax.jit(lambda x: jax.vmap(lambda one: image_mean(one, *weights))(x))
    made = {}
    for name, array in whole.variables.items():
        if _VERTICAL & set(array.dims) or name in _NO_MEAN:
            continue
        if not {"y", "x"} <= set(array.dims):
            blocks = [dim for dim in ("y", "x") if dim in array.dims]
            windows = dict.fromkeys(blocks, footprint)
            made[name] = array.coarsen(windows, np.mean) if blocks else array
            continue
        ordered = array.transpose(..., "y", "x")
        if array.dtype.kind != "f":
            blocks = ordered.values.reshape(
                *ordered.shape[:-2], kept["y"], footprint, kept["x"], footprint
            )
            values = np.bitwise_or.reduce(np.bitwise_or.reduce(blocks, axis=-1), axis=-2)
        else:
            flat = ordered.values.astype(np.float64).reshape(-1, *ordered.shape[-2:])
            first = flat[:, :1, :1] if name == _TURNS else 0.0
            turned = (flat - first + 180) % 360 - 180 if name == _TURNS else flat
            means = np.asarray(mean(jnp.asarray(turned))) + first
            values = means.reshape(*ordered.shape[:-2], *kept.values())
        made[name] = (ordered.dims, values, array.attrs)
    coordinates = {name: made.pop(name) for name in whole.coords if name in made}
    return xr.Dataset(made, coordinates, whole.attrs)
