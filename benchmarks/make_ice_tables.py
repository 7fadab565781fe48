"""Rough crystals' asymmetry factors, and what judges the optics of ice.

    python benchmarks/make_ice_tables.py baum-general-habit-mixture_ice_scattering.nc

prints the table of ``abi_operator/optics/rough_ice.py``, asymmetry factors of what is not
diffracted by the file's own single-scattering albedo, and writes ``tests/reference/ice.csv``
(``--output``): mass extinction coefficient, co-albedo and asymmetry factor of all light at the
centroids of the bands, linear between the wavelengths of the file. The file is that of the general
habit mixture, severely roughened, of Baum et al. (2014, doi:10.1016/j.jqsrt.2014.02.029), in the
form that the radiation code ecRad (github.com/ecmwf-ifs/ecrad, data/, Apache-2.0) carries it.
"""

import argparse
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import xarray as xr

from abi_operator.bands import BANDS
from abi_operator.optics.diffraction import diffraction_asymmetry, geometric_asymmetry

RADII_UM = (5, 7.5, 10, 15, 20, 25, 30, 40, 50, 60)
JUDGED_UM = (10, 20, 30, 50)
OUTPUT = Path(__file__).parents[1] / "tests" / "reference" / "ice.csv"
NAMES = ("mass_extinction_coefficient", "single_scattering_albedo", "asymmetry_factor")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    with xr.open_dataset(options.file) as dataset:
        by_wavelength = dataset.sortby("wavelength")
        wavelength_um = 1e6 * by_wavelength["wavelength"].values.astype(float)
        radius_um = np.round(1e6 * by_wavelength["effective_radius"].values.astype(float), 3)
        values = {name: by_wavelength[name].values.astype(float) for name in NAMES}

    def at(name, band, radius):
        (row,) = np.flatnonzero(radius_um == radius)
        return np.interp(BANDS[band].wavelength_um, wavelength_um, values[name][row])

    def geometric(band, radius):
        _, ssa, asymmetry = (at(name, band, radius) for name in NAMES)
        lobe = diffraction_asymmetry(radius, BANDS[band].wavelength_um)
        return float(geometric_asymmetry(*map(jnp.asarray, (asymmetry, ssa, lobe))))

    for band in BANDS:
        print(f'    "{band}": ({", ".join(f"{geometric(band, r):.4f}" for r in RADII_UM)}),')
    lines = ["band,effective_radius_um,mass_extinction,coalbedo,asymmetry"]
    for band in BANDS:
        for radius in JUDGED_UM:
            extinction, ssa, asymmetry = (at(name, band, radius) for name in NAMES)
            lines.append(f"{band},{radius},{extinction:.2f},{1 - ssa:.4f},{asymmetry:.4f}")
    options.output.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
