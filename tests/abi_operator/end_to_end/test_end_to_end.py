"""The operator against CDISORT on layers that none of its optics has made.

Specified columns of eight kinds, in all seven bands; 208 of them behind ``-m slow``. On one side a
`State` and one call; on the other layers built in NumPy from published equations and numbers
(``tests/independent_*.py``), one run of CDISORT for each exponential term, and the weighted sum of
the runs.
"""

from functools import partial

import independent_columns
import independent_layers as independent
import independent_plumes as plumes
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from independent_columns import BANDS, KINDS
from independent_emission import (
    IRRADIANCE,
    cdisort_planck,
    cdisort_radiance,
    cdisort_temperature,
    in_band,
)
from independent_single_scattering import cos_scattering

from abi_operator import brf, radiance
from abi_operator.bands import BANDS as ABI_BANDS
from abi_operator.optics import column_optics
from abi_operator.optics.mie_table import mie_table
from abi_operator.solver import on_double_gauss

SEED = 20050828
FEW, MANY = 4, 26  # columns of each kind
FEW_STREAMS, STREAMS = 4, 8  # of few columns, and of many
# Enough for any layer here.
DOUBLINGS = 10
FLOOR = 1e-3  # BRF below which differences are absolute
# Nearly all columns agree to 1e-10. What remains is CDISORT's, which ends a column at an absorption
# depth of 10 (C04), and spheres left out of sums.
EQUAL = 1e-6
# Of BRF, between tables of phase functions and Mie theory itself: 1e-5 is found. (Of ash sums over
# any other spheres differ by more.)
MIE_TABLES = 1e-4
EMITTING = ("C05", "C06", "C07")


@pytest.fixture(scope="module", autouse=True)
def nodes_of_cdisort():
    with on_double_gauss():
        yield


@pytest.fixture(scope="module", params=[FEW, pytest.param(MANY, marks=pytest.mark.slow)])
def many(request):
    return request.param


@pytest.fixture(scope="module")
def streams(many):
    return STREAMS if many == MANY else FEW_STREAMS


@pytest.fixture(scope="module")
def columns(many, request):
    """Of each kind the last, so that a sample of many columns is not that of few."""
    each = max(FEW, round(many * request.config.getoption("--scale")))
    every = independent_columns.specified_columns(many, SEED)
    return [c for k, c in enumerate(every) if k % many >= many - each]


@pytest.fixture(scope="module")
def states(columns):
    return independent_columns.states(columns)


@pytest.fixture(scope="module")
def reflected(states, streams):
    return np.asarray(brf(states, BANDS, num_streams=streams, num_doublings=DOUBLINGS))


def assert_equal(ours, reference, columns, bands, floor=FLOOR):
    """Within `EQUAL` of the reference or of the floor, by kind and band."""
    error = np.abs(ours - reference) / np.maximum(np.abs(reference), floor)
    kinds = [c["kind"] for c in columns]
    for kind in KINDS:
        worst = error[[k == kind for k in kinds]].max(axis=0, initial=0.0)
        print(f"{kind:20s}", *(f"{b} {x:.0e}" for b, x in zip(bands, worst, strict=True)))
    column, band = np.unravel_index(np.nanargmax(error), error.shape)
    assert np.all(error <= EQUAL), (
        f"column {column} ({kinds[column]}) in {bands[band]}: {ours[column, band]!r}, CDISORT "
        f"{reference[column, band]!r}"
    )


def test_reflectances_of_seven_bands(columns, reflected, streams):
    reference = [
        [independent.cdisort_sum(c, b, independent.layers(c, b), streams) for b in BANDS]
        for c in columns
    ]
    assert reflected.shape == (len(columns), len(BANDS)) and len(KINDS) * MANY >= 200
    assert_equal(reflected, np.array(reference), columns, BANDS)


def sources(made, band, distance):
    """Planck function at the levels and of the ground with its fire, and sunlight."""
    share, flames = made["fire"]
    background = in_band(made["ground"], band)
    ground = background + share * (in_band(flames, band) - background)
    sunlight = IRRADIANCE[band] / distance**2 if made["solar_zenith"] < np.pi / 2 else 0.0
    return in_band(made["temperature"], band), ground, sunlight


