"""Retrievals against the known truth: closure and calibration.

    python benchmarks/retrievals_against_truth.py [--pixels 512] [--streams 8] [--only NAMES]
                                                  [--rows 1 2 3 4 5 6]

Random pixels of `benchmarks/retrievals_pixels.py`: clear air of 20 layers, everything a pixel's own
(sun to 75 degrees, view to 70, albedo 0.01 to 0.4 in every band). Float64. Names are closure, fire,
starts and calibration; without any all run, in some five minutes for 1,024 pixels on two cores.

- closure: no noise and no prior, from C01 C02 C03, and three unknowns from C01 C02 C03 C05 C06 as
  well; aod_550 0.05 to 4, ssa 0.80 to 0.99 in C01, effective radius over the most of a table.
  Printed are the shares of pixels whose optical depth is right within 1e-3 at the solution, and at
  it or the second solution; whose brf fits within 1e-9; that fit and are wrong, which are second
  roots, and of these how many are coded as having multiple solutions; then second roots by albedo
  (the mean of the bands). Pixels of which no band tells (d brf / d ln aod below 1e-6) are counted
  apart.
- fire closure: C05 C06 C07, 450 to 1,200 K, fraction 1e-4 to 0.04, by day, unsaturated pixels.
- starts: the pixels of the calibration, from one start each, whose optical depth is ten times too
  large (up to nearly the limit of the retrieval) or too small.
- calibration: truth drawn from the prior (0.7 in ln aod, 0.5 in the logit of ssa), the imager's
  noise; a pixel that did not converge is not covered. The linearity test is that of
  `optimal_estimation`; coverage is that of its error bars, and that of the intervals of
  `retrievals.intervals`. In bins of the true optical depth coverage need not be that of all: a
  prior pulls the extremes inwards.
"""

import argparse
import time
from functools import partial
from itertools import pairwise

import jax
import numpy as np
from retrievals_pixels import BANDS, random_states, with_prior

from abi_operator import Atmosphere, Fire, LiquidCloud, State
from abi_operator.machine.speed import use_compilation_cache, use_compiler_flags
from retrievals import (
    ForwardModel,
    Observation,
    ResultCode,
    measurement,
    prepared,
    retrieve_pixels,
)
from retrievals.declarations import AOD_LIMIT, fire, plume
from retrievals.input_checks import checked
from retrievals.intervals import posterior_intervals
from retrievals.inverse import DEFAULT_MINIMISER
from retrievals.optimal_estimation import LARGEST_NONLINEARITY, estimates
from retrievals.rounds import minimise

SECONDS = "seconds for all, compiling too"
MORE_BANDS = (*BANDS, "C05", "C06")
ALBEDOS = (0.0, 0.1, 0.2, 0.3, 0.4)
RADII = {"smoke": (0.08, 0.3), "ash": (0.6, 8.0)}


def percent(chosen):
    return f"{100 * np.mean(chosen):.2f}"


def truth_of(rng, states, species, names):
    """True values of the quantities of a plume, by name."""
    n = len(states.geometry.solar_zenith)
    ssa, known = rng.uniform(0.80, 0.99, n), states.atmosphere.plumes[species].ssa["C01"]
    values = {
        "aod_550": np.exp(rng.uniform(np.log(0.05), np.log(4), n)),
        "ssa_shift": np.log(ssa / (1 - ssa)) - np.log(known / (1 - known)),
        "effective_radius_um": np.exp(rng.uniform(*np.log(RADII[species]), n)),
    }
    return [values[name] for name in names]


CLOSURES = (
    ("smoke", False, False, BANDS),
    ("ash", False, False, BANDS),
    ("smoke", True, False, BANDS),
    ("ash", True, False, BANDS),
    ("smoke", True, True, BANDS),
    ("smoke", True, True, MORE_BANDS),
)
"""Species, whether ssa and effective radius are unknown beside optical depth, and bands."""


