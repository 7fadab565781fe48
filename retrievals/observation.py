"""What the imager measured at each pixel, how well, and where that can be used."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, ArrayLike, Bool, Float

from abi_operator import BANDS, State
from abi_operator.instrument import (
    IMAGER,
    Imager,
    noise_deviation,
    radiance_from_reflectance_factor,
    range_ceiling,
    reflectance_factor_from_radiance,
    rounding_deviation,
)
from abi_operator.nomenclature import QUALITY_FLAGS
from abi_operator.radiance import FIRE_BANDS
from abi_operator.scene.angles import sun_distance

from .forward import THERMAL

LARGEST_REFLECTANCE_FACTOR = 2.0
"""No scene reflects more than this, and files end at 1.25: it is in another unit (percent). [-]"""

Seen = Callable[..., Array]
"""A forward model, or what it is called for: x, a state and the sun's distance in, bands out."""

# Flags of pixels that are not attempted. Optics beyond what they were fitted to are no reason: the
# retrieval's operator has the same.
UNUSABLE = sum(bit for name, bit in QUALITY_FLAGS.items() if name != "outside_fit")
# How far a saturated band may be exceeded before its likelihood no longer changes, in sigma. [-]
_ENOUGH = 6.0


class Observation(eqx.Module):
    r"""Measurements of one column and the standard deviation of their noise.

    A band whose measurement is NaN, or whose sigma is infinite, is missing and does not count. A
    saturated one is a lower bound: with the forward model's F and the ceiling C its likelihood is
    the probability that noise lifts F above it, :math:`\Phi((F - C) / \sigma)`.

    Parameters
    ----------
    measured
        Reflectance factor in C01 to C06 [-], radiance in C07 [W m-2 sr-1 um-1].
    sigma
        Standard deviation of the noise, in the same units.
    saturated
        Which bands are saturated; their `measured` is the ceiling. None if none is.
    sun_distance
        Distance of the sun [AU], None for 1 (`ForwardModel.measured`).
    correlation
        Of the errors of the bands with each other, 1 on its diagonal; None where they are
        independent, as noise is. What a forward model is wrong by is not. With its Cholesky factor
        L, residuals are :math:`L^{-1}` times the departures in standard deviations; bands that are
        missing or saturated have no part in it. [-]
    """

    measured: Float[Array | np.ndarray, "*batch band"]
    sigma: Float[Array | np.ndarray, "*batch band"]
    saturated: Bool[Array | np.ndarray, "*batch band"] | None = None
    sun_distance: Float[Array | np.ndarray, "*batch"] | None = None
    correlation: Float[Array | np.ndarray, "*batch band band"] | None = None

    @property
    def present(self) -> Bool[Array, "*batch band"]:
        """Bands that count, saturated or not."""
        return jnp.isfinite(self.measured) & jnp.isfinite(self.sigma)

    @property
    def num_values(self) -> np.ndarray:
        """Number of measurements that are values: bands neither missing nor saturated."""
        counts = np.isfinite(self.measured) & np.isfinite(self.sigma)
        if self.saturated is not None:
            counts &= ~np.asarray(self.saturated)
        return counts.sum(axis=-1)

    def departure(
        self, forward: Seen, x: Float[Array, "*batch x"], state: State
    ) -> Float[Array, "*batch band"]:
        """Residuals of x: what a forward model makes of it where the sun was, less the measurement.

        A forward model of one's own need not know of the sun's distance where there is none.
        """
        if self.sun_distance is None:
            return self.residual(forward(x, state))
        return self.residual(forward(x, state, jnp.asarray(self.sun_distance)))

    def residual(self, predicted: Float[Array, "*batch band"]) -> Float[Array, "*batch band"]:
        r"""Whitened departures of a forward model from the measurement, 0 in missing bands. [-]

        In a saturated band it is :math:`\sqrt{-2 \ln \Phi(z)}`, with the whitened departure z: its
        square is what the likelihood adds to the cost.
        """
        present = self.present
        measured = jnp.where(present, jnp.asarray(self.measured, predicted.dtype), 0)
        sigma = jnp.where(present, jnp.asarray(self.sigma, predicted.dtype), 1)
        departure = (predicted - measured) / sigma
        if self.saturated is not None:
            departure = jnp.where(jnp.asarray(self.saturated), _censored(departure), departure)
        departure = jnp.where(present, departure, 0)
        if self.correlation is None:
            return departure
        root = jnp.asarray(self.root_correlation, predicted.dtype)
        root = jnp.broadcast_to(root, (*departure.shape, departure.shape[-1]))
        solved = jax.lax.linalg.triangular_solve(
            root, departure[..., None], left_side=True, lower=True
        )
        return solved[..., 0]

    @property
    def root_correlation(self) -> Float[Array, "*batch band band"]:
        """Cholesky factor of the correlation of the bands that are values; others stand alone."""
        values = self.present
        if self.saturated is not None:
            values = values & ~jnp.asarray(self.saturated)
        unit = jnp.broadcast_to(jnp.eye(values.shape[-1]), (*values.shape, values.shape[-1]))
        if self.correlation is None:
            return unit
        both = values[..., :, None] & values[..., None, :]
        correlation = jnp.asarray(self.correlation)
        return jnp.linalg.cholesky(jnp.where(both, correlation, unit.astype(correlation.dtype)))


