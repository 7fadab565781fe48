"""Tables of Mie theory for aerosols, read from ``tables/aerosol_mie.nc`` on first use.

The file lists the species, so that another one needs no code. How they were computed, and from
which sizes and refractive indices, is written in its attributes and variables; its schema is in
``benchmarks/make_aerosol_tables.py``, which wrote it.
"""

from functools import lru_cache
from importlib.resources import as_file, files
from typing import NamedTuple

import numpy as np
import scipy  # its submodules load when they are first used


class MieTable(NamedTuple):
    """Optics of one species against effective radius.

    Parameters
    ----------
    effective_radius_um
        Effective radius, rising. [um]
    log_relative_extinction, log_coalbedo, asymmetry
        By band, against radius: logarithm of extinction relative to 550 nm, logarithm of 1 minus
        the single-scattering albedo, asymmetry factor. [-]
    """

    effective_radius_um: tuple[float, ...]
    log_relative_extinction: dict[str, tuple[float, ...]]
    log_coalbedo: dict[str, tuple[float, ...]]
    asymmetry: dict[str, tuple[float, ...]]


def mie_species() -> tuple[str, ...]:
    """Names of the species that have a table."""
    return tuple(_tables())


def mie_table(species: str) -> MieTable:
    """Table of a species.

    Raises
    ------
    ValueError
        Where there is none.
    """
    tables = _tables()
    if species not in tables:
        raise ValueError(f"no Mie table of species {species!r}; choose from {sorted(tables)}.")
    return tables[species]


@lru_cache(maxsize=1)
def _tables() -> dict[str, MieTable]:
    """All tables of the file, by species."""
    resource = files("abi_operator.optics").joinpath("tables", "aerosol_mie.nc")
    with as_file(resource) as path, scipy.io.netcdf_file(path, mmap=False) as file:
        variables = {name: variable[:] for name, variable in file.variables.items()}
    bands = _words(variables["band_name"])

    def by_band(values: np.ndarray) -> dict[str, tuple[float, ...]]:
        return dict(zip(bands, map(tuple, values.tolist()), strict=True))

    return {
        species: MieTable(
            tuple(variables["effective_radius_um"][i].tolist()),
            by_band(np.log(variables["relative_extinction"][i])),
            by_band(np.log(variables["coalbedo"][i])),
            by_band(variables["asymmetry"][i]),
        )
        for i, species in enumerate(_words(variables["species_name"]))
    }


def _words(characters: np.ndarray) -> list[str]:
    """Rows of characters as strings, without the spaces that fill them up."""
    return [b"".join(row).decode().strip() for row in characters]
