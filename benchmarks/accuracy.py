"""How wrong a reflectance is at a number of streams, and what it costs.

    python benchmarks/accuracy.py [--columns 1000] [--repeats 5]

Seven columns of three layers, air over a plume or a cloud over air (`CASES`): the largest relative
error of brf over 5 view angles x 4 azimuths, against CDISORT with 128 streams (200 for case g), of
this solver and of CDISORT at equal streams, and whether the two agree on CDISORT's nodes; then how
many moments the exact single scattering needs, how many azimuth modes, and microseconds a column
beside the error. Needs `nanodisort`, which the extra `test` brings. Float64; compiling apart.
"""

import argparse
import os
import platform
import sys
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from first_light import timed

from abi_operator import __version__
from abi_operator.optics.phase import HenyeyGreenstein, RayleighPhase
from abi_operator.solver import cos_scattering_angle, on_double_gauss, toa_brf

try:
    import nanodisort
except ModuleNotFoundError:
    sys.exit('This benchmark compares with CDISORT: pip install "abi-operator[test]".')

STREAMS = (4, 6, 8, 12, 16, 32)
CDISORT_STREAMS = (4, 8, 16, 32)
DELTA_M_STREAMS = (8, 16, 32)
SERIES_STREAMS = (8, 16, 32)
LENGTHS = (17, 33, 65, 129, 257)
CHECKED_LENGTH = 33
MODES = (2, 3, 4, 6)
NUM_MOMENTS = 641
SERIES_END = 1e-3  # (2l + 1)|chi_l| of the last moment, a usual measure of a long enough series
SPOILT = 1.1  # a series is long enough where the error is at most so many times the full one's

MU = np.repeat([0.2, 0.4, 0.6, 0.8, 1.0], 4)
RELATIVE_AZIMUTH = np.tile(np.radians([0.0, 60.0, 120.0, 180.0]), 5)
SCALE_HEIGHT = 8.0  # of the air's density [km]


@dataclass(frozen=True)
class Case:
    """A plume of Henyey-Greenstein phase functions, (share, g) each, within air of depth `air`."""

    name: str
    air: float
    tau: float
    ssa: float
    phase: tuple[tuple[float, float], ...]
    base_km: float
    top_km: float
    albedo: float
    mu0: float
    reference_streams: int = 128


CASES = (
    Case("a air", 0.2, 0, 1, (), 1, 3, 0.1, 0.6),
    Case("b smoke", 0.2, 1, 0.9, ((1, 0.6),), 1, 3, 0.05, 0.7),
    Case("c ash", 0.1, 2, 0.9, ((1, 0.7),), 8, 11, 0.1, 0.5),
    Case("d cloud", 0.1, 30, 0.9999, ((1, 0.86),), 1, 2, 0.05, 0.6),
    Case("e deep cloud", 0.1, 100, 1 - 1e-7, ((1, 0.85),), 1, 10, 0.5, 0.8),
    Case("f smoke, low sun", 0.2, 1, 0.9, ((1, 0.6),), 1, 3, 0.05, 0.05),
    Case("g peaked", 0.1, 10, 0.995, ((0.92, 0.96), (0.08, -0.2)), 1, 2, 0.1, 0.6, 200),
)


def layers(case):
    """tau, ssa, moments and phase function (layer, view) of a case, top first."""
    above = np.exp(-np.array([case.top_km, case.base_km]) / SCALE_HEIGHT)
    air = case.air * np.diff([0, *above, 1])
    plume = np.array([0, case.tau, 0])
    scattering = air + case.ssa * plume
    tau = air + plume
    cosine = cos_scattering_angle(case.mu0 + 0 * MU, MU, RELATIVE_AZIMUTH)
    terms = [(air, RayleighPhase(jnp.asarray(0.5)))]
    terms += [(case.ssa * w * plume, HenyeyGreenstein(jnp.asarray(g))) for w, g in case.phase]
    moments = sum(s[:, None] * np.asarray(p.moments(NUM_MOMENTS)) for s, p in terms)
    phase = sum(s[:, None] * np.asarray(jax.vmap(p)(cosine))[:, 0] for s, p in terms)
    return tau, scattering / tau, moments / scattering[:, None], phase / scattering[:, None]


def cdisort(tau, ssa, moments, case, num_streams, corrected):
    """CDISORT's brf in all directions, in its own order of them, or None where it refuses.

    Its azimuth is 0 in the forward direction.
    """
    mu, azimuth = np.unique(MU), np.unique(RELATIVE_AZIMUTH)
    state = nanodisort.DisortState()
    state.nstr, state.nlyr, state.nmom = num_streams, len(tau), moments.shape[1] - 1
    state.ntau, state.numu, state.nphi = 1, len(mu), len(azimuth)
    state.usrtau = state.usrang = state.lamber = state.quiet = True
    state.intensity_correction = state.old_intensity_correction = corrected
    state.allocate()
    state.dtauc, state.ssalb, state.pmom = tau, ssa, np.ascontiguousarray(moments.T)
    state.utau, state.umu, state.phi = np.zeros(1), mu, 180 - np.degrees(azimuth)
    state.fbeam, state.umu0, state.phi0, state.albedo = 1.0, case.mu0, 0.0, case.albedo
    state.accur = 0.0
    try:
        state.solve()
    except RuntimeError:
        return None
    return np.pi * np.asarray(state.uu)[:, 0, :].ravel() / case.mu0


