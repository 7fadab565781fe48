"""Is what a faint column's light may miss what it does miss? The fit behind `skipping/faint.py`.

    python benchmarks/fit_faint.py [--constants _SCATTERED=1.66 _UNSURE=1 ...]

Columns that scatter little are not solved where an estimate of what that misses is within the
error budget. Here they are all solved, as are columns that scatter more than is ever called faint,
and the error is divided by its estimate: among columns whose estimate is within ten times the
budget, the median, the 99th percentile and the largest (an estimate of less than a thousandth of
what is allowed counts as that: there the error is rounding). Beside them stand the share that are
called faint at the budget, and the largest error of these, in parts of it. An estimate is good
whose 99th percentile is about 1: less of it would solve too much, more would break the budget.

Columns are those of `pareto_columns` and the extremes of `stress_columns`, of seeds below
`skipping.FIRST_SEED`, and the same with a tenth to a thousandth of their optical depth; W3's bands
that emit also with more scattering, with air of random temperatures, and at night under grazing
views over fires and ice. Constants that are named stand in for those of `faint` in a further set of
rows.
"""

import argparse
from functools import partial

import jax
import numpy as np
import pareto_ours as ours
from fit_budget import read, standing_in
from pareto_columns import columns
from rounds import table
from skipping import FIRST_SEED
from stress_columns import draw

from abi_operator.solver import toa_brf, toa_radiance
from abi_operator.solver.column import Options, aligned, promoted
from abi_operator.solver.glimpse import radiance, reflectance
from abi_operator.solver.skipping import budget, faint

SEED = 5
BUDGET = 1e-3
LOOKED_AT, LEAST = 10, 1e-3  # times what is allowed
THIN = (1, 0.1, 0.01, 0.001)
NUM_LAYERS = 36


def glimpsed(kind, door, arguments, num_streams):
    """Errors of light that nobody has solved, their estimates, and what both are relative to."""
    count = len(arguments["mu0"])
    full = {k: np.broadcast_to(x, (count, *np.shape(x)[1:])) for k, x in arguments.items()}
    column = aligned(promoted(**{k: np.moveaxis(x, 0, -1) for k, x in full.items()}), False)
    options = Options(num_streams, num_streams, True, True, None, error_budget=BUDGET)
    found = kind(column, options)
    whole = np.asarray(door(**arguments, num_streams=num_streams))
    return abs(np.asarray(found.light[0]) - whole), found.missing, found.least


of_sunlight = partial(glimpsed, reflectance, toa_brf)
of_heat = partial(glimpsed, radiance, toa_radiance)


def row(name, kind, arguments, num_streams):
    wrong, missing, least = map(np.asarray, kind(arguments, num_streams))
    allowed = budget.OF_FAINT * BUDGET * least
    called, near = missing <= allowed, missing <= LOOKED_AT * allowed
    cells = [name, str(num_streams), f"{called.mean():.3f}"]
    if not near.any():
        return [*cells, "", "", "", ""]
    ratio = wrong[near] / np.maximum(missing, LEAST * allowed)[near]
    cells += [f"{x:.2f}" for x in (*np.quantile(ratio, (0.5, 0.99)), ratio.max())]
    over = (wrong / least)[called] / BUDGET
    return [*cells, f"{over.max():.2f}" if called.any() else ""]


def thinner(arguments, factor):
    return arguments | {"tau": np.asarray(arguments["tau"]) * factor}


def sunlit(count, num_streams):
    """Names and arguments of columns that do not emit."""
    yield "W3", ours.parts_of(columns("W3", count, SEED), num_streams)[0].arguments
    sets = {
        workload: ours.parts_of(columns(workload, count, SEED, num_layers=NUM_LAYERS), num_streams)
        for workload in ("W1", "W2")
    }
    cases = {workload: parts[0].arguments for workload, parts in sets.items()}
    cases["extremes"] = draw([SEED, num_streams], count, num_streams, 16, 1, False).columns
    for name, arguments in cases.items():
        for factor in THIN:
            yield f"{name} x {factor:g}", thinner(arguments, factor)


def emitting(count, num_streams):
    """The same of those that do."""
    rng = np.random.default_rng(SEED)
    base = ours.parts_of(columns("W3", count, SEED), num_streams)[1].arguments
    for factor in (1, 10, 100):
        given = {name: np.array(x) for name, x in base.items()}
        scattered = given["tau"] * given["ssa"] * factor
        absorbed = given["tau"] * (1 - given["ssa"])
        tau = scattered + absorbed
        given |= {"tau": tau, "ssa": scattered / np.maximum(tau, np.finfo(float).tiny)}
        name = f"W3 emitting, scattering x {factor}"
        yield name, given
        planck = given["planck_levels"] * 10 ** rng.uniform(-1, 1, given["planck_levels"].shape)
        yield f"{name}, random temperatures", given | {"planck_levels": planck}
        shape = given["mu"].shape
        night = {
            "mu": 10 ** rng.uniform(-2.5, 0, shape),
            "surface_emission": given["surface_emission"] * 10 ** rng.uniform(-3, 3, shape),
            "solar_irradiance": np.zeros_like(given["solar_irradiance"]),
        }
        yield f"{name}, night", given | night


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--constants", nargs="+", default=[], metavar="NAME=NUMBER")
    parser.add_argument("--columns", type=int, default=2000)
    parser.add_argument("--streams", type=int, nargs="+", default=[2, 4, 8])
    args = parser.parse_args()
    assert SEED < FIRST_SEED
    jax.config.update("jax_enable_x64", True)
    for text in ["", *args.constants]:
        print(f"{text or 'as they are'}: {args.columns} columns a row, a budget of {BUDGET:g}\n")
        with standing_in(faint, read(text)):
            rows = [
                row(name, kind, arguments, streams)
                for streams in args.streams
                for drawn, kind in ((sunlit, of_sunlight), (emitting, of_heat))
                for name, arguments in drawn(args.columns, streams)
            ]
        heads = ["columns", "streams", "faint", "error / estimate", "p99", "largest"]
        table([*heads, "largest error of the faint / budget"], rows)
        print()


if __name__ == "__main__":
    main()