def closure(num_pixels, streams, chosen):
    heads = ("retrieved", "bands", "blind", "aod, first", "aod, either", "brf 1e-9", "second roots")
    heads += ("coded so", "steps", SECONDS)
    print(f"\nshares of {num_pixels} pixels [%]:\n\n| {' | '.join(heads)} |")
    print(f"|{' --- |' * len(heads)}")
    roots = {}
    for species, ssa, radius, bands in [CLOSURES[k - 1] for k in chosen]:
        rng = np.random.default_rng(7)
        states = random_states(rng, num_pixels, bands, species)
        vector = plume(species, ssa=ssa, effective_radius=radius)
        truth = truth_of(rng, states, species, vector.names)
        forward = prepared(ForwardModel(vector, bands, streams, gases=()), states)
        x, sun = np.asarray(vector.x(*truth)), np.cos(states.geometry.solar_zenith)[:, None]
        seen = np.asarray(forward(x, states))
        more = np.asarray(forward(np.asarray(vector.x(truth[0] * 1.01, *truth[1:])), states))
        blind = (np.abs(more - seen) / sun).max(axis=1) < 0.01 * 1e-6
        sigma = measurement(seen, bands).sigma
        start = time.perf_counter()
        found = retrieve_pixels(forward, Observation(seen, sigma), states, exact=True)
        seconds = time.perf_counter() - start
        aod = [np.asarray(vector.values(s.x)["aod_550"]) for s in (found.inversion, found.other)]
        wrong = [np.abs(x - truth[0]) for x in aod]
        departure = np.abs(np.asarray(forward(found.inversion.x, states)) - seen) / sun
        fits = departure.max(axis=1) <= 1e-9
        second = fits & (wrong[0] > 1e-3)
        coded = found.codes[second] == ResultCode.MULTIPLE_SOLUTIONS
        cells = (
            percent(blind),
            percent(wrong[0][~blind] <= 1e-3),
            percent(np.minimum(*wrong)[~blind] <= 1e-3),
            percent(fits[~blind]),
            percent(second),
            percent(coded) if second.any() else "",
            f"{np.mean(found.inversion.num_steps):.1f}",
            f"{seconds:.0f}",
        )
        label = f"{species}: {', '.join(vector.names)} | {len(bands)}"
        print(f"| {label} | {' | '.join(cells)} |", flush=True)
        if second.any():
            roots[label] = second, np.mean([states.albedo[band] for band in bands], axis=0)
    print("\nsecond roots by mean albedo [%]:\n\n| retrieved | bands |", end="")
    print("".join(f" {low:g} to {high:g} |" for low, high in pairwise(ALBEDOS)))
    print(f"|{' --- |' * (len(ALBEDOS) + 1)}")
    for label, (second, albedo) in roots.items():
        shares = [
            percent(second[(albedo > low) & (albedo <= high)]) for low, high in pairwise(ALBEDOS)
        ]
        print(f"| {label} | {' | '.join(shares)} |", flush=True)


def fire_closure(num_pixels, streams):
    rng, bands = np.random.default_rng(9), ("C05", "C06", "C07")
    clear = random_states(rng, num_pixels, bands)
    air, n = clear.atmosphere, num_pixels
    temperature = np.linspace(210.0, 295.0, air.pressure.shape[1]) + rng.uniform(-8, 8, (n, 1))
    air = Atmosphere(
        air.pressure,
        air.height,
        LiquidCloud(air.liquid.mass_path, air.liquid.number_path),
        {},
        temperature=temperature,
    )
    truth = rng.uniform(450, 1200, n), np.exp(rng.uniform(np.log(1e-4), np.log(0.04), n))
    burning = Fire(np.full(n, 0.01), np.full(n, 700.0))
    states = State(air, clear.albedo, clear.geometry, temperature[:, -1] + 3, burning)
    vector = fire()
    forward = prepared(ForwardModel(vector, bands, streams, gases=()), states)
    observation = measurement(forward(vector.x(*truth), states), bands)
    start = time.perf_counter()
    found = retrieve_pixels(forward, observation, states, exact=True)
    seconds = time.perf_counter() - start
    fine = ~np.asarray(observation.saturated).any(axis=1)
    values = vector.values(found.inversion.x)
    kelvin = np.abs(np.asarray(values["fire_temperature"]) - truth[0])[fine]
    share = np.abs(np.asarray(values["fire_fraction"]) / truth[1] - 1)[fine]
    print(
        f"\nfires, {fine.sum()} unsaturated pixels: {percent((kelvin <= 0.1) & (share <= 1e-3))} % "
        f"within 0.1 K and 0.1 % of the fraction; {SECONDS}: {seconds:.0f}"
    )


