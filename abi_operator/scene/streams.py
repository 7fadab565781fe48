"""How many streams columns need for a stated error, by what is in them.

What few streams leave depends on depth, truncation, angles and albedo in no way that could be
written down. So the rule is one of kinds of columns, and its numbers are measured: the error within
which 99 of 100 columns and bands of a kind are, of columns made as those of `benchmarks/truth.py`
(`benchmarks/fit_streams.py`).
"""

import numpy as np

from ..atmosphere import Atmosphere

KINDS = ("air", "plume", "cloud")
"""Of columns: neither aerosol nor cloud; a plume or aerosol beside it, but no cloud; cloud of water
or ice, or what falls from it."""
STREAMS = (8, 10, 12, 16, 24)
"""Numbers of streams to choose from. [-]"""
ERRORS = {
    "air": (2.3e-3, 1.3e-3, 7.8e-4, 2.8e-4, 4.8e-5),
    "plume": (6.7e-3, 2.9e-3, 1.2e-3, 5.4e-4, 1.8e-4),
    "cloud": (9.5e-3, 6.5e-3, 6.1e-3, 4.9e-3, 4.1e-3),
}
"""By kind, what so many `STREAMS` leave of the error in 99 of 100 columns. [-]"""

LEAST_AOD, LEAST_PATH = 1e-3, 1e-5
"""Optical depth at 550 nm and mass [kg m-2] from which there is a plume, or cloud."""


def kinds_of(atmosphere: Atmosphere) -> np.ndarray:
    """Name of the kind of each column (column,), of `KINDS`."""
    count = len(np.asarray(atmosphere.pressure))
    path, aod = np.zeros(count), np.zeros(count)
    for matter in (atmosphere.liquid, *atmosphere.hydrometeors.values()):
        path += np.sum(np.asarray(matter.mass_path), axis=-1)
    everywhere = () if atmosphere.background is None else (atmosphere.background,)
    for aerosol in (*atmosphere.plumes.values(), *everywhere):
        aod += np.asarray(aerosol.aod_550)
    kinds = np.where(aod >= LEAST_AOD, "plume", "air")
    return np.where(path >= LEAST_PATH, "cloud", kinds)


def streams_of(atmosphere: Atmosphere, num_streams: float) -> np.ndarray:
    """Streams of each column (column,).

    Parameters
    ----------
    atmosphere
        Of the columns.
    num_streams
        So many for all columns; or, below 1, the relative error that they may leave in 99 of 100.
    """
    if num_streams >= 1:
        return np.full(len(np.asarray(atmosphere.pressure)), int(num_streams))
    needed = {kind: _needed(kind, num_streams) for kind in KINDS}
    return np.vectorize(needed.__getitem__, otypes=[int])(kinds_of(atmosphere))


def most_streams(num_streams: float) -> int:
    """Streams of the kind of column that needs the most of them.

    Raises
    ------
    ValueError
        Where more would be needed than any of `STREAMS`.
    """
    if num_streams >= 1:
        return int(num_streams)
    return max(_needed(kind, num_streams) for kind in KINDS)


def _needed(kind: str, error: float) -> int:
    for streams, left in zip(STREAMS, ERRORS[kind], strict=True):
        if left <= error:
            return streams
    least = max(errors[-1] for errors in ERRORS.values())
    raise ValueError(
        f"{STREAMS[-1]} streams leave an error of {least:g}, and got {error:g}; ask for that or "
        "more, or for a number of streams."
    )
