r"""What uncertain inputs contribute to the variance of what follows from them.

With the Jacobian K of a number and the covariance S of the inputs its variance is :math:`K S K^T`
to first order. The part of input i is

.. math:: v_i = K_i \sum_j S_{ij} K_j = \mathrm{Cov}(y,\; K_i\, \delta_i),

of which the first form is linear and the second can be sampled, whatever the function: the parts
sum to the variance in the one, and in the other but for what is not linear. Of inputs that hang
together a part may be negative.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..atmosphere import State
from .derivatives import Function, rows_of
from .inputs import Input, allowed, changed

# Columns that are evaluated together.
_COLUMNS = 16384


class SampledVariance(NamedTuple):
    """Variance of numbers of columns by sampling, each with its standard error.

    Parameters
    ----------
    total, total_error
        Of each number (column, of), in its unit squared.
    linear
        The same of the very draws by the Jacobian: what differs from it is not linear.
    parts, parts_error
        Of each input (column, of, to).
    draws
        Number of draws of each column that count: those that it may be changed by.
    """

    total: np.ndarray
    total_error: np.ndarray
    linear: np.ndarray
    parts: np.ndarray
    parts_error: np.ndarray
    draws: np.ndarray


def covariance_of(
    inputs: Sequence[Input], correlations: Mapping[tuple[str, str], float] | None = None
) -> np.ndarray:
    """Covariance (to, to) of inputs whose steps are standard deviations.

    Parameters
    ----------
    inputs
        The inputs.
    correlations
        By pairs of names; 0 for all others. [-]

    Raises
    ------
    ValueError
        Where a name is none of the inputs' or is given twice, or these correlations cannot be.
    """
    names = [one.name for one in inputs]
    check_once("input", names)
    matrix = np.eye(len(names))
    given = correlations or {}
    check_once("correlation", [" and ".join(sorted(pair)) for pair in given])
    for pair, correlation in given.items():
        unknown = [name for name in pair if name not in names]
        if unknown or pair[0] == pair[1]:
            raise ValueError(f"a correlation is of two of {', '.join(names)}; got {pair}.")
        if not -1 <= correlation <= 1:
            raise ValueError(
                f"a correlation is -1 to 1; got {correlation} of {' and '.join(pair)}."
            )
        i, j = (names.index(name) for name in pair)
        matrix[i, j] = matrix[j, i] = correlation
    sigma = np.array([one.step for one in inputs])
    return checked_covariance(matrix * np.outer(sigma, sigma), len(names))


def checked_covariance(covariance: np.ndarray, size: int) -> np.ndarray:
    """Return a covariance, or raise `ValueError` where it is none of so many inputs.

    It is judged by its correlations, which do not hang on the units of the inputs.
    """
    covariance = np.asarray(covariance)
    if not np.isfinite(covariance).all():
        raise ValueError(f"the covariance of {size} inputs is finite; got {covariance.tolist()}.")
    square = covariance.shape == (size, size)
    _, correlations = _standardized(covariance) if square else (None, covariance)
    if not square or not np.allclose(correlations, correlations.T):
        raise ValueError(
            f"the covariance of {size} inputs is symmetric, ({size}, {size}); got "
            f"{covariance.shape}."
        )
    smallest = np.linalg.eigvalsh(correlations)[0]
    if smallest < -1e-12 * size:
        raise ValueError(
            "these correlations cannot be: some combination of the inputs, each in standard "
            f"deviations, had a variance of {smallest:.3g}."
        )
    return covariance


def _standardized(covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviations (to,), 1 for those of 0, and the covariance in units of them."""
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0))
    sigma = np.where(sigma > 0, sigma, 1)
    return sigma, covariance / sigma[:, None] / sigma


def check_once(what: str, names: Sequence[str]) -> None:
    """Raise `ValueError` where a name is there twice."""
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise ValueError(f"each {what} is given once; got {', '.join(twice)} more often.")


