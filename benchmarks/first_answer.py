"""How long until the first answer, and again with the compiled programs of the first time.

    python benchmarks/first_answer.py [CASE ...] [--check]

Each case (see `CASES`) is what a user runs, in a process of its own without any setting of JAX or
XLA: once with an empty folder of compiled programs, then with what the first left there. Seconds
are those of the whole process, imports included. Programs are counted by `jax.monitoring`: those
compiled, and of them the big ones, which took longer than `BIG`. `--check` exits with 1 where a bar
is missed.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import workload
from peers import peak_memory
from plain import without_settings
from rounds import Bars, table

from abi_operator import (
    Geometry,
    State,
    __version__,
    ash,
    reflectance_factor,
    smoke,
    standard_atmosphere,
    use_compilation_cache,
)
from abi_operator.machine.speed import usable_cores
from abi_operator.solver import toa_brf

BIG = 0.5  # seconds that a program compiles
SEVEN = ("C01", "C02", "C03", "C04", "C05", "C06", "C07")
LAYERS, COLUMNS = 20, 2048
SIZES, LARGEST, MOST_PROGRAMS, MOST_MEMORY = 200, 5000, 10, 1e9
# Cloud water of four times, in parts of the demonstration's: the thickest layer differs.
CLOUD = (1.0, 0.3, 3.0, 10.0)
BUSY = 1.7  # cores that solving keeps busy, of two


class Programs:
    """Programs that JAX compiled or loaded since this was made."""

    def __init__(self):
        self.compiled, self.loaded = [], 0
        self._here = threading.local()
        jax.monitoring.register_event_listener(self._event)
        jax.monitoring.register_event_duration_secs_listener(self._duration)

    def _event(self, name, **_):
        self._here.loaded = name == "/jax/compilation_cache/cache_hits" or self._loaded()

    def _loaded(self):
        return getattr(self._here, "loaded", False)

    def _duration(self, name, seconds, **more):
        """One of each, whether it was compiled or loaded."""
        if name == "/jax/core/compile/backend_compile_duration":
            if self._loaded():
                self.loaded += 1
            else:
                self.compiled.append((seconds, str(more.get("fun_name", "a program"))))
            self._here.loaded = False

    def big(self):
        return [name for seconds, name in self.compiled if seconds > BIG]


class Case(NamedTuple):
    """What a user runs, and the most seconds that it may take at first and again."""

    run: object
    says: str
    cold: float | None = None
    again: float | None = None
    anew: str | None = None  # why it may compile a big program again


CALLS_BACK = "with `throw=True` it calls Python, and JAX keeps no program that does"


def demo(folder, _):
    command("demo", "--size", "64", "--out", folder / "demo")


def command(*words):
    """The command line, in this process. As all cases, it imports what no other case needs."""
    from abi_operator import cli

    sys.argv = ["abi-operator", *map(str, words)]
    try:
        cli.main()
    except SystemExit as end:
        if end.code:
            raise


def jacobian(*_):
    use_compilation_cache()
    height = jnp.linspace(24e3, 0.0, 25)
    plumes = {"smoke": smoke(aod_550=0.8, bands=SEVEN)}
    air = standard_atmosphere("midlatitude_summer", height, plumes=plumes)
    state = State(air, {band: 0.1 for band in SEVEN}, Geometry(0.6, 0.8, 1.2))
    slopes = jax.jacrev(lambda s: reflectance_factor(s, SEVEN))(state)
    assert np.isfinite(slopes.atmosphere.plumes["smoke"].ssa["C01"]).all()


def least_squares_without_throw(*_):
    least_squares(throw=False)


def least_squares(*_, throw=True):
    """The user's own inversion, by default with an error where it does not converge."""
    import optimistix as optx

    jax.config.update("jax_enable_x64", True)
    use_compilation_cache()
    height = jnp.linspace(24e3, 0.0, 25)

    def simulated(x):
        """Of ln(optical depth), and of what bends single-scattering albedo and asymmetry."""
        plume = ash(jnp.exp(x[0]), bands=SEVEN)
        shift, factor = 0.01 * jnp.tanh(x[1]), 1 + 0.1 * jnp.tanh(x[2])
        fields = vars(plume) | {
            "ssa": {band: value + shift for band, value in plume.ssa.items()},
            "asymmetry": {band: value * factor for band, value in plume.asymmetry.items()},
        }
        air = standard_atmosphere(
            "midlatitude_summer", height, plumes={"ash": type(plume)(**fields)}
        )
        state = State(air, {band: 0.1 for band in SEVEN}, Geometry(0.6, 0.8, 1.2))
        return reflectance_factor(state, SEVEN)

    observed = simulated(jnp.array([jnp.log(0.6), -0.5, 0.3]))
    found = optx.least_squares(
        lambda x, seen: (simulated(x) - seen) / 0.01,
        optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8),
        jnp.array([jnp.log(0.3), 0.0, 0.0]),
        args=observed,
        throw=throw,
    )
    np.testing.assert_allclose(simulated(found.value), observed, atol=1e-5)