def test_radiances_with_emission_and_fires(columns, streams):
    """Sunlight and emission in one solve, in the bands in which fires shine.

    CDISORT is given the temperatures at which its Planck function is the in-band one. Every tenth
    column lies in the dark, the sun's distance differs, and droplets are those of Mitchell.
    """
    rng = np.random.default_rng(SEED)
    distance = rng.uniform(0.983, 1.017, len(columns))
    seen = [
        c | {"solar_zenith": rng.uniform(1.6, 3.0)} if i % 10 == 0 else c
        for i, c in enumerate(columns)
    ]
    state = independent_columns.states(seen, "mitchell")
    ours = radiance(
        state, EMITTING, sun_distance=distance, num_streams=streams, num_doublings=DOUBLINGS
    )
    reference = [
        [
            independent.cdisort_sum(
                c,
                band,
                independent.layers(c, band, liquid_optics="mitchell"),
                streams,
                sources(c, band, distance[i]),
            )
            for band in EMITTING
        ]
        for i, c in enumerate(seen)
    ]
    # A white ground under this sun, of which a thousandth is the floor; none by night.
    mu0 = np.cos([c["solar_zenith"] for c in seen]).clip(min=0)
    white = mu0[:, None] * [IRRADIANCE[b] for b in EMITTING] / np.pi
    assert_equal(np.asarray(ours), np.array(reference), columns, EMITTING, FLOOR * white)


def test_plumes_of_spheres_straight_from_mie_theory(columns, reflected, streams):
    """The tables of phase functions left out as well: amplitudes summed over spheres.

    The tables keep moments and log P in 16 bits and smooth what narrow resonances do to P.
    """
    rows = [i for i, c in enumerate(columns) if c["kind"] == "spheres"]

    def mie_phase(species, node, band, cosine):
        moments, phase = plumes.phase_function(
            species, mie_table(species).effective_radius_um[node], band, cosine, streams + 1
        )
        return np.pad(moments, (0, independent.NUM_MOMENTS - moments.size)), lambda _: phase

    error = np.zeros((len(rows), len(BANDS)))
    for row, i in enumerate(rows):
        made = columns[i]
        cosine = cos_scattering(*independent.directions(made))
        for j, band in enumerate(BANDS):
            layers = independent.layers(made, band, mie_phase=partial(mie_phase, cosine=cosine))
            reference = independent.cdisort_sum(made, band, layers, streams)
            error[row, j] = abs(reflected[i, j] - reference)
    print(
        "largest difference",
        *(f"{b} {x:.0e}" for b, x in zip(BANDS, error.max(axis=0), strict=True)),
    )
    assert error.max() < MIE_TABLES


@pytest.mark.slow
@pytest.mark.parametrize("many", [FEW], indirect=True)
def test_sixteen_streams(columns):
    """Two columns of each kind, in a band of air and plumes and one of vapour and ice."""
    few, bands = columns[:: FEW // 2], ("C01", "C05")
    ours = brf(independent_columns.states(few), bands, num_streams=16, num_doublings=DOUBLINGS)
    reference = [
        [independent.cdisort_sum(c, b, independent.layers(c, b), 16) for b in bands] for c in few
    ]
    assert_equal(np.asarray(ours), np.array(reference), few, bands)


@pytest.mark.slow
def test_own_layers_through_cdisort(columns, states, reflected, streams):
    """Wiring: what the operator solves are the layers of `column_optics`, all terms of them."""
    rows, bands = np.arange(0, len(columns), 7), ("C02", "C04", "C07")

    @jax.jit
    @jax.vmap
    def optics(air, cosine):
        each = [column_optics(air, ABI_BANDS[band]) for band in bands]
        return [
            (x.weight, x.tau, x.ssa, x.moments(streams + 1), x.phase_function(cosine)) for x in each
        ]

    cosine = [cos_scattering(*independent.directions(columns[i])) for i in rows]
    air = jax.tree.map(lambda x: jnp.asarray(x[rows]), states.atmosphere)
    found = jax.tree.map(np.array, optics(air, jnp.asarray(cosine)))
    reference = [
        [
            independent.cdisort_sum(
                columns[i], band, independent.Layers(*(x[row] for x in own)), streams
            )
            for band, own in zip(bands, found, strict=True)
        ]
        for row, i in enumerate(rows)
    ]
    chosen = [BANDS.index(band) for band in bands]
    ours = reflected[np.ix_(rows, chosen)]
    assert_equal(ours, np.array(reference), [columns[i] for i in rows], bands)


def test_planck_function_given_to_cdisort():
    """A black body seen through CDISORT is the in-band radiance, and the inverse is exact."""
    for band in EMITTING:
        temperature = np.array([190.0, 250.0, 300.0, 600.0, 1200.0])
        wanted = in_band(temperature, band)
        found = cdisort_planck(cdisort_temperature(wanted, band), band)
        unit = wanted[0] / found[0]
        np.testing.assert_allclose(unit * found, wanted, rtol=1e-12)
        moments = np.eye(1, 2 * STREAMS)
        for t, radiance_of_it in zip(temperature, wanted, strict=True):
            column = np.array([0.5]), np.zeros(1), moments, 0.0, 0.6, 0.7, 1.0
            seen = cdisort_radiance(
                column, band, np.full(2, radiance_of_it), radiance_of_it, STREAMS, 0.0, True
            )
            np.testing.assert_allclose(seen, radiance_of_it, rtol=1e-11, err_msg=f"{band} {t}")
