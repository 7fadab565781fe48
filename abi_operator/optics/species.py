"""Plumes of smoke and ash with published optics, every number of which can be replaced."""

from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.typing import ArrayLike
from jaxtyping import Array

from ..atmosphere import Plume
from ..bands import GRASSO2013, check_bands
from .aerosol_tables import ASH, SMOKE, AerosolOptics


def smoke(
    aod_550: ArrayLike = 1.0,
    *,
    brightness: ArrayLike = 1.0,
    base: ArrayLike = 1000.0,
    top: ArrayLike = 3000.0,
    bands: Sequence[str] = GRASSO2013,
    relative_extinction: Mapping[str, ArrayLike] | None = None,
    ssa: Mapping[str, ArrayLike] | None = None,
    asymmetry: Mapping[str, ArrayLike] | None = None,
) -> Plume:
    """Plume of biomass-burning smoke, by default at 1-3 km as in Grasso et al. (2013).

    Optics are those of the biomass-burning model of 6SV2.1, the Amazonian forest smoke of AERONET
    [1]_, in every band for which nothing else is given. Arguments broadcast, so that an array
    of brightness makes a batch of plumes.

    Parameters
    ----------
    aod_550
        Optical depth at 550 nm where brightness is 1. [-]
    brightness
        Horizontal weight, 0 to 1. [-]
    base, top
        Edges above the ground. [m]
    bands
        Bands for which the plume is specified.
    relative_extinction, ssa, asymmetry
        By band, in place of the published ones: extinction relative to 550 nm, single-scattering
        albedo, asymmetry factor. [-]

    Raises
    ------
    ValueError
        Where a value is out of its range, unless it is traced.

    References
    ----------
    .. [1] O. Dubovik et al., "Variability of absorption and optical properties of key aerosol types
       observed in worldwide locations", J. Atmos. Sci., 59, 590-608, 2002,
       doi:10.1175/1520-0469(2002)059<0590:VOAAOP>2.0.CO;2
    """
    extent = {"aod_550": aod_550, "brightness": brightness, "base": base, "top": top}
    given = {"relative_extinction": relative_extinction, "ssa": ssa, "asymmetry": asymmetry}
    return _plume("smoke", extent, SMOKE, given, bands)


def ash(
    aod_550: ArrayLike = 1.0,
    *,
    brightness: ArrayLike = 1.0,
    base: ArrayLike = 8000.0,
    top: ArrayLike = 11000.0,
    bands: Sequence[str] = GRASSO2013,
    relative_extinction: Mapping[str, ArrayLike] | None = None,
    ssa: Mapping[str, ArrayLike] | None = None,
    asymmetry: Mapping[str, ArrayLike] | None = None,
) -> Plume:
    """Plume of volcanic ash, by default at 8-11 km as in Grasso et al. (2013).

    Optics are those of spheres with an effective radius of 3 um, near the mode that Prata and
    Grant [1]_ found, and a refractive index of 1.53 - 0.0015i, which makes the ash brown.
    Parameters are those of `smoke`.

    References
    ----------
    .. [1] A. J. Prata and I. F. Grant, "Retrieval of microphysical and morphological properties of
       volcanic ash plumes from satellite data", Q. J. R. Meteorol. Soc., 127, 2153-2179, 2001,
       doi:10.1002/qj.49712757615
    """
    extent = {"aod_550": aod_550, "brightness": brightness, "base": base, "top": top}
    given = {"relative_extinction": relative_extinction, "ssa": ssa, "asymmetry": asymmetry}
    return _plume("ash", extent, ASH, given, bands)


def _plume(
    species: str,
    extent: dict[str, ArrayLike],
    published: AerosolOptics,
    given: dict[str, Mapping[str, ArrayLike] | None],
    bands: Sequence[str],
) -> Plume:
    """Complete `published` by what is `given` and bring all to one dtype and shape."""
    bands = check_bands(bands)
    optics = {}
    for name, values in given.items():
        values = values or {}
        unknown = [band for band in values if band not in bands]
        if unknown:
            raise ValueError(f"{name} of {species} is given in {unknown}, outside {bands=}.")
        optics[name] = {band: values.get(band, getattr(published, name)[band]) for band in bands}

    numbers, structure = jax.tree.flatten(extent | optics)
    dtype = jnp.result_type(float, *numbers)
    arrays = jnp.broadcast_arrays(*(jnp.asarray(number, dtype) for number in numbers))
    plume = jax.tree.unflatten(structure, arrays)
    _check(species, plume)
    thickness = plume["top"] - plume["base"]
    return Plume(
        base=plume["base"],
        top=plume["top"],
        extinction_550=plume["aod_550"] / thickness,
        brightness=plume["brightness"],
        relative_extinction=plume["relative_extinction"],
        ssa=plume["ssa"],
        asymmetry=plume["asymmetry"],
    )


def _check(species: str, plume: dict) -> None:
    """Raise `ValueError` naming the first quantity that is out of range."""

    def check(name: str, requirement: str, holds: Array) -> None:
        if not isinstance(holds, Tracer) and not np.all(holds):
            raise ValueError(f"{name} of {species} must be {requirement}.")

    check("top", "above base", plume["top"] > plume["base"])
    check("aod_550", "0 or more", plume["aod_550"] >= 0)
    check("brightness", "0 or more", plume["brightness"] >= 0)
    for band, extinction in plume["relative_extinction"].items():
        check(f"relative_extinction[{band!r}]", "0 or more", extinction >= 0)
    for band, ssa in plume["ssa"].items():
        check(f"ssa[{band!r}]", "between 0 and 1", (ssa >= 0) & (ssa <= 1))
    for band, asymmetry in plume["asymmetry"].items():
        check(f"asymmetry[{band!r}]", "between -1 and 1, exclusive", abs(asymmetry) < 1)
