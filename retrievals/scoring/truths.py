"""What a result specifies of the quantities of a retrieval."""

import jax.numpy as jnp
import numpy as np
import xarray as xr

from abi_operator import LiquidCloud
from abi_operator.files import InputError

from ..declarations import mean_droplet_radius_um, optical_thickness

FIRST = {"cloud": "cloud_optical_thickness", "fire": "fire_temperature"}
"""Quantity by which a retrieval of each kind is judged first; of plumes it is ``aod_550``."""

_NEEDED = {
    "cloud": ("liquid_mass_path", "liquid_number_path"),
    "fire": ("fire_fraction", "fire_temperature"),
}


def first_of(kind: str) -> str:
    """Name of the first quantity of a kind of retrieval."""
    return FIRST.get(kind, "aod_550")


def known_truths(result: xr.Dataset, kind: str) -> dict[str, xr.DataArray]:
    """What a result specifies of the quantities of a retrieval, by name, the first one first.

    Parameters
    ----------
    result
        A result.
    kind
        One of `KINDS`.

    Raises
    ------
    InputError
        Where it lacks the truth.
    """
    needed = _NEEDED.get(kind, (f"{kind}_aod_550",))
    missing = [name for name in (*needed, "surface_albedo") if name not in result.variables]
    if missing:
        raise InputError(
            f"the result has no {', '.join(missing)}; give the one that the retrieval was made of, "
            "with all of its variables."
        )
    if kind == "cloud":
        return _of_cloud(result)
    if kind == "fire":
        burns = result["fire_fraction"] > 0
        return {name: result[name].where(burns) for name in ("fire_temperature", "fire_fraction")}
    truths = {"aod_550": result[f"{kind}_aod_550"]}
    for name in ("effective_radius_um", "mass_loading", "ssa"):
        if f"{kind}_{name}" in result:
            truths[name] = _everywhere(result[f"{kind}_{name}"], truths["aod_550"])
    return truths


def _of_cloud(result: xr.Dataset) -> dict[str, xr.DataArray]:
    mass, number = (
        result[name].transpose(..., "layer") for name in ("liquid_mass_path", "liquid_number_path")
    )
    cloud = LiquidCloud(jnp.asarray(mass.values, float), jnp.asarray(number.values, float))
    image = mass.isel(layer=0, drop=True)
    return {
        "cloud_optical_thickness": image.copy(data=np.asarray(optical_thickness(cloud))),
        "cloud_effective_radius_um": image.copy(data=np.asarray(mean_droplet_radius_um(cloud))),
    }


def _everywhere(variable: xr.DataArray, image: xr.DataArray) -> xr.DataArray:
    """A variable at every pixel of an image."""
    return variable if "y" in variable.dims else variable.broadcast_like(image)
