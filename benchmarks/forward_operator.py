"""How fast the whole operator is, from states to reflectances and their Jacobian.

    python benchmarks/forward_operator.py [--columns 1000] [--dtype float32] [--error-budget 1e-3]
        [--check]

Columns of 20 layers with droplets, ice, smoke and gases, no two alike, through the public doors:
`brf` in the four bands of Grasso et al. (2013) without gases, and `radiance` in seven bands with
them, C07 with its emission. Each is timed for the value and for the value with the Jacobian of all
bands with respect to the whole state by `jax.jacrev`; optics and solver are timed alone on the same
columns. With an error budget the number of doublings is left to it. Every round gives every program
one call in rotating order on columns that no round before had; medians of `--repeats` rounds and
their range. `--check` exits with 1 where optics take more than a quarter of the time.
"""

import argparse
import platform
import statistics
import sys
import time
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import workload
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from rounds import Bars, digits, table

from abi_operator import (
    BANDS,
    GRASSO2013,
    Geometry,
    Hydrometeor,
    LiquidCloud,
    State,
    __version__,
    brf,
    radiance,
    smoke,
    standard_atmosphere,
)
from abi_operator.optics import ALL_GASES, mixture
from abi_operator.planck import in_band_radiance
from abi_operator.satellites import solar_irradiance
from abi_operator.settings import NUM_STREAMS
from abi_operator.solver import cos_scattering_angle, toa_brf, toa_radiance

# Levels; 20 layers. [m]
HEIGHT = 1e3 * np.array(
    [60, 40, 30, 25, 20, 17, 15, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0], float
)
LOW, HIGH = (14, 20), (8, 13)  # layers in which droplets and crystals are
SEVEN = ("C01", "C02", "C03", "C04", "C05", "C06", "C07")
CASES = {
    "4 bands, no gases": (brf, GRASSO2013, ()),
    "7 bands, gases": (radiance, SEVEN, ALL_GASES),
}
MOST = 0.25  # of the time, for optics


def states(count, seed, dtype):
    """Random columns as one batch: cloud in six of ten, ice in four of ten, smoke in all."""
    rng = np.random.default_rng(seed)

    def cloud(layers, share, log_path, log_mass):
        """Mass in one layer and number in it, from the mean mass of a particle."""
        mass = np.zeros((count, HEIGHT.size - 1))
        there = rng.uniform(size=count) < share
        path = np.where(there, 10 ** rng.uniform(*log_path, count), 0)
        mass[np.arange(count), rng.integers(*layers, count)] = path
        return mass, mass / 10 ** rng.uniform(*log_mass, (count, 1))

    def of_columns(low, high):
        return rng.uniform(low, high, (count, 1))

    air = standard_atmosphere(
        "midlatitude_summer",
        HEIGHT,
        plumes={"smoke": smoke(10 ** rng.uniform(-2, 0.5, count), bands=SEVEN)},
    )
    plumes = air.plumes
    air = jax.tree.map(lambda x: np.broadcast_to(x, (count, *x.shape)), air)
    liquid = LiquidCloud(*cloud(LOW, 0.6, (-2.5, -0.5), (-12.5, -11)))  # [kg m-2], [kg]
    crystals = Hydrometeor(*cloud(HIGH, 0.4, (-3, -1), (-11.5, -10)))
    gases = air.gases
    fields = vars(air) | {
        "liquid": liquid,
        "plumes": plumes,
        "hydrometeors": {"ice": crystals},
        "temperature": air.temperature + of_columns(-8, 8),
        "gases": type(gases)(**vars(gases) | {"vapour": gases.vapour * of_columns(0.5, 1.5)}),
    }
    zenith = np.radians(rng.uniform(0, [[75], [70]], (2, count)))
    state = State(
        type(air)(**fields),
        {band: rng.uniform(0, 0.5, count) for band in SEVEN},
        Geometry(*zenith, rng.uniform(0, np.pi, count)),
        rng.uniform(280, 310, count),
    )
    return jax.tree.map(lambda x: np.asarray(x, dtype), state)


