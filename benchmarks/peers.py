"""Other solvers on the columns of `workload`, on all cores: nanodisort, disortpp and so on.

`Peers` keeps one process a core, each with one thread, and the columns in memory that all share:
nothing but the numbers of the first and last column travels with a call. Packing a column in the
form that a solver wants is part of its time. The processes are spawned, and none of them runs JAX.
"""

import importlib
import importlib.util
import multiprocessing
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from multiprocessing.sharedctypes import RawArray
from pathlib import Path

import numpy as np

NUM_MOMENTS = 129  # chi_0 .. chi_128: the single scattering of g = 0.8 converged to 1e-9
PLANET_RADIUS, LAYER_DEPTH, OBSERVER = 6.372e6, 1000.0, 2e5  # [m], of sasktran2; no light bends

# Names of a column's arrays, the axes that follow the column's, and where they lie.
AXES = {"tau": "l", "ssa": "l", "moments": "lm", "albedo": "", "mu0": "", "mu": "", "azimuth": ""}
# Of columns some of which emit: temperatures of levels and ground [K], where `planck_temperature`
# says so, and the sun's irradiance, 0 where a column does not emit.
EMISSION_AXES = {"temperature": "k", "ground_temperature": "", "irradiance": ""}
WAVENUMBER = 2570.0  # where peers evaluate Planck's function, in a window 1 wide [cm-1]
# Its constants in CDISORT: of Stefan and Boltzmann [W m-2 K-4], the second of radiation [cm K].
SIGMA, C2 = 5.67032e-8, 1.438786
_shared: dict[str, np.ndarray] = {}


def planck_temperature(radiance):
    """Temperature at which Planck's function of the peers is so much at `WAVENUMBER`. [K]"""
    scale = 15 * SIGMA / np.pi**5 * C2**4 * WAVENUMBER**3
    with np.errstate(divide="ignore"):
        return C2 * WAVENUMBER / np.log1p(scale / np.asarray(radiance))


@cache
def _nanodisort_state(num_streams, num_layers, corrected, num_moments=NUM_MOMENTS, emits=False):
    nanodisort = importlib.import_module("nanodisort")
    state = nanodisort.DisortState()
    state.nstr, state.nlyr, state.nmom = num_streams, num_layers, num_moments - 1
    state.ntau = state.numu = state.nphi = 1
    state.usrtau = state.usrang = state.lamber = state.quiet = True
    # Both flags: the correction of Nakajima and Tanaka.
    state.intensity_correction = state.old_intensity_correction = corrected
    state.planck = emits
    if emits:
        state.wvnmlo, state.wvnmhi = WAVENUMBER - 0.5, WAVENUMBER + 0.5
    state.allocate()
    state.utau, state.fbeam, state.phi0, state.accur = np.zeros(1), 1.0, 0.0, 0.0
    if emits:
        state.temis, state.ttemp = 1.0, 0.0
    return state


def _nanodisort(columns, num_streams, corrected=True, early_stop=0.0, num_moments=NUM_MOMENTS):
    """One solve a column, with its own sun and view; its state is allocated once."""
    tau, ssa, moments, albedo, mu0, mu, azimuth = (columns[k] for k in AXES)
    kinds = [
        _nanodisort_state(num_streams, tau.shape[1], corrected, num_moments, emits)
        for emits in (False, True)
    ]
    irradiance = columns.get("irradiance", np.zeros(len(tau)))
    degrees = 180 - np.degrees(azimuth)  # 0 is forward
    for i in range(len(tau)):
        state, sun = kinds[int(irradiance[i] > 0)], 1.0
        state.accur = early_stop
        state.dtauc, state.ssalb = tau[i], ssa[i]
        state.pmom = np.ascontiguousarray(moments[i, :, :num_moments].T)
        state.umu, state.phi = mu[i : i + 1], degrees[i : i + 1]
        state.umu0, state.albedo = mu0[i], albedo[i]
        if irradiance[i] > 0:
            state.fbeam = sun = irradiance[i]
            state.temper, state.btemp = columns["temperature"][i], columns["ground_temperature"][i]
        state.solve()
        yield np.pi / (mu0[i] * sun) * state.uu[0, 0, 0]


def _nanodisort_plain(columns, num_streams):
    """delta-M alone, and the sun and view of the first column for all: what sasktran2 is given."""
    one = {k: np.full_like(columns[k], _shared[k][0]) for k in ("mu0", "mu", "azimuth")}
    return _nanodisort(columns | one, num_streams, corrected=False)


