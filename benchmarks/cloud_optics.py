"""What Mie theory of cloud droplets costs and moves, beside modified anomalous diffraction.

    python benchmarks/cloud_optics.py [--size 48] [--num-streams 8] [--repeats 5] [--check]

Two scenes, each by both optics (`LiquidCloud`): the demonstration, and the same coast overcast, of
which every clear column has the cloud of one that has. Timed are `scene.simulate` of the paper's
four bands and `brf` with its gradient in every input, in rotating order; of every program the
least processor time of its rounds, which neighbours on the machine disturb least. First answers
come from a process of their own with no compiled programs. Then, by band, what the choice moves:
brf of columns with liquid cloud alone, in six bands, without gases; and the same of ice with smooth
and with rough crystals. `--check` exits with 1 where Mie theory costs more than `MOST`.
"""

import argparse
import os
import platform
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import jax
import numpy as np
from first_light import read
from pareto_states import make_state
from rounds import Bars, table

from abi_operator import GRASSO2013, __version__, brf
from abi_operator.atmosphere import ICE_OPTICS, LIQUID_OPTICS
from abi_operator.demo import write_demo
from abi_operator.machine.speed import usable_cores
from abi_operator.scene import column_states, simulate

MOST = 0.15  # of a scene's time, or of a gradient's
MOVED_BANDS = ("C01", "C02", "C03", "C05", "C06", "C07")
SCENES = ("demonstration", "overcast")
PROGRAMS = ("scene", "gradient")


def scenarios(size):
    """Scenes by name."""
    with tempfile.TemporaryDirectory() as name:
        scene = read(write_demo(Path(name), size=size)).load()
    return {"demonstration": scene, "overcast": overcast(scene)}


def overcast(scene):
    """The same with a cloud in every column."""
    paths = {x: scene[x].values.copy() for x in ("liquid_mass_path", "liquid_number_path")}
    cloudy = np.argwhere(paths["liquid_mass_path"].sum(axis=0) > 0)
    clear = np.argwhere(paths["liquid_mass_path"].sum(axis=0) <= 0)
    chosen = cloudy[np.random.default_rng(0).integers(len(cloudy), size=len(clear))]
    for values in paths.values():
        values[:, *clear.T] = values[:, *chosen.T]
    return scene.assign({name: (scene[name].dims, x) for name, x in paths.items()})


def call(program, scene, num_streams):
    """One answer, as NumPy arrays."""
    if program == "scene":
        return simulate(scene, num_streams=num_streams)["brf"].values
    states = column_states(scene, GRASSO2013)
    value, pull = jax.vjp(partial(brf, num_streams=num_streams), states)
    return np.asarray(value), jax.tree.map(np.asarray, pull(np.ones_like(value)))


def seconds_of(function):
    """Seconds on the clock and of the processor."""
    clock, used = time.perf_counter(), time.process_time()
    function()
    return time.perf_counter() - clock, time.process_time() - used


def timed(scenes, options):
    """Least processor time by program, scene and optics."""
    least = {}
    keys = [(p, s, o) for p in PROGRAMS for s in SCENES for o in LIQUID_OPTICS]
    for turn in range(options.repeats + 1):
        for program, name, optics in keys[turn % len(keys) :] + keys[: turn % len(keys)]:
            scene = scenes[name].assign_attrs(cloud_optics=optics)
            _, used = seconds_of(lambda: call(program, scene, options.num_streams))  # noqa: B023
            if turn > 0:
                key = program, name, optics
                least[key] = min(used, least.get(key, np.inf))
    return least


def first_answers(options):
    """Seconds of first answers, by program and optics, each of a process that compiles all."""
    found = {}
    for program in PROGRAMS:
        for optics in LIQUID_OPTICS:
            command = [sys.executable, __file__, "--first", program, optics]
            command += ["--size", "8", "--num-streams", str(options.num_streams)]
            with tempfile.TemporaryDirectory() as cache:
                own = os.environ | {"JAX_COMPILATION_CACHE_DIR": cache}
                done = subprocess.run(command, env=own, capture_output=True, text=True, check=True)
            found[program, optics] = tuple(map(float, done.stdout.split()))
    return found


