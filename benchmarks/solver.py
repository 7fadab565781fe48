"""How fast the solver is, beside other solvers on the same columns in the same run.

    python benchmarks/solver.py [--columns 1000] [--streams 4 8 16 32] [--sweep ...] [--check]

times the value (`toa_brf`), the value with its gradient in every argument, and every other solver
that is installed (extra `benchmark`), in rounds in which each has its turn on columns that no round
before had. Beside the time stands the error of those very calls. All solve on the nodes of double
Gauss, which others have, so that they agree to rounding; times are the same on our own. `--sweep`
(see --help) measures against batch, layers, streams or precision, memory and compiling, Jacobians
and `jax.vmap`, and a `jax.jit` of the caller's that names no number of doublings.
`--plain` times a user's script without any setting instead, beside a process tuned by hand, or
with `--sweep batch` in batches up to `--largest`.
`--check` judges all that was measured and exits with 1 where a bar is missed.
"""

import argparse
import platform
import sys
from dataclasses import replace

import jax
import numpy as np
import plain
import solver_sweeps
import workload
from peers import MEASURED_STREAMS, NUM_MOMENTS, PEERS, Peers, peer_version, usable_peers
from rounds import AGREE, Bars, Program, Rounds, apart, digits, relative, table

from abi_operator import __version__
from abi_operator.machine.speed import usable_cores
from abi_operator.solver import double_gauss, on_double_gauss

TRUE_STREAMS = 64
PEER_SHARE = 0.8  # of its earlier rate relative to nanodisort's, or the comparison is unfair
SPEED = {4: 12, 8: 10, 16: 7, 32: 3}  # times the fastest other solver
GRADIENT_COST = {4: 3.5, 8: 2.5, 16: 2.5, 32: 2.5}  # times the value
GRADIENT_SPEED = {8: 10, 16: 10}  # times the fastest other solver with derivatives
FEWEST_COLUMNS, FEWEST_ROUNDS = 1000, 5
STEP = 1e-5  # relative, of the difference quotients that judge the gradient


def directional_error(rounds, slopes, num_streams, num_layers, count, series, few=32):
    """Error of a gradient along a random direction, against difference quotients of nanodisort.

    Relative to the sum of the terms' sizes; the quotients themselves are good to about 1e-8.
    """
    given = rounds.drawn(rounds.repeats, count, num_layers).first(few)
    sides = workload.difference_quotient(given, seed=3, step=STEP)
    brf = []
    for side in sides:
        rounds.peers.put(side)
        brf.append(rounds.peers.solve("nanodisort", num_streams, len(given.mu))[0])
    quotient = (brf[0] - brf[1]) / (2 * STEP)
    above, below = (workload.arguments(side, num_streams, series=series) for side in sides)
    terms = [
        (s[:few] * (a - b) / (2 * STEP)).reshape(len(given.mu), -1)
        for s, a, b in zip(slopes, above, below, strict=True)
    ]
    terms = np.concatenate(terms, axis=1)
    return np.max(np.abs(terms.sum(axis=1) - quotient) / np.abs(terms).sum(axis=1))


def agreement(peers, streams, bars):
    """All solvers on 16 columns at equal streams, largest relative difference to nanodisort."""
    given = workload.columns(16, 20, seed=1000)
    rows, others = [], [name for name in PEERS if name != "nanodisort"]
    for n in streams:
        nodes = double_gauss(n)[0]
        on_nodes = nodes[np.argmin(np.abs(given.mu[:, None] - nodes), axis=1)]
        row = [n]
        for name in others:
            if name not in usable_peers(n):
                row.append("missing" if peer_version(name) is None else "refuses")
                continue
            seen = replace(given, mu=on_nodes) if name == "PythonicDISORT" else given
            peers.put(seen)
            reference = "plain" if PEERS[name].one_geometry else "nanodisort"
            expected = peers.solve(reference, n, 16)[0]
            error = np.max(np.abs(peers.solve(name, n, 16)[0] / expected - 1))
            row.append(f"{error:.0e}")
            bars.judge(error <= AGREE, f"{name} differs from nanodisort by {error:.0e} at {n}")
        if n == min(streams) and peer_version("sasktran2"):
            peers.put(given)
            peers.solve("sasktran2 + derivatives", n, 16)
            shared = workload.arguments(given.with_geometry_of_first(), n)[:7]
            options = {"num_streams": n, "num_doublings": workload.num_doublings(n)}
            plain = workload.gradient(options | {"single_scattering": None})
            slopes = plain(*shared)[1]
            ours = np.concatenate([slopes[0], slopes[1], slopes[3][:, None]], axis=1)
            theirs = peers.gradient(16)
            error = np.max(np.abs(ours - theirs) / np.abs(theirs).max(axis=1, keepdims=True))
            row.append(f"{error:.0e}")
            bars.judge(error <= AGREE, f"sasktran2's derivatives differ by {error:.0e} at {n}")
        else:
            row.append("")
        rows.append(row)
    print("Largest relative difference to nanodisort at equal streams, 16 columns:\n")
    names = [k.replace("PythonicDISORT", "PythonicDISORT, views on its nodes") for k in others]
    table(["streams", *names, "our derivatives from sasktran2's"], rows)