def variance_parts(
    jacobian: Float[np.ndarray, "*shape to"], covariance: Float[np.ndarray, "to to"]
) -> Float[np.ndarray, "*shape to"]:
    """Parts of the variance by input, to first order; their sum is the variance."""
    covariance = checked_covariance(covariance, jacobian.shape[-1])
    return jacobian * (jacobian @ covariance)


def sampled_variance(
    function: Function,
    states: State,
    inputs: Sequence[Input],
    jacobian: Float[np.ndarray, "column of to"],
    covariance: Float[np.ndarray, "to to"],
    *,
    num_samples: int = 256,
    seed: int = 0,
) -> SampledVariance:
    """Variance and its parts by normal draws of the inputs, other ones for each column.

    Draws by which a column may not be changed are left out, and told by `draws`; what fewer than
    two are left of has no variance, NaN.

    Parameters
    ----------
    function, states, inputs
        As of `derivatives.sensitivity`.
    jacobian
        Of the function, as that has it.
    covariance
        Of the inputs.
    num_samples, seed
        Draws a column, and the seed of their numbers.

    Raises
    ------
    ValueError
        Where there are fewer than 2 samples, or the covariance is none.
    """
    if num_samples < 2:
        raise ValueError(f"a variance needs 2 samples or more; got {num_samples}.")
    covariance, rows = checked_covariance(covariance, len(inputs)), rows_of(function)
    columns = jacobian.shape[0]
    sigma, correlations = _standardized(covariance)
    values, vectors = np.linalg.eigh(correlations)
    root = sigma[:, None] * vectors * np.sqrt(np.maximum(values, 0))
    rng = np.random.default_rng(seed)
    draws = rng.standard_normal((num_samples, columns, len(inputs))) @ root.T
    draws = draws.astype(jacobian.dtype)
    together = max(1, _COLUMNS // columns)
    found, use = [], []
    for first in range(0, num_samples, together):
        some = draws[first : first + together]
        flat = some.reshape(-1, len(inputs))
        tiled = _repeated(states, len(some))
        good = allowed(tiled, inputs, flat)
        by = jnp.asarray(flat * good[:, None])
        found.append(np.asarray(rows(changed(tiled, inputs, by))).reshape(len(some), columns, -1))
        use.append(good.reshape(len(some), columns))
    return _moments(np.concatenate(found), np.concatenate(use), draws, jacobian)


def _moments(
    y: Float[np.ndarray, "sample column of"],
    use: np.ndarray,
    draws: Float[np.ndarray, "sample column to"],
    jacobian: Float[np.ndarray, "column of to"],
) -> SampledVariance:
    """Variances, covariances and their standard errors over the samples that count."""
    count = use.sum(axis=0)
    weight = use[..., None]

    def mean(x: np.ndarray) -> np.ndarray:
        many = weight.reshape(*use.shape, *(1,) * (x.ndim - 2))
        per = np.maximum(count, 1).reshape(-1, *(1,) * (x.ndim - 2))
        return np.sum(np.where(many, x, 0), axis=0) / per

    unbiased = (count / np.maximum(count - 1, 1))[:, None]
    off = np.where(weight, y - mean(y), 0)
    squares = off**2
    total = mean(squares)
    error = np.sqrt(np.maximum(mean(squares**2) - total**2, 0) / np.maximum(count, 1)[:, None])
    moved = np.where(weight, draws - mean(draws), 0)
    first = jacobian * moved[:, :, None, :]  # sample column of to
    products = off[..., None] * first
    parts, linear = mean(products), mean(np.sum(first, axis=-1) ** 2)
    spread = np.maximum(mean(products**2) - parts**2, 0) / np.maximum(count, 1)[:, None, None]
    parts, spread = parts * unbiased[..., None], np.sqrt(spread)
    found = total * unbiased, error, linear * unbiased, parts, spread
    for some in found:
        some[count < 2] = np.nan
    return SampledVariance(*found, count)


def _repeated(states: State, times: int) -> State:
    """All columns, then all of them again, and so on."""
    return jax.tree.map(lambda x: np.tile(x, (times, *(1,) * (x.ndim - 1))), states)
