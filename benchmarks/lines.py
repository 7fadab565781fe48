"""Absorption by spectral lines: HITRAN records, Voigt profiles, the continuum of water vapour.

Cross-sections on a grid of wavenumbers, line by line. Lines reach 25 cm-1 to either side; those of
water vapour are lowered there to begin from 0, because MT_CKD counts what is under them, and what
is beyond, as continuum [3]_. Lines are shifted by pressure and broadened by air and by the gas
itself. Data are read from a folder of one's own:

- records of 160 characters as from hitran.org [1]_, in files that end in ``.par`` or ``.par.gz``;
- ``absco-ref_wv-mt-ckd.nc``, the coefficients of MT_CKD 4.3, as from github.com/AER-RC/MT_CKD.

Partition sums are straight in the logarithms of sum and temperature between the values of TIPS-2011
[2]_ every 25 K, which misses those between by 2e-4 or less.

Used by `lines_of_air.py`.

References
----------
.. [1] I. E. Gordon et al., "The HITRAN2020 molecular spectroscopic database", J. Quant. Spectrosc.
   Radiat. Transf., 277, 107949, 2022, doi:10.1016/j.jqsrt.2021.107949
.. [2] A. L. Laraia, R. R. Gamache, J. Lamouroux, I. E. Gordon and L. S. Rothman, "Total internal
   partition sums to support planetary remote sensing", Icarus, 215, 391-400, 2011,
   doi:10.1016/j.icarus.2011.06.004
.. [3] E. J. Mlawer et al., "Development and recent evaluation of the MT_CKD model of continuum
   absorption", Phil. Trans. R. Soc. A, 370, 2520-2556, 2012, doi:10.1098/rsta.2011.0295
"""

import gzip
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline
from scipy.special import wofz

REACH = 25.0  # of a line to either side [cm-1]
STEP = 0.002  # of the grid [cm-1]; Doppler widths are 0.003 and more
# Within this distance a line is a Voigt profile on the grid; its wings beyond, and a parabola that
# goes on from them inwards, are smooth and are summed up on a grid of `COARSE`. [cm-1]
CORE, COARSE = 1.0, 0.05
SECOND_RADIATION_CONSTANT = 1.438777  # hc / k [cm K]
ATM = 101325.0  # [Pa]

MOLECULES = {1: "H2O", 2: "CO2", 4: "N2O", 6: "CH4"}
_TEMPERATURES = 160.0 + 25.0 * np.arange(8)
# Partition sums at these temperatures by molecule and isotopologue [2].
# fmt: off
_SUMS = {
    (1, 1): (70.054, 86.817, 104.75, 123.8, 143.91, 165.03, 187.14, 210.21),
    (1, 4): (339.42, 422.59, 511.61, 606.19, 706.09, 811.17, 921.32, 1036.5),
    (4, 1): (2420.5, 2828.9, 3260.9, 3722.2, 4218.0, 4752.9, 5331.2, 5957.2),
}
# fmt: on
# [g mol-1]
_MASSES = {(1, 1): 18.010565, (1, 4): 19.016740, (4, 1): 44.001062}


class Lines(NamedTuple):
    """Lines of one isotopologue, one number of each a line, at 296 K. (HITRAN's units)"""

    isotopologue: tuple[int, int]
    position: np.ndarray  # [cm-1]
    intensity: np.ndarray  # natural abundance counted [cm-1 / (molecule cm-2)]
    air_width: np.ndarray  # [cm-1 atm-1]
    self_width: np.ndarray  # [cm-1 atm-1]
    lower_energy: np.ndarray  # [cm-1]
    exponent: np.ndarray  # [-]
    shift: np.ndarray  # [cm-1 atm-1]


def read_lines(folder: Path, first: float, last: float) -> list[Lines]:
    """Lines between two wavenumbers, by isotopologue; a line that stands in two files counts once.

    Raises `ValueError` where a record is not of 160 characters, or of an isotopologue of which the
    partition sum is not known here.
    """
    found: dict[tuple[int, int], set[tuple[float, ...]]] = {}
    for path in sorted([*folder.glob("*.par"), *folder.glob("*.par.gz")]):
        opened = gzip.open(path, "rt") if path.suffix == ".gz" else open(path)
        with opened as file:
            for text in file:
                record = text.rstrip("\r\n")
                if not record.strip():
                    continue
                if len(record) != 160:
                    raise ValueError(
                        f"{path.name}: a record has {len(record)} characters, not 160."
                    )
                if not first <= float(record[3:15]) <= last:
                    continue
                kind = int(record[:2]), int(record[2])
                if kind not in _SUMS:
                    raise ValueError(f"{path.name}: no partition sum of {kind}; of {list(_SUMS)}.")
                cuts = (3, 15), (15, 25), (35, 40), (40, 45), (45, 55), (55, 59), (59, 67)
                found.setdefault(kind, set()).add(tuple(float(record[a:b]) for a, b in cuts))
    return [Lines(kind, *np.array(sorted(rows)).T) for kind, rows in found.items()]


