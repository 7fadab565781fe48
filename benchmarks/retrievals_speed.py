"""How fast retrievals are: pixels a second that are right, beside the same inversion by CDISORT.

    python benchmarks/retrievals_speed.py [--pixels 10000] [--streams 8] [--check]

Optical depth, single-scattering albedo and effective radius of smoke from C01 C02 C03, with the
imager's noise and a prior, at random pixels of which everything is a pixel's own (geometry, albedo,
air of 20 layers; `retrievals_pixels.py`). All begin at the mean of the prior. A pixel counts where
it has converged and lies within 0.1 posterior standard deviations of a tight solve by the whole
forward model (tolerance 1e-5, no coarse steps, nothing left out).

- ours: `retrieve_pixels`, with an error budget of 1e-4; the median of three runs after one that
  compiles. `plain` makes all steps by the whole forward model instead.
- where the time goes: of the operator, as many evaluations as were made, alone and in the same
  chunks; the rest is the optimiser, waiting for the slowest pixel of a chunk included.
- CDISORT: nanodisort at as many streams with 129 moments in one process a core, Jacobians by
  differences, steps of Gauss and Newton, shortened where the cost rises, that end as ours do;
  pixels leave as they converge. Optics are this project's. Ours are on its nodes too
  (`solver.on_double_gauss`), so that both have the same minimum.
- cold: a process of its own with an empty folder of compiled programs, from its start to the first
  `--first-pixels` solutions.

`--check` exits with 1 below 1,000 right pixels/s or above 30 s.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import jax
import numpy as np
from peers import Peers
from retrievals_pixels import pixels_of_prior, rows, with_prior
from workload import near_node

from abi_operator.band_columns import columns_of_bands
from abi_operator.machine.speed import usable_cores, use_compilation_cache
from abi_operator.solver import on_double_gauss
from retrievals import Minimiser, measurement, prepared, retrieve_pixels
from retrievals.chunks import map_chunks
from retrievals.coarse_to_fine import coarse, minimise_coarsely
from retrievals.inverse import value_and_jacobian
from retrievals.last_steps import chunk_size, finish

NAMES = ("aod_550", "ssa_shift", "effective_radius_um")
BUDGET, RIGHT, LAST_STEP = 1e-4, 0.1, 0.05
NUM_MOMENTS, DIFFERENCE = 129, 1e-3
LEAST_RATE, LONGEST_START = 1000, 30
QUICK = Minimiser(starts="prior")
TIGHT = Minimiser(1e-5, 80, starts="prior", coarse_to_fine=False)


def seconds(function, repeats=3):
    """Median of the seconds that a call takes, after one that compiles."""
    function()
    found = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        found.append(time.perf_counter() - start)
    return float(np.median(found))


def share_right(x, converged, tight):
    """Share of pixels that count."""
    sigma = np.sqrt(np.diagonal(tight.covariance, axis1=1, axis2=2))
    return np.mean(converged & (np.abs(x - tight.x) <= RIGHT * sigma).all(axis=1))


def evaluation(forward, what):
    """The forward model, alone or with its Jacobian, of pixels."""

    def of_one(x, state):
        if what == "value":
            return forward(x, state)
        return value_and_jacobian(partial(forward, state=state), x)

    return jax.jit(jax.vmap(of_one))


def split(forward, observation, states, prior, total):
    """Print where the time goes; `total` is the time of a retrieval. [s]"""
    num_pixels = len(observation.measured)
    own = prior.of_pixels(num_pixels, NAMES)
    inputs = own, observation, states
    begun = minimise_coarsely(coarse(forward), QUICK.chosen(True), inputs, own.x_prior)
    found = finish(forward, inputs, begun.x, begun.jacobian, begun.num_steps)
    counts = begun.num_steps.mean(), (found.num_steps - begun.num_steps).mean() - 1, 1
    kinds = (coarse(forward), "slopes"), (forward, "value"), (forward, "slopes")
    operator = 0.0
    print("\n| evaluated | streams | times a pixel | us a pixel |\n| --- | --- | --- | --- |")
    for (model, what), count in zip(kinds, counts, strict=True):
        run = evaluation(model, what)
        chunk = chunk_size(num_pixels)
        each = seconds(partial(map_chunks, run, found.x, states, chunk=chunk)) / num_pixels
        operator += count * each * num_pixels
        print(f"| {what} | {model.num_streams} | {count:.2f} | {1e6 * count * each:.0f} |")
    print(
        f"\noperator {100 * operator / total:.0f} % of the time, optimiser "
        f"{100 * (1 - operator / total):.0f} %"
    )


class ByCdisort:
    """Residuals of pixels, whitened, and their differences, by nanodisort."""

    def __init__(self, peers, forward, observation, states, prior):
        self.peers, self.forward = peers, forward
        self.observation, self.states, self.prior = observation, states, prior
        self.root = np.linalg.cholesky(prior.S_prior)
        self.num_solved = 0

        def layers(x, state):
            full = forward.state(x, state)
            (columns,) = columns_of_bands(full, forward.bands, forward.gases, NUM_MOMENTS)
            return {k: v for k, v in columns.arguments.items() if k != "phase_function"}

        self.layers = jax.jit(jax.vmap(jax.vmap(layers, (0, None))))

    def __call__(self, pixels, z):
        """Residuals (pixel, residual) and Jacobian (pixel, residual, z) of some pixels."""
        size = z.shape[1]
        moved = z[:, None] + DIFFERENCE * np.concatenate([np.zeros((1, size)), np.eye(size)])
        x = self.prior.x_prior + moved @ self.root.T
        # As many as ever, so that optics are compiled once.
        fill = np.resize(np.arange(len(pixels)), len(self.observation.measured))
        arrays = self.layers(x[fill], rows(self.states, pixels[fill]))
        arrays = {k: np.asarray(v)[: len(pixels)] for k, v in arrays.items()}
        arrays["azimuth"] = arrays.pop("relative_azimuth")
        flat = {k: v.reshape(-1, *v.shape[3:]) for k, v in arrays.items()}
        count = len(flat["tau"])
        self.peers.put_arrays({k: flat[k] for k in self.order})
        brf = self.peers.solve("nanodisort", self.forward.num_streams, count)[0]
        self.num_solved += count
        seen = (brf * flat["mu0"]).reshape(len(pixels), size + 1, -1)
        measured = self.observation.measured[pixels, None]
        whitened = (seen - measured) / self.observation.sigma[pixels, None]
        residual = np.concatenate([whitened, moved], axis=2)
        slopes = (residual[:, 1:] - residual[:, :1]) / DIFFERENCE
        return residual[:, 0], np.swapaxes(slopes, 1, 2)

    order = ("tau", "ssa", "moments", "albedo", "mu0", "mu", "azimuth")


def gauss_newton(function, num_pixels, size, max_steps=30):
    """Minima of all pixels, (pixel, z), and which have converged."""
    best, candidate = np.zeros((2, num_pixels, size))
    step, cost = np.zeros((num_pixels, size)), np.full(num_pixels, np.inf)
    radius, converged = np.ones(num_pixels), np.zeros(num_pixels, bool)
    for _ in range(max_steps):
        pixels = np.flatnonzero(~converged)
        if pixels.size == 0:
            break
        residual, jacobian = function(pixels, candidate[pixels])
        new = np.sum(residual**2, axis=1)
        better = new <= cost[pixels]
        normal = np.einsum("pij,pik->pjk", jacobian, jacobian)
        right = np.einsum("pij,pi->pj", jacobian, residual)
        found = -np.linalg.solve(normal, right[..., None])[..., 0]
        length = np.linalg.norm(np.einsum("pij,pj->pi", jacobian, found), axis=1)
        worse = pixels[~better]
        radius[worse] = 0.25 * np.minimum(np.linalg.norm(step[worse], axis=1), radius[worse])
        pixels = pixels[better]
        best[pixels], step[pixels], cost[pixels] = candidate[pixels], found[better], new[better]
        ended = pixels[length[better] < LAST_STEP]
        best[ended] += step[ended]
        converged[ended] = True
        norms = np.linalg.norm(step, axis=1)
        share = np.minimum(1, radius / np.where(norms > 0, norms, 1))
        candidate = best + share[:, None] * step
    return best, converged


def by_cdisort(forward, observation, states, prior, num_pixels, tight):
    """Right pixels a second of the same inversion by nanodisort, and what it took."""
    chosen = np.flatnonzero(~near_node(np.cos(states.geometry.solar_zenith)))[:num_pixels]
    some = rows((observation, states), chosen)
    size = len(NAMES)
    columns = len(chosen) * len(forward.bands) * (size + 1)
    num_layers = states.atmosphere.height.shape[1] - 1
    with Peers(usable_cores(), columns, num_layers, NUM_MOMENTS) as peers:
        function = ByCdisort(peers, forward, *some, prior)
        function(np.arange(len(chosen)), np.zeros((len(chosen), size)))  # compiles, starts
        function.num_solved = 0
        start = time.perf_counter()
        z, converged = gauss_newton(function, len(chosen), size)
        taken = time.perf_counter() - start
    x = prior.x_prior + z @ function.root.T
    right = share_right(x, converged, rows(tight, chosen))
    return right, right * len(chosen) / taken, function.num_solved / len(chosen), len(chosen)


def cold_start(num_pixels, streams, measured):
    """Seconds that a process takes which has compiled nothing: by the clock, of processors."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"JAX_COMPILATION_CACHE_DIR": folder}
        np.save(Path(folder) / "measured.npy", measured[:num_pixels])
        command = [sys.executable, __file__, "--first", str(Path(folder) / "measured.npy")]
        start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        command += ["--streams", str(streams), "--pixels", str(len(measured))]
        subprocess.run(command, env=environment, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return time.perf_counter() - start, after.ru_utime - before.ru_utime


def first(given):
    """Retrieve what has been measured at the first pixels, as `with_prior` makes them."""
    measured = np.load(given.first)
    forward, states, prior, _, _ = pixels_of_prior(given.pixels, given.streams, NAMES)
    states = rows(states, slice(len(measured)))
    forward = replace(prepared(forward, states), error_budget=BUDGET)
    observation = measurement(measured, forward.bands)
    retrieve_pixels(forward, observation, states, prior=prior, minimiser=QUICK)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pixels", type=int, default=10_000)
    parser.add_argument("--streams", type=int, default=8)
    parser.add_argument("--peer-pixels", type=int, default=96)
    parser.add_argument("--first-pixels", type=int, default=1000)
    parser.add_argument("--plain", action="store_true", help="also without coarse steps")
    parser.add_argument("--first", help="retrieve once what this file holds, and end")
    parser.add_argument("--check", action="store_true")
    given = parser.parse_args()
    use_compilation_cache()
    jax.config.update("jax_enable_x64", True)
    if given.first:
        first(given)
        return
    with on_double_gauss():
        side_by_side(given)


def side_by_side(given):
    """The table, and where the time goes."""
    whole, observation, states, prior, _ = with_prior(given.pixels, given.streams, NAMES)
    forward = replace(whole, error_budget=BUDGET)
    retrieve = partial(retrieve_pixels, observations=observation, states=states, prior=prior)
    tight = retrieve(whole, minimiser=TIGHT).inversion
    print(
        f"{given.pixels} pixels, {given.streams} streams, {usable_cores()} cores; tight solve: "
        f"{100 * np.mean(tight.converged):.2f} % converged, {np.mean(tight.num_steps):.1f} steps\n"
    )
    print(f"| inversion | pixels | evaluations | right [%] | right pixels/s |\n|{' --- |' * 5}")
    kinds = {"coarse to fine": QUICK}
    if given.plain:
        kinds["plain"] = QUICK._replace(coarse_to_fine=False)
    taken = {}
    for label, how in kinds.items():
        found = retrieve(forward, minimiser=how).inversion
        taken[label] = seconds(partial(retrieve, forward, minimiser=how))
        right = share_right(found.x, found.converged, tight)
        rate = right * given.pixels / taken[label]
        print(
            f"| {label} | {given.pixels} | {np.mean(found.num_steps):.2f} | {100 * right:.2f} | "
            f"{rate:,.0f} |",
            flush=True,
        )
        taken[label, "rate"] = rate
    right, rate, solved, count = by_cdisort(
        whole, observation, states, prior, given.peer_pixels, tight
    )
    print(
        f"| CDISORT | {count} | {solved / len(forward.bands):.1f} | {100 * right:.2f} | "
        f"{rate:,.1f} |"
    )
    split(forward, observation, states, prior, taken["coarse to fine"])
    cold, processor = cold_start(given.first_pixels, given.streams, observation.measured)
    print(
        f"\ncold start to {given.first_pixels} solutions: {cold:.1f} s, of which the processors "
        f"worked {processor:.1f} s"
    )
    missed = [taken["coarse to fine", "rate"] < LEAST_RATE, cold > LONGEST_START]
    print(f"\n{2 - sum(missed)} bars held, {sum(missed)} missed")
    if given.check and any(missed):
        sys.exit(1)


if __name__ == "__main__":
    main()
