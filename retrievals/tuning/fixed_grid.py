r"""The grid of ABI's files: where on it a place on the ground is seen.

An ABI file counts its pixels by two angles at the satellite, x eastward and y northward. Of a place
of geodetic latitude :math:`\varphi` and longitude :math:`\lambda`, seen from a height H above the
centre of an ellipsoid with the semi-axes a and b, with the longitude :math:`\lambda_0` beneath the
satellite [1]_,

.. math::
   \tan\varphi_c &= \frac{b^2}{a^2} \tan\varphi, \qquad
   r_c = \frac{b}{\sqrt{1 - (1 - b^2 / a^2) \cos^2\varphi_c}}, \\
   s &= (H - r_c \cos\varphi_c \cos(\lambda - \lambda_0),\;
        -r_c \cos\varphi_c \sin(\lambda - \lambda_0),\; r_c \sin\varphi_c), \\
   y &= \arctan\frac{s_z}{s_x}, \qquad x = \arcsin\frac{-s_y}{|s|},

and it is in sight where :math:`H (H - s_x) \ge s_y^2 + \frac{a^2}{b^2} s_z^2`.

References
----------
.. [1] GOES-R Series Product Definition and Users' Guide, volume 3: Level 1b products, revision 2.2,
   2019, section 5.1.2.8.2
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from abi_operator.files import InputError

_NEEDED = (
    "semi_major_axis",
    "semi_minor_axis",
    "perspective_point_height",
    "longitude_of_projection_origin",
)


def scan_angles(
    latitude: np.ndarray, longitude: np.ndarray, projection: Mapping[str, Any]
) -> tuple[np.ndarray, np.ndarray]:
    """Angles x and y at the satellite, NaN where a place is out of its sight. [rad]

    Parameters
    ----------
    latitude, longitude
        Geodetic, of places on the ellipsoid. [degree]
    projection
        Attributes of ``goes_imager_projection``.

    Raises
    ------
    InputError
        Where one of them is missing, or the angles are those of another scan than ABI's.
    """
    missing = [name for name in _NEEDED if name not in projection]
    if missing:
        raise InputError(f"goes_imager_projection has no {', '.join(missing)}; give an ABI file.")
    sweep = str(projection.get("sweep_angle_axis", "x"))
    if sweep != "x":
        raise InputError(f"the sweep_angle_axis of ABI is x; got {sweep!r}.")
    try:
        a, b, above, origin = (float(np.squeeze(projection[name])) for name in _NEEDED)
    except (TypeError, ValueError) as error:
        raise InputError(f"goes_imager_projection is not of numbers ({error}).") from error
    if not (0 < b <= a < np.inf and 0 < above < np.inf and np.isfinite(origin)):
        raise InputError(
            f"goes_imager_projection is of an earth {a:g} and {b:g} m wide, seen from {above:g} m "
            f"above {origin:g} degrees; give an ABI file."
        )
    distance, apart = above + a, np.radians(longitude - origin)
    geocentric = np.arctan((b / a) ** 2 * np.tan(np.radians(latitude)))
    radius = b / np.sqrt(1 - (1 - (b / a) ** 2) * np.cos(geocentric) ** 2)
    towards = distance - radius * np.cos(geocentric) * np.cos(apart)
    across = -radius * np.cos(geocentric) * np.sin(apart)
    up = radius * np.sin(geocentric)
    in_sight = distance * (distance - towards) >= across**2 + (a / b * up) ** 2
    x = np.arcsin(-across / np.sqrt(towards**2 + across**2 + up**2))
    y = np.arctan2(up, towards)
    return np.where(in_sight, x, np.nan), np.where(in_sight, y, np.nan)


def nearest_on_axis(axis: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Index of the pixel of an evenly spaced axis that holds an angle, -1 where none does.

    Beside it how far the angle is from the pixel's centre. [rad]

    Parameters
    ----------
    axis
        Angles of the pixels' centres, rising or falling. [rad]
    wanted
        Angles, NaN for none. [rad]
    """
    if axis.ndim != 1 or axis.size < 2:
        raise InputError(f"an axis of scan angles has two pixels or more; got {axis.shape}.")
    step = (axis[-1] - axis[0]) / (axis.size - 1)
    if step == 0 or not np.allclose(np.diff(axis), step, rtol=1e-2, atol=0):
        raise InputError("the scan angles are not evenly spaced; give the file as it was written.")
    position = np.rint((wanted - axis[0]) / step)
    inside = (position >= 0) & (position < axis.size)
    apart = np.abs(wanted - (axis[0] + position * step))
    return np.where(inside, np.where(inside, position, 0), -1).astype(int), apart
