"""Plumes: of smoke and ash with published optics, and of spheres by their effective radius.

Every number of the published optics can be replaced.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.typing import ArrayLike

from ..atmosphere import BackgroundAerosol, MiePlume, Plume
from ..bands import GRASSO2013, check_bands
from ..ranges import STATE
from .aerosol_tables import ASH, SMOKE, AerosolOptics
from .mie_table import mie_table


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
        Where a band is unknown, or optics are given outside `bands`; where a value is out of its
        range (`ranges.STATE`), unless it is traced.

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
    Parameters, and what is refused, are those of `smoke`.

    References
    ----------
    .. [1] A. J. Prata and I. F. Grant, "Retrieval of microphysical and morphological properties of
       volcanic ash plumes from satellite data", Q. J. R. Meteorol. Soc., 127, 2153-2179, 2001,
       doi:10.1002/qj.49712757615
    """
    extent = {"aod_550": aod_550, "brightness": brightness, "base": base, "top": top}
    given = {"relative_extinction": relative_extinction, "ssa": ssa, "asymmetry": asymmetry}
    return _plume("ash", extent, ASH, given, bands)


BACKGROUND_SCALE_HEIGHT = 2000.0
"""Height by which background aerosol falls to 1 / e, as 6S has it. [m]"""


def background_aerosol(
    aod_550: ArrayLike,
    *,
    scale_height: ArrayLike = BACKGROUND_SCALE_HEIGHT,
    bands: Sequence[str] = GRASSO2013,
    relative_extinction: Mapping[str, ArrayLike] | None = None,
    ssa: Mapping[str, ArrayLike] | None = None,
    asymmetry: Mapping[str, ArrayLike] | None = None,
) -> BackgroundAerosol:
    """Aerosol that is everywhere beside the plumes, by default with the optics of smoke.

    Smoke is the one species here of fine particles, which most of the optical depth of continental
    air is due to; in the visible it scatters 0.93 of what it takes away, polluted continental air
    0.89 (Hess et al. 1998 [1]_, at 550 nm and 80 % humidity). Its scale height is that by which
    6S [2]_ thins aerosol upwards. Arguments broadcast, as those of `smoke`.

    Parameters
    ----------
    aod_550
        Optical depth at 550 nm. [-]
    scale_height
        Height by which extinction falls to 1 / e. [m]
    bands
        Bands for which it is specified.
    relative_extinction, ssa, asymmetry
        By band, in place of those of smoke. [-]

    Raises
    ------
    ValueError
        Where a band is unknown, or optics are given outside `bands`; where a value is out of its
        range (`ranges.STATE`), unless it is traced.

    References
    ----------
    .. [1] M. Hess et al., "Optical properties of aerosols and clouds: the software package OPAC",
       Bull. Amer. Meteor. Soc., 79, 831-844, 1998,
       doi:10.1175/1520-0477(1998)079<0831:OPOAAC>2.0.CO;2
    .. [2] E. F. Vermote et al., "Second simulation of the satellite signal in the solar spectrum,
       6S: an overview", IEEE Trans. Geosci. Remote Sens., 35, 675-686, 1997, doi:10.1109/36.581987
    """
    extent = {"aod_550": aod_550, "scale_height": scale_height}
    given = {"relative_extinction": relative_extinction, "ssa": ssa, "asymmetry": asymmetry}
    everything = _broadcast(extent | _completed("background aerosol", SMOKE, given, bands))
    _check("background aerosol", everything)
    return BackgroundAerosol(**everything)


