r"""The last steps of a minimisation that has come near: few evaluations, none of them in vain.

A chord, a value of the forward model with slopes of elsewhere, is a third as dear as a tangent, the
value with its own. So a chord comes first, then a tangent with the posterior covariance; and where
that step was not small another chord, or damped steps.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from abi_operator import State
from abi_operator.machine.sizes import chunk_of_pixels
from abi_operator.machine.speed import Kept

from .chunks import map_chunks, with_rows
from .forward import ForwardModel
from .inverse import DEFAULT_MINIMISER, Inversion, Linear, Pixel
from .observation import Observation
from .prior import Prior
from .rounds import Inputs

_LAST_STEP = 0.05
"""Largest step that may be the last, in posterior standard deviations. What is left is the square
of it times the forward model's curvature, which is below 1 where error bars mean anything."""

FEWEST_STEPS = 2
"""Evaluations that all pixels take: a chord and a tangent."""

_MOST_DAMPED = 0.4  # share of all steps, which few pixels need

_MANY = 256  # pixels a chunk, where there are as many: to begin and to end one takes milliseconds


class Moved(NamedTuple):
    """After a step with a Jacobian of elsewhere: x, what is left of the residuals, and whether the
    step is small. [-]
    """

    x: Float[Array | np.ndarray, "*batch x"]
    left: Float[Array | np.ndarray, "*batch residual"]
    near: Bool[Array | np.ndarray, "*batch"]


class Found(eqx.Module):
    """After a step of Gauss and Newton, and all residuals where that began."""

    inversion: Inversion
    here: Linear


def finish(
    forward: ForwardModel,
    inputs: tuple[Prior, Observation, State],
    x: np.ndarray,
    jacobian: np.ndarray,
    num_steps: np.ndarray,
    max_steps: int = DEFAULT_MINIMISER.max_steps,
) -> Inversion:
    """Take the last steps; `converged` where the very last is small.

    Parameters
    ----------
    forward
        The forward model.
    inputs
        Priors, measurements and states of the pixels.
    x, jacobian
        Where they have come to, and slopes of all residuals in z that are right nearly. [-]
    num_steps
        Evaluations so far. [-]
    max_steps
        How many there may be in all, of which two are taken anyway. [-]
    """
    chunk = chunk_size(len(x))
    chord, tangent = partial(_chord_chunk, forward), partial(_tangent_chunk, forward)
    moved = map_chunks(chord, *inputs, x, jacobian, chunk=chunk)
    found = map_chunks(tangent, *inputs, moved.x, chunk=chunk)
    found = eqx.tree_at(lambda f: f.inversion.num_steps, found, num_steps + FEWEST_STEPS)
    rows = _left(found, max_steps)
    if rows.size:
        some, before = jax.tree.map(lambda x: x[rows], (inputs, found))
        there = before.inversion.x, before.here.jacobian
        moved = map_chunks(chord, *some, *there, chunk=chunk)
        after = eqx.tree_at(lambda f: f.inversion, before, _after_chord(before.inversion, moved))
        found = jax.tree.map(partial(with_rows, rows), found, after)
    return _damped(partial(map_chunks, tangent, chunk=chunk), inputs, found, max_steps)


def _after_chord(before: Inversion, moved: Moved) -> Inversion:
    """What has been found: the chord's end with its costs where the step was small."""
    num_bands = moved.left.shape[1] - moved.x.shape[1]
    measurement, prior = np.split(np.asarray(moved.left) ** 2, [num_bands], axis=1)
    near = np.asarray(moved.near)
    found = np.asarray(moved.x), measurement.sum(axis=1), prior.sum(axis=1)
    then = map(np.asarray, (before.x, before.measurement_cost, before.prior_cost))
    return eqx.tree_at(
        lambda i: (i.x, i.measurement_cost, i.prior_cost, i.num_steps, i.converged),
        before,
        (*map(partial(_chosen, near), found, then), before.num_steps + 1, near),
    )