def largest(values, reference):
    """Largest relative error over the last axis."""
    return np.max(np.abs(values / reference - 1), axis=-1)


def table(head, rows):
    print(f"| {' | '.join(head)} |\n|{' --- |' * len(head)}")
    for row in rows:
        print(f"| {' | '.join(row)} |")
    print()


def digits(error):
    return "refused" if error is None else f"{error:.1e}"


def directions_last(columns, num_streams, num_moments=None, **options):
    """brf (case, view), one column a case with all its views."""
    tau, ssa, moments, phase = columns
    if num_moments is None:
        options["phase_function"] = phase
    moments = moments[:, :, : num_moments or num_streams + 1]
    albedo, mu0 = np.array([[case.albedo, case.mu0] for case in CASES]).T
    arguments = tau, ssa, moments, albedo, mu0, MU, RELATIVE_AZIMUTH
    return np.asarray(toa_brf(*arguments, num_streams=num_streams, multiple_views=True, **options))


def one_view_each(columns, num_streams, num_columns):
    """A function of the phase functions to brf of `num_columns` columns, cases and views by turns.

    `by_case` brings its result to (case, view).
    """
    tau, ssa, moments, _ = columns
    case, view = np.divmod(np.resize(np.arange(len(CASES) * MU.size), num_columns), MU.size)
    albedo, mu0 = np.array([[c.albedo, c.mu0] for c in CASES]).T
    arguments = [tau[case], ssa[case], moments[case, :, : num_streams + 1], albedo[case], mu0[case]]
    arguments += [MU[view], RELATIVE_AZIMUTH[view]]

    def solve(phase):
        exact = phase[case, :, view]
        return toa_brf(*arguments, num_streams=num_streams, phase_function=exact)

    return solve


def by_case(brf):
    return np.asarray(brf)[: len(CASES) * MU.size].reshape(len(CASES), MU.size)


def compare(title, ours, on_its_nodes, theirs):
    """Errors by case, ours and CDISORT's, and how many cells differ as printed on its nodes."""
    print(f"{title}:\n")
    head = ["case", *(f"{n}" for n in ours), *(f"CDISORT {n}" for n in theirs)]
    rows, apart = [], []
    for i, case in enumerate(CASES):
        left = {n: digits(error[i]) for n, error in ours.items()}
        right = {n: digits(error[i]) for n, error in theirs.items()}
        same = {n: digits(error[i]) for n, error in on_its_nodes.items()}
        apart += [f"{case.name} at {n}" for n in right if right[n] != same[n]]
        rows.append([case.name, *left.values(), *right.values()])
    table(head, rows)
    cells = len(CASES) * len(theirs)
    print("On its nodes, cells that differ from CDISORT's as printed: ", end="")
    print(f"{len(apart)} of {cells} {apart or ''}\n")


def delta_m_alone(columns, reference):
    """Errors by case and streams, without exact single scattering."""
    found = {n: directions_last(columns, n, single_scattering=None) for n in DELTA_M_STREAMS}
    return {n: largest(x, reference) for n, x in found.items()}


def series_errors(columns, solve, brf, reference, num_streams):
    """Error (case, length) with each length of the series from `num_streams` + 1 on.

    The reflectance is linear in the exact phase function of every layer, so that its response to
    each, measured once, gives all lengths. Returns also brf (case, view, length).
    """
    tau, _, moments, phase = columns
    one = np.eye(tau.shape[1])[:, None, :, None] + 0 * phase
    without = by_case(solve(0 * phase))
    response = [by_case(solve(x)) - without for x in one]
    cosine = [cos_scattering_angle(case.mu0 + 0 * MU, MU, RELATIVE_AZIMUTH) for case in CASES]
    polynomials = np.polynomial.legendre.legvander(np.asarray(cosine), NUM_MOMENTS - 1)
    degrees = 2 * np.arange(NUM_MOMENTS) + 1
    series = np.cumsum(np.einsum("l,ckl,cvl->ckvl", degrees, moments, polynomials), axis=-1)
    lacking = series[..., num_streams:] - phase[..., None]
    changed = brf[..., None] + np.einsum("kcv,ckvl->cvl", response, lacking)
    return np.max(np.abs(changed / reference[..., None] - 1), axis=1), changed


