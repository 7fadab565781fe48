"""Transmittances of standard atmospheres line by line, beside those of the operator's sums.

    python benchmarks/lines_transmittance.py FOLDER

FOLDER holds HITRAN records as from hitran.org and the file of MT_CKD (`lines.py` says which). For
the bands of which there are lines of vapour, C06 and C07, prints by profile and air mass of the
whole path, 1 to 6, the transmittance of each gas line by line and by the sum, and the largest
difference. In C07 vapour is given without HDO, too, and with a fifth more of it. Averages are over
the response of GOES-16, in C07 times the emission of 300 K, in C06 times sunlight. Some minutes.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from lines_of_air import MIXED, PROFILES, VAPOUR, Spectrum, spectrum, weights

from abi_operator.bands import BANDS
from abi_operator.optics.gas import gas_absorption, transmittance

AIR_MASSES = (1, 2, 3, 4, 5, 6)
SOURCES = {"C06": 5778.0, "C07": 300.0}  # of the light that is weighed [K]
UNCERTAIN = 1.2  # how much more HDO there might be


def by_lines(found: Spectrum, band: str, gases: Sequence[str], more_hdo: float = 1.0) -> np.ndarray:
    """Transmittance of some gases from the ground to space by air mass."""
    share = weights(band, found.grid, SOURCES[band])
    depth = sum(
        (more_hdo if gas == "HDO" else 1.0) * found.above(0.0, (gas,))
        for gas in gases
        if gas in found.depths
    )
    return np.array([share @ np.exp(-m * depth) for m in AIR_MASSES])


def by_sum(found: Spectrum, band: str, gas: str) -> np.ndarray:
    """The same by the operator's sum."""
    optics = gas_absorption(found.column, BANDS[band], (gas,))
    return np.asarray(transmittance(optics, jnp.asarray(AIR_MASSES, float)))


def row(*cells: str | np.ndarray) -> None:
    """One row of a table."""
    written = []
    for cell in cells:
        written += [cell] if isinstance(cell, str) else [f"{x:.4f}" for x in cell]
    print("| " + " | ".join(written) + " |")


def report(folder: Path, band: str) -> None:
    """One band in all profiles."""
    print(f"\n{band}, transmittance by air mass:\n")
    row("profile", "gas", *(str(m) for m in AIR_MASSES))
    row(*["---"] * (2 + len(AIR_MASSES)))
    largest: dict[str, float] = {}
    for name in PROFILES:
        found = spectrum(folder, name, band)
        groups = {"H2O": VAPOUR} | {gas: (gas,) for gas in MIXED if gas in found.depths}
        for gas, parts in groups.items():
            exact, fitted = by_lines(found, band, parts), by_sum(found, band, gas)
            row(name, f"{gas}, lines", exact)
            row("", f"{gas}, sum", fitted)
            apart = np.abs(fitted - exact).max()
            largest[gas] = float(np.maximum(largest.get(gas, 0.0), apart))
        if "HDO" in found.depths:
            light = [gas for gas in VAPOUR if gas != "HDO"]
            row("", "H2O without HDO", by_lines(found, band, light))
            row("", f"H2O, {UNCERTAIN} HDO", by_lines(found, band, VAPOUR, UNCERTAIN))
    print("\nlargest difference: " + ", ".join(f"{g} {x:.4f}" for g, x in largest.items()))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    jax.config.update("jax_enable_x64", True)
    chosen = parser.parse_args()
    for each in SOURCES:
        report(chosen.folder, each)
