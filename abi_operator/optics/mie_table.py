"""Tables of Mie theory, read from ``tables/*_mie.nc`` on first use.

A file lists its materials (aerosol species, droplets), so that another one needs no code. How they
were computed, and from which sizes and refractive indices, is written in its attributes and
variables; the schema is in ``benchmarks/mie_ensembles.py``, with which they were written.
"""

from collections.abc import Callable
from functools import cache
from importlib.resources import as_file, files
from typing import NamedTuple

import numpy as np
import scipy  # its submodules load when they are first used
from jaxtyping import Array, Float, Int

from ..bands import OneOf
from .radius_cubics import padded

FILES = ("aerosol_mie.nc", "droplet_mie.nc")
DROPLETS = "droplets"
"""The table of cloud droplets; all others are of aerosols."""


class BandTable(NamedTuple):
    """Optics of one material in one band against effective radius, `padded` for `radius_cubics`.

    Parameters
    ----------
    efficiencies
        Logarithm of extinction (relative to 550 nm of aerosols, the efficiency of droplets),
        logarithm of 1 minus the single-scattering albedo, asymmetry factor. [-]
    moments
        Legendre moments of the phase function, chi_0 = 1 first. [-]
    coordinate
        Nodes of the phase function in the coordinate u of its cosine, rising. [-]
    offsets
        Added to 1 + cos and to 1 - cos in u = ln((1 + cos + b) / (1 - cos + f)): b, f. [-]
    log_phase
        At every node the logarithm of the phase function and its slope in u. [-]
    """

    efficiencies: Float[np.ndarray, "row 3"]
    moments: Float[np.ndarray, "row moment"]
    coordinate: Float[np.ndarray, " angle"]
    offsets: tuple[float, float]
    log_phase: Float[np.ndarray, "angle 2 row"]


class MieTable(NamedTuple):
    """Optics of one material: effective radii, equidistant in their logarithm [um], and bands."""

    effective_radius_um: Float[np.ndarray, " radius"]
    bands: tuple[str, ...]


def mie_species() -> tuple[str, ...]:
    """Names of the aerosol species that have a table."""
    return tuple(name for name in _materials() if name != DROPLETS)


def mie_table(material: str) -> MieTable:
    """Radii and bands of a material's table.

    Raises
    ------
    ValueError
        Where there is none.
    """
    file, i = _find(material)
    return MieTable(_read(file)["effective_radius_um"][i], tuple(_bands(file)))


@cache
def band_table(material: str, band: str) -> BandTable:
    """Table of a material in one band.

    Raises
    ------
    ValueError
        Where there is none.
    """
    file, i = _find(material)
    bands = _bands(file)
    if band not in bands:
        raise ValueError(f"no Mie table of {material!r} in band {band!r}; choose from {bands}.")
    j = bands.index(band)
    variables = {name: values[i, j] for name, values in _read(file).items() if values.ndim > 2}
    extinction, coalbedo = np.log(variables["extinction"]), np.log(variables["coalbedo"])
    asymmetry = variables["asymmetry"]
    moments = _unpacked(variables, "moments").T
    moments[:, 0], moments[:, 1] = 1, asymmetry
    coordinate = variables["coordinate"]
    by_angle = padded(_unpacked(variables, "log_phase_function").T).T
    slopes = scipy.interpolate.CubicSpline(coordinate, by_angle)(coordinate, 1)
    backward, forward = _read(file)["coordinate_offset"].tolist()
    return BandTable(
        padded(np.stack([extinction, coalbedo, asymmetry], axis=1)),
        padded(moments),
        coordinate,
        (backward, forward),
        np.stack([by_angle, slopes], axis=1),
    )


def stacked(
    material: str, band: OneOf, part: Callable[[BandTable], np.ndarray]
) -> tuple[np.ndarray, int | Int[Array, ""]]:
    """Tables of all bands of which the band may be one, row after row, and its own first row.

    Parameters
    ----------
    material
        Name of the table.
    band
        Name of the band.
    part
        What of a band's table is wanted.

    Raises
    ------
    ValueError
        Where there is none.
    """
    tables = [part(band_table(material, name)) for name in band.names]
    return np.concatenate(tables), 0 if band.place is None else band.place * len(tables[0])


def _find(material: str) -> tuple[str, int]:
    """File of a material and its place there."""
    materials = _materials()
    if material not in materials:
        species = sorted(mie_species())
        raise ValueError(f"no Mie table of species {material!r}; choose from {species}.")
    return materials[material]


@cache
def _materials() -> dict[str, tuple[str, int]]:
    """File and place of every material."""
    return {
        name: (file, i) for file in FILES for i, name in enumerate(_words(file, "species_name"))
    }


def _bands(file: str) -> list[str]:
    return _words(file, "band_name")


def _words(file: str, name: str) -> list[str]:
    """Rows of characters as strings, without the spaces that fill them up."""
    return [b"".join(row).decode().strip() for row in _read(file)[name]]


@cache
def _read(file: str) -> dict[str, np.ndarray]:
    """All variables of a file."""
    resource = files("abi_operator.optics").joinpath("tables", file)
    with as_file(resource) as path, scipy.io.netcdf_file(path, mmap=False) as dataset:
        return {
            name: variable[:].astype(variable[:].dtype.newbyteorder("="))
            for name, variable in dataset.variables.items()
        }


def _unpacked(variables: dict[str, np.ndarray], name: str) -> np.ndarray:
    """Integers of 16 bits as the numbers they stand for, by row."""
    scale, offset = (variables[f"{name}_{x}"][:, None].astype(float) for x in ("scale", "offset"))
    return variables[name] * scale + offset
