"""A scene beside what was observed of it, and its plume tuned to that."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Literal, NamedTuple

import jax
import numpy as np
import xarray as xr

from abi_operator.files import InputError
from abi_operator.nomenclature import PLUME, SCENARIO
from abi_operator.scene import species_of, states_of_result

from ..images import forward_model
from ..observation import UNUSABLE, imager_of
from ..state_vector import StateVector
from .comparison import compare, regions_of
from .fit import Problem, fit, ready
from .observed import bands_in_common
from .plume_numbers import plume_numbers
from .plume_pixels import PlumePixels, error_of, lit_by_fires, plume_pixels
from .product import fit_dataset, joined

Where = Literal["plume", "clear"]


class Errors(NamedTuple):
    """How well an observation is known, and the model by itself.

    Parameters
    ----------
    calibration
        Whether the gain of each band is unknown, by the instrument's calibration error.
    forward_error
        Relative standard deviation of the forward model in each pixel and band by itself. [-]
    """

    calibration: bool = False
    forward_error: float = 0.0


NOISE_ALONE = Errors()
"""The model is exact, and the observation has the instrument's noise and, of counts, rounding."""


def compared(
    image: xr.Dataset,
    observed: xr.Dataset,
    *,
    species: str | None = None,
    bands: Sequence[str] | None = None,
) -> xr.Dataset:
    """Compare a scene with what was observed of it, as it is.

    Parameters
    ----------
    image
        Result of a simulation, of one time.
    observed
        Of `read_observed`.
    species
        Name of the plume that is told apart; None for the one that the scene has, if any.
    bands
        Bands to be compared; None for those that both have.

    Returns
    -------
    xarray.Dataset
        As `comparison.compare`, with the one stage ``scene``.

    Raises
    ------
    InputError
        Where bands or plumes are missing, or several plumes are there and none is named.
    """
    species = _species(image, species)
    bands = bands_in_common(image, observed, bands)
    found = compare(
        {"scene": _factor(image, bands)},
        observed.sel(band=list(bands)),
        regions_of(image, species),
    )
    return joined(found, None, image, observed, _about(species, bands))


def tuned(
    image: xr.Dataset,
    observed: xr.Dataset,
    numbers: Sequence[str] | StateVector,
    *,
    species: str | None = None,
    bands: Sequence[str] | None = None,
    where: Where = "plume",
    errors: Errors = NOISE_ALONE,
) -> xr.Dataset:
    """Fit numbers of a scene's plume to what was observed of it, and compare before and after.

    Parameters
    ----------
    image, observed, species, bands
        As of `compared`; the scene must be stored whole.
    numbers
        What is fitted, of `plume_numbers.NUMBERS`, with the declared priors; or `numbers_of` this
        plume, with priors of one's own.
    where
        ``"plume"``: all pixels of the plume decide; ``"clear"``: those without cloud in the scene.
    errors
        Of observation and model.

    Returns
    -------
    xarray.Dataset
        As `compared` with the stage ``tuned`` as well (in the plume what the fit predicts to be
        observed, which is times the fitted gains where the calibration is unknown, and NaN in bands
        in which a fire shines there, so that both stages are compared without it; outside the scene
        as it is), and what `product.fit_dataset` says of the fit and of whether it explains the
        observation.

    Raises
    ------
    InputError
        As of `compared`, and where numbers are unknown or there is no pixel to decide.
    """
    name = _species(image, species)
    if name is None:
        raise InputError("the result has no plume to be tuned; simulate it with --plume.")
    bands = bands_in_common(image, observed, bands)
    given = isinstance(numbers, StateVector)
    vector = numbers if given else numbers_of(image, numbers, name)
    regions = regions_of(image, name)
    if not 0 <= errors.forward_error < 1:
        raise InputError(f"the forward error is 0 or more, below 1; got {errors.forward_error:g}.")
    pixels = plume_pixels(image, observed, regions.plume, _deciding(image, where), bands)
    if pixels.counts.sum() <= vector.size:
        raise InputError(
            f"{pixels.counts.sum()} measurements in the plume cannot tell {vector.size} numbers."
        )
    with jax.enable_x64(True):
        problem = _problem(image, vector, pixels, errors)
        found = fit(problem)
        # As the residuals have it: what the gains explain is no bias any more.
        of_plume = (1 + problem.gains(found.z)) * found.normal.predicted
        # Where a fire of the scene shines it is not part of what is predicted.
        of_plume = np.where(lit_by_fires(image, bands)[:, pixels.y, pixels.x].T, np.nan, of_plume)
        maps = _factor(image, bands).copy(deep=True)
        maps.values[:, pixels.y, pixels.x] = of_plume.T
        table = fit_dataset(problem, found, _first_state(pixels))
    stages = {"scene": _factor(image, bands), "tuned": maps}
    both = compare(stages, observed.sel(band=list(bands)), regions)
    if errors.calibration:
        for variable in (both["simulated"], both["difference"]):
            variable.attrs["long_name"] += ", in the plume of stage tuned with the fitted gains"
    about = _about(name, bands) | {
        "fitted": " ".join(vector.names),
        "pixels_that_decide": where,
        "forward_error": errors.forward_error,
        "calibration": "unknown" if errors.calibration else "taken as exact",
        "rounded_to_counts": " ".join(np.compress(pixels.quantised, bands)) or "none",
    }
    return joined(both, table, image, observed, about)