def cross_section(
    lines: Lines, grid: np.ndarray, pressure: float, temperature: float, fraction: float
) -> np.ndarray:
    """Cross-section on an even grid. [cm2 per molecule of the gas, all its isotopologues]

    At a pressure [Pa], a temperature [K] and a mole fraction of the gas itself [-].
    """
    atmospheres = pressure / ATM
    position = lines.position + lines.shift * atmospheres
    intensity = lines.intensity * _warmer(lines, temperature)
    air, own = lines.air_width * (1 - fraction), lines.self_width * fraction
    lorentz = atmospheres * (air + own) * (296 / temperature) ** lines.exponent
    # 1/e half-width: position sqrt(2 k T / m) / c.
    doppler = position * 4.301413e-7 * np.sqrt(temperature / _MASSES[lines.isotopologue])
    level = intensity * lorentz / np.pi / (REACH**2 + lorentz**2)
    if lines.isotopologue[0] != 1:
        level = np.zeros_like(level)
    total = _wings(position, intensity, lorentz, level, grid)
    step = grid[1] - grid[0]
    first = np.searchsorted(grid, position - CORE)
    last = np.searchsorted(grid, position + CORE)
    for i in np.flatnonzero(last > first):
        x = grid[0] + step * np.arange(first[i], last[i]) - position[i]
        z = (x + 1j * lorentz[i]) / doppler[i]
        voigt = wofz(z).real * (intensity[i] / (doppler[i] * np.sqrt(np.pi)))
        total[first[i] : last[i]] += voigt - _parabola(x, intensity[i], lorentz[i])
    return np.maximum(total, 0.0)


def _warmer(lines: Lines, temperature: float) -> np.ndarray:
    """Intensity at a temperature relative to that at 296 K."""

    def logarithm_of_sum(t: float) -> float:
        known = np.log(_SUMS[lines.isotopologue])
        return float(np.interp(np.log(t), np.log(_TEMPERATURES), known))

    c2 = SECOND_RADIATION_CONSTANT
    population = c2 * lines.lower_energy * (1 / 296 - 1 / temperature)
    stimulated = np.expm1(-c2 * lines.position / temperature) / np.expm1(-c2 * lines.position / 296)
    return np.exp(logarithm_of_sum(296.0) - logarithm_of_sum(temperature) + population) * stimulated


def _parabola(x: np.ndarray, intensity: float, lorentz: float) -> np.ndarray:
    """What goes on inwards from the wings of a Lorentz profile at `CORE`, with its slope."""
    edge = CORE**2 + lorentz**2
    wing = intensity * lorentz / np.pi / edge
    return wing * (1 + (CORE**2 - x**2) / edge)


def _wings(
    position: np.ndarray,
    intensity: np.ndarray,
    lorentz: np.ndarray,
    level: np.ndarray,
    grid: np.ndarray,
) -> np.ndarray:
    """All lines but for their cores, lowered by `level` within their reach."""
    coarse = np.arange(grid[0] - 3 * COARSE, grid[-1] + 4 * COARSE, COARSE)
    total = np.zeros_like(coarse)
    for i in range(position.size):
        a, b = np.searchsorted(coarse, (position[i] - REACH, position[i] + REACH))
        if b > a:
            x2 = (coarse[a:b] - position[i]) ** 2
            wing = intensity[i] * lorentz[i] / np.pi / (np.maximum(x2, CORE**2) + lorentz[i] ** 2)
            edge = CORE**2 + lorentz[i] ** 2
            inner = 1 + np.maximum(CORE**2 - x2, 0.0) / edge
            total[a:b] += wing * inner - level[i]
    return CubicSpline(coarse, total)(grid)


class Continuum:
    """Self and foreign continuum of water vapour by MT_CKD [3]_."""

    def __init__(self, folder: Path, grid: np.ndarray) -> None:
        with xr.open_dataset(folder / "absco-ref_wv-mt-ckd.nc") as data:
            known = data.wavenumbers.values
            chosen = (known > grid[0] - 50) & (known < grid[-1] + 50)

            def on_grid(name: str) -> np.ndarray:
                return CubicSpline(known[chosen], data[name].values[chosen])(grid)

            self._foreign = on_grid("for_absco_ref")
            self._own = on_grid("self_absco_ref")
            self._exponent = on_grid("self_texp")
            self._reference = 100 * float(data.ref_press), float(data.ref_temp)
        self._grid = grid

    def __call__(
        self, pressure: float, temperature: float, fraction: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Cross-sections, self and foreign. [cm2 per molecule]"""
        p0, t0 = self._reference
        density = pressure / p0 * (t0 / temperature)
        x = SECOND_RADIATION_CONSTANT * self._grid / temperature
        field = self._grid * np.tanh(x / 2)
        own = self._own * (t0 / temperature) ** self._exponent
        return own * fraction * density * field, self._foreign * (1 - fraction) * density * field
