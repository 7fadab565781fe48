"""The columns of `solver.py`, and what is run of this project on them.

Every program takes and gives NumPy arrays: moving them to the device, transposing them and reading
the results back are part of its time.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from abi_operator import use_full_speed
from abi_operator.solver import cos_scattering_angle, double_gauss, toa_brf

MAX_TAU, MIN_MU, MAX_MU = 30.0, 0.2, 0.95
MOST_STREAMS = 64
NODE_DISTANCE = 5e-4  # relative; CDISORT refuses a sun within 1e-4 of one of its own directions
NUM_STATES, NUM_BANDS, NUM_VIEWS = 10, 3, 3


@dataclass(frozen=True)
class Columns:
    """Layers with Henyey-Greenstein phase functions; one sun and view a column."""

    tau: np.ndarray
    ssa: np.ndarray
    asymmetry: np.ndarray
    albedo: np.ndarray
    mu0: np.ndarray
    mu: np.ndarray
    relative_azimuth: np.ndarray

    def moments(self, count):
        return self.asymmetry[..., None] ** np.arange(count)

    def first(self, count):
        return Columns(*(x[:count] for x in vars(self).values()))

    def with_geometry_of_first(self):
        names = ("mu0", "mu", "relative_azimuth")
        same = {k: np.full_like(getattr(self, k), getattr(self, k)[0]) for k in names}
        return replace(self, **same)


def columns(count, num_layers, seed):
    """Random columns, every layer different: tau 1e-3 to 3, and 30 in one layer at a random place.

    Absorption is weak enough that no solver cuts the column off (CDISORT does at a depth of 10).
    """
    rng = np.random.default_rng(seed)
    shape = (count, num_layers)
    tau = 10 ** rng.uniform(-3, np.log10(3), shape)
    ssa, asymmetry = rng.uniform(0.8, 1, shape), rng.uniform(0.3, 0.8, shape)
    cloud = np.arange(count), rng.integers(num_layers, size=count)
    tau[cloud], ssa[cloud] = MAX_TAU, rng.uniform(0.99, 0.9999, count)
    mu0 = rng.uniform(MIN_MU, MAX_MU, count)
    while (near := near_node(mu0)).any():
        mu0[near] = rng.uniform(MIN_MU, MAX_MU, near.sum())
    mu, azimuth = rng.uniform(MIN_MU, MAX_MU, count), rng.uniform(0, np.pi, count)
    return Columns(tau, ssa, asymmetry, rng.uniform(0, 0.6, count), mu0, mu, azimuth)


@cache
def _nodes():
    every = [double_gauss(n)[0] for n in range(2, MOST_STREAMS + 2, 2)]
    return np.sort(np.concatenate([[0], *every, [1]]))


def near_node(mu):
    """Whether a cosine is near a direction of any number of streams up to 64."""
    above = np.searchsorted(_nodes(), mu)
    beside = _nodes()[above - 1], _nodes()[above]
    return np.min([np.abs(mu / x - 1) for x in beside], axis=0) < NODE_DISTANCE


def henyey_greenstein(asymmetry, cosine):
    return (1 - asymmetry**2) / (1 + asymmetry**2 - 2 * asymmetry * cosine) ** 1.5


def num_doublings(num_streams):
    """For layers up to tau = 3 and one of 30, right to 1e-5; see `doublings.start_coefficient`."""
    return 2 if num_streams <= 8 else 3


def use_all_cores():
    """Float64, and full speed for programs under `jax.jit`, tuned by hand.

    Threads of XLA stay each on a core, as the processes of the other solvers do: after a pause
    Linux often wakes two on one core, and takes longer to part them than a call lasts.
    """
    jax.config.update("jax_enable_x64", True)
    found = use_full_speed()
    jax.block_until_ready(jax.numpy.zeros(1) + 1)
    cores = sorted(os.sched_getaffinity(0))
    threads = [int(x.name) for x in Path("/proc/self/task").iterdir()]
    workers = [t for t in threads if "XLAEigen" in Path(f"/proc/{t}/comm").read_text()]
    for k, thread in enumerate(sorted(workers)):
        os.sched_setaffinity(thread, {cores[k % len(cores)]})
    return found.cores


def arguments(given: Columns, num_streams, dtype=np.float64, series=None):
    """What `toa_brf` is given: its seven arrays and the phase function at the scattering angle.

    `series`: so many moments and no phase function instead, as the other solvers are given.
    """
    angle = np.asarray(cos_scattering_angle(given.mu0, given.mu, given.relative_azimuth))
    arrays = [given.tau, given.ssa, given.moments(series or num_streams + 1), given.albedo]
    arrays += [given.mu0, given.mu, given.relative_azimuth]
    if not series:
        arrays.append(henyey_greenstein(given.asymmetry, angle[:, None]))
    return tuple(np.ascontiguousarray(x, dtype) for x in arrays)


def solve(*arrays, **options):
    phase = arrays[7] if len(arrays) > 7 else None
    return toa_brf(*arrays[:7], phase_function=phase, **options)


def read_back(tree):
    return jax.tree.map(np.asarray, tree)


def value(options) -> Callable[..., Any]:
    """brf by the batched call itself, not under any `jax.jit` of the caller."""
    return lambda *arrays: np.asarray(solve(*arrays, **options))


def jitted_value(options):
    """The same under a `jax.jit` of the caller's."""
    program = jax.jit(partial(solve, **options))
    return lambda *arrays: np.asarray(program(*arrays))