def _nanodisort_one_geometry(columns, num_streams):
    """The sun and view of the first column for all, corrected."""
    one = {k: np.full_like(columns[k], _shared[k][0]) for k in ("mu0", "mu", "azimuth")}
    return _nanodisort(columns | one, num_streams)


@cache
def _disortpp_state(num_streams, num_layers, corrected, num_moments, emits):
    disortpp = importlib.import_module("disortpp")
    config = disortpp.DisortConfig(num_layers, num_streams, num_moments - 1)
    flags = config.flags
    flags.use_user_mu = flags.use_user_tau = flags.use_lambertian_surface = True
    flags.intensity_corr_nakajima = flags.intensity_corr_buras = corrected
    flags.use_thermal_emission = emits
    config.num_user_tau = config.num_user_mu = config.num_phi = 1
    config.allocate()
    config.tau_user = [0.0]
    config.bc.direct_beam_flux, config.bc.direct_beam_phi = 1.0, 0.0
    if emits:
        config.wavenumber_low, config.wavenumber_high = WAVENUMBER - 0.5, WAVENUMBER + 0.5
        config.bc.temperature_top, config.bc.emissivity_top = 0.0, 1.0
    return disortpp.DisortSolver(), config


def _disortpp(columns, num_streams, corrected=True, early_stop=0.0, num_moments=NUM_MOMENTS):
    """One solve a column: its call for many shares sun and view."""
    tau, ssa, moments, albedo, mu0, mu, azimuth = (columns[k] for k in AXES)
    kinds = [
        _disortpp_state(num_streams, tau.shape[1], corrected, num_moments, emits)
        for emits in (False, True)
    ]
    irradiance = columns.get("irradiance", np.zeros(len(tau)))
    degrees = 180 - np.degrees(azimuth)
    for i in range(len(tau)):
        (solver, config), sun = kinds[int(irradiance[i] > 0)], 1.0
        config.accuracy_fourier_series = early_stop
        config.delta_tau, config.single_scat_albedo = tau[i].tolist(), ssa[i].tolist()
        config.phase_function_moments = moments[i, :, :num_moments].tolist()
        config.mu_user, config.phi_user = [mu[i]], [degrees[i]]
        config.bc.direct_beam_mu, config.bc.surface_albedo = mu0[i], albedo[i]
        if irradiance[i] > 0:
            config.bc.direct_beam_flux = sun = irradiance[i]
            config.temperature = columns["temperature"][i].tolist()
            config.bc.temperature_bottom = columns["ground_temperature"][i]
        yield np.pi / (mu0[i] * sun) * solver.solve(config).intensities(0, 0, 0)


def _pythonic(columns, num_streams):
    """One solve a column; the radiance is interpolated from the quadrature's nodes to the view."""
    package = importlib.import_module("PythonicDISORT")
    tau, ssa, moments, albedo, mu0, mu, azimuth = (columns[k] for k in AXES)
    for i in range(len(tau)):
        *_, radiance = package.pydisort(
            np.cumsum(tau[i]),
            ssa[i],
            num_streams,
            moments[i],
            mu0[i],
            1.0,
            0.0,
            NLeg=num_streams,
            f_arr=moments[i, :, num_streams],
            BDRF_Fourier_modes=[albedo[i]],
            cache_asso_leg="no_mu0",
        )
        seen = package.subroutines.interpolate(radiance, NT_cor="eval")
        yield np.pi / mu0[i] * float(seen(mu[i], 0.0, np.pi - azimuth[i]))


