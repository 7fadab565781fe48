"""Which standard column notices which fault: one program, with a factor for every fault.

A fault is a small number in classes of particles that exist for this test alone, the same in every
layer, as optics of particles see no other: it travels with the state into the operator, where the
functions that optics and the ground are read by are replaced by ones that look it up. So all faults
are columns of one batch, and one compilation serves them; with all factors 0 the program is the one
that is guarded, which is asserted first.
"""

import importlib
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator import Hydrometeor, guard, standard_atmospheres
from abi_operator.optical_properties import OpticalProperties, Scatterer
from abi_operator.optics import CLASSES, mie_species

COLUMN = importlib.import_module("abi_operator.optics.column")
BAND_COLUMNS = importlib.import_module("abi_operator.band_columns")
OCEAN = importlib.import_module("abi_operator.surface.ocean")

SEEN = ("C02",)
FACTORS = "factors of faults"
(TABLE,) = (species for species in mie_species() if species not in ("smoke", "ash"))
SCALED = ("rayleigh", "gases", "smoke", "ash", TABLE, "liquid", "ice", "snow", "rain")
OTHERS = ("ground", "sign of a derivative", "float32", "default of snow")
FAULTS = (*SCALED, *OTHERS)
CARRIERS = tuple(f"{FACTORS} {k}" for k in range((len(FAULTS) + 1) // 2))
# A scale of 1.001; a derivative's sign turned; rounding to float32; another shape of snow.
SIZES = dict.fromkeys(SCALED, 1e-3) | {"ground": 1e-3, "default of snow": 0.1}
SIZES |= {"sign of a derivative": 2.0, "float32": 1.0}

# Those of one structure, with all the producers in it.
STANDARD = guard.standard_columns()
EVERY = {name for name, state in STANDARD.items() if state.fire is not None}
ROUGH = {name for name in STANDARD if "sea and land" in name}
OTHERWISE = set(STANDARD) - EVERY - ROUGH
FROZEN = "other hydrometeors over sea and land"
# By day: in C02 there is nothing to see of the sun's light by night.
DAY = EVERY - {"fire by night"}
SMOKY = {"smoke", "smoke over stratus", "fire by day"}
# Columns whose value moves.
CATCHES = {
    "rayleigh": DAY,
    "gases": DAY,
    "smoke": SMOKY,
    "ash": {"ash"},
    TABLE: {TABLE},
    "liquid": {"liquid cloud", "smoke over stratus"},
    "ice": {"ice, snow and rain"},
    "snow": {"ice, snow and rain"},
    "rain": {"ice, snow and rain"},
    "ground": DAY,
    "sign of a derivative": set(),
    "float32": DAY,
    "default of snow": {"ice, snow and rain"},
}
# Columns of which a derivative moves beside those: the derivative by the extinction of a plume is
# not 0 where there is no plume, that by the mass of an empty class is.
BY_DERIVATIVE = dict.fromkeys(("smoke", "ash", TABLE, "sign of a derivative"), DAY)


def factors_of(atmosphere):
    """Factors by fault, in the state that a producer is given: two in a class of particles."""
    carriers = [atmosphere.hydrometeors[name] for name in CARRIERS]
    numbers = [x[0] for c in carriers for x in (c.mass_path, c.number_path - 1)]
    return dict(zip(FAULTS, numbers, strict=False))


def scaled(optics, factor):
    scatterers = tuple(Scatterer((1 + factor) * s.scattering, s.phase) for s in optics.scatterers)
    return OpticalProperties((1 + factor) * optics.extinction, optics.weight, scatterers)


def rounded(x, factor):
    """To float32 and back, with the derivative of what was not rounded."""
    single = jax.lax.reduce_precision(x, exponent_bits=8, mantissa_bits=23)
    return x + factor * jax.lax.stop_gradient(single - x)


def producers():
    """Those that `column_optics` adds up, each with its faults."""
    rayleigh, gases, liquid = COLUMN.rayleigh, COLUMN.gas_absorption, COLUMN.liquid_cloud
    aerosol, hydrometeor = COLUMN.aerosol, COLUMN.hydrometeor

    def faulty_rayleigh(atmosphere, band):
        factors = factors_of(atmosphere)
        optics = scaled(rayleigh(atmosphere, band), factors["rayleigh"])
        x = optics.extinction
        x = x + factors["sign of a derivative"] * (jax.lax.stop_gradient(x) - x)
        x = rounded(x, factors["float32"])
        return OpticalProperties(x, optics.weight, optics.scatterers)

    def faulty_gases(atmosphere, band, names):
        return scaled(gases(atmosphere, band, names), factors_of(atmosphere)["gases"])

    def faulty_aerosol(atmosphere, name, band):
        return scaled(aerosol(atmosphere, name, band), factors_of(atmosphere)[name])

    def faulty_liquid(atmosphere, band):
        return scaled(liquid(atmosphere, band), factors_of(atmosphere)["liquid"])

    def faulty_hydrometeor(atmosphere, name, band):
        factors = factors_of(atmosphere)
        if name in CARRIERS:
            nothing = jnp.zeros_like(atmosphere.hydrometeors[name].mass_path)[None]
            return OpticalProperties(nothing, jnp.ones(1), ())
        snow = CLASSES["snow"]
        classes = CLASSES | {"snow": snow._replace(nu=snow.nu + factors["default of snow"])}
        return scaled(hydrometeor(atmosphere, name, band, classes), factors[name])

    return {
        "rayleigh": faulty_rayleigh,
        "gas_absorption": faulty_gases,
        "aerosol": faulty_aerosol,
        "liquid_cloud": faulty_liquid,
        "hydrometeor": faulty_hydrometeor,
    }


def carrying(state, fault=None):
    """The state with the factors of one fault, or none, in classes of their own."""
    air = state.atmosphere
    every = jnp.ones(air.height.shape[0] - 1)
    numbers = [SIZES[name] if name == fault else 0.0 for name in FAULTS]
    pairs = np.pad(numbers, (0, len(numbers) % 2)).reshape(-1, 2)
    # Where there is mass there must be a number, so numbers begin at 1.
    carriers = [Hydrometeor(x * every, (1 + y) * every) for x, y in pairs]
    classes = air.hydrometeors | dict(zip(CARRIERS, carriers, strict=True))
    return replace(state, atmosphere=replace(air, hydrometeors=classes))


def evaluations():
    """By fault, and by None without one, what the standard columns give."""
    with pytest.MonkeyPatch.context() as patch:
        ground_of = BAND_COLUMNS.ground_of

        def faulty_ground(state, band):
            factors = factors_of(state.atmosphere)
            return rounded((1 + factors["ground"]) * ground_of(state, band), factors["float32"])

        for name, function in producers().items():
            patch.setattr(COLUMN, name, function)
        patch.setattr(BAND_COLUMNS, "ground_of", faulty_ground)
        states = {x: state for x, state in STANDARD.items() if x in EVERY}
        columns = {
            f"{name}/{fault}": carrying(state, fault)
            for fault in (None, *CATCHES)
            for name, state in states.items()
        }
        # The classes of factors make these states a structure that no other test compiles.
        every = guard.evaluate(columns, SEEN)
    inputs = [name for name in every.inputs if FACTORS not in name]
    found, names = {}, tuple(states)
    for fault in (None, *CATCHES):
        part = guard.select(every, [f"{name}/{fault}" for name in names], SEEN, inputs)
        found[fault] = part._replace(columns=names)
    return found


@pytest.mark.slow
def test_every_fault_is_caught_and_nothing_moves_without(baseline):
    """One study, as one program is most of it; the baseline in the repository is the code's."""
    found = evaluations()
    now = found[None]
    stored = guard.select(baseline, now.columns, SEEN, now.inputs)
    comparison = guard.compare(stored, now)
    assert not comparison.moved, guard.report(comparison)
    print(f"largest change, in tolerances: {guard.excess(stored, now):.1e}")
    for fault in CATCHES:
        assert_caught(found, fault)


def assert_caught(evaluations, fault):
    """A fault, by the columns that hold what is at fault, and no value of any other."""
    comparison = guard.compare(evaluations[None], evaluations[fault])
    caught = {entry.column for entry in comparison.moved}
    by_value = {entry.column for entry in comparison.moved if not entry.entry}
    rows = "\n".join(
        f"{fault}: {name}, {sum(m.column == name for m in comparison.moved)} numbers, "
        f"{max(m.excess for m in comparison.moved if m.column == name):.1e} tolerances at most"
        for name in sorted(caught)
    )
    print(rows)
    print("by value:", ", ".join(sorted(by_value)))
    assert by_value == CATCHES[fault], rows
    assert caught == CATCHES[fault] | BY_DERIVATIVE.get(fault, set()), rows


def test_a_changed_default_of_a_builder(monkeypatch):
    """Of the standard atmospheres: every column has another state, which needs no solving."""
    builder = standard_atmospheres.standard_atmosphere
    before = STANDARD
    monkeypatch.setitem(builder.__kwdefaults__, "carbon_dioxide", 420e-6)
    after = guard.standard_columns()
    for name in EVERY:
        old, new = before[name].atmosphere.gases, after[name].atmosphere.gases
        assert abs(new.carbon_dioxide / old.carbon_dioxide - 1) > guard.INPUT_TOLERANCE


def test_a_changed_foam(monkeypatch):
    """Of a band of the sea: its columns have another state, which needs no solving."""
    before = STANDARD
    monkeypatch.setitem(OCEAN.FOAM_REFLECTANCE, "C01", 0.221)
    after = guard.standard_columns()
    for name in ROUGH:
        old, new = (x[name].albedo["C01"].foam_reflectance for x in (before, after))
        assert abs(new / old - 1) > guard.INPUT_TOLERANCE


def test_other_classes_and_mie_plumes_are_seen():
    """The columns on rough ground have every class and plume that the others have not."""
    columns = STANDARD
    classes = {name for x in columns.values() for name in x.atmosphere.hydrometeors}
    assert classes == set(CLASSES) - {"cloud"}
    plumes = columns["Mie smoke and ash over sea and land"].atmosphere.plumes
    assert {plume.species for plume in plumes.values()} == {"smoke", "ash"}
    for name, hydrometeor in columns[FROZEN].atmosphere.hydrometeors.items():
        assert np.sum(hydrometeor.mass_path) > 0, name


def test_optics_that_are_others_by_choice_are_seen():
    """What no other column has: a sphere, and other theories of droplets, ice and aerosol."""
    for name in OTHERWISE:
        state = STANDARD[name]
        assert state.geometry.spherical, name
        assert state.atmosphere.liquid.optics == "mitchell", name
        assert {x.optics for x in state.atmosphere.hydrometeors.values()} == {"rough"}, name
        assert state.atmosphere.background is not None, name


@pytest.mark.slow
def test_graupel_of_another_asymmetry(monkeypatch):
    """By 0.001, in the column that has graupel."""
    column = {FROZEN: guard.standard_columns()[FROZEN]}
    stored = guard.evaluate(column, ("C01",))
    monkeypatch.setitem(CLASSES, "graupel", CLASSES["graupel"]._replace(asymmetry=0.801))
    # Doublings of its own, so that the program is another.
    now = guard.evaluate(column, ("C01",), num_doublings=11)
    caught = guard.compare(stored, now).moved
    assert "" in {entry.entry for entry in caught}