def _summed(options, single_call):
    def total(arrays):
        brf = single_call(arrays, options)
        return brf.sum(), brf

    return total


def _batched(arrays, options):
    return solve(*arrays, **options)


def _mapped(arrays, options):
    return jax.vmap(partial(solve, **options))(*arrays)


def gradient(options, call=_batched):
    """brf and its gradient in every argument; columns do not mix, so that of the sum is enough."""
    program = jax.jit(jax.value_and_grad(_summed(options, call), has_aux=True))

    def run(*arrays):
        (_, brf), slopes = read_back(program(arrays))
        return brf, slopes

    return run


def mapped_value(options):
    program = jax.jit(partial(_mapped, options=options))
    return lambda *arrays: np.asarray(program(arrays))


def mapped_gradient(options):
    """`jax.vmap` of the gradient of the call for one column."""

    def column(arrays):
        brf, slopes = jax.value_and_grad(lambda x: solve(*x, **options))(arrays)
        return brf, slopes

    program = jax.jit(jax.vmap(column))
    return lambda *arrays: read_back(program(arrays))


def view_arguments(given: Columns, num_streams):
    """The arguments with `NUM_VIEWS` views of every column, the first of them its own."""
    arrays = list(arguments(given, num_streams))
    steps = np.arange(NUM_VIEWS)
    mu = MIN_MU + (given.mu[:, None] - MIN_MU + 0.2 * steps) % (MAX_MU - MIN_MU)
    azimuth = (given.relative_azimuth[:, None] + steps) % np.pi
    angle = np.asarray(cos_scattering_angle(given.mu0[:, None], mu, azimuth))
    phase = henyey_greenstein(given.asymmetry[..., None], angle[:, None])
    return (*arrays[:5], mu, azimuth, phase)


def view_value(options):
    """brf of each column's own view, the first; all are read back."""
    return lambda *arrays: np.asarray(solve(*arrays, multiple_views=True, **options))[:, 0]


def view_jacobian(options):
    """The same, and the derivative of every view in every argument, by reverse mode."""

    def totals(arrays):
        brf = solve(*arrays, multiple_views=True, **options)
        return brf.sum(axis=0), brf

    program = jax.jit(jax.jacrev(totals, has_aux=True))

    def run(*arrays):
        jacobian, brf = read_back(program(arrays))
        return brf[:, 0], jacobian

    return run


def state_jacobian(options, transform, num_layers):
    """d brf / d state of `NUM_BANDS` bands, pixel by pixel under `jax.vmap`.

    The state bends tau, single-scattering albedo, asymmetry of every layer and the ground's albedo
    of all bands, by fixed random weights; at state 0 they are those given. Phase functions and
    moments follow the asymmetry.
    """
    rng = np.random.default_rng(2)
    weights = 0.1 * rng.standard_normal((3, NUM_BANDS, num_layers, NUM_STATES))
    ground = 0.1 * rng.standard_normal((NUM_BANDS, NUM_STATES))
    num_moments = options["num_streams"] + 1

    def bands(state, pixel):
        tau, ssa, asymmetry, albedo, mu0, mu, azimuth = pixel
        bent = weights @ state
        asymmetry = asymmetry * jnp.exp(bent[2])
        phase = henyey_greenstein(asymmetry, cos_scattering_angle(mu0, mu, azimuth)[:, None])
        moments = asymmetry[..., None] ** jnp.arange(num_moments)
        ground_albedo = albedo * jnp.exp(ground @ state)
        layers = tau * jnp.exp(bent[0]), 1 - (1 - ssa) * jnp.exp(bent[1]), moments
        return solve(*layers, ground_albedo, mu0, mu, azimuth, phase, **options)

    def twice(state, pixel):
        brf = bands(state, pixel)
        return brf, brf

    # The value comes from the program that computes the Jacobian, as its auxiliary result.
    program = jax.jit(jax.vmap(transform(twice, has_aux=True)))

    def run(given: Columns):
        pixels = len(given.mu0) // NUM_BANDS
        arrays = [x[: pixels * NUM_BANDS] for x in vars(given).values()]
        arrays = [x.reshape(pixels, NUM_BANDS, *x.shape[1:]) for x in arrays]
        jacobian, brf = read_back(program(np.zeros((pixels, NUM_STATES)), arrays))
        return brf.ravel(), jacobian

    return run


def difference_quotient(given: Columns, seed, step):
    """Columns a step to either side along a random direction of all their numbers."""
    rng = np.random.default_rng(seed)
    names = list(vars(given))
    relative = {k: rng.choice([-1.0, 1.0], getattr(given, k).shape) for k in names}
    relative["ssa"] = -np.abs(relative["ssa"]) * (1 - given.ssa)  # stays below 1
    return [
        replace(given, **{k: getattr(given, k) * (1 + s * step * relative[k]) for k in names})
        for s in (1, -1)
    ]
