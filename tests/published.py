"""Published cases in one call of the solver a number of streams: compiling is what costs."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import plumes
from disort_suite import (
    FULL_DEGREE,
    Problem,
    cdisort_planck,
    phase_moments,
    random_emitting_problems,
    read_table,
    suite_problem,
)

from abi_operator.solver import double_gauss, on_double_gauss, toa_albedo, toa_radiance

MAX_LAYERS = 6
# Thicker layers come as several, for which few doublings are enough: a program with more of them
# takes longer to compile than more layers to solve.
THICKEST = 25.0
H_OMEGA = (0.2, 0.5, 0.9, 0.99, 0.999, 1.0)
H_MU = (0.1, 0.4, 0.7, 1.0)
# exp(-2 k tau) < 1e-10 for each diffusion exponent k; omega = 1 has its rest in closed form.
H_TAU = (40.0, 40.0, 40.0, 80.0, 250.0, 40.0)
MEAN_AZIMUTHS = (18.0, 54.0, 90.0, 126.0, 162.0)
SEED = 19850314
NUM_RANDOM, RANDOM_STREAMS = 100, (4, 8, 16)
PLUME_STREAMS, SHORT_SERIES = (4, 8, 16, 32), (17, 33, 129)


@dataclass(frozen=True)
class View:
    """A problem seen from one direction; azimuth as DISORT counts it. [deg]"""

    problem: Problem
    mu: float
    azimuth_deg: float = 0.0
    planck_levels: np.ndarray | None = None
    surface_emission: float = 0.0

    def sources(self):
        """Planck function at the levels, emission of the ground, and what falls on the top."""
        p = self.problem
        if p.temperature is None:
            levels = self.planck_levels
            levels = np.zeros(p.tau.size + 1) if levels is None else levels
            return levels, self.surface_emission, p.isotropic_top
        levels = np.array([cdisort_planck(t, p.wavenumber) for t in p.temperature])
        ground = (1 - p.albedo) * cdisort_planck(p.bottom_temperature, p.wavenumber)
        return levels, ground, p.isotropic_top + cdisort_planck(p.top_temperature, p.wavenumber)


def in_parts(problem, levels):
    """Layers none of which is thick, and the Planck function at their levels."""
    parts = np.maximum(1, np.ceil(problem.tau / THICKEST)).astype(int)
    tau, ssa, moments = (
        np.repeat(x, parts, axis=0) for x in (problem.tau / parts, problem.ssa, problem.moments)
    )
    places = np.append(0, np.cumsum(parts))
    return tau, ssa, moments, np.interp(np.arange(places[-1] + 1), places, levels)


def solver_arguments(views):
    """Arguments of `toa_radiance`, batch first; empty layers below make all as many."""
    problems, sources = [view.problem for view in views], [view.sources() for view in views]
    layers = [in_parts(p, levels) for p, (levels, _, _) in zip(problems, sources, strict=True)]
    num_moments = max(p.moments.shape[1] for p in problems)
    max_layers = max(tau.size for tau, *_ in layers)
    tau, ssa = np.zeros((2, len(views), max_layers))
    moments = np.zeros((len(views), max_layers, num_moments))
    moments[..., 0] = 1
    levels = np.zeros((len(views), max_layers + 1))
    for i, (own_tau, own_ssa, own_moments, inside) in enumerate(layers):
        n, degrees = own_moments.shape
        tau[i, :n], ssa[i, :n], moments[i, :n, :degrees] = own_tau, own_ssa, own_moments
        levels[i, : n + 1], levels[i, n + 1 :] = inside, inside[-1]
    albedo, mu0, irradiance = (
        np.array([getattr(p, key) for p in problems])
        for key in ("albedo", "mu0", "solar_irradiance")
    )
    mu = np.array([view.mu for view in views])
    azimuth = np.pi - np.radians([view.azimuth_deg for view in views])
    sources = {
        "solar_irradiance": irradiance,
        "planck_levels": levels,
        "surface_emission": np.array([ground for _, ground, _ in sources]),
        "isotropic_top": np.array([top for _, _, top in sources]),
    }
    return (tau, ssa, moments, albedo, mu0, mu, azimuth), sources


@cache
def problems(degree=None):
    """The suite's problems by name; moments up to `degree`, or as the suite has them."""
    return {row["case"]: suite_problem(row, degree) for row in read_table("disort_problems.csv")}


