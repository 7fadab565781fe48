"""The tables of droplets and rain in `abi_operator.optics`, by Mie theory (miepython).

    python benchmarks/make_water_tables.py

prints, for every band, the asymmetry factor of gamma distributions of spheres: of droplets (nu = 7,
`abi_operator.optics.water`) and of rain (nu = 0, `abi_operator.optics.rain`), to be pasted there.
It takes some minutes; with numba, set MIEPYTHON_USE_JIT=1.
"""

import miepython
import numpy as np

from abi_operator.bands import BANDS
from abi_operator.optics import rain, water
from abi_operator.optics.droplets import NU


def mean_asymmetry(band: str, nu: float, radius_um: tuple, diameter_um: np.ndarray) -> np.ndarray:
    """Asymmetry factor of gamma distributions of spheres of water. [-]"""
    x = np.pi * diameter_um / BANDS[band].wavelength_um
    _, q_sca, _, asymmetry = miepython.efficiencies_mx(water.REFRACTIVE_INDEX[band], x)
    slope = (nu + 3) / (2 * np.asarray(radius_um, float)[:, None])
    area = np.exp((nu + 3) * np.log(slope * diameter_um) - slope * diameter_um)
    return (area @ (q_sca * asymmetry)) / (area @ q_sca)


def main() -> None:
    """Print both tables."""
    tables = {
        "droplets": (NU, water.EFFECTIVE_RADIUS_UM, np.geomspace(0.05, 500, 40000)),
        "rain": (0.0, rain.EFFECTIVE_RADIUS_UM, np.geomspace(0.5, 15000, 6000)),
    }
    for name, (nu, radius_um, diameter_um) in tables.items():
        print(name, radius_um, flush=True)
        for band in water.REFRACTIVE_INDEX:
            row = mean_asymmetry(band, nu, radius_um, diameter_um)
            print(f'    "{band}": ({", ".join(f"{g:.5f}" for g in row)}),', flush=True)


if __name__ == "__main__":
    main()