def four_times(folder, programs):
    """Programs after each time of a scene."""
    after = simulate(folder, 64, CLOUD, programs)
    return {"big after the first time": after[-1]["big"] - after[0]["big"], "times": after}


def solving(folder, programs):
    """Seconds and processor time of solving the second of two times, which compiles nothing."""
    return simulate(folder, 128, CLOUD[:2], programs)[1]


def simulate(folder, size, cloud, programs):
    """`abi-operator simulate` of some times; what each of them took between reading and writing."""
    from abi_operator import simulation

    inputs, scene = demo_scene(folder, size, cloud)
    found = []

    def run(read_block, times, shape, write_block, **options):
        clock = {}

        def read(*arguments):
            block = read_block(*arguments)
            clock.update(wall=time.perf_counter(), processor=time.process_time())
            return block

        def write(*arguments):
            found.append(
                {
                    "wall": time.perf_counter() - clock["wall"],
                    "processor": time.process_time() - clock["processor"],
                    "compiled": len(programs.compiled),
                    "big": len(programs.big()),
                }
            )
            write_block(*arguments)

        return original(read, times, shape, write, **options)

    original, simulation.run = simulation.run, run
    paths = ("--albedo", inputs.albedo, "--plume", inputs.plume, "--out", folder / "out")
    command("simulate", scene, "--ocean-albedo", 0.03, "--gases", "none", *paths)
    return found


def demo_scene(folder, size, cloud):
    """The demonstration's inputs, and its model output at several times with other clouds."""
    import netCDF4

    from abi_operator.demo import write_demo

    inputs = write_demo(folder / "inputs", size=size)
    path = folder / "wrfout_of_times.nc"
    with netCDF4.Dataset(inputs.wrf) as one, netCDF4.Dataset(path, "w") as many:
        many.setncatts({name: one.getncattr(name) for name in one.ncattrs()})
        for name, dimension in one.dimensions.items():
            many.createDimension(name, None if dimension.isunlimited() else dimension.size)
        for name, given in one.variables.items():
            made = many.createVariable(name, given.dtype, given.dimensions)
            made.setncatts({x: given.getncattr(x) for x in given.ncattrs()})
            if "Time" not in given.dimensions:
                made[:] = given[:]
                continue
            for index, share in enumerate(cloud):
                made[index] = given[0] * share if name == "QCLOUD" else given[0]
                if name == "Times":
                    made[index] = np.array(list(f"2007-10-23_{18 + index}:00:00"), "S1")
    return inputs, path


def batch_sizes(*_):
    jax.config.update("jax_enable_x64", True)
    use_compilation_cache()
    arrays = workload.arguments(workload.columns(LARGEST, LAYERS, seed=0), 8)
    for size in sizes():
        brf = workload.solve(*(x[:size] for x in arrays), num_streams=8)
        assert brf.shape == (size,) and np.isfinite(brf).all()


def sizes():
    """So many different sizes, as evenly spread over the logarithms as whole numbers can be."""
    count = SIZES
    while True:
        found = np.unique(np.rint(np.geomspace(1, LARGEST, count)).astype(int))
        if len(found) >= SIZES:
            return np.random.default_rng(0).permutation(found[-SIZES:])
        count += 1


def solver_gradient(*_):
    jax.config.update("jax_enable_x64", True)
    use_compilation_cache()
    arrays = workload.arguments(workload.columns(COLUMNS, LAYERS, seed=0), 16)

    def total(*x):
        brf = toa_brf(*x[:7], phase_function=x[7], num_streams=16)
        return brf.sum(), brf

    _, slopes = jax.value_and_grad(total, argnums=range(8), has_aux=True)(*arrays)
    assert all(np.isfinite(x).all() for x in slopes)


CASES = {
    "demo": Case(demo, "`abi-operator demo --size 64`", 20, 8),
    "jacobian": Case(jacobian, "first Jacobian of README's state with gases, seven bands", 25, 5),
    "least_squares": Case(
        least_squares,
        "`optimistix.least_squares` of seven bands, three unknowns",
        40,
        anew=CALLS_BACK,
    ),
    "least_squares_without_throw": Case(
        least_squares_without_throw, "the same with `throw=False`", 40
    ),
    "solver_gradient": Case(
        solver_gradient, f"`toa_brf` with gradient, 16 streams, {COLUMNS:,} columns", 15
    ),
    "four_times": Case(four_times, "`abi-operator simulate` of four times, 64 x 64"),
    "batch_sizes": Case(batch_sizes, f"`toa_brf`, 8 streams, {SIZES} numbers of columns"),
}
ONE_AND_TWO = "cores"


def child(name, folder):
    """Run a case in this process, and leave an account in its folder."""
    programs = Programs()
    case = solving if name == ONE_AND_TWO else CASES[name].run
    found = case(folder, programs) or {}
    found |= {"compiled": programs.compiled, "loaded": programs.loaded, "big": programs.big()}
    found["memory"] = peak_memory()
    (folder / "account.json").write_text(json.dumps(found))