@cache
def streams():
    """The suite's number of streams by problem."""
    return {row["case"]: int(row["streams"]) for row in read_table("disort_problems.csv")}


def suite_rows(table, num_streams=None):
    """Rows of a table of the suite, all or those for so many streams."""
    return [r for r in read_table(table) if num_streams in (None, streams()[r["case"]])]


def glows(problem):
    """Whether anything but the sun shines."""
    return problem.isotropic_top > 0 or problem.temperature is not None


def _from_suite(row, degree=None):
    return View(problems(degree)[row["case"]], float(row["mu"]), float(row["azimuth_deg"]))


def _views_on_double_gauss(num_streams):
    """What other solvers have at the same streams."""
    # The flux without the sun: radiances at the nodes. TMS does nothing there.
    dark = [
        View(replace(problems()[row["case"]], solar_irradiance=0.0), mu)
        for row in suite_rows("disort_fluxes.csv", num_streams)
        if glows(problems()[row["case"]])
        for mu in double_gauss(num_streams)[0]
    ]
    views = {
        "suite": [_from_suite(r) for r in suite_rows("disort_radiances.csv", num_streams)],
        "dark": dark,
    }
    if num_streams in RANDOM_STREAMS:
        views["random"] = random_views(num_streams)
    return views


def _views(num_streams):
    """What is known whatever the streams."""
    views = {}
    if num_streams in PLUME_STREAMS:
        views["plumes"] = _seen(plumes.columns())
    if num_streams in (16, 32, 64):
        views |= {
            "converged": [_from_suite(r, FULL_DEGREE) for r in suite_rows("disort_radiances.csv")],
            "garcia_siewert": _garcia_siewert(),
            "van_de_hulst": [
                View(_van_de_hulst(r), float(r["mu"]))
                for r in read_table("van_de_hulst.csv")
                if r["mu"] != "flux"
            ],
            "semi_infinite": [View(p, mu) for p in semi_infinite() for mu in H_MU],
            "emitting": _emitting(),
        }
    if num_streams == 16:
        views["isothermal"] = _isothermal()
        views["delta_m_alone"] = _seen(plumes.delta_m_alone(num_streams))
        views |= {f"series of {n}": _seen(plumes.with_series(n)) for n in SHORT_SERIES}
    return views


@cache
def random_views(num_streams):
    """Random warm columns, the odd ones in sunlight too; other ones for each number of streams."""
    rng = np.random.default_rng([SEED, num_streams])
    return [View(*one) for one in random_emitting_problems(rng, NUM_RANDOM, MAX_LAYERS)]


def _seen(columns):
    """Columns of `plumes` under a sun that makes a radiance a reflectance; columns slowest."""
    directions = list(zip(plumes.MU, 180 - np.degrees(plumes.AZIMUTH), strict=True))
    return [
        View(Problem(*column, solar_irradiance=np.pi / column[-1]), mu, azimuth)
        for column in zip(*columns, strict=True)
        for mu, azimuth in directions
    ]


def _garcia_siewert():
    views = []
    for row in read_table("garcia_siewert.csv"):
        ssa = 0.95 if row["problem"] == "mie_8" else 0.9
        phase = phase_moments(row["problem"], 1, FULL_DEGREE)
        slab = Problem(np.ones(1), np.array([ssa]), phase, mu0=0.5, solar_irradiance=np.pi)
        # The zeros of cos 5 phi: the mean over them is exact for modes 0 to 9.
        mean = row["azimuth_deg"] == "mean"
        azimuths = MEAN_AZIMUTHS if mean else [float(row["azimuth_deg"])]
        views += [View(slab, float(row["mu"]), azimuth) for azimuth in azimuths]
    return views


