"""Random fields that look like nature: sums of waves with long ones strong and short ones weak."""

from typing import NamedTuple

import numpy as np


class Noise(NamedTuple):
    """A smooth random field of the plane, mean 0 and variance 1, the same on any grid.

    Its value is ``sum(amplitude * cos(k_east * east + k_north * north + phase))``.

    Parameters
    ----------
    wavenumber
        Wave vectors, east and north. [rad m-1]
    phase, amplitude
        Of each wave. [rad], [-]
    """

    wavenumber: np.ndarray
    phase: np.ndarray
    amplitude: np.ndarray

    def __call__(self, east: np.ndarray, north: np.ndarray, resolution: float = 0.0) -> np.ndarray:
        """Evaluate the field, without the waves shorter than twice `resolution`. [m] -> [-]"""
        total = np.zeros(np.broadcast_shapes(np.shape(east), np.shape(north)))
        for (k_east, k_north), phase, amplitude in zip(*self, strict=True):
            if np.hypot(k_east, k_north) * resolution <= np.pi:
                total += amplitude * np.cos(k_east * east + k_north * north + phase)
        return total


def make_noise(
    rng: np.random.Generator,
    longest: float,
    shortest: float,
    slope: float = 1.0,
    num_waves: int = 120,
) -> Noise:
    """Draw a random field.

    Parameters
    ----------
    rng
        Where randomness comes from.
    longest, shortest
        Bounds of the wavelengths, which are spread evenly in their logarithm. [m]
    slope
        Amplitude grows as this power of the wavelength. [-]
    num_waves
        Number of waves. [-]
    """
    wavelength = longest * (shortest / longest) ** rng.uniform(size=num_waves)
    direction, phase = rng.uniform(0, 2 * np.pi, size=(2, num_waves))
    toward = np.stack([np.cos(direction), np.sin(direction)], axis=1)
    amplitude = wavelength**slope
    amplitude *= np.sqrt(2 / np.sum(amplitude**2))
    return Noise(2 * np.pi / wavelength[:, None] * toward, phase, amplitude)
