"""The bands of the Advanced Baseline Imager that the operator simulates.

A band is named by the string that ABI files use, ``"C01"``. Inputs that differ from band to band
(surface albedo, single-scattering albedo of a plume) are dictionaries with these names as keys, so
that a state holds just the bands it was specified for and a Jacobian says by name which is which.
"""

from collections.abc import Sequence
from typing import NamedTuple


class Band(NamedTuple):
    """One band: its name in ABI files and the centroid of its response. [um]

    Centroids are those of GOES-16's spectral response [1]_ weighted by the solar spectrum; those
    of GOES-17 to -19 differ by 1.4 nm or less in the bands listed here.

    References
    ----------
    .. [1] NOAA GOES-R Calibration Working Group, ABI spectral response functions (PFM), 2016.
    """

    name: str
    wavelength_um: float


BANDS: dict[str, Band] = {
    band.name: band
    for band in (Band("C01", 0.4711), Band("C02", 0.6396), Band("C03", 0.8644), Band("C06", 2.2427))
}


def check_bands(bands: Sequence[str]) -> tuple[str, ...]:
    """Return `bands` as a tuple, or raise `ValueError` naming the ones that are not simulated."""
    unknown = [name for name in bands if name not in BANDS]
    if unknown or not bands:
        raise ValueError(f"bands {unknown or '()'} are not simulated; choose from {list(BANDS)}.")
    if len(set(bands)) != len(bands):
        raise ValueError(f"each band can be asked for once; got {tuple(bands)}.")
    return tuple(bands)