def measured(name, folder, cache, cores=None):
    """What a process took for a case: its account, and seconds."""
    folder.mkdir(parents=True)
    settings = {"XDG_CACHE_HOME": str(cache)}
    settings["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
    words = [sys.executable, "-P", __file__, "--child", str(folder), name]
    start = time.perf_counter()
    process = subprocess.Popen(
        words,
        env=without_settings() | settings,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        preexec_fn=None if cores is None else lambda: os.sched_setaffinity(0, cores),
    )
    output = process.stdout.read().decode()
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        errors = [line for line in output.splitlines() if "Error: " in line]
        raise Failed(errors[-1] if errors else output[-200:])
    found = json.loads((folder / "account.json").read_text())
    return found | {"seconds": seconds, "user": usage.ru_utime}


class Failed(Exception):
    """A case ended with an error, the words of which this holds."""


def first_and_again(name, folder, bars):
    """Rows of a case, and its judgement."""
    case, rows = CASES[name], []
    for turn, most in (("empty", case.cold), ("filled", case.again)):
        found = measured(name, folder / turn, folder / "cache")
        row = [case.says, turn, f"{found['seconds']:.1f}", "" if most is None else most]
        row += [f"{found['user']:.1f}", f"{found['memory'] / 1e6:,.0f}"]
        rows.append([*row, len(found["compiled"]), len(found["big"]), found["loaded"]])
        if most is not None:
            seconds = found["seconds"]
            bars.judge(seconds <= most, f"{name}, {turn}: {seconds:.1f} s, not {most}")
        if turn == "filled" and case.anew and found["big"]:
            print(f"{case.says} compiles {', '.join(found['big'])} again: {case.anew}.\n")
            continue
        if turn == "filled":
            bars.judge(not found["big"], f"{name}, {turn}, compiles {', '.join(found['big'])}")
            continue
        if name == "four_times":
            late = found["big after the first time"]
            bars.judge(late == 0, f"{late} big programs after the first of four times")
            print("Programs compiled after each of four times:", end=" ")
            print(", ".join(f"{x['compiled']} ({x['big']} big)" for x in found["times"]), "\n")
        if name == "batch_sizes":
            number, memory = len(found["compiled"]), found["memory"]
            bars.judge(number <= MOST_PROGRAMS, f"{number} programs for {SIZES} sizes")
            bars.judge(memory <= MOST_MEMORY, f"{memory / 1e6:,.0f} MB for {SIZES} sizes")
    return rows


def one_and_two(folder, bars):
    """Solving on one core and on two, by the command line and without being told."""
    cores = sorted(os.sched_getaffinity(0))[:2]
    if len(cores) < 2:
        print("There is one core only.\n")
        return
    rows = []
    for name, some in (("compiling", cores), ("one", cores[:1]), ("two", cores)):
        found = measured(ONE_AND_TWO, folder / name, folder / "cache", set(some))
        if name == "compiling":
            continue
        busy = found["processor"] / found["wall"]
        row = [len(some), f"{found['wall']:.2f}", f"{found['processor']:.2f}", f"{busy:.2f}"]
        rows.append([*row, f"{found['memory'] / 1e6:,.0f}"])
    bars.judge(busy >= BUSY, f"solving keeps {busy:.2f} cores of two busy, not {BUSY}")
    head = ["cores", "solving [s]", "processor time [s]", "cores busy", "most memory [MB]"]
    print(f"`abi-operator simulate`, {128 * 128:,} columns of four bands, the second of two times:")
    print()
    table(head, rows)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", nargs="*", help=f"of {', '.join([*CASES, ONE_AND_TWO])}; or all")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        child(options.cases[0], options.child)
        return
    chosen = options.cases or [*CASES, ONE_AND_TWO]
    if unknown := set(chosen) - {*CASES, ONE_AND_TWO}:
        parser.error(f"no such case: {', '.join(sorted(unknown))}")
    print(f"abi-operator {__version__}, jax {jax.__version__}, cpu, {platform.machine()}, ", end="")
    print(f"{usable_cores()} cores, Python {sys.version.split()[0]}\n", flush=True)
    bars, rows = Bars(), []
    with tempfile.TemporaryDirectory() as name:
        for case in (x for x in CASES if x in chosen):
            try:
                rows += first_and_again(case, Path(name) / case, bars)
            except Failed as error:
                bars.judge(False, f"{case} fails: {error}")
        if ONE_AND_TWO in chosen:
            try:
                one_and_two(Path(name) / ONE_AND_TWO, bars)
            except Failed as error:
                bars.judge(False, f"{ONE_AND_TWO} fails: {error}")
    head = ["what", "folder", "seconds", "bar", "user seconds", "most memory [MB]"]
    table([*head, "programs compiled", "big ones", "loaded"], rows)
    bars.report()
    sys.exit(1 if options.check and bars.failed else 0)


if __name__ == "__main__":
    main()
