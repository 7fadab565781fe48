"""Coefficients of the in-band Planck radiance, and their errors, from spectral responses.

    python benchmarks/fit_planck.py responses.csv

The file has the columns satellite, band (1, 2, ...), wavelength_um, srf, the mean response over
cells of equal width that cover the band (NOAA CWG's release averaged over 45 to 90 cells); lines
that begin with # are skipped. For each response the band's radiance is integrated from 250 to 1500
K and the form that `abi_operator.planck` evaluates is fitted: for a trial wavenumber fk1 and fk2
are Planck's own, bc1 and bc2 are those of least squares in the logarithm of radiance, and the trial
with the smallest largest error is printed. The last column is the error of the coefficients that
`abi_operator.satellites` holds.
"""

import csv
import sys

import numpy as np

from abi_operator.satellites import SATELLITES, planck_coefficients

PLANCK, LIGHT, BOLTZMANN = 6.62607015e-34, 299792458.0, 1.380649e-23  # SI (exact, 2019)
TEMPERATURES = np.arange(250.0, 1501.0, 5.0)
TRIALS = 1 + np.linspace(-1e-3, 1e-3, 401)  # of the wavenumber, relative to the centroid
POINTS = 20  # at which a cell is sampled


def read_responses(path: str) -> dict[tuple[str, str], np.ndarray]:
    """Wavelength [um] and response of each satellite and band."""
    with open(path) as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    responses: dict[tuple[str, str], list] = {}
    for row in rows:
        key = row["satellite"], f"C{int(row['band']):02d}"
        responses.setdefault(key, []).append((float(row["wavelength_um"]), float(row["srf"])))
    return {key: np.array(value) for key, value in responses.items()}


def sampled(response: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths inside the cells and weights that sum to 1."""
    centres, srf = response.T
    width = (centres[-1] - centres[0]) / (len(centres) - 1)
    inside = (np.arange(POINTS) + 0.5) / POINTS - 0.5
    wavelengths = (centres[:, None] + width * inside).ravel()
    weights = np.repeat(srf, POINTS)
    return wavelengths, weights / weights.sum()


def integrated(response: np.ndarray, temperatures: np.ndarray) -> np.ndarray:
    """Mean of Planck's radiance over the response. [W m-2 sr-1 um-1]"""
    wavelengths, weights = sampled(response)
    metres = 1e-6 * wavelengths
    x = PLANCK * LIGHT / (metres * BOLTZMANN * temperatures[:, None])
    return 1e-6 * (2 * PLANCK * LIGHT**2 / metres**5 / np.expm1(x)) @ weights


def form(temperature, fk1, fk2, bc1, bc2, factor):
    """The fitted form, in the unit of `integrated`."""
    return factor * fk1 / np.expm1(fk2 / (bc1 + bc2 * temperature))


def fit(response: np.ndarray) -> tuple[float, ...]:
    """fk1 [mW m-2 sr-1 (cm-1)-1], fk2 [K], bc1 [K], bc2 and the factor between the two units."""
    wavelengths, weights = sampled(response)
    factor = 10 * weights @ wavelengths**-2.0  # a response of width dl has width 1e4 dl / l^2 cm-1
    centroid = 1e6 * (weights @ wavelengths**-3.0) / (weights @ wavelengths**-2.0)  # [m-1]
    radiance = integrated(response, TEMPERATURES)
    candidates = []
    for wavenumber in centroid * TRIALS:
        fk1 = 1e5 * 2 * PLANCK * LIGHT**2 * wavenumber**3
        fk2 = PLANCK * LIGHT * wavenumber / BOLTZMANN
        effective = fk2 / np.log1p(factor * fk1 / radiance)
        sensitivity = fk2 / TEMPERATURES**2  # d ln(radiance) / d(effective temperature)
        columns = np.stack([np.ones_like(TEMPERATURES), TEMPERATURES], axis=1)
        bc1, bc2 = np.linalg.lstsq(
            sensitivity[:, None] * columns, sensitivity * effective, rcond=None
        )[0]
        coefficients = fk1, fk2, bc1, bc2, factor
        candidates.append((largest_error(response, coefficients), coefficients))
    return min(candidates)[1]


def largest_error(response: np.ndarray, coefficients) -> float:
    """Largest relative error of radiance over the temperatures. [-]"""
    radiance = integrated(response, TEMPERATURES)
    return float(np.abs(form(TEMPERATURES, *coefficients) / radiance - 1).max())


def main() -> None:
    print("satellite band  fk1           fk2          bc1       bc2        factor     error  held")
    for (satellite, band), response in read_responses(sys.argv[1]).items():
        if satellite not in SATELLITES or band not in ("C05", "C06", "C07"):
            continue
        best = fit(response)
        error = largest_error(response, best)
        held = largest_error(response, planck_coefficients(band, satellite))
        print(
            f"{satellite}   {band}  {best[0]:<12.3f}  {best[1]:.4f}  {best[2]:.6f}  {best[3]:.7f}"
            f"  {best[4]:.6f}  {error:.1e}  {held:.1e}"
        )


if __name__ == "__main__":
    main()
