"""The tables of droplets and rain in `abi_operator.optics`, by Mie theory (miepython).

    python benchmarks/make_water_tables.py

prints, for every band, the asymmetry factor of gamma distributions of spheres: of droplets (nu = 7,
`abi_operator.optics.water`) and of rain (nu = 0, `abi_operator.optics.rain`), to be pasted there.
It takes some minutes; with numba, set MIEPYTHON_USE_JIT=1.
"""

import miepython
import numpy as np

from abi_operator.bands import BANDS
from abi_operator.optics.water import REFRACTIVE_INDEX

DROPLET_RADIUS_UM = (2, 2.5, 3, 3.5, 4, 4.5, 5, 6, 7, 8, 10, 12, 15, 20, 30, 40, 50)
RAIN_RADIUS_UM = (10, 20, 30, 50, 75, 100, 150, 200, 300, 500, 750, 1000, 1500, 2000)


def mean_asymmetry(band: str, nu: float, radius_um: tuple, diameter_um: np.ndarray) -> np.ndarray:
    """Asymmetry factor of gamma distributions of spheres of water. [-]"""
    x = np.pi * diameter_um / BANDS[band].wavelength_um
    _, q_sca, _, asymmetry = miepython.efficiencies_mx(REFRACTIVE_INDEX[band], x)
    slope = (nu + 3) / (2 * np.asarray(radius_um, float)[:, None])
    area = np.exp((nu + 3) * np.log(slope * diameter_um) - slope * diameter_um)
    return (area @ (q_sca * asymmetry)) / (area @ q_sca)


def main() -> None:
    """Print both tables."""
    tables = {
        "droplets": (7.0, DROPLET_RADIUS_UM, np.geomspace(0.05, 500, 40000)),
        "rain": (0.0, RAIN_RADIUS_UM, np.geomspace(0.5, 15000, 6000)),
    }
    for name, (nu, radius_um, diameter_um) in tables.items():
        print(name, radius_um, flush=True)
        for band in REFRACTIVE_INDEX:
            row = mean_asymmetry(band, nu, radius_um, diameter_um)
            print(f'    "{band}": ({", ".join(f"{g:.5f}" for g in row)}),', flush=True)


if __name__ == "__main__":
    main()
