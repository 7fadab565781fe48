"""Where the sun and the satellite stand, seen from a column."""

import math
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

HORIZON = math.pi / 2
"""Zenith angle of the horizon, which counts as below it. [rad]"""


def is_up(zenith: Any) -> Any:
    """Whether what stands at a zenith angle is above the horizon; false of what is no number.

    By the angle and not by its cosine, which of the double nearest to pi/2 is 6e-17 and not 0.

    Parameters
    ----------
    zenith
        Angles from the local vertical, of NumPy or JAX, ``*batch``. [rad]
    """
    return zenith < HORIZON


def _cosine(zenith: Array) -> Array:
    """Above 0 where and only where it is up."""
    cosine = jnp.cos(zenith)
    return jnp.where(is_up(zenith), cosine, jnp.minimum(cosine, 0))


class Geometry(eqx.Module):
    """Directions of the sun and of the satellite at the ground point of one column.

    Angles and not their cosines are the state: near the vertical slopes by an angle are finite,
    while those by its cosine grow without end. At a zenith angle of exactly 0 itself the slope by
    it is given as 0. It is not 0 along an azimuth, but the azimuth says nothing there, and the mean
    over all azimuths is 0. So it is as long as the cosine rounds to 1, up to 1e-8 rad in float64
    and 2e-4 rad in float32, and rounding can be felt to some ten times that.

    Parameters
    ----------
    solar_zenith, view_zenith
        Angles from the local vertical, 0 to below pi/2. [rad]
    relative_azimuth
        Azimuth of the satellite minus azimuth of the sun, both seen from the ground: 0 with sun
        and satellite on the same side (backscatter), pi where a mirror would glint. [rad]
    spherical
        Whether a low sun shines through the layers of a sphere (`sun_secant`): flat up to 65
        degrees from the zenith, spherical from 70 on, and smooth in between.
    """

    solar_zenith: Float[Array, "*batch"]
    view_zenith: Float[Array, "*batch"]
    relative_azimuth: Float[Array, "*batch"]
    spherical: bool = eqx.field(default=False, static=True)

    @property
    def mu0(self) -> Float[Array, "*batch"]:
        """Cosine of the solar zenith angle, above 0 where the sun `is_up`. [-]"""
        return _cosine(self.solar_zenith)

    @property
    def mu(self) -> Float[Array, "*batch"]:
        """Cosine of the view zenith angle, above 0 where the satellite `is_up`. [-]"""
        return _cosine(self.view_zenith)
