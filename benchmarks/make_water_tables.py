"""The tables of droplets and rain in `abi_operator.optics`, by Mie theory (miepython).

    MIEPYTHON_USE_JIT=1 python benchmarks/make_water_tables.py [--output droplet_mie.nc]

writes ``abi_operator/optics/tables/droplet_mie.nc`` in the schema of `mie_ensembles`, for gamma
distributions of cloud droplets (nu = 7); extinction is the efficiency, averaged by area. With
``--print`` it prints, for every band, the asymmetry factor alone of droplets
(`abi_operator.optics.water`, used with anomalous diffraction) and of rain (nu = 0,
`abi_operator.optics.rain`), to be pasted there. Either takes half an hour or less with numba, and
many times that without (no MIEPYTHON_USE_JIT).
"""

import argparse
from pathlib import Path

import miepython
import numpy as np
from mie_ensembles import Population, population, tabulate, write

from abi_operator.bands import BANDS
from abi_operator.optics import rain, water
from abi_operator.optics.droplets import NU

OUTPUT = Path(__file__).parents[1] / "abi_operator" / "optics" / "tables" / "droplet_mie.nc"
RADIUS_UM = np.geomspace(1.6, 64.0, 45)  # effective; of use from the second to the last but one
DIAMETER_UM = np.geomspace(0.2, 800.0, 100_000)
NUM_NODES, NUM_SPLIT = 180, 24  # of the phase function
# Nodes are placed on fewer droplets that absorb enough to have no narrow resonances.
PROXY_UM, PROXY_K = np.geomspace(0.2, 800.0, 40_000), 5e-4


def areas(radius_um: np.ndarray, nu: float, diameter_um: np.ndarray) -> np.ndarray:
    """Area of droplets of each diameter in gamma distributions, (distribution, diameter)."""
    slope = (nu + 3) / (2 * np.asarray(radius_um, float)[:, None])
    log_area = (nu + 3) * np.log(slope * diameter_um) - slope * diameter_um
    area = np.exp(log_area - log_area.max(axis=1, keepdims=True))
    return area / area.sum(axis=1, keepdims=True)


def droplets(band: str, diameter_um: np.ndarray, least_k: float = 0.0) -> Population:
    """Droplets of all radii of the table in one band."""
    index = water.REFRACTIVE_INDEX[band]
    index = complex(index.real, min(index.imag, -least_k))
    x = np.pi * diameter_um / BANDS[band].wavelength_um
    print(band, flush=True)
    return population(index, x, areas(RADIUS_UM, NU, diameter_um))


def write_table(path: Path) -> None:
    """Write the table of cloud droplets."""
    bands = [droplets(band, DIAMETER_UM) for band in BANDS]
    proxies = [droplets(band, PROXY_UM, PROXY_K) for band in BANDS]
    extinction = np.stack([b.extinction for b in bands])
    attributes = {
        "title": "Optics of cloud droplets in the bands of the Advanced Baseline Imager, "
        "Mie theory",
        "source": f"miepython {miepython.__version__}, benchmarks/make_water_tables.py",
        "comment": f"gamma distributions of diameter D^nu exp(-Lam D), nu = {NU:g}; sums over "
        f"{DIAMETER_UM.size} diameters, {DIAMETER_UM[0]:g} to {DIAMETER_UM[-1]:g} um, equidistant "
        "in their logarithm; extinction is the efficiency, averaged by area",
        "sources_of_droplets": "refractive index: D. J. Segelstein, The complex refractive index "
        "of water, M.S. thesis, University of Missouri-Kansas City, 1981",
    }
    write(
        path,
        attributes,
        {"droplets": RADIUS_UM},
        {"droplets": water.REFRACTIVE_INDEX},
        {"droplets": {"extinction": extinction} | tabulate(bands, proxies, NUM_NODES, NUM_SPLIT)},
        {"shape": ("1", ("species",), [NU])},
    )


def mean_asymmetry(band: str, nu: float, radius_um: tuple, diameter_um: np.ndarray) -> np.ndarray:
    """Asymmetry factor of gamma distributions of spheres of water. [-]"""
    x = np.pi * diameter_um / BANDS[band].wavelength_um
    _, q_sca, _, asymmetry = miepython.efficiencies_mx(water.REFRACTIVE_INDEX[band], x)
    area = areas(np.asarray(radius_um), nu, diameter_um)
    return (area @ (q_sca * asymmetry)) / (area @ q_sca)


def print_asymmetry() -> None:
    """Print the asymmetry factors of droplets and rain."""
    tables = {
        "droplets": (NU, water.EFFECTIVE_RADIUS_UM, np.geomspace(0.05, 500, 40000)),
        "rain": (0.0, rain.EFFECTIVE_RADIUS_UM, np.geomspace(0.5, 15000, 6000)),
    }
    for name, (nu, radius_um, diameter_um) in tables.items():
        print(name, radius_um, flush=True)
        for band in water.REFRACTIVE_INDEX:
            row = mean_asymmetry(band, nu, radius_um, diameter_um)
            print(f'    "{band}": ({", ".join(f"{g:.5f}" for g in row)}),', flush=True)


def main() -> None:
    """Write the table to the path given, or print."""
    parser = argparse.ArgumentParser(description="Tables of droplets and rain.")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    parser.add_argument("--print", action="store_true", help="asymmetry factors alone")
    options = parser.parse_args()
    if options.print:
        print_asymmetry()
    else:
        write_table(options.output)


if __name__ == "__main__":
    main()
