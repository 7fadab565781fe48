"""Builders of plumes, and the published numbers they use."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from independent_mie import sphere_efficiencies

from abi_operator.bands import BANDS, GRASSO2013
from abi_operator.optics import ash, smoke
from abi_operator.optics.aerosol_tables import ASH, SMOKE
from abi_operator.optics.species import mie_plume

LAST_DIGIT = 6e-4  # of the ash table, and of sums over 1000 radii
BUILDERS = [smoke, ash]


@functools.cache
def ash_mie(wavelength_um):
    """Mie theory for the ash of the table: extinction efficiency, ssa, asymmetry. [-]"""
    log_width = np.log(2.0)
    median = 3.0 * np.exp(-2.5 * log_width**2)
    radius = np.geomspace(0.02, 60.0, 1000)
    number = np.exp(-0.5 * (np.log(radius / median) / log_width) ** 2)
    area = number * radius**2 / np.sum(number * radius**2)
    q_ext, q_sca, directed = sphere_efficiencies(1.53 - 0.0015j, radius, wavelength_um)
    return area @ q_ext, area @ q_sca / (area @ q_ext), area @ directed / (area @ q_sca)


@pytest.mark.parametrize("band", ["C03", "C04", "C05", "C06", "C07"])
def test_ash_optics_are_those_of_mie_theory(band):
    at_550, _, _ = ash_mie(0.550)
    extinction, ssa, asymmetry = ash_mie(BANDS[band].wavelength_um)
    np.testing.assert_allclose(ASH.relative_extinction[band], extinction / at_550, rtol=2e-3)
    np.testing.assert_allclose(ASH.ssa[band], ssa, rtol=0, atol=LAST_DIGIT)
    np.testing.assert_allclose(ASH.asymmetry[band], asymmetry, rtol=0, atol=LAST_DIGIT)


def test_smoke_extinction_refers_to_550_nm():
    # Angstrom exponent of the source between 0.4711 and 0.555 um: ln(1.3573) / ln(0.555/0.4711).
    extinction = SMOKE.relative_extinction["C01"]
    exponent = np.log(extinction) / np.log(0.550 / 0.4711)
    np.testing.assert_allclose(exponent, 1.8639, rtol=1e-4)
    np.testing.assert_allclose(extinction, 1.3346, rtol=1e-4)


@pytest.mark.parametrize("build", BUILDERS)
def test_optical_depth_and_defaults(build):
    plume = build(0.6, brightness=0.5)
    np.testing.assert_allclose(plume.aod_550, 0.3)
    assert tuple(plume.ssa) == GRASSO2013
    assert all(leaf.shape == () for leaf in jax.tree.leaves(plume))


@pytest.mark.parametrize("build", BUILDERS)
def test_every_band_can_be_asked_for(build):
    plume = build(bands=tuple(BANDS))
    for optics in (plume.relative_extinction, plume.ssa, plume.asymmetry):
        assert set(optics) == set(BANDS)


@pytest.mark.parametrize("build", BUILDERS)
def test_every_number_can_be_replaced(build):
    plume = build(
        2.0,
        base=500.0,
        top=1500.0,
        bands=("C01", "C03"),
        relative_extinction={"C01": 1.5},
        ssa={"C03": 0.75},
        asymmetry={"C03": 0.0},
    )
    np.testing.assert_allclose(plume.extinction_550, 2e-3)
    published = {smoke: SMOKE, ash: ASH}[build]
    assert plume.relative_extinction == {"C01": 1.5, "C03": published.relative_extinction["C03"]}
    assert plume.ssa == {"C01": published.ssa["C01"], "C03": 0.75}
    assert plume.asymmetry == {"C01": published.asymmetry["C01"], "C03": 0}


def test_an_array_of_brightness_makes_a_batch():
    plume = smoke(brightness=np.array([0.0, 0.5, 1.0]))
    assert all(leaf.shape == (3,) for leaf in jax.tree.leaves(plume))
    np.testing.assert_allclose(plume.aod_550, [0, 0.5, 1])


@pytest.mark.parametrize("build", BUILDERS)
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (dict(base=2000.0, top=2000.0), "top of .* is 2000.0; it must be above base"),
        (dict(ssa={"C02": 1.01}), r"ssa\['C02'\] of .* is 1.01; it must be 0 to 1"),
        (dict(ssa={"C02": -0.1}), r"ssa\['C02'\] of .* is -0.1; it must be 0 to 1"),
        (dict(asymmetry={"C06": -1.0}), r"asymmetry\['C06'\] of .* above -1 and below 1"),
        (dict(asymmetry={"C06": float("nan")}), r"asymmetry\['C06'\] of"),
        (dict(relative_extinction={"C01": -1.0}), r"relative_extinction\['C01'\] of"),
        (dict(base=-1.0), "base of .* is -1.0; it must be 0 or more and below 1e\\+09 m"),
        (dict(aod_550=-0.1), "aod_550 of .* is -0.1; it must be 0 or more"),
        (dict(brightness=np.array([0.5, -0.5])), "brightness of .* is -0.5; it must be 0 to 1"),
        (dict(bands=("C01",), ssa={"C02": 0.9}), r"ssa of .* is given in \['C02'\]"),
        (dict(bands=("C13",)), r"bands \['C13'\] are not simulated"),
    ],
)
def test_numbers_out_of_range_are_named(build, wrong, message):
    with pytest.raises(ValueError, match=message):
        build(**wrong)


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_traced_numbers_pass_and_differentiate(mode):
    derivative = mode(lambda top: smoke(1.0, base=1000.0, top=top).extinction_550)(3000.0)
    np.testing.assert_allclose(derivative, -1 / 2000.0**2)


@pytest.mark.float32
@pytest.mark.parametrize("build", BUILDERS)
def test_dtype_follows_the_arrays_given(build):
    plume = build(jnp.float32(0.4), brightness=0.5)
    assert all(leaf.dtype == jnp.float32 for leaf in jax.tree.leaves(plume))


def spheres(**changed):
    extent = dict(aod_550=0.6, effective_radius_um=2.0, base=1000.0, top=3000.0)
    return mie_plume("ash", **(extent | changed))


def test_plume_of_spheres():
    plume = spheres(brightness=np.array([0.0, 0.5]))
    assert plume.species == "ash"
    assert all(leaf.shape == (2,) for leaf in jax.tree.leaves(plume))
    np.testing.assert_allclose(plume.aod_550, [0, 0.3])
    np.testing.assert_allclose(plume.extinction_550, 3e-4)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (dict(top=1000.0), "top of ash is 1000.0; it must be above base"),
        (dict(aod_550=-0.1), "aod_550 of ash is -0.1; it must be 0 or more"),
        (dict(brightness=-0.5), "brightness of ash is -0.5; it must be 0 to 1"),
        (
            dict(effective_radius_um=np.zeros(2)),
            "effective_radius_um of ash is .*; it must be above 0 and below 1e\\+06 um",
        ),
        (
            dict(effective_radius_um=float("nan")),
            "effective_radius_um of ash is .*; it must be above 0 and below 1e\\+06 um",
        ),
    ],
)
def test_numbers_of_spheres_out_of_range_are_named(wrong, message):
    with pytest.raises(ValueError, match=message):
        spheres(**wrong)


def test_species_without_a_table_is_named():
    with pytest.raises(ValueError, match="no Mie table of species 'fog'"):
        mie_plume("fog", 1.0, 2.0, base=0.0, top=1.0)


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_traced_numbers_of_spheres_pass_and_differentiate(mode):
    derivative = mode(lambda radius: spheres(effective_radius_um=radius).effective_radius_um)(2.0)
    np.testing.assert_allclose(derivative, 1)


@pytest.mark.float32
def test_dtype_of_spheres_follows_the_arrays_given():
    plume = spheres(effective_radius_um=jnp.float32(2.0))
    assert all(leaf.dtype == jnp.float32 for leaf in jax.tree.leaves(plume))
