"""Spectra of standard atmospheres, line by line, and means over ABI's bands.

Each layer of a standard atmosphere is taken at its mean pressure and temperature; layers are 0.5 km
thick to 12 km and as published above. Water vapour is that of the profile, other gases are mixed.
Depths are by the lines and the continuum of `lines.py`; those of N2O are of its first isotopologue,
with the others (1 %) counted as that one. In C07 lines of HDO are those of `lines_hdo.py`, unless
the folder has records of them. Of vapour's other isotopologues what records there are is counted.

Used by `lines_transmittance.py`, `lines_temperature.py` and `fit_gas_lines.py`.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from lines import MOLECULES, STEP, Continuum, Lines, cross_section, read_lines
from lines_hdo import hdo_lines

from abi_operator.atmosphere import Atmosphere
from abi_operator.standard_atmospheres import standard_atmosphere

PROFILES = ("tropical", "midlatitude_summer", "midlatitude_winter", "us_standard")
HEIGHT = 1e3 * np.array(
    [60, 50, 45, 40, 35, 30, 25, *range(22, 12, -2), *np.arange(12, -0.1, -0.5)]
)
MIXED = {"N2O": 0.33e-6}  # mole fractions of the depths that `spectrum` gives
VAPOUR = ("H2O", "HDO", "self", "foreign")
NITROUS_OXIDE_446 = 0.990333  # share of the isotopologue, natural [-]

# Mean response of GOES-16 in even cells, the first at `first` and of width `step`. [um] (NOAA
# GOES-R Calibration Working Group, ABI spectral response functions, PFM, 2016)
RESPONSES: dict[str, tuple[float, float, tuple[float, ...]]] = {
    # fmt: off
    "C06": (
        2.19529,
        0.0017261,
        (
            0.0012,
            0.0018,
            0.0027,
            0.0039,
            0.0053,
            0.0079,
            0.0121,
            0.0180,
            0.0290,
            0.0470,
            0.0761,
            0.1247,
            0.2010,
            0.3196,
            0.4714,
            0.6444,
            0.7963,
            0.9020,
            0.9491,
            0.9632,
            0.9623,
            0.9609,
            0.9626,
            0.9708,
            0.9806,
            0.9918,
            0.9987,
            0.9993,
            0.9983,
            0.9946,
            0.9907,
            0.9867,
            0.9778,
            0.9652,
            0.9545,
            0.9470,
            0.9401,
            0.9239,
            0.8803,
            0.7940,
            0.6577,
            0.4932,
            0.3306,
            0.2021,
            0.1191,
            0.0689,
            0.0402,
            0.0243,
            0.0152,
            0.0098,
            0.0064,
            0.0043,
            0.0028,
            0.0018,
            0.0016,
        ),
    ),
    "C07": (
        3.69786,
        0.0063655,
        (
            0.002,
            0.003,
            0.003,
            0.005,
            0.006,
            0.008,
            0.012,
            0.016,
            0.026,
            0.043,
            0.062,
            0.090,
            0.127,
            0.184,
            0.256,
            0.345,
            0.448,
            0.564,
            0.679,
            0.779,
            0.868,
            0.926,
            0.943,
            0.939,
            0.934,
            0.929,
            0.940,
            0.961,
            0.982,
            0.993,
            0.998,
            0.978,
            0.935,
            0.890,
            0.857,
            0.828,
            0.798,
            0.779,
            0.762,
            0.753,
            0.750,
            0.745,
            0.740,
            0.721,
            0.680,
            0.617,
            0.523,
            0.403,
            0.292,
            0.203,
            0.133,
            0.088,
            0.053,
            0.031,
            0.022,
            0.013,
            0.010,
            0.006,
            0.004,
            0.002,
        ),
    ),
    # fmt: on
}


class Spectrum(NamedTuple):
    """Depths of the layers of one column, top first, on a grid of wavenumbers [cm-1]."""

    column: Atmosphere
    grid: np.ndarray
    depths: dict[str, np.ndarray]  # by gas: [layer, wavenumber]

    def above(self, height: float, gases: tuple[str, ...]) -> np.ndarray:
        """Vertical depth of some gases between a level [m] and space, by wavenumber."""
        layers = int(np.flatnonzero(np.asarray(self.column.height) == height)[0])
        return np.sum([self.depths[g][:layers].sum(axis=0) for g in gases], axis=0)


def grid_of(band: str) -> np.ndarray:
    """Wavenumbers of a band. [cm-1]"""
    first, step, response = RESPONSES[band]
    longest = first + step * (len(response) - 0.5)
    return np.arange(1e4 / longest, 1e4 / (first - step / 2), STEP)


def response_of(band: str, grid: np.ndarray) -> np.ndarray:
    """Response of a band at wavenumbers, 0 beyond its cells. [-]"""
    first, step, response = RESPONSES[band]
    cells = first + step * np.arange(len(response))
    return np.interp(1e4 / grid, cells, response, left=0, right=0)


def planck(grid: np.ndarray, temperature: float) -> np.ndarray:
    """Radiance of a black body per wavenumber. [W m-2 sr-1 (cm-1)-1]"""
    return 1.191043e-8 * grid**3 / np.expm1(1.438777 * grid / temperature)


def weights(band: str, grid: np.ndarray, temperature: float | None) -> np.ndarray:
    """Share of each wavenumber in what a band receives from a black body, or from even light.

    The sun's light in C07 and C06 is that of a black body of 5778 K within what matters here.
    """
    emitted = np.ones_like(grid) if temperature is None else planck(grid, temperature)
    share = response_of(band, grid) * emitted
    return share / share.sum()


def spectrum(folder: Path, name: str, band: str, height: np.ndarray = HEIGHT) -> Spectrum:
    """Depths in a standard atmosphere of the gases of which the folder has lines in the band.

    By gas: ``"H2O"`` for lines but those of ``"HDO"``, ``"self"`` and ``"foreign"`` for the
    continuum of vapour, and those of `MIXED`.
    """
    grid = grid_of(band)
    lists = read_lines(folder, grid[0] - 26, grid[-1] + 26)
    if band == "C07" and not any(x.isotopologue == (1, 4) for x in lists):
        lists.append(hdo_lines())
    continuum = Continuum(folder, grid)
    column = standard_atmosphere(name, height)
    assert column.temperature is not None and column.gases is not None
    pressure, temperature = np.asarray(column.pressure), np.asarray(column.temperature)
    vapour = np.asarray(column.gases.vapour) / 18.015e-3 * 6.02214076e19  # [molecules cm-2]
    dry = np.diff(pressure) / 9.80665 / 28.9647e-3 * 6.02214076e19  # [molecules cm-2]
    middle = (pressure[1:] + pressure[:-1]) / 2, (temperature[1:] + temperature[:-1]) / 2
    names = ["self", "foreign", *(_gas_of(x) for x in lists)]
    depths = {gas: np.zeros((vapour.size, grid.size)) for gas in names}
    for k, (p, t) in enumerate(zip(*middle, strict=True)):
        fraction = vapour[k] / (vapour[k] + dry[k])
        own, foreign = continuum(p, t, fraction)
        depths["self"][k] = vapour[k] * own
        depths["foreign"][k] = vapour[k] * foreign
        for lines in lists:
            gas = _gas_of(lines)
            if gas in VAPOUR:
                depths[gas][k] += vapour[k] * cross_section(lines, grid, p, t, fraction)
            else:
                share = NITROUS_OXIDE_446 if gas == "N2O" else 1.0
                one = cross_section(lines, grid, p, t, MIXED[gas])
                depths[gas][k] += dry[k] * MIXED[gas] / share * one
    return Spectrum(column, grid, depths)


def _gas_of(lines: Lines) -> str:
    return "HDO" if lines.isotopologue == (1, 4) else MOLECULES[lines.isotopologue[0]]