def _van_de_hulst(row):
    tau, ssa, g = (np.array([float(row[key])]) for key in ("tau", "ssa", "asymmetry"))
    phase = g[:, None] ** np.arange(FULL_DEGREE + 1)
    return Problem(tau, ssa, phase, mu0=float(row["mu0"]), solar_irradiance=np.pi)


def semi_infinite():
    """Thick isotropic layers under each sun, omega slowest."""
    phase = phase_moments("isotropic", 1, FULL_DEGREE)
    return [
        Problem(np.array([tau]), np.array([omega]), phase, mu0=mu0, solar_irradiance=np.pi / mu0)
        for omega, tau in zip(H_OMEGA, H_TAU, strict=True)
        for mu0 in H_MU
    ]


def _emitting():
    # B = 1 + 0.3 tau over a black ground at the temperature of the last level.
    phase = phase_moments("isotropic", 1, FULL_DEGREE)
    return [
        View(
            Problem(np.array([tau]), np.array([omega]), phase),
            mu,
            planck_levels=1 + 0.3 * np.array([0, tau]),
            surface_emission=1 + 0.3 * tau,
        )
        for omega, tau in zip(H_OMEGA[:-1], H_TAU[:-1], strict=True)
        for mu in H_MU
    ]


def _isothermal(count=60, planck=1.7):
    rng = np.random.default_rng(SEED)
    views = []
    for i in range(count):
        layers = rng.integers(1, MAX_LAYERS + 1)
        tau = 10 ** rng.uniform(-4, 2, layers) * (rng.random(layers) > 0.1)
        ssa = rng.choice([0.0, 1.0, rng.uniform(), 1 - 1e-6], layers)
        phase = rng.uniform(-0.5, 0.95, (layers, 1)) ** np.arange(FULL_DEGREE + 1)
        albedo = (0.0, 1.0, rng.uniform())[i % 3]
        box = Problem(tau, ssa, phase, albedo, isotropic_top=planck)
        level = np.full(layers + 1, planck)
        views.append(View(box, rng.uniform(0.02, 1), 0.0, level, (1 - albedo) * planck))
    return views


def _radiances(views, num_streams):
    arguments, sources = solver_arguments([view for group in views.values() for view in group])
    result = np.asarray(toa_radiance(*arguments, **sources, num_streams=num_streams))
    ends = np.cumsum([len(group) for group in views.values()])
    return dict(zip(views, np.split(result, ends[:-1]), strict=True))


@cache
def radiances(num_streams):
    """Radiance of views whose radiance is known, at so many streams, by group."""
    return _radiances(_views(num_streams), num_streams)


@cache
def radiances_on_double_gauss(num_streams):
    """Radiance of every view that others have at so many streams, by group."""
    with on_double_gauss():
        return _radiances(_views_on_double_gauss(num_streams), num_streams)


def _plane_albedos(groups, num_streams):
    views = [View(p, 0.5) for group in groups.values() for p in group]
    (tau, ssa, moments, albedo, mu0, *_), _ = solver_arguments(views)
    result = np.asarray(toa_albedo(tau, ssa, moments, albedo, mu0, num_streams=num_streams))
    ends = np.cumsum([len(group) for group in groups.values()])
    return dict(zip(groups, np.split(result, ends[:-1]), strict=True))


@cache
def plane_albedos(num_streams):
    """Plane albedo at so many streams, by group: converged, tabulated, thick."""
    groups = {
        "converged": [problems(FULL_DEGREE)[r["case"]] for r in suite_rows("disort_fluxes.csv")],
        "van_de_hulst": [
            _van_de_hulst(r) for r in read_table("van_de_hulst.csv") if r["mu"] == "flux"
        ],
        "semi_infinite": semi_infinite(),
    }
    return _plane_albedos(groups, num_streams)


@cache
def plane_albedos_on_double_gauss(num_streams):
    """Plane albedo of the suite's problems at their own streams."""
    suite = [problems()[r["case"]] for r in suite_rows("disort_fluxes.csv", num_streams)]
    with on_double_gauss():
        return _plane_albedos({"suite": suite}, num_streams)["suite"]
