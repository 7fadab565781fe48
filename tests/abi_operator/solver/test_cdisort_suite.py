"""The solver on the nodes of others: DISORT's test problems at its own streams, and CDISORT.

One file, as all of them come from one call of the solver a number of streams (`published.py`).

DISORT's problems are compared with printed values and CDISORT. Left out are 5b (no level at the
top), 6a (an empty column) and the grounds that are not Lambertian (6d-h, 7e). A flux is that of the
sunlight, by `toa_albedo`, plus radiances at the nodes with the sun off.
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
    plane_albedos_on_double_gauss,
    problems,
    radiances_on_double_gauss,
    random_views,
    suite_rows,
)

from abi_operator.solver import double_gauss

# Compiling is what these take; one program for radiances, one for albedos.
RADIANCE_STREAMS = (8, *(pytest.param(n, marks=pytest.mark.slow) for n in (4, 12, 16, 20, 32, 48)))
FLUX_STREAMS = RADIANCE_STREAMS
# One program with the radiances of as many streams.
RANDOM = [pytest.param(n, marks=pytest.mark.slow) if n == 16 else n for n in RANDOM_STREAMS]
EQUIVALENCE = 1e-8
# Where they differ by more, 40 digits decide, and ours has to be right to this.
RIGHT = 1e-10
# Problems without a layer of albedo 1 agree to 4e-13 (6c to 2e-11); CDISORT lowers that albedo a
# little and loses digits, 8e-9 at most (4a). It cuts 12b off at an absorption depth of 10: 2e-9.
# Half of the last printed digit, and a tenth for the machine that printed it.
PRINTED = 0.6


def unit_of_last_digit(text):
    """Worth of the last digit of a printed number."""
    mantissa, _, exponent = text.partition("E")
    decimals = len(mantissa.partition(".")[2])
    return 10.0 ** (int(exponent or 0) - decimals)


def fluxes(num_streams):
    """Upward flux of each of the suite's problems at so many streams."""
    rows = suite_rows("disort_fluxes.csv", num_streams)
    nodes, weights = double_gauss(num_streams)
    columns = [problems()[row["case"]] for row in rows]
    emitted = np.zeros((len(rows), nodes.size))
    emitted[[glows(p) for p in columns]] = radiances_on_double_gauss(num_streams)["dark"].reshape(
        -1, nodes.size
    )
    sunlight = np.array([p.mu0 * p.solar_irradiance for p in columns])
    return sunlight * plane_albedos_on_double_gauss(num_streams) + 2 * np.pi * emitted @ (
        nodes * weights
    )


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
        on_double_gauss=True,
    )


@pytest.mark.parametrize("num_streams", RADIANCE_STREAMS)
def test_radiances_at_the_suites_streams_and_moments(num_streams):
    """CDISORT to 1e-8 (or else 40 digits to 1e-10), and the printed values to their digits."""
    rows, ours = (
        suite_rows("disort_radiances.csv", num_streams),
        radiances_on_double_gauss(num_streams)["suite"],
    )
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


@pytest.mark.parametrize("num_streams", RANDOM)
def test_equals_cdisort_with_its_planck_source_on(num_streams):
    """100 random columns a number of streams, half of them in sunlight too, to 1e-8.

    Excluded are only columns where 40 digits show CDISORT wrong: within 1e-4 of an eigenvalue's
    inverse it takes a term's limit, and a dim layer is what is left of large terms.
    """
    found, wrong = [], []
    for view, value in zip(
        random_views(num_streams), radiances_on_double_gauss(num_streams)["random"], strict=True
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
