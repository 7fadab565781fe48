"""What the instrument makes of what is seen, on each satellite."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..instrument import (
    NOISE,
    Imager,
    Noise,
    calibration_gain,
    image_mean,
    noise_deviation,
    observe,
    observe_mean,
    overlap_lengths,
    quantise,
    range_ceiling,
    reflectance_factor_from_radiance,
)
from ..planck import brightness_temperature
from ..radiance import FIRE_BANDS
from ..satellites import SATELLITES
from .seen import Seen

_CEILING_WIDTH = 0.1  # of a smooth ceiling [-]
_SUN_DISTANCE = 0.983  # where it is not 1 [AU]
_FIRE_SATURATION = 400.0  # of C07, as Grasso et al. (2013) have it [K]
# Edges of cells and of a pixel along one axis, and the cells' radiances in C03.
# [km], [W m-2 sr-1 um-1]
_CELL_EDGES, _PIXEL_EDGES = (0.0, 0.7, 1.5, 2.6), (0.2, 2.3)
_CELLS = ((40.0, 90.0, 130.0), (20.0, 70.0, 35.0), (110.0, 5.0, 60.0))


def instrument_outputs(seen: Seen, band: str) -> dict[str, Float[Array, " column"]]:
    """Outputs by name, functions of the value of one band, on every satellite.

    ``reflectance_factor`` and ``radiance`` as the operator has them; ``observed`` under a hard
    ceiling and ``softened`` under a smooth one, which is that of 400 K in C07, with the sun at
    0.983 AU, both as reflectance factor or, in C07, as brightness temperature;
    ``quantised_radiance`` after packing into a file; ``noise_deviation``; and
    ``brightness_temperature`` in the bands in which fires shine.

    Parameters
    ----------
    seen
        Values of the columns.
    band
        Name of the band.
    """
    found = {}
    if band != "C07":
        found[f"reflectance_factor.{band}"] = seen.reflectance_factor(band)
    for satellite in SATELLITES:
        of_band = _on_satellite(seen.radiance(band, satellite), band, satellite)
        found |= {f"{name}.{band}.{satellite}": value for name, value in of_band.items()}
    return found


def instrument_constants(bands: Sequence[str]) -> dict[str, Float[Array, ""] | float]:
    """Outputs by name that are functions of no column.

    ``saturation_radiance`` of the files' range, and with C05 to C07 saturating at 400 K;
    ``calibration_deviation``, the draw of a gain over that of a gain of deviation 1; and, in C03,
    ``footprint_mean`` and ``image_mean`` of three and of nine cells.
    """
    found = {}
    measured = [band for band in bands if band != "green"]
    for band in measured:
        for satellite in SATELLITES:
            top = range_ceiling(band, satellite)
            found[f"saturation_radiance.{band}.{satellite}"] = top
            if band in FIRE_BANDS:
                top = range_ceiling(band, satellite, jnp.asarray(_FIRE_SATURATION))
                found[f"saturation_radiance.{band}.{satellite}.at_400_K"] = top
    key, unit = jax.random.key(0), Noise(calibration=dict.fromkeys(NOISE.calibration, 1.0))
    for band in (x for x in measured if x in NOISE.calibration):
        error, of_unit = (calibration_gain(band, key, noise) - 1 for noise in (NOISE, unit))
        found[f"calibration_deviation.{band}"] = error / of_unit
    if "C03" in bands:
        lengths = overlap_lengths(jnp.asarray(_CELL_EDGES), jnp.asarray(_PIXEL_EDGES))
        cells = jnp.asarray(_CELLS)
        found["footprint_mean.C03"] = observe(cells[0], lengths[0], "C03").radiance
        found["image_mean.C03"] = image_mean(cells, lengths, lengths)[0, 0]
    return found


def _on_satellite(
    radiance: Float[Array, " column"], band: str, satellite: str
) -> dict[str, Float[Array, " column"]]:
    smooth = Imager(
        satellite, fire_saturation_temperature=_FIRE_SATURATION, ceiling_width=_CEILING_WIDTH
    )
    found = {"radiance": radiance}
    for name, observation in (
        ("observed", observe_mean(radiance, band, Imager(satellite))),
        ("softened", observe_mean(radiance, band, smooth, sun_distance=_SUN_DISTANCE)),
    ):
        if observation.reflectance_factor is not None:
            found[f"{name}_reflectance_factor"] = observation.reflectance_factor
        if observation.brightness_temperature is not None:
            found[f"{name}_brightness_temperature"] = observation.brightness_temperature
    if band == "C07":
        found["reflectance_factor"] = reflectance_factor_from_radiance(radiance, band, satellite)
    if band in FIRE_BANDS:
        found["brightness_temperature"] = brightness_temperature(radiance, band, satellite)
    if band != "green":
        found["quantised_radiance"] = quantise(radiance, band, satellite)
        found["noise_deviation"] = noise_deviation(
            radiance, band, satellite, sun_distance=_SUN_DISTANCE
        )
    return found