def _damped(
    tangent: Callable[..., Found],
    inputs: tuple[Prior, Observation, State],
    found: Found,
    max_steps: int,
) -> Inversion:
    """Go on with the pixels that have not converged, by Levenberg's damped steps."""
    damping = np.zeros(len(found.inversion.x))
    for _ in range(int(_MOST_DAMPED * max_steps)):
        rows = _left(found, max_steps)
        if rows.size == 0:
            break
        some, before = jax.tree.map(lambda x, rows=rows: x[rows], (inputs, found))
        z, residual, jacobian = before.here
        normal = np.einsum("pri,prj->pij", jacobian, jacobian)
        normal += damping[rows, None, None] * np.eye(z.shape[1])
        step = -np.linalg.solve(normal, np.einsum("pri,pr->pi", jacobian, residual)[..., None])
        moved = np.linalg.cholesky(some[0].S_prior) @ (z[..., None] + step)
        after = tangent(*some, some[0].x_prior + moved[..., 0])
        better = np.sum(after.here.residual**2, axis=1) <= np.sum(residual**2, axis=1)
        after = jax.tree.map(partial(_chosen, better), after, before)
        num_steps = before.inversion.num_steps + 1
        after = eqx.tree_at(lambda f: f.inversion.num_steps, after, num_steps)
        found = jax.tree.map(partial(with_rows, rows), found, after)
        more, less = np.maximum(10 * damping[rows], 0.1), 0.1 * damping[rows]
        damping[rows] = np.where(better, np.where(less < 1e-2, 0, less), more)
    return found.inversion


def _left(found: Found, max_steps: int) -> np.ndarray:
    """Pixels that have not converged, and may."""
    inversion = found.inversion
    left = ~inversion.converged & (inversion.num_steps < max_steps)
    return np.flatnonzero(left & np.isfinite(inversion.cost))


def _chosen(choice: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Rows of one where chosen, and of the other elsewhere."""
    return np.where(choice.reshape(-1, *[1] * (one.ndim - 1)), one, other)


def prepare_to_finish(forward: ForwardModel, inputs: Inputs, x: np.ndarray) -> None:
    """Compile what takes longest of `finish`, to be done while something else compiles, too."""
    _tangent_chunk.prepare(forward, *_first_chunk((*inputs, x), len(x)))


def prepare_chord(
    forward: ForwardModel, inputs: Inputs, x: np.ndarray, jacobian: np.ndarray
) -> None:
    """The same of the rest."""
    _chord_chunk.prepare(forward, *_first_chunk((*inputs, x, jacobian), len(x)))


def _first_chunk(arrays: Any, num_pixels: int) -> Any:
    rows = np.minimum(np.arange(chunk_size(num_pixels)), num_pixels - 1)
    return jax.tree.map(lambda y: np.asarray(y)[rows], arrays)


def chunk_size(num_pixels: int) -> int:
    """Pixels that are taken together, of so many."""
    few = chunk_of_pixels()
    return few if num_pixels <= 4 * few else max(few, _MANY)


@Kept
def _chord_chunk(
    forward: ForwardModel,
    prior: Prior,
    observations: Observation,
    states: State,
    x: jax.Array,
    jacobian: jax.Array,
) -> Moved:
    def of_one(
        prior: Prior, observation: Observation, state: State, x: Array, jacobian: Array
    ) -> Moved:
        pixel = Pixel.of(forward, observation, state, x, prior)
        z = pixel.z(x)
        here = Linear(z, pixel(z), jacobian)
        near = in_sigmas(jacobian, here.step) < _LAST_STEP
        return Moved(pixel.x(z + here.step), here.left, near)

    return jax.vmap(of_one)(prior, observations, states, x, jacobian)


@Kept
def _tangent_chunk(
    forward: ForwardModel, prior: Prior, observations: Observation, states: State, x: jax.Array
) -> Found:
    def of_one(prior: Prior, observation: Observation, state: State, x: Array) -> Found:
        pixel = Pixel.of(forward, observation, state, x, prior)
        here = pixel.linear(pixel.z(x))
        small = in_sigmas(here.jacobian, here.step) < _LAST_STEP
        inversion = pixel.inversion(here, jnp.ones((), int), jnp.array(True))
        return Found(eqx.tree_at(lambda i: i.converged, inversion, small), here)

    return jax.vmap(of_one)(prior, observations, states, x)


def in_sigmas(jacobian: Array, step: Array) -> Array:
    """Length of a step in posterior standard deviations. [-]"""
    return jnp.sqrt(jnp.sum((jacobian @ step) ** 2))
