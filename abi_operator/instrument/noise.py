"""What the instrument adds of its own: random noise, and an error of its calibration."""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from .._numerics import safe_sqrt
from ..bands import BANDS
from ..planck import in_band_radiance
from .reflectance_factor import radiance_from_reflectance_factor, reflectance_factor_from_radiance

REFLECTIVE = ("C01", "C02", "C03", "C04", "C05", "C06")


def _every(value: float):
    return lambda: {band: value for band in REFLECTIVE}


class Noise(eqx.Module):
    r"""Standard deviations of the noise and of the calibration, by band.

    In C01 to C06 the variance of the reflectance factor :math:`\rho` is that of the electronics
    plus that of counting photons, :math:`\sigma^2 = a^2 + b \rho`; in C07 the noise is that of a
    brightness temperature at one scene temperature, constant in radiance.

    The defaults of a and b give the signal-to-noise ratio of 300 that is required at a reflectance
    factor of 1 [1]_ and the 57 that was measured in C02 at 0.05 [2]_, and are used for all six
    bands; the noise in C07 is the 0.1 K required at 300 K [1]_. The 3 % of the calibration is an
    assumption, a round figure to be replaced.

    Parameters
    ----------
    floor
        Noise of a dark scene, a, by band. [-]
    slope
        Variance per reflectance factor, b, by band. [-]
    temperature_deviation, scene_temperature
        Noise of C07 and the scene that it refers to. [K]
    calibration
        Standard deviation of the gain, by band: one error for all pixels. [-] Bands that are not
        listed have none specified.

    References
    ----------
    .. [1] T. J. Schmit et al., "A closer look at the ABI on the GOES-R series", Bull. Amer.
       Meteor. Soc., 98, 681-698, 2017, doi:10.1175/BAMS-D-15-00230.1
    .. [2] R. Iacovazzi and X. Wu, "GOES-16 Advanced Baseline Imager visible near-infrared channel
       low-light signal-to-noise ratio", J. Appl. Remote Sens., 14, 026502, 2020,
       doi:10.1117/1.JRS.14.026502
    """

    floor: Mapping[str, Float[Array, ""] | float] = eqx.field(default_factory=_every(4.8e-4))
    slope: Mapping[str, Float[Array, ""] | float] = eqx.field(default_factory=_every(1.09e-5))
    temperature_deviation: Float[Array, ""] | float = 0.1
    scene_temperature: Float[Array, ""] | float = 300.0
    calibration: Mapping[str, Float[Array, ""] | float] = eqx.field(default_factory=_every(0.03))


NOISE = Noise()
"""The noise of the requirements and of the measurement that `Noise` names."""


def noise_deviation(
    radiance: Float[Array, "*shape"],
    band: str,
    satellite: str = "GOES-16",
    noise: Noise = NOISE,
    sun_distance: Float[Array, ""] | float = 1.0,
) -> Float[Array, "*shape"]:
    """Standard deviation of the noise at a radiance. [W m-2 sr-1 um-1]

    Parameters
    ----------
    radiance
        Mean radiance of footprints. [W m-2 sr-1 um-1]
    band, satellite
        Names, ``"C01"`` to ``"C07"`` and ``"GOES-16"`` for example.
    noise
        Noise of each band.
    sun_distance
        Distance of the sun, which enters the reflectance factor. [AU]
    """
    if band == "C07":
        dtype = radiance.dtype
        scene = jnp.asarray(noise.scene_temperature, dtype)
        deviation = jnp.asarray(noise.temperature_deviation, dtype)
        _, sigma = jax.jvp(lambda t: in_band_radiance(t, band, satellite), (scene,), (deviation,))
        return jnp.broadcast_to(sigma, radiance.shape)
    floor = _of_band(noise.floor, "floor", band, radiance.dtype)
    slope = _of_band(noise.slope, "slope", band, radiance.dtype)
    rho = reflectance_factor_from_radiance(radiance, band, satellite, sun_distance)
    sigma = safe_sqrt(floor**2 + slope * rho)
    return radiance_from_reflectance_factor(sigma, band, satellite, sun_distance)


def add_noise(
    radiance: Float[Array, "*shape"], deviation: Float[Array, "*#shape"], key: PRNGKeyArray
) -> Float[Array, "*shape"]:
    """Radiance with Gaussian noise, independent in each pixel. [W m-2 sr-1 um-1]

    Parameters
    ----------
    radiance, deviation
        Mean radiance of footprints and the standard deviation of its noise. [W m-2 sr-1 um-1]
    key
        Key of `jax.random`; the same key draws the same noise.
    """
    return radiance + deviation * jax.random.normal(key, radiance.shape, radiance.dtype)


def calibration_gain(
    band: str, key: PRNGKeyArray, noise: Noise = NOISE, dtype: jnp.dtype | type = float
) -> Float[Array, ""]:
    """One draw of a band's gain, by which the radiance of all its pixels is multiplied. [-]

    Parameters
    ----------
    band
        Name of a band whose calibration `noise` specifies. Bands draw from one key independently.
    key
        Key of `jax.random`: one for all pixels.
    noise
        Noise, of which the calibration is read.
    dtype
        Type of the result.
    """
    deviation = _of_band(noise.calibration, "calibration", band, dtype)
    own = jax.random.fold_in(key, list(BANDS).index(band))
    return 1 + deviation * jax.random.normal(own, (), dtype)


def _of_band(values: Mapping[str, Array | float], name: str, band: str, dtype) -> Array:
    if band not in values:
        raise ValueError(f"{name} is not specified in band {band!r}, only in {sorted(values)}.")
    return jnp.asarray(values[band], dtype)
