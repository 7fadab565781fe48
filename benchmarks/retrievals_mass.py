"""Extinction efficiencies at 550 nm behind a mass loading (`retrievals.mass_loading`).

    python benchmarks/retrievals_mass.py

prints, for ash and dust, the mean efficiency of the size distributions of the tables of aerosol
optics at radii equidistant in their logarithm, by miepython, and the mass extinction that follows.
"""

import make_aerosol_tables as tables
import miepython
import numpy as np

from retrievals.mass_loading import DENSITY

SPHERE_RADIUS_UM = np.geomspace(0.002, 600.0, 3000)
RADIUS_UM = np.geomspace(0.25, 20.0, 14)


def efficiency(name):
    """Extinction over area of the spheres, one for each of `RADIUS_UM`."""
    species = tables.SPECIES[name]
    tables.SPHERE_RADIUS_UM = SPHERE_RADIUS_UM
    areas = tables.volume_weights(RADIUS_UM, species.log_width) / SPHERE_RADIUS_UM
    x = 2 * np.pi * SPHERE_RADIUS_UM / tables.REFERENCE_UM
    q_ext, *_ = miepython.efficiencies_mx(species.refractive_index["green"], x)
    return (areas @ q_ext) / areas.sum(axis=1)


def main():
    print("| species | radius [um] | Q at 550 nm [-] | mass extinction [m2 g-1] |")
    print(f"|{' --- |' * 4}")
    for name, density in DENSITY.items():
        for radius, q in zip(RADIUS_UM, efficiency(name), strict=True):
            mass_extinction = 3 * q / (4 * density * 1e3 * radius * 1e-6)
            print(f"| {name} | {radius:.3f} | {q:.3f} | {mass_extinction:.3f} |")


if __name__ == "__main__":
    main()
