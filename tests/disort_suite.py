"""DISORT's own test problems, and CDISORT with all its sources by way of `nanodisort`.

Azimuths here are DISORT's, 0 in the forward direction; radiances are in each problem's own units.
"""

import csv
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path

import nanodisort
import numpy as np
from nanodisort.utils import phase_functions

REFERENCE = Path(__file__).parent / "reference"
FULL_DEGREE = 298
"""Degree of the longest phase function of the suite, Cloud C.1."""
MIE_8 = np.array(
    [1, 2.00916, 1.56339, 0.67407, 0.22215, 0.04725, 0.00671, 0.00068, 0.00005]
) / np.arange(1, 19, 2)
"""Moments of Mie spheres of size parameter 2 and index 1.33 (Garcia and Siewert 1985)."""


@dataclass(frozen=True)
class Problem:
    """One column with all that shines on it and in it; without temperatures it does not emit."""

    tau: np.ndarray
    ssa: np.ndarray
    moments: np.ndarray
    albedo: float = 0.0
    mu0: float = 0.5
    solar_irradiance: float = 0.0
    isotropic_top: float = 0.0
    temperature: np.ndarray | None = None
    top_temperature: float = 0.0
    bottom_temperature: float = 0.0
    wavenumber: tuple[float, float] = (0.0, 0.0)


def read_table(name):
    """Rows of a reference table, as dictionaries of text."""
    with open(REFERENCE / name, newline="") as file:
        return list(csv.DictReader(file))


def phase_moments(name, num_layers, degree):
    """Moments, ``layer moment``, of a phase function named as in the tables, up to `degree`."""
    kind, *parameters = name.split()
    moments = np.zeros((num_layers, degree + 1))
    moments[:, 0] = 1
    if kind == "henyey_greenstein":
        g = np.array([float(Fraction(g)) for g in parameters])
        moments[:] = g[:, None] ** np.arange(degree + 1)
    elif kind == "rayleigh":
        moments[:, 2] = 0.1
    elif kind == "mie_8":
        count = min(MIE_8.size, degree + 1)
        moments[:, :count] = MIE_8[:count]
    elif kind in ("haze_l", "cloud_c1"):
        moments[:] = getattr(phase_functions, kind)(degree)
    else:
        assert kind == "isotropic", kind
    return moments


def suite_problem(row, degree=None):
    """The problem of one row of `disort_problems.csv`, with moments up to `degree` if given."""
    tau, ssa, temperature = (
        np.array([float(x) for x in row[key].split()]) for key in ("tau", "ssa", "temperature")
    )
    thermal = {}
    if temperature.size:
        thermal = {key: float(row[key]) for key in ("top_temperature", "bottom_temperature")}
        thermal["wavenumber"] = float(row["wavenumber_low"]), float(row["wavenumber_high"])
        thermal["temperature"] = temperature
    return Problem(
        tau,
        ssa,
        phase_moments(row["phase"], tau.size, degree or int(row["degree"])),
        albedo=float(row["albedo"]),
        mu0=float(row["mu0"]),
        solar_irradiance=_number(row["solar_irradiance"]),
        isotropic_top=_number(row["isotropic_top"]),
        **thermal,
    )


def _number(text):
    # The table writes "10 pi" and "1/pi", as the suite does.
    value = float(text.replace("pi", "").strip(" /"))
    if "pi" not in text:
        return value
    return value / np.pi if "/" in text else value * np.pi


def cdisort(problem, mu, azimuth_deg, num_streams, corrected=True):
    """Radiance upward at the top in one direction, and the flux; its last digits are ~1e-9."""
    thermal = problem.temperature is not None
    state = nanodisort.DisortState()
    state.nstr, state.nlyr = num_streams, len(problem.tau)
    state.nmom = problem.moments.shape[1] - 1
    state.ntau = state.numu = state.nphi = 1
    state.usrtau = state.usrang = state.lamber = state.quiet = True
    state.intensity_correction = state.old_intensity_correction = corrected
    state.planck = thermal
    if thermal:
        state.wvnmlo, state.wvnmhi = problem.wavenumber
    state.allocate()
    state.dtauc, state.ssalb = problem.tau, problem.ssa
    state.pmom = np.ascontiguousarray(problem.moments.T)
    state.utau, state.umu, state.phi = np.zeros(1), np.array([mu]), np.array([azimuth_deg])
    state.fbeam, state.umu0, state.phi0 = problem.solar_irradiance, problem.mu0, 0.0
    state.albedo, state.fisot, state.fluor = problem.albedo, problem.isotropic_top, 0.0
    state.accur = 0.0
    if thermal:
        state.temper, state.temis = problem.temperature, 1.0
        state.ttemp, state.btemp = problem.top_temperature, problem.bottom_temperature
    state.solve()
    return state.uu[0, 0, 0], state.flup[0]


@cache
def cdisort_planck(temperature, wavenumber):
    """CDISORT's own Planck integral: what a black ground sends through an empty layer."""
    empty = Problem(
        np.zeros(1),
        np.zeros(1),
        np.eye(1, 5),
        temperature=np.zeros(2),
        bottom_temperature=temperature,
        wavenumber=wavenumber,
    )
    return cdisort(empty, 1.0, 0.0, 4)[0]


def random_emitting_problems(rng, count, max_layers=6):
    """Warm columns over a warm ground, the odd ones in sunlight too, each with its direction.

    No layer is thinner than CDISORT's 1e-4, below which it takes the Planck function as constant.
    """
    degrees = np.arange(65)
    for i in range(count):
        layers = rng.integers(1, max_layers + 1)
        tau = np.exp(rng.uniform(np.log(1e-3), np.log(30), layers))
        ssa = np.where(rng.random(layers) < 0.2, rng.choice([0.0, 1 - 1e-4]), rng.random(layers))
        moments = rng.uniform(-0.3, 0.9, (layers, 1)) ** degrees
        low = rng.choice([0.0, 300.0, 800.0, 2500.0])
        wavenumber = (low, 50000.0 if low == 0 else low + 300)
        ground = rng.uniform(200, 320)
        problem = Problem(
            tau,
            ssa,
            moments,
            albedo=rng.choice([0.0, 1.0, rng.random()]),
            mu0=rng.uniform(0.02, 1),
            solar_irradiance=i % 2 * rng.uniform(0, 10) * cdisort_planck(ground, wavenumber),
            isotropic_top=i % 3 * rng.uniform(0, 0.3) * cdisort_planck(ground, wavenumber),
            temperature=rng.uniform(200, 320, layers + 1),
            top_temperature=rng.choice([0.0, rng.uniform(100, 250)]),
            bottom_temperature=ground,
            wavenumber=wavenumber,
        )
        yield problem, rng.uniform(0.02, 0.99), rng.uniform(0, 180)
