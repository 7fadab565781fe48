"""Tables of Mie theory against miepython outside their nodes; phase functions in themselves."""

import jax
import jax.numpy as jnp
import mie_reference
import numpy as np
import pytest

from abi_operator.bands import BANDS, several_bands
from abi_operator.optics import MiePhase, mie_species
from abi_operator.optics.mie_aerosol import mie_optics
from abi_operator.optics.mie_moments import moments_of
from abi_operator.optics.mie_table import DROPLETS, band_table, mie_table

REFERENCES, GEOMETRIES = mie_reference.read()
MATERIALS = [*mie_species(), DROPLETS]
EXTINCTION, ASYMMETRY, COALBEDO, FLOOR = 5e-3, 1e-3, 2e-2, 1e-6
MOMENTS = 2e-4  # sums over fewer spheres than the table's
# Relative error of P beyond 3 degrees. Broad distributions of absorbing spheres are smooth. Narrow
# resonances of droplets ripple sums over spheres, those of the reference too; the table smooths.
PHASE = {DROPLETS: 5e-3}
# Interpolation of P in angle and radius against its own moments, between the radii of the table;
# in the first and last interval, where the slope fades, 1e-3.
CONSISTENT, ENDS = 2e-4, 1e-3


def test_reference_covers_all_materials_and_lies_between_the_nodes():
    assert sorted(REFERENCES) == sorted(MATERIALS)
    for material, reference in REFERENCES.items():
        nodes = mie_table(material).effective_radius_um
        distance = np.abs(np.log(reference.effective_radius_um[:, None] / nodes)).min(axis=1)
        # None on a node, one of them at least a quarter of an interval away.
        assert distance.min() > 0.02 * np.log(nodes[1] / nodes[0])
        assert distance.max() > 0.25 * np.log(nodes[1] / nodes[0])
        assert nodes[1] < reference.effective_radius_um.min()
        assert reference.effective_radius_um.max() < nodes[-2]


@pytest.mark.parametrize("material", MATERIALS)
def test_tables_against_miepython(material):
    reference = REFERENCES[material]
    cosines = jnp.asarray(mie_reference.cos_scattering(GEOMETRIES))

    @jax.jit
    def all_bands(radii):
        def in_band(band):
            phase = MiePhase(radii, material, band.name)
            optics = mie_optics(material, radii, band.name)
            return *optics, phase.moments(17), jax.vmap(phase)(cosines).T

        return jax.vmap(in_band, out_axes=1)(several_bands(tuple(BANDS), float))

    extinction, coalbedo, asymmetry, moments, phase = all_bands(
        jnp.asarray(reference.effective_radius_um)
    )
    errors = {
        "extinction": np.abs(extinction / reference.extinction - 1).max(),
        "co-albedo": (
            np.abs(coalbedo - reference.coalbedo) / np.maximum(reference.coalbedo, FLOOR / COALBEDO)
        ).max(),
        "asymmetry": np.abs(asymmetry - reference.asymmetry).max(),
        "moments": np.abs(moments - reference.moments).max(),
        "phase function": np.abs(phase / reference.phase - 1).max(),
    }
    print(material, {name: f"{error:.1e}" for name, error in errors.items()})
    np.testing.assert_allclose(extinction, reference.extinction, rtol=EXTINCTION)
    np.testing.assert_allclose(coalbedo, reference.coalbedo, rtol=COALBEDO, atol=FLOOR)
    np.testing.assert_allclose(asymmetry, reference.asymmetry, rtol=0, atol=ASYMMETRY)
    np.testing.assert_allclose(moments, reference.moments, rtol=0, atol=MOMENTS)
    np.testing.assert_allclose(phase, reference.phase, rtol=PHASE.get(material, 1e-3))


@pytest.mark.parametrize("material", MATERIALS)
def test_phase_function_agrees_with_its_moments(material):
    nodes = mie_table(material).effective_radius_um
    between = np.sqrt(nodes[1:] * nodes[:-1])[[0, 2, 9, 17, -9, -1]]
    # Gauss points in panels of the angle, dense about both ends.
    edges = np.concatenate([np.geomspace(1e-3, 5, 60), np.arange(6, 175, 1.0)])
    edges = np.radians(np.concatenate([[0], edges, 180 - np.geomspace(5, 1e-2, 40), [180]]))
    x, weight = np.polynomial.legendre.leggauss(6)
    angle = (edges[:-1, None] + np.diff(edges)[:, None] * (x + 1) / 2).ravel()
    measure = np.sin(angle) / 2 * (np.diff(edges)[:, None] * weight / 2).ravel()
    legendre = np.polynomial.legendre.legvander(np.cos(angle), 64)
    bands = ("C01", "C05", "C07")

    @jax.jit
    def functions(radii, cosines):
        def in_band(band):
            phase = MiePhase(radii, material, band.name)
            return jax.vmap(phase)(cosines), phase.moments(65)

        return jax.vmap(in_band)(several_bands(bands, float))

    found = functions(jnp.asarray(between), jnp.asarray(np.cos(angle)))
    for phase, moments in zip(*found, strict=True):
        assert np.all(phase > 0)
        integrals = (measure * np.asarray(phase).T) @ legendre
        np.testing.assert_allclose(integrals[1:-1], moments[1:-1], rtol=0, atol=CONSISTENT)
        np.testing.assert_allclose(integrals, moments, rtol=0, atol=ENDS)
        np.testing.assert_allclose(moments[:, 0], 1, rtol=1e-14)


