"""The solver against the test problems of DISORT: printed values, CDISORT, converged answers.

Left out are 5b (no level at the top), 6a (an empty column) and the grounds that are not Lambertian
(6d-h, 7e). A flux is that of the sunlight, by `toa_albedo`, plus radiances at the nodes with the
sun off.
"""

import numpy as np
import pytest
from disort_suite import cdisort
from forty_digits import forty_digit_radiance
from published import (
    NUM_RANDOM,
    RANDOM_STREAMS,
    View,
    glows,
    half_range_nodes,
    plane_albedos,
    problems,
    radiances,
    random_views,
    suite_rows,
)

# Compiling is what these take; one program for radiances, one for albedos.
RADIANCE_STREAMS = (8, 16, 32, *(pytest.param(n, marks=pytest.mark.slow) for n in (4, 12, 20, 48)))
FLUX_STREAMS = (8, 16, *(pytest.param(n, marks=pytest.mark.slow) for n in (4, 12, 20, 32, 48)))
EQUIVALENCE = 1e-8
# Where they differ by more, 40 digits decide, and ours has to be right to this.
RIGHT = 1e-10
# Problems without a layer of albedo 1 agree to 4e-13 (6c to 2e-11); CDISORT lowers that albedo a
# little and loses digits, 8e-9 at most (4a). It cuts 12b off at an absorption depth of 10: 2e-9.
# Half of the last printed digit, and a tenth for the machine that printed it.
PRINTED = 0.6
# Left by 32 and by 64 streams, relative, where it is more than `LEFT`. Sharp phase functions come
# last at exact backscatter: 5a, of which CDISORT with 200 streams lacks 2e-4, and 12, a dark
# absorber that returns 0.1 % of the light.
LEFT_AT_32 = {"1a": 2e-5, "1b": 8e-5, "1c": 7e-6, "2": 8e-6, "3": 1.3e-5, "4": 1.3e-4}
LEFT_AT_32 |= {"5a": 8.5e-3, "7c": 5e-7, "7d": 5e-7, "12": 7.5e-2, "1e": 2e-7}
LEFT_AT_64 = {"1b": 6e-7, "1c": 2e-7, "5a": 8.5e-3, "12": 1.3e-3}
# Eight printed digits of the converged values, and CDISORT's own rounding at 200 streams.
LEFT = 1.5e-7


def unit_of_last_digit(text):
    """Worth of the last digit of a printed number."""
    mantissa, _, exponent = text.partition("E")
    decimals = len(mantissa.partition(".")[2])
    return 10.0 ** (int(exponent or 0) - decimals)


def fluxes(num_streams):
    """Upward flux of each of the suite's problems at so many streams."""
    rows = suite_rows("disort_fluxes.csv", num_streams)
    nodes, weights = half_range_nodes(num_streams)
    columns = [problems()[row["case"]] for row in rows]
    emitted = np.zeros((len(rows), nodes.size))
    emitted[[glows(p) for p in columns]] = radiances(num_streams)["dark"].reshape(-1, nodes.size)
    sunlight = np.array([p.mu0 * p.solar_irradiance for p in columns])
    return sunlight * plane_albedos(num_streams)["suite"] + 2 * np.pi * emitted @ (nodes * weights)


def forty_digits(view, num_streams):
    """The view's radiance from 40 digits."""
    p, (levels, ground, top) = view.problem, view.sources()
    return forty_digit_radiance(
        p.tau,
        p.ssa,
        p.moments,
        p.albedo,
        p.mu0,
        view.mu,
        np.pi - np.radians(view.azimuth_deg),
        num_streams,
        True,
        solar_irradiance=p.solar_irradiance,
        planck_levels=levels,
        surface_emission=ground,
        isotropic_top=top,
    )


@pytest.mark.parametrize("num_streams", RADIANCE_STREAMS)
def test_radiances_at_the_suites_streams_and_moments(num_streams):
    """CDISORT to 1e-8 (or else 40 digits to 1e-10), and the printed values to their digits."""
    rows, ours = suite_rows("disort_radiances.csv", num_streams), radiances(num_streams)["suite"]
    for row, value in zip(rows, ours, strict=True):
        problem, name = problems()[row["case"]], (row["case"], row["mu"], row["azimuth_deg"])
        expected, _ = cdisort(problem, float(row["mu"]), float(row["azimuth_deg"]), num_streams)
        if abs(value - expected) > EQUIVALENCE * abs(expected):
            exact = forty_digits(
                View(problem, float(row["mu"]), float(row["azimuth_deg"])), num_streams
            )
            assert abs(value - exact) <= RIGHT * exact, (name, value, expected, exact)
        if row["printed"]:
            off = abs(value - float(row["printed"])) / unit_of_last_digit(row["printed"])
            assert off <= PRINTED, (name, value, row["printed"])


