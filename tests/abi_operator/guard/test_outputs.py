"""What the instrument and products make of values: which number of theirs moves which output.

No column is solved: outputs are made of the values that the baseline holds.
"""

import importlib

import jax
import numpy as np
import pytest
import xarray as xr

from abi_operator import guard
from abi_operator.bands import BANDS
from abi_operator.guard.evaluation import seen_in
from abi_operator.guard.outputs import CONSTANTS, PIECEWISE_CONSTANT, outputs_of
from abi_operator.instrument import NOISE
from abi_operator.satellites import SATELLITES

SATELLITE, GREEN, ENHANCEMENT, CREFL, TABLE, RAYLEIGH = (
    importlib.import_module(f"abi_operator.{name}")
    for name in (
        "satellites",
        "products.green",
        "products.enhancement",
        "products.crefl",
        "products.rayleigh_table",
        "optics.rayleigh",
    )
)
# By how much a number is wrong.
FACTOR = 1.001


@pytest.fixture(scope="module")
def made(baseline):
    """Makes outputs of the baseline's values of some bands, those without a fault once."""
    kept = {}

    def make(bands, anew=True):
        if anew or bands not in kept:
            of = guard.select(baseline, baseline.columns, bands, baseline.inputs)
            with jax.enable_x64(True):
                found = of._replace(outputs=outputs_of(seen_in(of), "GOES-16"))
            if anew:
                return found
            kept[bands] = found
        return kept[bands]

    return make


def scaled(value, path):
    """A number, or a tuple of which one number is, scaled."""
    if not path:
        return FACTOR * value
    key, *rest = path
    place = value._fields.index(key) if isinstance(key, str) else key
    parts = [scaled(x, rest) if k == place else x for k, x in enumerate(value)]
    return value._make(parts) if hasattr(value, "_make") else tuple(parts)


def make_wrong(patch, owner, path):
    """Scale the number at a path of attributes, keys and places."""
    name, *rest = path
    inner = getattr(owner, name)
    if not isinstance(inner, dict):
        return patch.setattr(owner, name, scaled(inner, rest))
    while isinstance(inner[rest[0]], dict):
        inner, rest = inner[rest[0]], rest[1:]
    return patch.setitem(inner, rest[0], scaled(inner[rest[0]], rest[1:]))


OBSERVED = {"observed_reflectance_factor", "softened_reflectance_factor"}
COUNTED = {"quantised_radiance"}
SUNLIT = {"radiance", "noise_deviation"} | COUNTED | OBSERVED
PACKED = {"saturation_radiance", "quantised_radiance"}
EMITTED = {"saturation_radiance", "brightness_temperature", "noise_deviation"}
EMITTED |= {"observed_brightness_temperature", "softened_brightness_temperature"}
COLOURS = ("C01", "C02", "C03")
STRETCHED = {"natural_color"}
# The bands looked at, where the number is that is wrong, and first words of what moves.
FAULTS = {
    # Counts of C01, which has 10 bits, lie further apart than that moves any column's radiance.
    "sun in C01": (("C01",), (SATELLITE, "_SOLAR_IRRADIANCE", "GOES-16", "C01"), SUNLIT - COUNTED),
    "sun in C03": (("C03",), (SATELLITE, "_SOLAR_IRRADIANCE", "GOES-16", "C03"), SUNLIT),
    "step of C05": (("C05",), (SATELLITE, "_PACKING", "C05", "scale"), PACKED | OBSERVED),
    "noise of C04": (("C04",), (NOISE, "floor", "C04"), {"noise_deviation"}),
    "photons of C02": (("C02",), (NOISE, "slope", "C02"), {"noise_deviation"}),
    "calibration of C06": (("C06",), (NOISE, "calibration", "C06"), {"calibration_deviation"}),
    "a recipe": (COLOURS, (GREEN, "GREEN_RECIPES", "edc", "near_infrared"), {"derived_green"}),
    "CIRA's black": (COLOURS, (ENHANCEMENT, "_DARKEST"), STRETCHED),
    "CIMSS' black": (COLOURS, (ENHANCEMENT, "_CIMSS_DARKEST"), STRETCHED),
    "a corner": (COLOURS, (ENHANCEMENT, "_CREFL_BRIGHTNESS", 2), STRETCHED),
    "a colour": (COLOURS, (ENHANCEMENT, "_JMA_GOES16", 1, 2), {"jma_true_color"}),
    "crefl": (("C01",), (CREFL, "_MODE2", 1), {"rayleigh_corrected"}),
    "air in green": (("green",), (RAYLEIGH, "STANDARD_DEPTH", "green"), {"rayleigh_corrected"}),
}
FAULTS |= {
    f"{name} of {satellite}": (("C07",), (SATELLITE, "_PLANCK", satellite, "C07", name), EMITTED)
    for satellite, name in zip(SATELLITES, ("fk1", "fk2", "bc1", "bc2"), strict=True)
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_moves(made, monkeypatch, fault):
    """One number wrong by 0.1 %: just the outputs that are made of it."""
    bands, path, expected = FAULTS[fault]
    stored = made(bands, anew=False)
    make_wrong(monkeypatch, path[0], path[1:])
    assert_moved(stored, made(bands), expected)


def test_a_lower_ceiling(made, monkeypatch):
    """Half the counts in C02: what was below the ceiling is above."""
    stored = made(("C02",), anew=False)
    packing = SATELLITE._PACKING["C02"]
    monkeypatch.setitem(SATELLITE._PACKING, "C02", packing._replace(bits=packing.bits - 1))
    assert_moved(stored, made(("C02",)), PACKED | OBSERVED)


def test_a_number_of_the_air(made, monkeypatch):
    """Of the tables of pure air: at angles of some columns, and at angles of none."""
    stored = made(("C02",), anew=False)
    tables = TABLE._tables()
    for name, place, expected in (
        ("multiple", (10, 9, 5, 1, 0), {"pure_air", "rayleigh_corrected"}),
        ("lost", (0, 5, 1, 0), {"pure_air"}),
    ):
        wrong = getattr(tables, name).copy()
        wrong[place] *= FACTOR
        changed = tables._replace(**{name: wrong})
        monkeypatch.setattr(TABLE, "_tables", lambda x=changed: x)
        assert_moved(stored, made(("C02",)), expected)


def assert_moved(stored, now, expected):
    comparison = guard.compare(stored, now)
    assert not comparison.changed
    print(guard.report(comparison))
    assert {entry.quantity.partition(".")[0] for entry in comparison.moved} == expected


def test_without_fault_nothing_moves(made, baseline):
    """Of all bands; also: the baseline in the repository has the outputs of the code."""
    now = made(tuple(BANDS), anew=False)
    comparison = guard.compare(baseline, now)
    assert not comparison, guard.report(comparison)
    largest = guard.excess(baseline, now)
    print(f"largest change, in tolerances: {largest:.1e}")
    assert largest < 0.1


def test_slopes_are_differences(made, baseline):
    """All bands change at once, each by a share of its own: outputs change by the sum over them."""
    now = made(tuple(BANDS), anew=False)
    rows = slice(len(baseline.columns))
    change = 1e-6 * np.array([0.9, -0.5, 0.7, -1.1, 1.3, 0.6, -0.8, 1.2]) * baseline.value
    ends = []
    for sign in (1, -1):
        moved = baseline._replace(value=baseline.value + sign * change)
        with jax.enable_x64(True):
            ends.append(outputs_of(seen_in(moved), "GOES-16").value[rows])
    slope = now.outputs.slope[rows]
    has = ~np.isnan(slope).all(axis=-1)
    expected = np.nansum(slope * change[:, None, :], axis=-1)[has]
    found = ((ends[0] - ends[1]) / 2)[has]
    assert np.count_nonzero(expected) > 500
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-12)


