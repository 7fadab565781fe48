"""One band, from the radiance of cells to what is reported of the pixels."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from ..bands import check_bands
from ..planck import brightness_temperature
from ..satellites import check_satellite
from .ceiling import hard_ceiling, range_ceiling, smooth_ceiling
from .footprint import footprint_mean
from .noise import NOISE, Noise, add_noise, calibration_gain, noise_deviation
from .quantisation import quantise
from .reflectance_factor import reflectance_factor_from_radiance


class Imager(eqx.Module):
    """Settings of the instrument.

    Parameters
    ----------
    satellite
        ``"GOES-16"`` to ``"GOES-19"``.
    noise
        Noise and calibration error of each band; drawn only where `observe` is given keys.
    fire_saturation_temperature
        Brightness temperature at which C07 saturates; None, the default, for the end of the L1b
        files' range (411.9 K), 400 K for that of Grasso et al. (2013). Counts end with the range
        whatever it is. [K]
    ceiling_width
        Relative width of a smooth ceiling; None, the default, for a hard one. [-]
    quantised
        Whether radiance is rounded to the counts of L1b files.

    Raises
    ------
    ValueError
        If the satellite is unknown, or a temperature that can be read is not above 0.
    """

    satellite: str = eqx.field(static=True, default="GOES-16")
    noise: Noise = NOISE
    fire_saturation_temperature: Float[Array, ""] | float | None = None
    ceiling_width: Float[Array, ""] | float | None = None
    quantised: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        check_satellite(self.satellite)
        hottest = self.fire_saturation_temperature
        if isinstance(hottest, float | int | np.ndarray | np.floating) and not hottest > 0:
            raise ValueError(f"fire_saturation_temperature is {hottest}; allowed is above 0 K.")


class Observation(eqx.Module):
    """What the imager reports of footprints in one band.

    Parameters
    ----------
    radiance
        Radiance after all steps. [W m-2 sr-1 um-1]
    reflectance_factor
        Its reflectance factor in C01 to C06 and green, None in C07. [-]
    brightness_temperature
        Its brightness temperature in C07, None elsewhere. [K]
    saturated
        Whether the radiance reached the ceiling before the ceiling was applied.
    """

    radiance: Float[Array, "*shape"]
    reflectance_factor: Float[Array, "*shape"] | None
    brightness_temperature: Float[Array, "*shape"] | None
    saturated: Bool[Array, "*shape"]


IMAGER = Imager()
"""GOES-16 with a hard ceiling at the end of the files' range, not quantised."""


def observe(
    radiance: Float[Array, " cell"],
    weights: Float[Array, " cell"],
    band: str,
    imager: Imager = IMAGER,
    *,
    sun_distance: Float[Array, ""] | float = 1.0,
    key: PRNGKeyArray | None = None,
    calibration_key: PRNGKeyArray | None = None,
) -> Observation:
    """What the imager makes of the cells that one pixel sees.

    Mean over the footprint, and then all that `observe_mean` does. With `jax.vmap` over pixels give
    each its own `key` and all of them the same `calibration_key`.

    Parameters
    ----------
    radiance
        Radiance of the cells, as it leaves the atmosphere, not limited. [W m-2 sr-1 um-1]
    weights
        Area of each cell in the footprint, in any one unit.
    band, imager, sun_distance, key, calibration_key
        As in `observe_mean`.

    Raises
    ------
    ValueError
        If cells and weights differ in number, and as in `observe_mean`.
    """
    if radiance.shape != weights.shape or radiance.ndim != 1:
        raise ValueError(
            f"one footprint has one axis of cells and as many weights; got {radiance.shape=} and "
            f"{weights.shape=}."
        )
    return observe_mean(
        footprint_mean(radiance, weights),
        band,
        imager,
        sun_distance=sun_distance,
        key=key,
        calibration_key=calibration_key,
    )


def observe_mean(
    radiance: Float[Array, "*shape"],
    band: str,
    imager: Imager = IMAGER,
    *,
    sun_distance: Float[Array, ""] | float = 1.0,
    key: PRNGKeyArray | None = None,
    calibration_key: PRNGKeyArray | None = None,
) -> Observation:
    """What the imager makes of the mean radiance of footprints, of one or of an image of them.

    Noise and calibration, ceiling, quantisation, and only then reflectance factor or brightness
    temperature. The imager has no green band: "green" has neither noise nor ceiling nor counts.

    Parameters
    ----------
    radiance
        Mean radiance of the footprints, not limited. [W m-2 sr-1 um-1]
    band
        Name of the band.
    imager
        Settings.
    sun_distance
        Distance of the sun. [AU]
    key
        Key of the noise, which is independent in each footprint; None for no noise.
    calibration_key
        Key of the band's calibration error, one for all footprints; None for no error.

    Raises
    ------
    ValueError
        If the band is unknown, or if noise or an error is asked for in a band that has none
        specified.
    """
    check_bands((band,))
    satellite, noise = imager.satellite, imager.noise
    if key is not None:
        deviation = noise_deviation(radiance, band, satellite, noise, sun_distance)
        radiance = add_noise(radiance, deviation, key)
    if calibration_key is not None:
        radiance = radiance * calibration_gain(band, calibration_key, noise, radiance.dtype)
    saturated = jnp.zeros(radiance.shape, bool)
    if band != "green":
        radiance, saturated = _limited(radiance, band, imager)
        radiance = quantise(radiance, band, satellite) if imager.quantised else radiance
    if band == "C07":
        temperature = brightness_temperature(radiance, band, satellite)
        return Observation(radiance, None, temperature, saturated)
    rho = reflectance_factor_from_radiance(radiance, band, satellite, sun_distance)
    return Observation(radiance, rho, None, saturated)


def _limited(
    radiance: Float[Array, "*shape"], band: str, imager: Imager
) -> tuple[Float[Array, "*shape"], Bool[Array, "*shape"]]:
    """Radiance under the ceiling, and whether it was above."""
    temperature = imager.fire_saturation_temperature if band == "C07" else None
    if temperature is not None:
        temperature = jnp.asarray(temperature, radiance.dtype)
    ceiling = jnp.asarray(range_ceiling(band, imager.satellite, temperature), radiance.dtype)
    if imager.quantised:  # counts end there, wherever the detector does
        last = jnp.asarray(range_ceiling(band, imager.satellite), radiance.dtype)
        ceiling = jnp.minimum(ceiling, last)
    saturated = radiance >= ceiling
    if imager.ceiling_width is None:
        return hard_ceiling(radiance, ceiling), saturated
    width = jnp.asarray(imager.ceiling_width, radiance.dtype)
    return smooth_ceiling(radiance, ceiling, width), saturated
