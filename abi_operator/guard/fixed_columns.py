"""Numbers that no standard column gives: where the instrument saturates and pictures have corners.

They are no columns of air: what is seen of them is written down here, so that they need no solving.
Each stands for a part of the range that outputs tell apart,

- ``"edge of black"``: C01 and C02 just below and just above what CIMSS' contrast shows as black,
  4e-6 of reflectance to either side;
- ``"dim"`` and ``"grey"``: a colour in each of the lines of the stretch for corrected reflectance,
  which has its corners at 0.098, 0.216 and 0.392;
- ``"white"``: beyond the instrument's ceiling in every band, and beyond what any picture can show.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from .seen import Seen

# Bidirectional reflectance factor [-] of C01 to C04 and radiance [W m-2 sr-1 um-1] of those in
# which fires shine, which begin at C05.
_BANDS = ("C01", "green", "C02", "C03", "C04", "C05", "C06", "C07")
_EMITTING = ("C05", "C06", "C07")
_VALUES = {
    "edge of black": (0.0179587, 0.016, 0.0179668, 0.012, 0.0006, 0.21, 0.067, 0.29),
    "dim": (0.161, 0.093, 0.067, 0.24, 0.021, 9.7, 1.31, 0.83),
    "grey": (0.31, 0.34, 0.71, 0.57, 0.43, 37.0, 7.9, 6.1),
    "white": (1.61, 1.67, 4.43, 1.72, 1.81, 157.0, 61.0, 33.0),
}
# Solar zenith, view zenith and relative azimuth. [rad]
_ANGLES = {
    "edge of black": (0.45, 0.95, 2.3),
    "dim": (1.05, 0.25, 0.8),
    "grey": (0.75, 0.65, 1.7),
    "white": (0.35, 0.55, 3.0),
}

FIXED = tuple(_VALUES)
"""Their names."""


def fixed_columns(bands: Sequence[str]) -> Seen:
    """What is seen of them in these bands, of `BANDS`."""
    places = {band: _BANDS.index(band) for band in bands}
    numbers = np.array([_VALUES[name] for name in FIXED])
    return Seen(
        {band: jnp.asarray(numbers[:, place]) for band, place in places.items()},
        {band: np.full(len(FIXED), band not in _EMITTING) for band in bands},
        *np.array([_ANGLES[name] for name in FIXED]).T,
    )