def numbers_of(
    image: xr.Dataset, numbers: Sequence[str], species: str | None = None
) -> StateVector:
    """State vector of numbers of a scene's plume, with the declared priors."""
    name = _species(image, species)
    if name is None:
        raise InputError("the result has no plume to be tuned; simulate it with --plume.")
    first = image.isel(y=slice(0, 1), x=slice(0, 1))
    try:
        with jax.enable_x64(True):
            states = states_of_result(first, [str(band) for band in image["band"].values])
            plume = jax.tree.map(lambda leaf: leaf[0], states.atmosphere.plumes[name])
            return plume_numbers(numbers, name, plume)
    except ValueError as error:
        raise InputError(str(error)) from None


def _problem(
    image: xr.Dataset, vector: StateVector, pixels: PlumePixels, errors: Errors
) -> Problem:
    # The satellite is the scene's; whether counts were rounded only what was observed can say.
    imager = imager_of(image)
    imagers = [replace(imager, quantised=counts) for counts in pixels.quantised]
    prior = vector.prior()
    gains = [
        float(imager.noise.calibration.get(band, 0.0)) if errors.calibration else 0.0
        for band in pixels.bands
    ]
    return Problem(
        ready(forward_model(image, vector, pixels.bands, None), pixels),
        pixels,
        np.asarray(prior.x_prior),
        np.sqrt(np.diag(np.asarray(prior.S_prior))),
        np.array(gains),
        partial(error_of, bands=pixels.bands, imagers=imagers, forward_error=errors.forward_error),
    )


def _deciding(image: xr.Dataset, where: str) -> np.ndarray:
    """Pixels (y, x) by which a plume may be judged."""
    if where not in ("plume", "clear"):
        raise InputError(f"pixels that decide are those of 'plume' or 'clear'; got {where!r}.")
    good = (image["quality_flag"].values & UNUSABLE) == 0
    if where == "clear":
        paths = [name for name in image.data_vars if str(name).endswith("_mass_path")]
        for name in paths:
            good &= image[name].sum("layer").values == 0
    return good


def _first_state(pixels: PlumePixels):
    """The column of the first pixel: a plume's optics are the same in all of them."""
    _, states = next(pixels.blocks())
    return jax.tree.map(lambda leaf: np.asarray(leaf)[0], states)


def _factor(image: xr.Dataset, bands: tuple[str, ...]) -> xr.DataArray:
    if "reflectance_factor" not in image:
        raise InputError("the result has no reflectance_factor; simulate it with that.")
    factor = image["reflectance_factor"].sel(band=list(bands)).transpose("band", "y", "x")
    return factor.astype(np.float64)


def _species(image: xr.Dataset, species: str | None) -> str | None:
    there = species_of(image)
    if species is not None and species not in there:
        raise InputError(
            f"the result has no plume of {species} (plumes: {', '.join(there) or 'none'})."
        )
    if species is None and len(there) > 1:
        raise InputError(f"the result has plumes of {', '.join(there)}; say which with --species.")
    name = species if species is not None else next(iter(there), None)
    plume = [] if name is None else [f"{name}_{quantity}" for quantity in PLUME]
    missing = [x for x in (*SCENARIO, *plume) if x not in image.variables]
    if missing:
        raise InputError(
            f"the result has no {', '.join(missing)}; keep all of it (abi-operator simulate "
            "without --variables)."
        )
    return name


def _about(species: str | None, bands: tuple[str, ...]) -> dict[str, object]:
    return {"species": species or "none", "bands": " ".join(bands)}