def _censored(departure: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    # Beyond, the square root of next to nothing has no slope; what is NaN is not beyond, but NaN.
    near = ~(departure >= _ENOUGH)
    likelihood = jax.scipy.special.log_ndtr(jnp.where(near, departure, _ENOUGH))
    # Its sign is that of a departure from below, so that a step knows which way to go.
    return -jnp.sqrt(-2 * likelihood)


def noise_sigma(measured: ArrayLike, band: str, imager: Imager = IMAGER) -> np.ndarray:
    """Standard deviation of the instrument's noise, of measurements of one band.

    Parameters
    ----------
    measured
        Reflectance factor, or in C07 radiance; below 0 the noise is that of a dark scene.
    band, imager
        Name of the band, and the instrument, whose noise is `abi_operator.instrument.Noise`; of
        one whose radiances are quantised what rounding takes off is part of it.

    Returns
    -------
    numpy.ndarray
        In the unit of `measured`, of the same shape.
    """
    dark = jnp.maximum(jnp.asarray(measured, float), 0)
    satellite = imager.satellite
    rounded = rounding_deviation(band, satellite) if imager.quantised else 0.0
    thermal = band == THERMAL
    radiance = dark if thermal else radiance_from_reflectance_factor(dark, band, satellite)
    sigma = jnp.hypot(noise_deviation(radiance, band, satellite, imager.noise), rounded)
    return np.asarray(
        sigma if thermal else reflectance_factor_from_radiance(sigma, band, satellite)
    )


def ceiling(band: str, imager: Imager = IMAGER) -> float:
    """Largest measurement that the instrument can tell: reflectance factor, or radiance in C07."""
    temperature = imager.fire_saturation_temperature if band == THERMAL else None
    if temperature is not None:
        temperature = jnp.asarray(temperature, float)
    top = jnp.asarray(range_ceiling(band, imager.satellite, temperature), float)
    if imager.quantised:  # counts end there, wherever the detector does
        top = jnp.minimum(top, jnp.asarray(range_ceiling(band, imager.satellite), float))
    if band != THERMAL:
        top = reflectance_factor_from_radiance(top, band, imager.satellite)
    return float(top)


def measurement(
    measured: Float[ArrayLike, "*batch band"],
    bands: Sequence[str],
    imager: Imager = IMAGER,
    *,
    calibration: bool = False,
    forward_error: float | Float[np.ndarray, "band band"] = 0.0,
    sun_distance: Float[ArrayLike, "*batch"] | None = None,
    saturated: Bool[ArrayLike, "*batch band"] | None = None,
) -> Observation:
    """An observation with the noise and the ceilings of the instrument.

    Parameters
    ----------
    measured
        Reflectance factors, not per cent, which nobody notices before `retrieve_pixels`, and the
        radiance of C07, in the order of `bands`. What is at a band's ceiling or above becomes the
        ceiling, and is saturated.
    bands, imager
        Names of the bands, and the instrument.
    calibration
        Whether the uncertainty of the calibration is part of sigma, as an error that is another one
        in every pixel and band.
    forward_error
        Relative standard deviation of what the forward model itself is wrong by, in each band, or
        the relative covariance of that, band by band, which makes errors of bands correlated. [-]
    sun_distance
        Distance of the sun, None for 1. [AU]
    saturated
        Which measurements are known to be saturated, whatever their size: each is its own lower
        bound, as counts and rounding may have taken it below the ceiling. None for those at the
        ceiling or above alone.

    Returns
    -------
    Observation
        The measurements in the type of JAX's floats, NaN where they were, with the standard
        deviations of their errors, and with the errors' correlation if `forward_error` is a matrix.
    """
    values = np.asarray(measured, np.result_type(float))
    relative = np.zeros(len(bands))
    if calibration:
        relative = np.array([float(imager.noise.calibration.get(band, 0.0)) for band in bands])
    tops = np.array([ceiling(band, imager) for band in bands], values.dtype)
    distance = None
    if sun_distance is not None:  # ceilings are those of radiance
        distance = np.broadcast_to(np.asarray(sun_distance, values.dtype), values.shape[:-1])
        reflective = np.array([band != THERMAL for band in bands])
        tops = np.where(reflective, tops * distance[..., None] ** 2, tops)
    known = np.broadcast_to(False if saturated is None else np.asarray(saturated), values.shape)
    limited = known | (values >= tops)
    values = np.where(limited & ~known, tops, values)
    columns = [noise_sigma(values[..., i], band, imager) for i, band in enumerate(bands)]
    noise = np.stack(columns, axis=-1)
    if np.ndim(forward_error) == 0:
        other = np.hypot(relative, forward_error).astype(values.dtype) * values
        return Observation(values, np.hypot(noise, other), limited, distance)
    covariance = values[..., :, None] * np.asarray(forward_error) * values[..., None, :]
    covariance += (noise**2 + (relative * values) ** 2)[..., None] * np.eye(len(bands))
    sigma = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)).astype(values.dtype)
    correlation = (covariance / (sigma[..., :, None] * sigma[..., None, :])).astype(values.dtype)
    return Observation(values, sigma, limited, distance, correlation)