@pytest.mark.parametrize("num_streams", FLUX_STREAMS)
def test_fluxes_at_the_suites_streams_and_moments(num_streams):
    """Upward flux at the top: CDISORT to 1e-8, and the printed values to their digits."""
    rows = suite_rows("disort_fluxes.csv", num_streams)
    for row, value in zip(rows, fluxes(num_streams), strict=True):
        _, expected = cdisort(problems()[row["case"]], 0.5, 0.0, num_streams)
        assert abs(value - expected) <= EQUIVALENCE * abs(expected), row["case"]
        if row["printed"]:
            off = abs(value - float(row["printed"])) / unit_of_last_digit(row["printed"])
            assert off <= PRINTED, (row["case"], value, row["printed"])


def errors(num_streams):
    """Largest relative error of each problem's radiances, all moments, to the converged values."""
    largest = {}
    rows, ours = suite_rows("disort_radiances.csv"), radiances(num_streams)["converged"]
    for row, value in zip(rows, ours, strict=True):
        expected = float(row["converged"])
        error = abs(value - expected) / (abs(expected) or 1)
        largest[row["case"]] = max(error, largest.get(row["case"], 0))
    return largest


@pytest.mark.parametrize(
    ("num_streams", "known"),
    [(32, LEFT_AT_32), pytest.param(64, LEFT_AT_64, marks=pytest.mark.slow)],
)
def test_radiances_converge_to_the_converged_answers(num_streams, known):
    found = errors(num_streams)
    print(num_streams, {case: f"{error:.1e}" for case, error in found.items()})
    for case, error in found.items():
        bound = known.get(case, known.get(case.rstrip("abcd"), LEFT))
        assert error <= bound, (case, error, bound)


def test_error_falls_from_16_to_32_streams():
    """At least fourfold, but for the glory of Cloud C.1 (5a), which only halves."""
    coarse, fine = errors(16), errors(32)
    for case, error in coarse.items():
        assert fine[case] <= max(error / (1.8 if case == "5a" else 4), LEFT), case


# Relative, by problem: thin layers at grazing sun (1) and sharp peaks (12) need the most streams.
ALBEDO_LEFT = {
    16: {"1a": 1e-3, "1b": 1.3e-4, "12": 9e-3, "2": 8e-5, "3": 3e-5, "4": 1.1e-4, "": 4e-5},
    32: {"1a": 6e-5, "1b": 8e-6, "12": 6e-4, "": 1e-6},
}


@pytest.mark.parametrize("num_streams", [16, pytest.param(32, marks=pytest.mark.slow)])
def test_plane_albedos_converge_to_the_converged_fluxes(num_streams):
    rows, known = suite_rows("disort_fluxes.csv"), ALBEDO_LEFT[num_streams]
    for row, albedo in zip(rows, plane_albedos(num_streams)["converged"], strict=True):
        problem, case = problems()[row["case"]], row["case"]
        if glows(problem):
            continue
        flux, expected = albedo * problem.mu0 * problem.solar_irradiance, float(row["converged"])
        bound = known.get(case, known.get(case.rstrip("abcd"), known[""]))
        assert abs(flux - expected) <= bound * expected, (case, flux, expected)


@pytest.mark.parametrize("num_streams", RANDOM_STREAMS)
def test_equals_cdisort_with_its_planck_source_on(num_streams):
    """100 random columns a number of streams, half of them in sunlight too, to 1e-8.

    Excluded are only columns where 40 digits show CDISORT wrong: within 1e-4 of an eigenvalue's
    inverse it takes a term's limit, and a dim layer is what is left of large terms.
    """
    found, wrong = [], []
    for view, value in zip(
        random_views(num_streams), radiances(num_streams)["random"], strict=True
    ):
        levels, ground, top = view.sources()
        scale = max(levels.max(), ground, top, view.problem.solar_irradiance / np.pi)
        expected, _ = cdisort(view.problem, view.mu, view.azimuth_deg, num_streams)
        difference = abs(value - expected) / max(abs(expected), 1e-5 * scale)
        if difference > EQUIVALENCE:
            exact = forty_digits(view, num_streams)
            # A dim layer is what is left of terms as large as its source, which round.
            bound = RIGHT * max(exact, 1e-5 * scale)
            assert abs(value - exact) <= bound, (view, value, expected, exact)
            wrong.append(f"{difference:.0e} (ours {abs(value / exact - 1):.0e})")
            continue
        found.append(difference)
    print(f"{num_streams} streams: largest of {len(found)} {max(found):.1e}; CDISORT off: {wrong}")
    assert len(wrong) <= NUM_RANDOM // 50