def main_table(rounds, options, bars):
    """Value, value + gradient and every peer; error beside time."""
    layers, count, few = options.layers, options.columns, min(options.truth, options.columns)
    truth, truth_one = [], []
    for turn in range(1, rounds.repeats + 1):
        rounds.peers.put(rounds.drawn(turn, count, layers).first(few))
        truth.append(rounds.peers.solve("nanodisort", TRUE_STREAMS, few)[0])
        truth_one.append(rounds.peers.solve("one geometry", TRUE_STREAMS, few)[0])
    rows, notes = [], []
    for n in options.streams:
        k, names = workload.num_doublings(n), usable_peers(n)
        settings = {"num_streams": n, "num_doublings": k}
        programs = {
            "value": Program(workload.value(settings)),
            "value + gradient": Program(workload.gradient(settings)),
        }
        series = NUM_MOMENTS if options.series else None
        timed = rounds.run(programs, n, layers, count, names, series=series)
        plain = []
        for turn in range(1, rounds.repeats + 1):
            rounds.peers.put(rounds.drawn(turn, count, layers).first(few))
            plain.append(rounds.peers.solve("plain", n, few)[0])
        error = directional_error(
            rounds, timed["value + gradient"].slopes, n, layers, count, series
        )
        bars.judge(error <= AGREE, f"gradient at {n}: {error:.0e} from difference quotients")
        slope_error = f"{error:.0e}"
        others = {x: timed[x] for x in names}
        fastest = min(timed[x].microseconds for x in others if not PEERS[x].derivatives)
        for name, t in timed.items():
            peer = PEERS.get(name)
            one = peer is not None and peer.one_geometry
            equal = apart(t.brf, plain if one else timed["nanodisort"].brf)
            error = relative(t.brf, truth_one if one else truth)
            row = [n, name, k if peer is None else "", t.count]
            row += [digits(t.microseconds), t.spread, f"{1e6 / t.microseconds:,.0f}"]
            row += [f"{fastest / t.microseconds:.2f}", f"{equal:.0e}"]
            row += [f"{np.median(error):.1e}", f"{error.max():.1e}"]
            row += ["" if peer else f"{t.first:.1f}", slope_error if "gradient" in name else ""]
            rows.append(row)
            if peer is None:
                bars.judge(equal <= AGREE, f"{name} at {n}: {equal:.0e} from nanodisort")
                if n == solver_sweeps.COMPILE_STREAMS:
                    most = solver_sweeps.COMPILE_SECONDS[name]
                    seconds = t.first - t.microseconds * count / 1e6
                    bars.judge(seconds <= most, f"{name} at {n} compiles {seconds:.0f} s > {most}")
            elif n in MEASURED_STREAMS and name != "nanodisort":
                column = MEASURED_STREAMS.index(n)
                earlier = peer.rates[column] / PEERS["nanodisort"].rates[column]
                share = timed["nanodisort"].microseconds / t.microseconds / earlier
                notes.append(f"{name} at {n}: {share:.0%}")
                bars.judge(
                    share >= PEER_SHARE, f"{name} at {n} runs at {share:.0%} of its earlier rate"
                )
        judge_speed(n, timed, others, fastest, bars)
    head = ["streams", "program", "doublings", "columns", "microseconds a column", "range"]
    head += ["columns / s", "x fastest other", "from nanodisort", f"median from {TRUE_STREAMS}"]
    table([*head, "largest", "first call [s]", "gradient's error"], rows)
    print("Rate relative to nanodisort's, in parts of an earlier one:", "; ".join(notes), "\n")