def layers_of(state, bands, gases, num_moments):
    """What the solver is given for these bands of columns, whose axis is the last, and the weight
    of each term."""
    geometry = state.geometry
    angles = geometry.mu0, geometry.mu, geometry.relative_azimuth
    cosine = cos_scattering_angle(*angles)
    found = []
    for band in bands:
        optics = mixture(state.atmosphere, BANDS[band], gases, num_moments, cosine)
        count = optics.weight.size
        same = optics.moments, optics.phase_function, state.albedo[band]
        terms = (jnp.broadcast_to(x, (count, *jnp.shape(x))) for x in (*same, *angles))
        found.append((optics.tau, optics.ssa, *terms, optics.weight))
    names = ("tau", "ssa", "moments", "phase_function", "albedo", "mu0", "mu", "relative_azimuth")
    joined = [jnp.concatenate(x) for x in zip(*found, strict=True)]
    return dict(zip(names, joined, strict=False)), joined[-1]


def sources_of(state, band):
    """Sunlight and emission of one column in a band that emits."""
    air = in_band_radiance(state.atmosphere.temperature, band)
    ground = in_band_radiance(state.surface_temperature, band) * (1 - state.albedo[band])
    return {"planck_levels": air, "surface_emission": ground}


class Programs:
    """What is timed in one case; each takes a batch of states, or what `prepare` makes of one."""

    def __init__(self, case, options, cores):
        door, self.bands, self.gases = CASES[case]
        self.options = {"num_streams": options.num_streams} | _how(options)
        self.operator = partial(door, **self.options, gases=self.gases)
        self.emitting = tuple(x for x in self.bands if door is radiance and x == "C07")
        # Columns lie on all cores, and each core has its own, as in the operator.
        mesh = Mesh(np.asarray(jax.devices()[:cores]), ("core",))
        self.share = NamedSharding(mesh, PartitionSpec("core"))
        self.num_moments = options.num_streams + 1
        on_each = partial(jax.shard_map, mesh=mesh, in_specs=self.share.spec, check_vma=False)
        of_all = partial(self._optics, bands=self.bands)
        layers = jax.eval_shape(of_all, states(cores, 0, options.dtype))
        self._all_optics = jax.jit(on_each(of_all, out_specs=jax.tree.map(_on_last_axis, layers)))
        slopes = jax.grad(self._squares)
        self._optics_slopes = jax.jit(on_each(slopes, out_specs=self.share.spec))
        self._solver_slopes = jax.jit(jax.grad(lambda x: jnp.sum(self._solve(x))))
        self._jacobian = jax.jit(jax.jacrev(self._summed, has_aux=True))

    def all(self):
        return {
            "value": self.value,
            "value, optics": self.optics,
            "value, solver": self.solver,
            "Jacobian": lambda state: _read(self._jacobian(state)),
            "Jacobian, optics": lambda copies: jax.block_until_ready(self._optics_slopes(copies)),
            "Jacobian, solver": lambda x: jax.block_until_ready(self._solver_slopes(x)),
        }

    def prepare(self, name, state):
        """What a program takes, untimed."""
        if name.endswith("optics"):
            state = jax.device_put(state, self.share)
            return {x: state for x in self.bands} if name.startswith("Jacobian") else state
        if name.endswith("solver"):
            return jax.tree.map(lambda x: jnp.asarray(np.asarray(x)), self._all_optics(state))
        return state

    def value(self, state):
        return np.asarray(self.operator(state, self.bands))

    def optics(self, state):
        return jax.block_until_ready(self._all_optics(state))

    def solver(self, groups):
        return jax.block_until_ready(self._solve(groups))

    def _optics(self, state, bands):
        """Layers and weights of the bands that only reflect, and of the one that emits."""
        state, groups = jax.tree.map(lambda x: jnp.moveaxis(x, 0, -1), state), []
        reflecting = tuple(x for x in bands if x not in self.emitting)
        if reflecting:
            groups.append(layers_of(state, reflecting, self.gases, self.num_moments))
        for band in (x for x in bands if x in self.emitting):
            layers, weight = layers_of(state, (band,), self.gases, self.num_moments)
            for name, x in sources_of(state, band).items():
                layers[name] = jnp.broadcast_to(x, (weight.size, *x.shape))
            groups.append((layers, weight))
        return groups

    def _solve(self, groups):
        """Sum over terms of all bands; which band a term belongs to costs no time."""
        total = 0.0
        for layers, weight in groups:
            layers = {name: jnp.moveaxis(x, -1, 1) for name, x in layers.items()}
            if "planck_levels" in layers:
                sun = jnp.full_like(layers["mu0"], solar_irradiance("C07"))
                light = toa_radiance(**layers, solar_irradiance=sun, **self.options)
            else:
                light = toa_brf(**layers, **self.options)
            total = total + weight @ light
        return total

    def _summed(self, state):
        """Columns do not mix: slopes of the sum over columns are those of each."""
        found = self.operator(state, self.bands)
        return found.sum(axis=0), found

    def _squares(self, copies):
        """Sum over what optics give every band of its own copy of the states.

        Each band's slopes are pulled back once, as in the Jacobian. Those of squares are as large
        as the arrays, and not constant.
        """
        given = {x: self._optics(y, bands=(x,)) for x, y in copies.items()}
        return sum(jnp.sum(x**2) for x in jax.tree.leaves(given))