def test_what_has_no_slope(made):
    """Neither what is piecewise constant nor what is a function of no column; both have values."""
    of = made(tuple(BANDS), anew=False).outputs
    without = np.isnan(of.slope).all(axis=(0, 2)) & ~np.isnan(of.value).all(axis=0)
    first_words = {name.partition(".")[0] for name, x in zip(of.names, without, strict=True) if x}
    constant = ~np.isnan(of.value[-1])
    assert of.beside[-1] == CONSTANTS and constant.any() and np.isnan(of.slope[-1]).all()
    of_constants = {name.partition(".")[0] for name in np.array(of.names)[constant]}
    assert first_words == of_constants | set(PIECEWISE_CONSTANT)


def test_a_file_from_before(made, baseline, tmp_path, monkeypatch):
    """It has no outputs, nothing moved, and they are kept when accepted."""
    path = tmp_path / "before.nc"
    of = made(("C02",), anew=False)
    guard.write_baseline(path, guard.Baseline(of._replace(outputs=None), "standard", {}, ("old",)))
    with xr.open_dataset(path) as file:
        assert not [name for name in file.variables if "output" in name]
    stored = guard.read_baseline(path).jacobians
    assert stored.outputs is None
    found = guard.compare(stored, of)
    assert not found and "outputs are not in the file yet" in guard.report(found)
    monkeypatch.setattr(guard.workflow, "evaluate", lambda *_, **__: of)
    assert not guard.check(path)
    guard.accept(path, "outputs as well")
    kept = guard.read_baseline(path).jacobians.outputs
    assert kept.names == of.outputs.names and kept.beside == of.outputs.beside
    np.testing.assert_array_equal(kept.slope, of.outputs.slope)
    assert guard.compare(of, stored).changed == ["outputs are gone."]


def test_names_and_table(made):
    """An output that went, one in another unit, and the row of one that moved."""
    of = made(("C02",), anew=False)
    fewer = of.outputs.named(of.outputs.names[1:], of.outputs.beside[1:])
    changed = guard.compare(of, of._replace(outputs=fewer)).changed
    assert changed == [
        f"output {of.outputs.names[0]} is gone.",
        f"row of outputs {of.outputs.beside[0]} is gone.",
    ]
    units = ("cd", *of.outputs.units[1:])
    changed = guard.compare(of, of._replace(outputs=of.outputs._replace(units=units))).changed
    assert changed == [f"output {of.outputs.names[0]} is in cd, was in {of.outputs.units[0]}."]
    slope = of.outputs.slope.copy()
    slope[0, of.outputs.names.index("radiance.C02.GOES-16"), 0] *= FACTOR
    text = guard.report(guard.compare(of, of._replace(outputs=of.outputs._replace(slope=slope))))
    assert text.splitlines()[1].startswith("clear   C02   d radiance.C02.GOES-16 / d value")