def judge_speed(n, timed, others, fastest, bars):
    value, slope = (timed[x].microseconds for x in ("value", "value + gradient"))
    if n in SPEED:
        gain = fastest / value
        bars.judge(
            gain >= SPEED[n], f"value at {n}: {gain:.2f} x the fastest other, not {SPEED[n]}"
        )
    if n in GRADIENT_COST:
        cost, most = slope / value, GRADIENT_COST[n]
        bars.judge(cost <= most, f"value + gradient at {n} costs {cost:.2f} values, not {most}")
    slopes = [t.microseconds for x, t in others.items() if PEERS[x].derivatives]
    if n in GRADIENT_SPEED and slopes:
        gain, least = min(slopes) / slope, GRADIENT_SPEED[n]
        bars.judge(gain >= least, f"value + gradient at {n}: {gain:.2f} x sasktran2, not {least}")


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--columns", type=int, help="default: 1,000, with --plain 2,048")
    parser.add_argument("--layers", type=int, default=20)
    parser.add_argument("--streams", type=int, nargs="+", help="default: 4 8 16, and 32")
    parser.add_argument("--repeats", type=int, help="default: 5, with --plain 15")
    parser.add_argument("--seconds", type=float, default=2.0, help="most of a slow peer's call")
    parser.add_argument("--truth", type=int, default=32, help="columns a round with 64 streams")
    parser.add_argument("--series", action="store_true", help="ours sums 129 moments as well")
    parser.add_argument("--sweep", nargs="+", default=[], choices=["main", *solver_sweeps.SWEEPS])
    parser.add_argument("--plain", action="store_true", help="calls of a script without settings")
    parser.add_argument("--sweep-streams", type=int, nargs="+", help="default: 8 and 16, or all")
    parser.add_argument("--largest", type=int, default=100_000, help="batch of the sweeps")
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    options.repeats = options.repeats or (plain.ROUNDS if options.plain else 5)
    options.columns = options.columns or (plain.COLUMNS if options.plain else 1000)
    options.streams = options.streams or [*plain.STREAMS, *([] if options.plain else [32])]
    # A process that times plain calls leaves JAX alone: its children have one each.
    cores = usable_cores() if options.plain else workload.use_all_cores()
    found = {name: peer_version(name) or "MISSING" for name in PEERS}
    versions = ", ".join(f"{k} {v}" for k, v in found.items() if "+" not in k)
    print(f"abi-operator {__version__}, jax {jax.__version__}, {versions}")
    device = "cpu" if options.plain else jax.devices()[0].device_kind
    print(f"{device}, {platform.machine()}, {cores} cores used by every")
    print(
        f"solver, Python {sys.version.split()[0]}, float64, {options.layers} layers\n", flush=True
    )
    bars = Bars()
    enough = options.columns >= FEWEST_COLUMNS and options.repeats >= FEWEST_ROUNDS
    bars.judge(enough, f"fewer than {FEWEST_COLUMNS} columns or {FEWEST_ROUNDS} rounds")
    for name, text in found.items():
        bars.judge(text != "MISSING", f"{name} is not installed")
    if found["nanodisort"] == "MISSING":
        sys.exit('The reference is missing: pip install "abi-operator[benchmark]".')
    with (
        Peers(cores, max(options.columns, 16), max(60, options.layers)) as peers,
        on_double_gauss(),
    ):
        rounds = Rounds(peers, options.repeats, options.seconds)
        if options.plain and "batch" in options.sweep:
            options.sweep_streams = options.sweep_streams or solver_sweeps.USUAL_STREAMS
            sizes = [k for k in solver_sweeps.BATCHES if k <= options.largest]
            plain.batches(peers, options, sizes, bars)
        elif options.plain:
            plain.plain(peers, options, bars)
        elif not options.sweep or "main" in options.sweep:
            agreement(peers, options.streams, bars)
            main_table(rounds, options, bars)
        for name in options.sweep:
            if name != "main" and not options.plain:
                solver_sweeps.SWEEPS[name](rounds, options, bars)
    bars.report()
    sys.exit(1 if options.check and bars.failed else 0)


if __name__ == "__main__":
    main()
