"""Air over a plume or a cloud over air: the five columns of `benchmarks/accuracy.py`.

CDISORT at 48 streams, which differs from 128 streams by 1e-6 at most, is their reference.
"""

from functools import cache

import numpy as np
from cdisort import cdisort_brf

REFERENCE_STREAMS = 48
NUM_MOMENTS = 257

MU = np.array([*np.repeat([0.2, 0.4, 0.6, 0.8], 4), 1.0])
AZIMUTH = np.array([*np.tile(np.radians([0.0, 60.0, 120.0, 180.0]), 4), 0.0])

# Optical depth of the air above, within and below the plume; the plume's tau, ssa and asymmetry;
# albedo of the ground; cosine of the sun's zenith angle.
COLUMNS = {
    "air": ((0.137, 0.039, 0.024), 0, 1, 0, 0.1, 0.6),
    "smoke": ((0.137, 0.039, 0.024), 1, 0.9, 0.6, 0.05, 0.7),
    "ash": ((0.025, 0.012, 0.063), 2, 0.9, 0.7, 0.1, 0.5),
    "cloud": ((0.078, 0.010, 0.012), 30, 0.9999, 0.86, 0.05, 0.6),
    "deep cloud": ((0.029, 0.059, 0.012), 100, 1 - 1e-7, 0.85, 0.5, 0.8),
}


@cache
def columns():
    """tau, ssa, moments, albedo and mu0 of `COLUMNS`."""
    air, tau, ssa, g, albedo, mu0 = (
        np.array(x, float) for x in zip(*COLUMNS.values(), strict=True)
    )
    plume = tau[:, None] * np.array([0, 1, 0])
    scattered = air + ssa[:, None] * plume
    share = (air / scattered)[..., None]
    rayleigh = np.zeros(NUM_MOMENTS)
    rayleigh[[0, 2]] = 1, 0.1
    moments = share * rayleigh + (1 - share) * (g[:, None] ** np.arange(NUM_MOMENTS))[:, None]
    return air + plume, scattered / (air + plume), moments, albedo, mu0


def with_series(num_moments):
    """The same with so many moments."""
    tau, ssa, moments, *others = columns()
    return tau, ssa, moments[..., :num_moments], *others


def delta_m_alone(num_streams):
    """Scaled layers, which so many streams resolve: nothing is left to correct."""
    tau, ssa, moments, *others = columns()
    forward = moments[..., num_streams]
    left = 1 - ssa * forward
    scaled = (moments[..., :num_streams] - forward[..., None]) / (1 - forward[..., None])
    return left * tau, (1 - forward) * ssa / left, scaled, *others


@cache
def reference():
    """brf (column, view)."""
    return np.array(
        [
            [
                cdisort_brf(*column, mu, azimuth, REFERENCE_STREAMS, True)
                for mu, azimuth in zip(MU, AZIMUTH, strict=True)
            ]
            for column in zip(*columns(), strict=True)
        ]
    )


def largest_error(values):
    """Of each column, relative."""
    return np.max(np.abs(values / reference() - 1), axis=-1)