def _sasktran2(columns, num_streams, derivatives=False, corrected=False, num_moments=NUM_MOMENTS):
    """All columns at once, as wavelengths; so all have the sun and view of the first column.

    `corrected`: light scattered once is its own exact integral, by so many moments.
    """
    sk = importlib.import_module("sasktran2")
    tau, ssa, moments, albedo, *_ = (columns[k] for k in AXES)
    mu0, mu, azimuth = (float(_shared[k][0]) for k in ("mu0", "mu", "azimuth"))
    count, layers = tau.shape
    config = sk.Config()
    config.num_streams, config.num_threads, config.delta_m_scaling = num_streams, 1, True
    config.multiple_scatter_source = sk.MultipleScatterSource.DiscreteOrdinates
    once = sk.SingleScatterSource
    config.single_scatter_source = once.Exact if corrected else once.DiscreteOrdinates
    used = max(num_moments, num_streams + 1) if corrected else num_streams + 1
    config.num_singlescatter_moments = used
    levels = LAYER_DEPTH * np.arange(layers + 1)
    interpolation, flat = sk.InterpolationMethod.LowerInterpolation, sk.GeometryType.PlaneParallel
    geometry = sk.Geometry1D(mu0, 0, PLANET_RADIUS, levels, interpolation, flat)
    view = sk.ViewingGeometry()
    view.add_ray(sk.GroundViewingSolar(mu0, np.pi - azimuth, mu, OBSERVER))
    # An engine that has served an atmosphere without derivatives crashes on one with them.
    engine = sk.Engine(config, geometry, view)
    unused = dict.fromkeys(("legendre", "pressure", "temperature", "specific_humidity"), False)
    unused = {f"{name}_derivative": x for name, x in unused.items()}
    air = sk.Atmosphere(
        geometry, config, numwavel=count, calculate_derivatives=derivatives, **unused
    )
    # From the ground up. delta-M changes these in place, so they are filled anew for every call.
    air.storage.total_extinction[:layers] = tau.T[::-1] / LAYER_DEPTH
    air.storage.ssa[:layers] = ssa.T[::-1]
    degrees = 2 * np.arange(used) + 1
    air.leg_coeff.a1[:, :layers] = (moments[..., :used] * degrees).T[:, ::-1]
    air.surface.albedo[:] = albedo
    result = engine.calculate_radiance(air)
    if derivatives:
        width = 2 * layers + 1
        gradient = _shared["gradient"][columns["start"] * width :][: count * width]
        gradient = gradient.reshape(count, width)
        of_depth, of_ssa = (result[f"wf_{k}"].values[:, :, 0, 0] for k in ("extinction", "ssa"))
        gradient[:, :layers] = np.pi / mu0 / LAYER_DEPTH * of_depth[layers - 1 :: -1].T
        gradient[:, layers:-1] = np.pi / mu0 * of_ssa[layers - 1 :: -1].T
        gradient[:, -1] = np.pi / mu0 * result["wf_albedo"].values[:, 0, 0]
    return np.pi / mu0 * result["radiance"].values[:, 0, 0]


def _sasktran2_derivatives(columns, num_streams, **options):
    """The same, with derivatives in tau and ssa of every layer and the albedo."""
    return _sasktran2(columns, num_streams, derivatives=True, **options)


@dataclass(frozen=True)
class Peer:
    """How a solver is called, and what it should reach.

    `rates`: columns a second at 4, 8, 16, 32 streams on one core, from an earlier measurement of
    each in its fastest form (20 layers, 128 moments, machine otherwise idle). Their ratio to
    nanodisort's tells whether a run here treats it well.
    """

    package: str
    solve: Callable
    rates: tuple[float, float, float, float]
    at_once: bool = False  # as few calls as there are cores
    derivatives: bool = False
    one_geometry: bool = False
    fewest_streams: int = 2


PEERS = {
    "nanodisort": Peer("nanodisort", _nanodisort, (12500, 2400, 370, 43)),
    "disortpp": Peer("disortpp", _disortpp, (8700, 2400, 432, 48), fewest_streams=4),
    "sasktran2": Peer(
        "sasktran2", _sasktran2, (13700, 2800, 452, 46), at_once=True, one_geometry=True
    ),
    "sasktran2 + derivatives": Peer(
        "sasktran2",
        _sasktran2_derivatives,
        (2700, 537, 92, 11.5),
        at_once=True,
        derivatives=True,
        one_geometry=True,
    ),
    "PythonicDISORT": Peer("PythonicDISORT", _pythonic, (281, 218, 121, 28), fewest_streams=4),
}
REFERENCES = {"plain": _nanodisort_plain, "one geometry": _nanodisort_one_geometry}
MEASURED_STREAMS = (4, 8, 16, 32)


def peer_version(name):
    """Version of the peer's package, or None where it is missing."""
    package = PEERS[name].package
    return version(package) if importlib.util.find_spec(package) else None


def usable_peers(num_streams):
    """Names of those installed that take so few streams."""
    return [k for k, x in PEERS.items() if peer_version(k) and num_streams >= x.fewest_streams]


def _view(buffers, name, num_layers, num_moments):
    letters = {"l": num_layers, "m": num_moments, "k": num_layers + 1}
    shape = [letters[c] for c in (AXES | EMISSION_AXES)[name]]
    array = np.frombuffer(buffers[name])
    return array[: array.size - array.size % int(np.prod(shape))].reshape(-1, *shape)


