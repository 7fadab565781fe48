"""Mie theory straight from miepython, for the tests of the tables of `abi_operator.optics`.

    MIEPYTHON_USE_JIT=1 python benchmarks/make_mie_reference.py [--output mie.csv] [--material ash]

writes ``tests/reference/mie.csv``, one row for each material, band and effective radius of
`RADII_UM`, none of which is in a table: extinction (relative to 0.55 um of aerosols, the
efficiency of droplets), 1 - single-scattering albedo, asymmetry factor, Legendre moments 0 to 16,
and the phase function for the sun, view and relative azimuth angles [deg] in its columns' names.
Sizes and refractive indices are those of the scripts that make the tables; spheres and sums are
not: miepython's amplitudes sphere by sphere, and Gauss points in the scattering angle for moments.
It takes a quarter of an hour with numba.
"""

import argparse
import csv
from pathlib import Path

import make_aerosol_tables as aerosols
import miepython
import numpy as np

from abi_operator.bands import BANDS
from abi_operator.optics.droplets import NU
from abi_operator.optics.water import REFRACTIVE_INDEX

OUTPUT = Path(__file__).parents[1] / "tests" / "reference" / "mie.csv"
RADII_UM = {
    "droplets": (2.3, 4.4, 8.7, 13.1, 27.0, 47.0),
    "smoke": (0.062, 0.137, 0.41),
    "ash": (0.41, 1.7, 8.3),
    "dust": (0.41, 1.7, 8.3),
}
# Sun, view, relative azimuth [deg]: glory (180 and 178 degrees), rainbow (139), side, forward (30).
GEOMETRIES = (
    (30, 30, 0),
    (40, 42, 0),
    (41, 0, 0),
    (60, 10, 100),
    (65, 50, 150),
    (75, 75, 180),
)
NUM_MOMENTS = 17
# Radii of spheres: for efficiencies and phase functions, and (one in `_EVERY`) for moments.
SPHERES_UM = {"droplets": np.geomspace(0.15, 350.0, 150_001)}
AEROSOL_SPHERES_UM = np.geomspace(0.003, 400.0, 12_001)
_EVERY = {"droplets": 6}
_AEROSOL_EVERY = 2
_PANELS_DEG = (0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1, 1.5, 2, 3, 4, 6, 8, *range(9, 181, 3))
_POINTS = 9


def areas(material: str, spheres: np.ndarray) -> np.ndarray:
    """Area in spheres of each radius [um] at all `RADII_UM`, per volume (aerosols) or area."""
    effective = np.array(RADII_UM[material])[:, None]
    if material == "droplets":
        slope = (NU + 3) / effective  # per radius
        area = spheres ** (NU + 3) * np.exp(-slope * spheres) * slope ** (NU + 3)
        return area / area.sum(axis=1, keepdims=True)

    species = aerosols.SPECIES[material]

    def volumes(radius, width):
        # The median of number of a lognormal distribution is exp(-5/2 width^2) effective radii.
        median = radius * np.exp(-2.5 * width**2)
        volume = spheres**3 * np.exp(-0.5 * (np.log(spheres / median) / width) ** 2)
        return volume / volume.sum(axis=-1, keepdims=True)

    second = species.second_volume * volumes(species.second_radius_um, species.second_log_width)
    return (volumes(effective, species.log_width) + second) / spheres


def mean_phase(index: complex, x: np.ndarray, weights: np.ndarray, cos: np.ndarray) -> np.ndarray:
    """Phase function at some angles, mean 1 over the sphere: (distribution, angle)."""
    total = np.zeros((len(weights), cos.size))
    scattering = np.zeros(len(weights))
    important = (weights / weights.max(axis=1, keepdims=True)).max(axis=0) > 1e-11
    for size, weight in zip(x[important], weights[:, important].T, strict=True):
        s1, s2 = miepython.S1_S2(index, size, cos, norm="wiscombe")
        total += weight[:, None] * 2 * (np.abs(s1) ** 2 + np.abs(s2) ** 2) / size**2
    _, q_sca, _, _ = miepython.efficiencies_mx(index, x[important])
    scattering = weights[:, important] @ q_sca
    return total / scattering[:, None]


def cos_scattering(geometry: tuple[float, float, float]) -> float:
    """Cosine of the scattering angle; azimuth 0 is backscatter."""
    sun, view, azimuth = np.radians(geometry)
    return -np.cos(sun) * np.cos(view) - np.sin(sun) * np.sin(view) * np.cos(azimuth)


def rows(material: str):
    """Rows of one material."""
    droplets = material == "droplets"
    spheres = SPHERES_UM.get(material, AEROSOL_SPHERES_UM)
    coarse = spheres[:: _EVERY.get(material, _AEROSOL_EVERY)]
    index = REFRACTIVE_INDEX if droplets else aerosols.SPECIES[material].refractive_index
    weights = areas(material, spheres)
    cos = np.array([cos_scattering(geometry) for geometry in GEOMETRIES])
    edges = np.radians(_PANELS_DEG)
    points, share = np.polynomial.legendre.leggauss(_POINTS)
    angle = (edges[:-1, None] + np.diff(edges)[:, None] * (points + 1) / 2).ravel()
    measure = np.sin(angle) / 2 * (np.diff(edges)[:, None] * share / 2).ravel()
    legendre = np.polynomial.legendre.legvander(np.cos(angle), NUM_MOMENTS - 1)
    reference = 1.0
    if not droplets:
        at_550 = 2 * np.pi * spheres / aerosols.REFERENCE_UM
        reference = weights @ miepython.efficiencies_mx(index["green"], at_550)[0]
    for band in BANDS.values():
        m = index[band.name]
        x = 2 * np.pi * spheres / band.wavelength_um
        q_ext, q_sca, _, g = miepython.efficiencies_mx(m, x)
        extinction, scattering = weights @ q_ext, weights @ q_sca
        asymmetry = weights @ (q_sca * g) / scattering
        phase = mean_phase(m, x, weights, cos)
        x = 2 * np.pi * coarse / band.wavelength_um
        moments = mean_phase(m, x, areas(material, coarse), np.cos(angle)) * measure @ legendre
        print(material, band.name, np.abs(moments[:, 0] - 1).max(), flush=True)
        for i, radius in enumerate(RADII_UM[material]):
            numbers = [(extinction / reference)[i], 1 - scattering[i] / extinction[i], asymmetry[i]]
            numbers += [*(moments[i] / moments[i, 0]), *phase[i]]
            yield [material, band.name, radius, *(f"{number:.7g}" for number in numbers)]


def main() -> None:
    """Write the reference to the path given."""
    parser = argparse.ArgumentParser(description="Mie theory at points outside the tables.")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    parser.add_argument("--material", choices=RADII_UM, action="append")
    options = parser.parse_args()
    names = ["material", "band", "effective_radius_um", "extinction", "coalbedo", "asymmetry"]
    names += [f"moment_{degree}" for degree in range(NUM_MOMENTS)]
    names += ["phase_" + "_".join(map(str, geometry)) for geometry in GEOMETRIES]
    with options.output.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        for material in options.material or RADII_UM:
            writer.writerows(rows(material))


if __name__ == "__main__":
    main()
