"""What a comparison and a fit have found, as a Dataset with words and units."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import jax.numpy as jnp
import numpy as np
import xarray as xr

from abi_operator import State, __version__

from ..transforms import Bounded
from .fit import Fitted, Problem
from .misfit import Misfit, misfit

LEAST_TOLD = 0.5
"""Share told by the observation below which a number is the prior's. [-]"""
NEAR = 0.01
"""Share of the distance of two limits from which a number is at one of them. [-]"""
_PLACE = ("latitude", "longitude", "time", "crs", "y", "x")


def fit_dataset(problem: Problem, found: Fitted, state: State) -> xr.Dataset:
    """The numbers that were found, how well they are known, and whether they explain the image.

    Parameters
    ----------
    problem, found
        What was fitted, and the outcome.
    state
        The column of one pixel, of which the plume's optics are read.

    Returns
    -------
    xarray.Dataset
        Along ``element``: ``value``, ``sigma`` (posterior, 1 sigma), ``prior_value`` and
        ``prior_sigma``, in ``element_units``; ``told`` (share told by the observation and not by
        the prior), ``band_sigma`` (element, band), 1 sigma from one band alone were all other
        numbers known, and ``error_correlation`` (element, element_2). Of ssa in each band ``ssa``
        and ``ssa_sigma``. Whitened ``residual`` (band, y, x), and of each band
        ``chi_square_of_band``, ``mean_residual`` and ``neighbours_product`` with the scatter
        that noise has. Attributes tell of the misfit: ``misfit_found`` (0 or 1), ``misfit`` in
        words, and the reduced ``chi_square``.
    """
    vector, size = problem.forward.vector, problem.x_prior.size
    bands = problem.pixels.bands
    x, gains = problem.x(found.z), problem.gains(found.z)
    free = problem.free_gains
    names = [*vector.names, *(f"gain_{bands[b]}" for b in free)]
    words = [*(q.long_name for q in vector.quantities), *(f"gain of {bands[b]}" for b in free)]
    units = [*(q.units for q in vector.quantities), *("1" for _ in free)]
    scale = np.concatenate(
        [np.asarray(vector.slopes(jnp.asarray(x))) * problem.sigma_prior, problem.gain_sigma[free]]
    )
    at_prior = np.asarray(vector.slopes(jnp.asarray(problem.x_prior))) * problem.sigma_prior
    deviation = np.sqrt(np.diag(found.covariance))
    values = [float(v) for v in vector.values(jnp.asarray(x)).values()]
    priors = [float(v) for v in vector.values(jnp.asarray(problem.x_prior)).values()]
    own = np.diagonal(found.normal.matrix, axis1=1, axis2=2).T  # (element, band)
    with np.errstate(divide="ignore"):
        alone = np.abs(scale)[:, None] / np.sqrt(own)
    columns = {
        "value": (np.array([*values, *(1 + gains[free])]), "value that was found"),
        "sigma": (np.abs(scale) * deviation, "its posterior standard deviation"),
        "prior_value": (np.array([*priors, *np.ones(free.size)]), "mean of the prior"),
        "prior_sigma": (
            np.concatenate([np.abs(at_prior), problem.gain_sigma[free]]),
            "standard deviation of the prior, at its mean",
        ),
        "told": (1 - deviation**2, "share told by the observation, the rest by the prior"),
    }
    variables: dict[str, Any] = {
        name: ("element", array, {"long_name": text}) for name, (array, text) in columns.items()
    }
    variables["band_sigma"] = (
        ("element", "band"),
        alone,
        {"long_name": "standard deviation from one band alone, were all other numbers known"},
    )
    correlation = found.covariance / np.outer(deviation, deviation)
    variables["error_correlation"] = (
        ("element", "element_2"),
        correlation,
        {"long_name": "correlation of the posterior errors", "units": "1"},
    )
    covariance = found.covariance[:size, :size] * np.outer(problem.sigma_prior, problem.sigma_prior)
    reported = vector.report(jnp.asarray(x), state, jnp.asarray(covariance))
    for name, by_band in reported.items():
        assert isinstance(by_band, dict)
        array = np.array([float(by_band[band]) for band in bands])
        text = "of the plume, tuned" if not name.endswith("_sigma") else "posterior 1 sigma"
        variables[name] = ("band", array, {"long_name": f"single-scattering albedo {text}"})
    judged = _judged(problem, found)
    variables |= _residual_variables(problem, found, judged)
    coordinates = {
        "element": names,
        "element_2": names,
        "element_units": ("element", units),
        "element_name": ("element", words),
        "band": list(bands),
    }
    return xr.Dataset(variables, coordinates).assign_attrs(_attributes(problem, found, judged))