def _start(buffers, cores):
    """Runs once in every process, which keeps a core. CDISORT's warnings cannot be turned off."""
    os.sched_setaffinity(0, {cores.get()})
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    _shared["buffers"] = buffers
    _shared["brf"], _shared["gradient"] = (np.frombuffer(buffers[k]) for k in ("brf", "gradient"))


def peak_memory(_=None):
    """Largest memory of this process so far [bytes].

    What `getrusage` says counts that of the process it was started from.
    """
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.split("VmHWM:")[1].split()[0])


def _solve(task):
    name, num_streams, shape, start, stop, options = task
    buffers = _shared["buffers"]
    names = [k for k in AXES | EMISSION_AXES if k in buffers]
    _shared.update({k: _view(buffers, k, *shape) for k in names})
    columns = {k: _shared[k][start:stop] for k in names}
    solve = PEERS[name].solve if name in PEERS else REFERENCES[name]
    if name in PEERS and PEERS[name].derivatives:
        columns["start"] = start
    used = np.frombuffer(buffers["used"], np.int64)[start:stop]
    brf = _shared["brf"][start:stop]
    if (used == shape[0]).all():
        brf[:] = np.fromiter(solve(columns, num_streams, **options), float, stop - start)
        return peak_memory()
    # Columns of as many layers are solved together.
    for layers in np.unique(used):
        rows = np.flatnonzero(used == layers)
        own = {k: x[rows] for k, x in columns.items()}
        own |= {k: own[k][:, :layers] for k in ("tau", "ssa", "moments")}
        brf[rows] = np.fromiter(solve(own, num_streams, **options), float, len(rows))
    return peak_memory()


class Peers:
    """Processes that solve columns; `put` them first."""

    def __init__(
        self, num_processes, capacity, num_layers, num_moments=NUM_MOMENTS, emission=False
    ):
        self.num_processes, self.capacity, self.num_moments = num_processes, capacity, num_moments
        sizes = {"l": num_layers, "m": num_moments, "k": num_layers + 1}
        axes = AXES | (EMISSION_AXES if emission else {})
        size = {k: capacity * int(np.prod([sizes[c] for c in x])) for k, x in axes.items()}
        size |= {"brf": capacity, "used": capacity, "gradient": capacity * (2 * num_layers + 1)}
        self.buffers = {k: RawArray("d", n) for k, n in size.items()}
        before = dict(os.environ)
        # Read when a process loads its linear algebra.
        os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        context = multiprocessing.get_context("spawn")
        cores = context.Queue()
        for core in sorted(os.sched_getaffinity(0))[:num_processes]:
            cores.put(core)
        self.pool = context.Pool(num_processes, _start, (self.buffers, cores))
        os.environ.clear()
        os.environ |= before

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.pool.terminate()
        self.pool.join()

    def put(self, columns):
        """Take the columns of the following calls."""
        arrays = (columns.tau, columns.ssa, columns.moments(self.num_moments), columns.albedo)
        arrays += (columns.mu0, columns.mu, columns.relative_azimuth)
        self.put_arrays(dict(zip(AXES, arrays, strict=True)))

    def put_arrays(self, arrays, used=None):
        """The same of arrays by name; of each column the first `used` layers are there."""
        self.num_layers = arrays["tau"].shape[1]
        shape = self.num_layers, self.num_moments
        for name, array in arrays.items():
            _view(self.buffers, name, *shape)[: len(array)] = array
        there = np.frombuffer(self.buffers["used"], np.int64)
        there[:] = self.num_layers
        if used is not None:
            there[: len(used)] = used

    def solve(self, name, num_streams, count, **options):
        """brf of the first `count` columns, and the largest memory of a process [bytes]."""
        calls = self.num_processes * (1 if name in PEERS and PEERS[name].at_once else 4)
        bounds = np.linspace(0, count, min(calls, count) + 1).astype(int).tolist()
        shape = self.num_layers, self.num_moments
        tasks = [
            (name, num_streams, shape, *x, options)
            for x in zip(bounds[:-1], bounds[1:], strict=True)
        ]
        memory = self.pool.map(_solve, tasks, chunksize=1)
        return np.frombuffer(self.buffers["brf"])[:count].copy(), max(memory)

    def idle_memory(self):
        """Largest memory of a process so far [bytes]."""
        return max(self.pool.map(peak_memory, range(4 * self.num_processes), chunksize=1))

    def gradient(self, count):
        """Derivatives of the last call: tau and ssa of every layer, albedo."""
        width = 2 * self.num_layers + 1
        return np.frombuffer(self.buffers["gradient"])[: count * width].reshape(count, -1).copy()
