"""Mie theory straight from miepython (tests/reference/mie.csv), at radii outside the tables."""

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np

from abi_operator.bands import BANDS

FILE = Path(__file__).parent / "reference" / "mie.csv"


class Reference(NamedTuple):
    """One material, against effective radius and band; angles in degrees."""

    effective_radius_um: np.ndarray  # (radius,)
    extinction: np.ndarray  # (radius, band)
    coalbedo: np.ndarray
    asymmetry: np.ndarray
    moments: np.ndarray  # (radius, band, moment)
    phase: np.ndarray  # (radius, band, geometry)


def read() -> tuple[dict[str, Reference], np.ndarray]:
    """References by material, and the (sun, view, relative azimuth) of the geometries. [deg]"""
    with FILE.open(newline="") as file:
        rows = list(csv.DictReader(file))
    phases = [name for name in rows[0] if name.startswith("phase_")]
    moments = [name for name in rows[0] if name.startswith("moment_")]
    references = {}
    for material in dict.fromkeys(row["material"] for row in rows):
        mine = [row for row in rows if row["material"] == material]
        radii = list(dict.fromkeys(row["effective_radius_um"] for row in mine))
        at = {(row["effective_radius_um"], row["band"]): row for row in mine}

        def table(names, at=at, radii=radii):
            return np.array(
                [[[float(at[r, band][name]) for name in names] for band in BANDS] for r in radii]
            )

        single = (table([name])[..., 0] for name in ("extinction", "coalbedo", "asymmetry"))
        references[material] = Reference(
            np.array(radii, float), *single, table(moments), table(phases)
        )
    return references, np.array([[float(x) for x in name.split("_")[1:]] for name in phases])


def cos_scattering(geometries: np.ndarray) -> np.ndarray:
    """Cosines of the scattering angles of rows of sun, view and relative azimuth in degrees."""
    sun, view, azimuth = np.radians(geometries).T
    return -np.cos(sun) * np.cos(view) - np.sin(sun) * np.sin(view) * np.cos(azimuth)
