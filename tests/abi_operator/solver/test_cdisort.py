"""The solver against CDISORT, at equal streams, on columns nobody chose."""

import numpy as np
import pytest
from cdisort import cdisort_brf, cut
from forty_digits import forty_digit_brf

from abi_operator.solver import toa_brf

SEED = 20071023
NUM_COLUMNS = 500
STREAMS = (2, 4, 6, 8, 12, 16, 32)
MAX_LAYERS = 50
NUM_MOMENTS = 641
# Both solve the same equations; CDISORT's eigenvalues and our doublings round at about 1e-11.
EQUIVALENCE = 1e-8
# Where they differ by more, 40 digits decide, and ours has to be right to this.
RIGHT = 1e-10
FLOOR = 1e-5


def random_columns(rng, count):
    """Layers, ground and directions over all that the solver promises; tau 0 pads to 50 layers."""
    layers = rng.integers(1, MAX_LAYERS + 1, count)
    exists = np.arange(MAX_LAYERS) < layers[:, None]
    thickest = 10 ** rng.uniform(-3, np.log10(200), (count, 1))
    tau = np.exp(rng.uniform(np.log(1e-6), np.log(thickest), exists.shape)) * exists
    special = rng.choice([0.0, 1.0, 1 - 1e-12], exists.shape)
    floor = rng.choice([0.0, 0.9, 0.999], (count, 1))
    ssa = np.where(rng.random(exists.shape) < 0.3, special, rng.uniform(floor, 1, exists.shape))
    g = rng.uniform(-0.5, 0.95, exists.shape)
    haze = rng.choice([0.0, 0.5, 1.0], exists.shape, p=[0.15, 0.15, 0.7])[..., None]
    rayleigh = np.zeros(NUM_MOMENTS)
    rayleigh[[0, 2]] = 1, 0.1
    moments = haze * g[..., None] ** np.arange(NUM_MOMENTS) + (1 - haze) * rayleigh
    mu0, mu = rng.uniform(0.02, 1, (2, count))
    mu[rng.random(count) < 0.05] = 1
    same = rng.random(count) < 0.05
    mu[same] = mu0[same]
    albedo, azimuth = rng.uniform(0, 1, count), rng.uniform(0, np.pi, count)
    return tau, ssa, moments, albedo, mu0, mu, azimuth


def error(ours, reference):
    return abs(ours - reference) / max(abs(reference), FLOOR)


def assert_single_scattering(column, num_streams):
    """CDISORT returns 0 for a column this thin; over black ground the closed form is the judge."""
    tau, ssa, moments, _, mu0, mu, azimuth = column
    cosine = -mu * mu0 - np.sqrt((1 - mu**2) * (1 - mu0**2)) * np.cos(azimuth)
    degrees = 2 * np.arange(moments.shape[-1]) + 1
    phase = np.array([np.polynomial.legendre.legval(cosine, degrees * chi) for chi in moments])
    expected = np.sum(ssa * tau * phase) / (4 * mu * mu0)
    result = toa_brf(tau, ssa, moments, 0.0, mu0, mu, azimuth, num_streams=num_streams)
    # What is attenuated, or scattered once more, is smaller by the slant optical depth.
    slant = tau.sum() * (1 / mu + 1 / mu0)
    np.testing.assert_allclose(result, expected, rtol=2 * slant)


@pytest.mark.parametrize("corrected", [False, True], ids=["delta-M", "TMS"])
def test_equals_cdisort_on_500_random_columns(corrected):
    """At most 1e-8 apart; excluded are only columns that CDISORT refuses or cuts off, or where 40
    digits show it wrong.
    """
    rng = np.random.default_rng(SEED)
    counts = np.diff(np.linspace(0, NUM_COLUMNS, len(STREAMS) + 1).astype(int))
    errors, reasons = [], {"compared uncut": 0, "compared cut (absorption depth > 10)": 0}
    reasons |= {"CDISORT refuses": 0, "total tau < 1e-5": 0, "40 digits: CDISORT off": 0}
    for num_streams, count in zip(STREAMS, counts, strict=True):
        tau, *rest = random_columns(rng, count)
        was_cut = np.zeros(count, bool)
        if corrected:
            for i in range(count):
                tau[i], was_cut[i] = cut(tau[i], rest[0][i])
        scattering = "tms" if corrected else None
        ours = np.asarray(
            toa_brf(tau, *rest, num_streams=num_streams, single_scattering=scattering)
        )
        for i in range(count):
            used = tau[i] > 0
            column = [tau[i][used], *(x[i][used] for x in rest[:2]), *(x[i] for x in rest[2:])]
            if tau[i].sum() < 1e-5:
                reasons["total tau < 1e-5"] += 1
                if corrected:
                    assert_single_scattering(column, num_streams)
                continue
            try:
                reference = cdisort_brf(*column, num_streams, corrected)
            except RuntimeError:
                reasons["CDISORT refuses"] += 1
                continue
            difference = error(ours[i], reference)
            if difference > EQUIVALENCE:
                exact = forty_digit_brf(*column, num_streams, corrected)
                print(
                    f"streams {num_streams} column {i}: apart by {difference:.1e}; from 40 digits, "
                    f"ours {error(ours[i], exact):.1e}, CDISORT {error(reference, exact):.1e}"
                )
                assert error(ours[i], exact) <= RIGHT
                reasons["40 digits: CDISORT off"] += 1
                continue
            reasons["compared cut (absorption depth > 10)" if was_cut[i] else "compared uncut"] += 1
            errors.append(difference)
    p50, p99, p999 = np.percentile(errors, [50, 99, 99.9])
    print(f"seed {SEED}: p50 {p50:.1e} p99 {p99:.1e} p99.9 {p999:.1e} max {max(errors):.1e}")
    print(reasons)
    assert len(errors) + sum(list(reasons.values())[2:]) == NUM_COLUMNS
    assert reasons["CDISORT refuses"] + reasons["total tau < 1e-5"] <= NUM_COLUMNS // 100
    assert max(errors) <= EQUIVALENCE