def mie_plume(
    species: str,
    aod_550: ArrayLike,
    effective_radius_um: ArrayLike,
    *,
    base: ArrayLike,
    top: ArrayLike,
    brightness: ArrayLike = 1.0,
) -> MiePlume:
    """Plume of spheres, the optics of which follow from their effective radius in every band.

    Arguments broadcast, so that an array of radii makes a batch of plumes.

    Parameters
    ----------
    species
        Name of a species that has a table (`optics.mie_species` lists them), whose refractive
        indices `benchmarks/make_aerosol_tables.py` names with their sources.
    aod_550
        Optical depth at 550 nm where brightness is 1. [-]
    effective_radius_um
        Effective radius; of smoke, that of its fine mode. Beyond the table of the species optics
        are those at its end (`mie_optics`). [um]
    base, top
        Edges above the ground. [m]
    brightness
        Horizontal weight, 0 to 1. [-]

    Raises
    ------
    ValueError
        Where there is no such species, or where a value is out of its range, unless it is traced.
    """
    mie_table(species)
    extent = {"aod_550": aod_550, "brightness": brightness, "base": base, "top": top}
    plume = _broadcast(extent | {"effective_radius_um": effective_radius_um})
    _check(species, plume)
    return MiePlume(
        base=plume["base"],
        top=plume["top"],
        extinction_550=plume["aod_550"] / (plume["top"] - plume["base"]),
        brightness=plume["brightness"],
        effective_radius_um=plume["effective_radius_um"],
        species=species,
    )


def _plume(
    species: str,
    extent: dict[str, ArrayLike],
    published: AerosolOptics,
    given: dict[str, Mapping[str, ArrayLike] | None],
    bands: Sequence[str],
) -> Plume:
    """A plume with the `published` optics, completed by what is `given`."""
    plume = _broadcast(extent | _completed(species, published, given, bands))
    _check(species, plume)
    return Plume(
        base=plume["base"],
        top=plume["top"],
        extinction_550=plume["aod_550"] / (plume["top"] - plume["base"]),
        brightness=plume["brightness"],
        relative_extinction=plume["relative_extinction"],
        ssa=plume["ssa"],
        asymmetry=plume["asymmetry"],
    )


def _completed(
    species: str,
    published: AerosolOptics,
    given: dict[str, Mapping[str, ArrayLike] | None],
    bands: Sequence[str],
) -> dict[str, dict[str, ArrayLike]]:
    """Optics by band: `published` ones, unless others are `given`."""
    bands = check_bands(bands)
    optics = {}
    for name, values in given.items():
        values = values or {}
        unknown = [band for band in values if band not in bands]
        if unknown:
            raise ValueError(f"{name} of {species} is given in {unknown}, outside {bands=}.")
        optics[name] = {band: values.get(band, getattr(published, name)[band]) for band in bands}
    return optics


def _broadcast(plume: dict) -> dict:
    """Bring all numbers of a plume to one dtype and shape."""
    numbers, structure = jax.tree.flatten(plume)
    dtype = jnp.result_type(float, *numbers)
    arrays = jnp.broadcast_arrays(*(jnp.asarray(number, dtype) for number in numbers))
    return jax.tree.unflatten(structure, arrays)


def _read(plume: dict) -> dict:
    """The same as NumPy's arrays where they can be read, with which no comparison is compiled."""
    return jax.tree.map(lambda x: x if isinstance(x, Tracer) else np.asarray(x), plume)


def _check(species: str, plume: dict) -> None:
    """Raise `ValueError` naming a quantity that is out of its range, unless it is traced."""
    plume = _read(plume)
    for name, values in plume.items():
        by_band = values.items() if isinstance(values, dict) else [(None, values)]
        for band, x in by_band:
            label = name if band is None else f"{name}[{band!r}]"
            _refuse(species, label, x, STATE[name].holds, STATE[name].words)
    base = plume.get("base")
    if base is not None and not isinstance(base, Tracer):
        _refuse(species, "top", plume["top"], lambda top: top > base, "above base")


def _refuse(
    species: str, label: str, x: Any, holds: Callable[[np.ndarray], np.ndarray], allowed: str
) -> None:
    """Raise `ValueError` with the first value that does not hold, of those that can be read."""
    if isinstance(x, Tracer):
        return
    bad = ~np.asarray(holds(x))
    if np.any(bad):
        raise ValueError(f"{label} of {species} is {x[bad][0]}; it must be {allowed}.")