# As many radii as angles, so that all materials share the program's shapes.
COSINES = np.array([-1.0, -1 + 1e-9, -0.9999, -0.99, -0.75, -0.1, 0.3, 0.9, 0.9999, 1.0])


@pytest.fixture(scope="module")
def derivatives():
    """Value and derivatives of P, for radii of layers, by radius and by the cosine."""

    @jax.jit
    def function(radius, cosine):
        def phase(radius, cosine):
            return jax.vmap(lambda r, c: MiePhase(r, DROPLETS, "C02")(c)[0])(radius, cosine)

        one, zero = jnp.ones_like(radius), jnp.zeros_like(radius)
        value, by_radius = jax.jvp(phase, (radius, cosine), (one, zero))
        _, by_cosine = jax.jvp(phase, (radius, cosine), (zero, one))
        _, pull = jax.vjp(phase, radius, cosine)
        return value, by_radius, by_cosine, *pull(jnp.ones_like(value))

    return function


def test_derivatives_against_differences(derivatives):
    radius = jnp.asarray(np.geomspace(2.1, 45.0, COSINES.size))
    cosine = jnp.asarray(np.clip(COSINES, -0.99999, 0.99999))
    _, by_radius, by_cosine, *reverse = derivatives(radius, cosine)
    np.testing.assert_allclose(reverse, [by_radius, by_cosine], rtol=1e-12)
    step = 1e-6 * radius
    difference = derivatives(radius + step, cosine)[0] - derivatives(radius - step, cosine)[0]
    np.testing.assert_allclose(by_radius, difference / (2 * step), rtol=1e-6, atol=1e-7)
    # Near the ends P turns within a few 1e-6 of the cosine.
    step = 1e-5 * (1 - jnp.abs(cosine))
    difference = derivatives(radius, cosine + step)[0] - derivatives(radius, cosine - step)[0]
    np.testing.assert_allclose(by_cosine, difference / (2 * step), rtol=1e-6, atol=1e-7)


@pytest.mark.float32
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_derivatives_are_finite_at_any_angle_and_radius(derivatives, dtype):
    if dtype == "float64" and not jax.config.jax_enable_x64:
        dtype = "float32"
    for radius in (0.0, 1e-30, 10.0, 1e30):
        results = derivatives(jnp.full(COSINES.size, radius, dtype), jnp.asarray(COSINES, dtype))
        for result in results:
            assert result.dtype == dtype
            assert np.all(np.isfinite(result))
        assert np.all(np.asarray(results[0]) > 0)


@pytest.mark.float32
def test_float32_is_close_to_the_table(derivatives):
    # Cosines apart from the glory, where one of 32 bits does not tell angles apart.
    radius, cosine = np.geomspace(2.0, 40.0, COSINES.size), np.clip(COSINES, -0.99, 0.99)
    single = derivatives(jnp.asarray(radius, jnp.float32), jnp.asarray(cosine, jnp.float32))[0]
    double = derivatives(jnp.asarray(radius, float), jnp.asarray(cosine, float))[0]
    np.testing.assert_allclose(single, double, rtol=1e-4)


def test_layers_are_independent():
    radii = jnp.asarray([3.0, 12.0, 30.0])
    together = MiePhase(radii, DROPLETS, "C06")
    apart = [MiePhase(r, DROPLETS, "C06") for r in radii]
    cosine = jnp.asarray(-0.8)
    np.testing.assert_allclose(together(cosine), [p(cosine)[0] for p in apart], rtol=1e-14)
    np.testing.assert_allclose(
        together.moments(9), [p.moments(9)[0] for p in apart], rtol=1e-14, atol=1e-15
    )


@pytest.mark.parametrize("material", MATERIALS)
def test_moments_go_on_where_the_table_ends(material):
    """Those that the table has are those of its P to 1e-5; what follows is of the same series."""
    for band in ("C01", "C07"):
        table = band_table(material, band)
        found = moments_of(table._replace(moments=table.moments[:, :1]), 65)[2:-2]
        np.testing.assert_allclose(found, table.moments[2:-2], rtol=0, atol=2e-5)
        radius = jnp.asarray(mie_table(material).effective_radius_um[5])
        many = np.asarray(MiePhase(radius, material, band).moments(200))[0]
        np.testing.assert_array_equal(many[:65], MiePhase(radius, material, band).moments(65)[0])
        step = np.abs(np.diff(many))
        assert step[60:70].max() < 1.2 * step[50:64].max() + 2e-5
