"""The albedos of snow in `abi_operator.surface.snow_and_ice`, by Mie theory (miepython).

    python benchmarks/make_snow_albedo.py

prints, for grains of several radii and each band of sunlight, the white-sky albedo of snow that is
deep enough, and that of Kokhanovsky and Zege's formula beside it, which holds where it is large.
"""

import jax
import miepython
import numpy as np

from abi_operator.bands import BANDS
from abi_operator.optics.ice_tables import ICE_INDEX
from abi_operator.solver import toa_albedo

RADII_UM = (50.0, 100.0, 200.0, 500.0, 1000.0)
# Single spheres have resonances, which a quarter of their radius to either side averages out; the
# effective radius, of volume to area, is the one named.
SPREAD = np.exp(np.linspace(-0.25, 0.25, 21))
SPREAD *= (SPREAD**2).sum() / (SPREAD**3).sum()
DEPTH = 1e5  # optical
NUM_STREAMS, NUM_MOMENTS, NUM_NODES = 16, 129, 16


def grains(band: str, radius_um: float) -> tuple[float, float]:
    """Single-scattering albedo and asymmetry factor of spheres of ice of an effective radius."""
    radii = radius_um * SPREAD
    sizes = 2 * np.pi * radii / BANDS[band].wavelength_um
    found = np.array([miepython.efficiencies_mx(ICE_INDEX[band], x) for x in sizes])
    extinction, scattering, asymmetry = found[:, 0], found[:, 1], found[:, 3]
    area = radii**2
    ssa = (area @ scattering) / (area @ extinction)
    return float(ssa), float((area * scattering) @ asymmetry / (area @ scattering))


def white_sky_albedo(ssa: float, asymmetry: float) -> float:
    """Albedo of a deep layer under light from everywhere."""
    nodes, weights = np.polynomial.legendre.leggauss(NUM_NODES)
    mu0, weights = (nodes + 1) / 2, weights * (nodes + 1) / 2
    one = np.ones((NUM_NODES, 1))
    moments = np.broadcast_to(asymmetry ** np.arange(NUM_MOMENTS), (NUM_NODES, 1, NUM_MOMENTS))
    plane = toa_albedo(DEPTH * one, ssa * one, moments, 0.0, mu0, num_streams=NUM_STREAMS)
    return float(np.asarray(plane) @ weights)


def main() -> None:
    jax.config.update("jax_enable_x64", True)
    bands = [band for band in ICE_INDEX if band != "C07"]
    print("radius [um]", *bands)
    for radius in RADII_UM:
        optics = [grains(band, radius) for band in bands]
        print(radius, *(f"{white_sky_albedo(*x):.4f}" for x in optics))
        formula = [np.exp(-4 * np.sqrt((1 - ssa) / (3 * (1 - g)))) for ssa, g in optics]
        print("formula", *(f"{x:.4f}" for x in formula))


if __name__ == "__main__":
    main()