def _judged(problem: Problem, found: Fitted) -> Misfit:
    pixels = problem.pixels
    counts = pixels.on_map(pixels.counts.astype(float)) == 1
    learnt = float(np.trace(np.eye(found.z.size) - found.covariance))
    return misfit(pixels.on_map(found.normal.residual), counts, pixels.bands, learnt)


def _residual_variables(problem: Problem, found: Fitted, judged: Misfit) -> dict[str, Any]:
    pixels = problem.pixels
    residual = np.where(pixels.counts, found.normal.residual, np.nan)
    variables: dict[str, Any] = {
        "residual": (
            ("band", "y", "x"),
            pixels.on_map(residual),
            {"long_name": "tuned minus observed in standard deviations of noise", "units": "1"},
        ),
        "count_of_band": (
            "band",
            pixels.counts.sum(axis=0),
            {"long_name": "measurements that decided", "units": "1"},
        ),
    }
    tables = {
        "chi_square_of_band": (judged.by_band, "reduced chi-square of the band"),
        "mean_residual": (judged.mean, "mean residual in standard deviations of noise"),
        "neighbours_product": (judged.alike, "mean product of neighbours' residuals"),
    }
    for name, (tests, words) in tables.items():
        values = [tests[band].value if band in tests else np.nan for band in pixels.bands]
        scatter = [tests[band].scatter if band in tests else np.nan for band in pixels.bands]
        variables[name] = ("band", np.array(values), {"long_name": words, "units": "1"})
        variables[f"{name}_scatter"] = (
            "band",
            np.array(scatter),
            {"long_name": f"what noise makes of it, 1 sigma: {words}", "units": "1"},
        )
    return variables


def _attributes(problem: Problem, found: Fitted, judged: Misfit) -> dict[str, Any]:
    names = problem.forward.vector.names
    told = 1 - np.diag(found.covariance)[: len(names)]
    lost = [name for name, share in zip(names, told, strict=True) if share < LEAST_TOLD]
    return {
        "misfit_found": int(judged.found),
        "misfit": judged.sentence,
        "chi_square": judged.chi_square.value,
        "chi_square_scatter": judged.chi_square.scatter,
        "num_measurements": int(problem.pixels.counts.sum()),
        "num_pixels": int(problem.pixels.counts.any(axis=1).sum()),
        "num_steps": found.num_steps,
        "converged": int(found.converged),
        "not_told": " ".join(lost) or "none",
        "second_minimum": _second_minimum(problem, found),
        "at_limit": " ".join(names[i] for i in range(len(names)) if _at_limit(problem, found, i))
        or "none",
    }


def _second_minimum(problem: Problem, found: Fitted) -> str:
    """Where it is and by how much worse, in words."""
    if found.other is None:
        return "none found"
    values = problem.forward.vector.values(jnp.asarray(problem.x(found.other.z)))
    words = ", ".join(f"{name} {float(value):.4g}" for name, value in values.items())
    return f"{words}; its cost is higher by {found.other.cost - found.cost:.3g}"


def _at_limit(problem: Problem, found: Fitted, i: int) -> bool:
    """Whether a number that has limits is within a hundredth of their distance from one."""
    transform = problem.forward.vector.quantities[i].transform
    share = 1 / (1 + np.exp(-problem.x(found.z)[i]))
    return isinstance(transform, Bounded) and not NEAR < share < 1 - NEAR


def joined(
    comparison: xr.Dataset,
    fitted: xr.Dataset | None,
    image: xr.Dataset,
    observed: xr.Dataset,
    about: Mapping[str, Any],
) -> xr.Dataset:
    """One Dataset of a comparison and, if there was one, a fit, with place, time and origin."""
    found = (
        comparison
        if fitted is None
        else xr.merge([comparison, fitted], combine_attrs="override", join="exact")
    )
    found = found.assign_coords({x: image[x] for x in _PLACE if x in image.variables})
    if "time" in found.coords:
        found["time"].attrs["units_metadata"] = "leap_seconds: none"
    attributes = {} if fitted is None else fitted.attrs
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    made = {
        "Conventions": "CF-1.11",
        "title": "A simulated scene beside what was observed",
        "source": f"retrievals of abi_operator {__version__}",
        "history": f"{now} compared by abi_operator {__version__}",
    }
    return found.assign_attrs(made | dict(about) | observed.attrs | attributes)
