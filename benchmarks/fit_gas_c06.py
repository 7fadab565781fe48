"""Fit the exponential sum of gases in C06 (2.25 um): vapour line by line, CH4 and N2O by 6SV2.1.

    python benchmarks/fit_gas_c06.py FOLDER

Paths to space from five heights of four AFGL atmospheres. FOLDER holds the lines and the continuum
of vapour (`lines.py`); methane and nitrous oxide are the closed forms of `fit_gas_sums.py`. Gases
together are the product of each by itself. Averages are over the response of GOES-16 times
sunlight. Prints what stands in `abi_operator/optics/gas/tables.py`, its errors, and what the tests
hold.
"""

import argparse
import itertools
from pathlib import Path

import jax
import numpy as np
from fit_gas_lines import continuum, vapour_amounts
from fit_gas_sums import AIR_MASSES, Samples, joint_sum, path, report
from lines_of_air import PROFILES, Spectrum, spectrum, weights

from abi_operator.optics.gas.amounts import ScaledVapour

GASES = ("CH4", "N2O", "H2O")
GROUPS = (*((g,) for g in GASES), GASES)
HEIGHTS = (0.0, 1e3, 2e3, 4e3, 6e3)
TERMS = 3
LARGEST_AIR_MASS = 12.0
SUN = 5778.0  # [K]
VAPOUR = ("H2O", "self", "foreign")
LINES = ScaledVapour(101325.0, 0.7)


def samples_of(
    found: dict[str, Spectrum], continua: dict[str, float]
) -> tuple[Samples, np.ndarray]:
    """Each gas alone and all together, and what the grey continuum lets pass on each path.

    The transmittances of the samples are those without the continuum.
    """
    rows = []
    for one in found.values():
        share = weights("C06", one.grid, SUN)
        amounts = vapour_amounts(one.column, LINES)
        for height in HEIGHTS:
            layers = int(np.flatnonzero(np.asarray(one.column.height) == height)[0])
            lines, *grey = (x[:layers].sum() for x in amounts)
            grey = sum(k * x for k, x in zip(continua.values(), grey, strict=True))
            relative = float(one.column.pressure[layers]) / 101325
            vapour = one.above(height, VAPOUR)
            for m, mixing in itertools.product(AIR_MASSES, (0.8, 1.0, 1.2)):
                mixed = [path("C06", g, m, relative, 0.0, mixing) for g in GASES[:2]]
                along = [*mixed, (m * lines, -np.log(share @ np.exp(-m * vapour)))]
                for group in GROUPS:
                    chosen = np.array([g in group for g in GASES])
                    unit, depth = np.array(along).T * chosen
                    exact = np.exp(-depth.sum())
                    rows.append((*unit, exact, m, m * grey * ("H2O" in group)))
    table = np.unique(np.array(rows), axis=0)
    own = np.exp(-table[:, -1])
    return Samples(table[:, :3], table[:, 3] / own, table[:, 4], own), own


def main(folder: Path) -> None:
    """Fit, and print the sum and its errors."""
    found = {name: spectrum(folder, name, "C06") for name in PROFILES}
    continua = continuum(list(found.values()), "C06", SUN)
    samples, own = samples_of(found, continua)
    inside = samples.air_mass <= LARGEST_AIR_MASS
    fitted = joint_sum(Samples(*(column[inside] for column in samples)), TERMS)
    report("C06", list(GASES), fitted, samples, own)
    for name, one in found.items():
        share = weights("C06", one.grid, SUN)
        for height in (0.0, 2e3, 5e3):
            depth = one.above(height, VAPOUR)
            values = [float(share @ np.exp(-m * depth)) for m in (1.0, 2.0, 4.0)]
            print(f"  {name} {height:.0f} m, vapour: " + ", ".join(f"{t:.4f}" for t in values))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    jax.config.update("jax_enable_x64", True)
    main(parser.parse_args().folder)