def poor_starts(num_pixels, streams):
    names = ("aod_550", "ssa_shift")
    forward, observation, states, prior, truth = with_prior(num_pixels, streams, names)
    usual = retrieve_pixels(forward, observation, states, prior=prior).inversion
    diagnosed = estimates(forward, observation, states, usual.x, prior)
    sigma = np.sqrt(np.diagonal(diagnosed.posterior_covariance, axis1=1, axis2=2))
    _, observation, prior = checked(forward, observation, prior)
    aod = np.asarray(forward.vector.values(truth)["aod_550"])
    print(
        "\none start of a wrong optical depth, shares of pixels [%]:\n\n"
        "| times the true one | converged | as from the usual starts, within 0.1 sigma | "
        f"not finite, told | not finite, not told | steps, mean | most |\n|{' --- |' * 7}"
    )
    for factor in (10.0, 0.1):
        wrong = np.minimum(factor * aod, 0.99 * AOD_LIMIT)
        x_first = np.asarray(forward.vector.x(wrong, np.zeros(num_pixels)))
        minimiser = DEFAULT_MINIMISER.chosen(True)
        found = minimise(forward, minimiser, (prior, observation, states), x_first)
        same = np.all(np.abs(found.x - usual.x) <= 0.1 * sigma, axis=1)
        lost = ~np.isfinite(found.x).all(axis=1)
        cells = (
            f"{factor:g}",
            percent(found.converged),
            percent(same & found.converged),
            percent(lost & ~found.converged),
            percent(lost & found.converged),
            f"{np.mean(found.num_steps):.1f}",
            str(np.max(found.num_steps)),
        )
        print(f"| {' | '.join(cells)} |", flush=True)


def calibration(num_pixels, streams):
    names = ("aod_550", "ssa_shift")
    forward, observation, states, prior, truth = with_prior(num_pixels, streams, names)
    found = retrieve_pixels(forward, observation, states, prior=prior)
    inversion = found.inversion
    diagnosed = estimates(forward, observation, states, inversion.x, prior)
    linear = diagnosed.nonlinearity <= LARGEST_NONLINEARITY
    within = posterior_intervals(forward, observation, states, inversion.x, diagnosed, prior)
    sigma = np.sqrt(np.diagonal(diagnosed.posterior_covariance, axis1=1, axis2=2))
    inside = np.abs(inversion.x - truth)[:, None] <= np.array([1.0, 1.96])[:, None] * sigma[:, None]
    lowest, low, high, highest = np.moveaxis(within.bounds, 1, 0)
    between = np.stack([(low <= truth) & (truth <= high), (lowest <= truth) & (truth <= highest)])
    holds = np.stack([inside, np.moveaxis(between, 0, 1)], axis=1)  # pixel, way, width, quantity
    holds &= np.asarray(inversion.converged)[:, None, None, None]
    print(
        f"\ncalibration, {num_pixels} pixels of smoke with noise and prior: "
        f"{percent(inversion.converged)} % converged, mean of cost / m "
        f"{np.mean(inversion.cost) / len(BANDS):.3f}, linear {percent(linear)} %\n\n"
        "| pixels | quantity | within 1 sigma [%] | within 1.96 sigma [%] | in the 68 % interval | "
        f"in the 95 % interval |\n|{' --- |' * 6}"
    )
    aod = np.asarray(forward.vector.values(truth)["aod_550"])
    bins = [("all", np.ones(num_pixels, bool)), ("linear", linear), ("not linear", ~linear)]
    bins += [
        (f"linear, aod {low:g} to {high:g}", linear & (aod > low) & (aod <= high))
        for low, high in ((0, 0.2), (0.2, 0.5), (0.5, 1), (1, 10))
    ]
    for label, rows in bins:
        errors = [100 * np.sqrt(p * (1 - p) / max(rows.sum(), 1)) for p in (0.683, 0.95)]
        for i, name in enumerate(names):
            shares = [
                f"{percent(holds[rows, way, width, i])} +- {errors[width]:.1f}"
                for way in (0, 1)
                for width in (0, 1)
            ]
            print(f"| {label} ({rows.sum()}) | {name} | {' | '.join(shares)} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pixels", type=int, default=512)
    parser.add_argument("--streams", type=int, default=8)
    parser.add_argument("--only", default="closure,fire,starts,calibration")
    numbers = range(1, len(CLOSURES) + 1)
    parser.add_argument("--rows", type=int, nargs="+", choices=numbers, help="of the closure")
    arguments = parser.parse_args()
    use_compiler_flags()
    use_compilation_cache()
    jax.config.update("jax_enable_x64", True)
    studies = {
        "closure": partial(closure, chosen=arguments.rows or numbers),
        "fire": fire_closure,
        "starts": poor_starts,
        "calibration": calibration,
    }
    for name in arguments.only.split(","):
        studies[name](arguments.pixels, arguments.streams)


if __name__ == "__main__":
    main()