def _on_last_axis(x):
    """Where the columns of an array that the optics give are: on its last axis, if it has any."""
    return PartitionSpec(*[None] * (x.ndim - 1), "core" if x.ndim > 1 else None)


def _how(options):
    if options.error_budget is None:
        return {"num_doublings": options.num_doublings}
    return {"error_budget": options.error_budget}


def _read(tree):
    return jax.tree.map(np.asarray, tree)


def timed(programs, count, options):
    """Seconds of every program's first call, and of one in each round."""
    everything = programs.all()
    first, seconds = {}, {name: [] for name in everything}
    for turn in range(options.repeats + 1):
        given = states(count, turn, options.dtype)
        order = list(everything)
        for name in order[turn % len(order) :] + order[: turn % len(order)]:
            prepared = jax.block_until_ready(programs.prepare(name, given))
            start = time.perf_counter()
            everything[name](prepared)
            spent = time.perf_counter() - start
            if turn:
                seconds[name].append(spent)
            else:
                first[name] = spent
    return first, seconds


def report(case, programs, count, options, bars):
    """Rows of a case, and its judgement."""
    first, seconds = timed(programs, count, options)
    work = count * len(programs.bands)
    median = {name: statistics.median(x) for name, x in seconds.items()}
    rows = []
    for name, every in seconds.items():
        micro = [1e6 * x / work for x in (median[name], min(every), max(every))]
        whole = median[name.split(",")[0]]
        share = f"{median[name] / whole:.0%}"
        rows.append([case, name, f"{work / median[name]:,.0f}", digits(micro[0])])
        rows[-1] += [f"{digits(micro[1])}-{digits(micro[2])}", share, f"{first[name]:.1f}"]
    for what in ("value", "Jacobian"):
        part = median[f"{what}, optics"] / median[what]
        bars.judge(part <= MOST, f"optics take {part:.0%} of the {what} of {case}, not {MOST:.0%}")
    return rows


def largest_error(case, programs, options):
    """Largest relative error by doublings that are too few, or by the budget, on 64 columns."""
    given = states(64, 0, np.float64)
    door, bands, gases = CASES[case]
    exact = np.asarray(door(given, bands, gases=gases, num_streams=options.num_streams))
    return np.max(np.abs(programs.value(given) / exact - 1))


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--columns", type=int, default=1000)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--num-streams", type=int, default=NUM_STREAMS)
    parser.add_argument("--num-doublings", type=int, default=3)
    parser.add_argument("--error-budget", type=float)
    parser.add_argument("--dtype", choices=["float64", "float32"], default="float64")
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    cores = workload.use_all_cores()
    count = cores * -(-options.columns // cores)
    print(f"abi-operator {__version__}, jax {jax.__version__}, {jax.devices()[0].device_kind},")
    print(f"{platform.machine()}, {cores} cores, Python {sys.version.split()[0]}, {options.dtype}")
    print(f"{count} columns, {HEIGHT.size - 1} layers, {options.num_streams} streams, ", end="")
    how = [f"{name.replace('_', ' ')} {x:g}" for name, x in _how(options).items()]
    print(*how, "\n", flush=True)
    bars, rows, notes = Bars(), [], []
    for case in CASES:
        programs = Programs(case, options, cores)
        rows += report(case, programs, count, options, bars)
        error = largest_error(case, programs, options)
        notes.append(f"{case} {error:.0e}")
    head = ["case", "program", "columns x bands / s", "microseconds", "range", "of the whole"]
    table([*head, "first call [s]"], rows)
    print("Microseconds are those of one band of one column; the Jacobian comes with the value.")
    print(f"Largest relative error that this leaves: {'; '.join(notes)}.\n")
    bars.report()
    sys.exit(1 if options.check and bars.failed else 0)


if __name__ == "__main__":
    main()
