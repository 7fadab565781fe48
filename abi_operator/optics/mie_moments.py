r"""Legendre moments of tabulated phase functions, beyond those that a table has.

Solvers of more than 64 streams read more moments than the 65 of the tables. They are

.. math:: \chi_l = \frac12 \int_{-1}^1 P\, P_l\, d\cos\Theta

of the table's P, by Gauss points between its angles; the 65 come out right to 1e-5 by the same
way, at the table's radii. NumPy in float64, once for each table.
"""

import numpy as np
import scipy
from jaxtyping import Float

from .mie_table import BandTable
from .radius_cubics import padded

# Between two angles of a table lie half a degree near forward and backward scattering and 2 degrees
# at most: so many points follow P_l to degrees of 1000 and more.
_POINTS = 16
_PADDING = 2  # rows before and after a table's radii


def moments_of(table: BandTable, num_moments: int) -> Float[np.ndarray, "row moment"]:
    """Moments of a band's table, `padded`, as many as are asked for.

    Parameters
    ----------
    table
        Table of one material in one band.
    num_moments
        How many, the first is 1.
    """
    held = table.moments.shape[1]
    if num_moments <= held:
        return table.moments[:, :num_moments]
    return np.concatenate([table.moments, _further(table, held, num_moments)], axis=1)


def _further(table: BandTable, first: int, end: int) -> Float[np.ndarray, "row moment"]:
    nodes, (backward, forward) = table.coordinate, table.offsets
    x, weight = np.polynomial.legendre.leggauss(_POINTS)
    width = np.diff(nodes)[:, None]
    u = nodes[:-1, None] + width * (x + 1) / 2
    rising = np.exp(u)
    cosine = ((1 + forward) * rising - (1 + backward)) / (1 + rising)
    measure = (2 + forward + backward) * rising / (1 + rising) ** 2 * weight * width / 4
    # As `mie_phase` reads it: cubics in u, by values and slopes at the angles.
    log_phase, slope = table.log_phase[:, 0, :], table.log_phase[:, 1, :]
    between = scipy.interpolate.CubicHermiteSpline(nodes, log_phase, slope)
    weighted = np.exp(between(u.ravel())[:, _PADDING:-_PADDING]) * measure.ravel()[:, None]
    cosine = cosine.ravel()
    found = np.empty((end, weighted.shape[1]))
    before, here = np.zeros_like(cosine), np.ones_like(cosine)
    for degree in range(end):
        found[degree] = here @ weighted
        following = ((2 * degree + 1) * cosine * here - degree * before) / (degree + 1)
        before, here = here, following
    # P is 1 on the average to 2e-4 only; a moment is relative to it.
    return padded((found[first:] / found[0]).T)
