"""The bands of the Advanced Baseline Imager that the operator simulates.

A band is named by the string that ABI files use, ``"C01"``. Inputs that differ from band to band
(surface albedo, single-scattering albedo of a plume) are dictionaries with these names as keys, so
that a state holds just the bands it was specified for and a Jacobian says by name which is which.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple


class Band(NamedTuple):
    """One band: its name in ABI files and the centroid of its response. [um]

    Centroids are those of GOES-16's spectral response [1]_; those of GOES-17 to -19 differ by 1.4
    nm or less, but by 6 nm in C04 and by 14 nm in C07.

    References
    ----------
    .. [1] NOAA GOES-R Calibration Working Group, ABI spectral response functions (PFM), 2016.
    """

    name: str
    wavelength_um: float


# "green" is the band that the imager lacks, monochromatic light of 0.555 um.
BANDS: dict[str, Band] = {
    band.name: band
    for band in (
        Band("C01", 0.4711),
        Band("green", 0.555),
        Band("C02", 0.6396),
        Band("C03", 0.8644),
        Band("C04", 1.3732),
        Band("C05", 1.6095),
        Band("C06", 2.2427),
        Band("C07", 3.8934),
    )
}

GRASSO2013 = ("C01", "C02", "C03", "C06")
"""The reflective bands of Grasso et al. (2013): those simulated where nothing else is asked for."""


def check_bands(bands: Sequence[str], known: Collection[str] = BANDS) -> tuple[str, ...]:
    """Return `bands` as a tuple, or raise `ValueError` naming the ones that are not `known`."""
    unknown = [name for name in bands if name not in known]
    if unknown or not bands:
        raise ValueError(f"bands {unknown or '()'} are not simulated; choose from {list(known)}.")
    if len(set(bands)) != len(bands):
        raise ValueError(f"each band can be asked for once; got {tuple(bands)}.")
    return tuple(bands)