def moved(of, count=1024, num_layers=30):
    """Rows of by how much brf differs with the optics of cloud or ice, where there is some."""
    state = make_state(count, num_layers, MOVED_BANDS, np.random.default_rng(0), clouds=True)
    air = state.atmosphere
    matter = air.liquid if of == "liquid" else air.hydrometeors[of]
    # A path of 10 g m-2 has an optical depth of 1 or more in droplets, of 0.3 or more in ice.
    some = np.flatnonzero(np.sum(matter.mass_path, axis=1) > 0.01)
    state = jax.tree.map(lambda x: np.asarray(x)[some], state)
    matter = jax.tree.map(lambda x: np.asarray(x)[some], matter)
    nothing = replace(state.atmosphere.liquid, mass_path=0 * matter.mass_path)

    def reflectance(optics):
        seen = replace(matter, optics=optics)
        clouds = {"liquid": seen, "hydrometeors": {}}
        if of != "liquid":
            clouds = {"liquid": nothing, "hydrometeors": {of: seen}}
        atmosphere = replace(state.atmosphere, **clouds)
        return np.asarray(brf(replace(state, atmosphere=atmosphere), MOVED_BANDS, gases=()))

    new, old = LIQUID_OPTICS if of == "liquid" else ICE_OPTICS[::-1]
    before, after = reflectance(old), reflectance(new)
    for k, band in enumerate(MOVED_BANDS):
        d = np.abs(after - before)[:, k]
        r = d / before[:, k]
        yield [
            band,
            f"{np.median(d):.3f}",
            f"{d.max():.3f}",
            f"{np.median(r):.1%}",
            f"{r.max():.0%}",
        ]
    yield [f"{len(some)} columns", *[""] * 4]


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--size", type=int, default=48)
    parser.add_argument("--num-streams", type=int, default=8)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--first", nargs=2, metavar=("PROGRAM", "OPTICS"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    scenes = scenarios(options.size)
    if options.first:
        scene = scenes["overcast"].assign_attrs(cloud_optics=options.first[1])
        print(*seconds_of(lambda: call(options.first[0], scene, options.num_streams)))
        return
    print(
        f"abi-operator {__version__}, jax {jax.__version__}, {jax.devices()[0].platform}, ", end=""
    )
    print(f"{platform.machine()}, {usable_cores()} cores, Python {sys.version.split()[0]}, float64")
    layers = scenes["overcast"].sizes["layer"]
    print(f"{options.size} x {options.size} columns x 4 bands, {layers} layers, ", end="")
    print(f"{options.num_streams} streams\n", flush=True)
    bars, least, first = Bars(), timed(scenes, options), first_answers(options)
    rows, new, old = [], *LIQUID_OPTICS
    for program in PROGRAMS:
        for name in SCENES:
            before, after = least[program, name, old], least[program, name, new]
            rows.append(
                [program, name, f"{before:.2f}", f"{after:.2f}", f"{after / before - 1:+.0%}"]
            )
            bars.judge(after / before - 1 <= MOST, f"{program} of {name}: {after / before - 1:.0%}")
        before, after = first[program, old][1], first[program, new][1]
        rows.append([f"{program}, first", "overcast, 8 x 8", f"{before:.1f}", f"{after:.1f}"])
        rows[-1].append(f"{after / before - 1:+.0%}")
    table(["what", "scene", f"{old} [s]", f"{new} [s]", "more"], rows)
    print("Seconds of processor time.\n")
    head = ["band", "median", "largest", "median, relative", "largest, relative"]
    for of, what in (("liquid", f"{old} to {new}"), ("ice", " to ".join(ICE_OPTICS))):
        print(f"By how much brf differs, {what} ({of}):\n")
        table(head, list(moved(of)))
    bars.report()
    sys.exit(1 if options.check and bars.failed else 0)


if __name__ == "__main__":
    main()
