"""The table of aerosol optics in `abi_operator.optics`, by Mie theory (miepython).

    MIEPYTHON_USE_JIT=1 python benchmarks/make_aerosol_tables.py [--output aerosol_mie.nc]

writes ``abi_operator/optics/tables/aerosol_mie.nc`` (classic NetCDF), for spheres of each species
in `SPECIES` and every band; another species is another entry there. It takes a quarter of an hour
with numba, and many times that without (no MIEPYTHON_USE_JIT). The schema is that of
`mie_ensembles`, with extinction over that at 0.550 um, and

| variable | axes | unit | meaning |
| --- | --- | --- | --- |
| log_width | species, mode | - | standard deviation of ln r in each lognormal mode |
| second_mode_effective_radius_um | species | um | does not follow the first mode's |
| second_mode_volume_ratio | species | - | its volume over that of the first, 0 where there is one |

The effective radius is that of the first mode.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

import miepython
import numpy as np
from mie_ensembles import population, tabulate, write

from abi_operator.bands import BANDS

OUTPUT = Path(__file__).parents[1] / "abi_operator" / "optics" / "tables" / "aerosol_mie.nc"
REFERENCE_UM = 0.550
# Equidistant in their logarithm, 5 standard deviations of area beyond every size distribution.
NUM_RADII = 41
NUM_NODES = 80  # of the phase function
SPHERE_RADIUS_UM = np.geomspace(0.002, 600.0, 20000)


class Species(NamedTuple):
    """Size distribution and refractive index of a species, and where they are from."""

    effective_radius_um: np.ndarray
    log_width: float
    refractive_index: dict[str, complex]
    sources: str
    second_log_width: float = 1.0
    second_radius_um: float = 1.0
    second_volume: float = 0.0


# Refractive index of mineral particles that ECMWF's atmospheric composition model uses from cycle
# 48r1 on, as its package ecaeropt (github.com/ecmwf-ifs/ecaeropt, file du_ri_table_composite)
# lists it: from twelve minerals below 1 um, Balkanski et al. (2007, doi:10.5194/acp-7-81-2007) in
# 1-3 um, Bodele in the Sahara of Di Biagio et al. (2017, doi:10.5194/acp-17-1901-2017) above.
# Wavelength [um], n, k [-].
COMPOSITE = np.array(
    [
        (0.40, 1.525, 5.0e-3),
        (0.60, 1.520, 2.2e-3),
        (1.00, 1.510, 6.0e-4),
        (1.26, 1.490, 5.4e-4),
        (1.58, 1.490, 5.3e-4),
        (1.88, 1.480, 5.2e-4),
        (2.25, 1.470, 5.2e-4),
        (3.50, 1.429, 3.0e-3),
        (4.00, 1.417, 4.0e-3),
    ]
)


def composite_index() -> dict[str, complex]:
    """`COMPOSITE` in the bands: n linear in wavelength, k log-log."""
    wavelength, n, k = COMPOSITE.T
    at = {name: band.wavelength_um for name, band in BANDS.items()}
    log_k = {name: np.interp(np.log(x), np.log(wavelength), np.log(k)) for name, x in at.items()}
    return {
        name: complex(np.interp(x, wavelength, n), -np.exp(log_k[name])) for name, x in at.items()
    }


SPECIES = {
    # Volume median radii, widths and volumes of Dubovik et al. at an optical depth of 0.74 at
    # 0.44 um: fine mode 0.15 um (here the one that varies), coarse mode 3.27 + 0.58 * 0.74 um. The
    # effective radius of a mode is its volume median radius times exp(-width^2 / 2).
    "smoke": Species(
        np.geomspace(0.04, 0.6, NUM_RADII),
        0.40,
        dict.fromkeys(BANDS, 1.47 - 0.0093j),
        "sizes and refractive index (the same in all bands): Amazonian forest of Dubovik et al. "
        "(2002), doi:10.1175/1520-0469(2002)059<0590:VOAAOP>2.0.CO;2; effective_radius_um is that "
        "of the fine mode, the coarse mode has 0.05/0.12 of its volume",
        second_log_width=0.79,
        second_radius_um=(3.27 + 0.58 * 0.74) * np.exp(-(0.79**2) / 2),
        second_volume=0.05 / 0.12,
    ),
    "ash": Species(
        np.geomspace(0.25, 20.0, NUM_RADII),
        np.log(2.0),
        {
            "C01": 1.5690 - 0.000542j,
            "green": 1.5690 - 0.000594j,
            "C02": 1.5690 - 0.000619j,
            "C03": 1.5680 - 0.001049j,
            "C04": 1.5646 - 0.001709j,
            "C05": 1.5625 - 0.001848j,
            "C06": 1.5568 - 0.002220j,
            "C07": 1.5382 - 0.003713j,
        },
        "refractive index: Eyjafjallajokull of 4 May 2010, Deguine et al. (2020), Appl. Opt., 59, "
        "884, data doi:10.6084/m9.figshare.9873134; width: after Prata and Grant (2001), "
        "doi:10.1002/qj.49712757615",
    ),
    "dust": Species(
        np.geomspace(0.25, 20.0, NUM_RADII),
        np.log(2.0),
        composite_index(),
        "refractive index: composite of ECMWF's ecaeropt after Balkanski et al. (2007), "
        "doi:10.5194/acp-7-81-2007, and Di Biagio et al. (2017), doi:10.5194/acp-17-1901-2017; "
        "width: accumulation mode of minerals, Hess et al. (1998), "
        "doi:10.1175/1520-0477(1998)079<0831:OPOAAC>2.0.CO;2",
    ),
}


def volume_weights(effective_radius_um: np.ndarray | float, log_width: float) -> np.ndarray:
    """Share of each of `SPHERE_RADIUS_UM` in the volume of a lognormal mode, (..., sphere)."""
    log_median = np.log(effective_radius_um) + log_width**2 / 2
    deviation = (np.log(SPHERE_RADIUS_UM) - np.expand_dims(log_median, -1)) / log_width
    weight = np.exp(-(deviation**2) / 2)
    return weight / weight.sum(axis=-1, keepdims=True)


def table(name: str) -> dict[str, np.ndarray]:
    """Variables of one species, (band, ...).

    The index at 0.550 um is that of the green band, 5 nm away.
    """
    species = SPECIES[name]
    first = volume_weights(species.effective_radius_um, species.log_width)
    second = volume_weights(species.second_radius_um, species.second_log_width)
    areas = (first + species.second_volume * second) / SPHERE_RADIUS_UM
    x = 2 * np.pi * SPHERE_RADIUS_UM
    q_ext, *_ = miepython.efficiencies_mx(species.refractive_index["green"], x / REFERENCE_UM)
    bands = []
    for band in BANDS.values():
        index = species.refractive_index[band.name]
        bands.append(population(index, x / band.wavelength_um, areas))
        print(name, band.name, flush=True)
    extinction = np.stack([b.extinction for b in bands]) / (areas @ q_ext)
    return {"extinction": extinction} | tabulate(bands, bands, NUM_NODES)


def write_table(path: Path) -> None:
    """Write the table."""
    rows = SPECIES.values()
    spheres = (
        f"sums over {SPHERE_RADIUS_UM.size} radii of spheres, {SPHERE_RADIUS_UM[0]:g} to "
        f"{SPHERE_RADIUS_UM[-1]:g} um, equidistant in their logarithm; extinction is relative "
        f"to {REFERENCE_UM} um with the refractive index of the green band"
    )
    attributes = {
        "title": "Optics of aerosols in the bands of the Advanced Baseline Imager, Mie theory",
        "source": f"miepython {miepython.__version__}, benchmarks/make_aerosol_tables.py",
        "comment": spheres,
    }
    write(
        path,
        attributes | {f"sources_of_{name}": s.sources for name, s in SPECIES.items()},
        {name: s.effective_radius_um for name, s in SPECIES.items()},
        {name: s.refractive_index for name, s in SPECIES.items()},
        {name: table(name) for name in SPECIES},
        {
            "log_width": (
                "1",
                ("species", "mode"),
                [(s.log_width, s.second_log_width) for s in rows],
            ),
            "second_mode_effective_radius_um": (
                "um",
                ("species",),
                [s.second_radius_um for s in rows],
            ),
            "second_mode_volume_ratio": ("1", ("species",), [s.second_volume for s in rows]),
        },
    )


def main() -> None:
    """Write the table to the path given."""
    parser = argparse.ArgumentParser(description="Write the table of aerosol optics.")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    write_table(parser.parse_args().output)


if __name__ == "__main__":
    main()