def add_noise(
    measured: xr.DataArray,
    seed: int,
    imager: Imager = IMAGER,
    saturated: xr.DataArray | None = None,
) -> xr.DataArray:
    """Add the instrument's noise, Gaussian, independent between pixels and bands.

    Parameters
    ----------
    measured
        Reflectance factor, or radiance in C07, with a dimension ``band``. [-], [W m-2 sr-1 um-1]
    seed, imager
        Of the noise, and whose it is.
    saturated
        What is saturated (`known_saturated`), and stays as it is: no noise changes a ceiling.
    """
    imager = replace(imager, quantised=False)  # what was rounded off is off already
    noisy = measured.copy(deep=True)
    for band in noisy["band"].values:
        if band == "green":  # which the instrument lacks
            continue
        values = noisy.sel(band=band).values
        own = np.random.default_rng([seed, list(BANDS).index(str(band))])
        values = values + noise_sigma(values, str(band), imager) * own.standard_normal(values.shape)
        noisy.loc[{"band": band}] = values
    return noisy if saturated is None else noisy.where(~saturated, measured)


def imager_of(dataset: xr.Dataset) -> Imager:
    """The instrument of a result: its satellite, and if it was observed so, where C07 saturates
    and whether radiances are counts."""
    hottest = dataset.attrs.get("fire_saturation_temperature")
    return Imager(
        str(dataset.attrs.get("satellite", IMAGER.satellite)),
        fire_saturation_temperature=None if hottest is None else float(hottest),
        quantised=int(dataset.attrs.get("quantised", 0)) == 1,
    )


def has_noise(dataset: xr.Dataset) -> bool:
    """Whether a result was observed with the instrument's noise."""
    return str(dataset.attrs.get("noise", "none")) != "none"


def has_calibration_error(dataset: xr.Dataset) -> bool:
    """Whether a result was observed with an error of the calibration, which S_obs then has."""
    return str(dataset.attrs.get("calibration_error", "none")) != "none"


def distance_of(image: xr.Dataset) -> float:
    """Distance of the sun at the time of an image, as it was simulated; 1 without a time. [AU]"""
    return sun_distance(image["time"].values) if "time" in image.variables else 1.0


def known_saturated(dataset: xr.Dataset) -> xr.DataArray | None:
    """Which measurements are saturated, as a result says that was observed; None if none was."""
    return dataset["saturated"] == 1 if "saturated" in dataset else None


def observe(columns: xr.Dataset, bands: tuple[str, ...]) -> Observation:
    """Take the measurement vectors of a Dataset of one time with a dimension ``column``.

    The instrument is that of the Dataset (`imager_of`), and so are the errors: the calibration's is
    part of sigma where the Dataset has one. Bands in which a fire of the scenario
    shines are missing: it is not part of the forward models of reflectances. Ceilings are those of
    the sun's distance, which the observation does not have unless there is C07 in it: reflected
    light alone does not tell.
    """
    measured = columns["reflectance_factor"].sel(band=list(bands))
    if THERMAL in bands:
        thermal = columns["radiance"].sel(band=list(bands))
        measured = measured.where(measured["band"] != THERMAL, thermal)
    if "fire_fraction" in columns:
        shines = measured["band"].isin(FIRE_BANDS) & (columns["fire_fraction"] > 0)
        measured = measured.where(~shines)
    limited = known_saturated(columns)
    if limited is not None:
        limited = limited.sel(band=list(bands)).transpose("column", "band").values
    values = measured.transpose("column", "band").values.astype(np.float64)
    distance = np.full(len(values), distance_of(columns))
    found = measurement(
        values,
        bands,
        imager_of(columns),
        calibration=has_calibration_error(columns),
        sun_distance=distance,
        saturated=limited,
    )
    return found if THERMAL in bands else replace(found, sun_distance=None)