def series_tables(columns, solvers, brf, reference, plain):
    """How long the series must be, and what too short a one costs."""
    found = {n: series_errors(columns, solvers[n], brf[n], reference, n) for n in SERIES_STREAMS}
    print(f"Moments from which on the error is at most {SPOILT} times that of the closed form:\n")
    head = ["case", *(f"{n} streams" for n in found), f"until (2l+1)chi_l < {SERIES_END:g}"]
    head += ["error at 16 with these", f"with {NUM_MOMENTS}", "closed form"]
    rows = []
    for i, case in enumerate(CASES):
        exact = {n: largest(brf[n][i], reference[i]) for n in found}
        row = [case.name]
        for n, (errors, _) in found.items():
            bad = np.flatnonzero(errors[i] > SPOILT * exact[n])
            row.append(str(n + 1 + (bad[-1] + 1 if bad.size else 0)))
        size = (2 * np.arange(NUM_MOMENTS) + 1) * np.abs(columns[2][i]).max(axis=0)
        length = int(np.flatnonzero(size >= SERIES_END)[-1]) + 2
        errors = found[16][0][i]
        row += [str(length), digits(errors[max(length, 17) - 17]), digits(errors[-1])]
        rows.append([*row, digits(exact[16])])
    table(head, rows)

    errors, values = found[16]
    print("Error at 16 streams by moments of the series:\n")
    head = ["case", *map(str, LENGTHS), "closed form", "no correction"]
    rows = []
    for i, case in enumerate(CASES):
        row = [digits(errors[i, n - 17]) for n in LENGTHS]
        rows.append([case.name, *row, digits(largest(brf[16][i], reference[i]))])
        rows[-1].append(digits(plain[16][i]))
    table(head, rows)
    summed = directions_last(columns, 16, num_moments=CHECKED_LENGTH)
    apart = np.abs(summed / values[..., CHECKED_LENGTH - 17] - 1).max()
    print(f"Summed by the solver, {CHECKED_LENGTH} moments: the same to {apart:.0e}\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--columns", type=int, default=1000)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(f"abi-operator {__version__}, jax {jax.__version__}, nanodisort ", end="")
    print(f"{nanodisort.__version__}, {jax.devices()[0].platform}, {platform.machine()}, ", end="")
    print(f"{os.cpu_count()} cores, Python {sys.version.split()[0]}, float64\n")

    every_case = [layers(case) for case in CASES]
    columns = [np.stack(x) for x in zip(*every_case, strict=True)]
    pairs = list(zip(CASES, every_case, strict=True))
    reference = np.stack([cdisort(*x[:3], c, c.reference_streams, True) for c, x in pairs])

    def theirs(num_streams, corrected):
        found = [cdisort(*x[:3], case, num_streams, corrected) for case, x in pairs]
        return [None if brf is None else largest(brf, reference[i]) for i, brf in enumerate(found)]

    count = max(options.columns, len(CASES) * MU.size)
    solvers = {n: one_view_each(columns, n, count) for n in STREAMS}
    times = {n: timed(partial(f, columns[3]), options.repeats) for n, f in solvers.items()}
    brf = {n: by_case(x[3]) for n, x in times.items()}
    errors = {n: largest(x, reference) for n, x in brf.items()}
    corrected = {n: theirs(n, True) for n in CDISORT_STREAMS}
    plain = delta_m_alone(columns, reference)
    with on_double_gauss():
        same = {n: by_case(one_view_each(columns, n, count)(columns[3])) for n in CDISORT_STREAMS}
        same = {n: largest(x, reference) for n, x in same.items()}
        same_plain = delta_m_alone(columns, reference)
    compare("delta-M and exact single scattering", errors, same, corrected)
    compare("delta-M alone", plain, same_plain, {n: theirs(n, False) for n in DELTA_M_STREAMS})
    series_tables(columns, solvers, brf, reference, plain)

    print("Azimuth modes kept at 16 streams, exact single scattering:\n")
    kept = [largest(directions_last(columns, 16, num_modes=m), reference) for m in MODES]
    rows = [
        [case.name, *(digits(e[i]) for e in kept), digits(errors[16][i])]
        for i, case in enumerate(CASES)
    ]
    table(["case", *map(str, MODES), "all 16"], rows)

    print(f"{count} columns of these cases, one view each, 3 layers:\n")
    head = ["streams", "first call [s]", "median [s]", "microseconds a column"]
    rows = []
    for n, (first, median, *_) in times.items():
        every = np.abs(brf[n] / reference - 1)
        row = [f"{n}", f"{first:.1f}", f"{median:.3f}", f"{median / count * 1e6:.0f}"]
        rows.append(row + [digits(x) for x in (np.median(every), every[:6].max(), every[6].max())])
    table([*head, "median error", "largest, a to f", "largest, g"], rows)


if __name__ == "__main__":
    main()
