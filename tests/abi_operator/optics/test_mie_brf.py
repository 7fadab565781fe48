"""End to end: what errors of the tables of Mie theory do to the reflectance of clouds and plumes.

One layer over ground of albedo 0.1, in every band, for sun and view in the glory, the rainbow,
sideways and forward (75 degrees each, turned by 30). Optics are our own or straight from miepython
(`mie_reference`); both clouds have the same mass of water, both plumes the same optical depth at
550 nm: that of the reference.
"""

from functools import partial

import jax
import jax.numpy as jnp
import mie_reference
import numpy as np
import pytest

from abi_operator.atmosphere import Atmosphere, LiquidCloud
from abi_operator.bands import BANDS, several_bands
from abi_operator.constants import WATER_DENSITY
from abi_operator.optics import aerosol, from_effective_radius, liquid_cloud, mie_plume
from abi_operator.optics.mie_table import DROPLETS
from abi_operator.solver import sufficient_doublings, toa_brf

REFERENCES, GEOMETRIES = mie_reference.read()
CLOUD_DEPTHS, PLUME_DEPTHS = (1.0, 10.0, 100.0), (0.1, 1.0, 4.0)  # in the green band, at 550 nm
BRF = 1e-3
NUM_MOMENTS = 17
GREEN = list(BANDS).index("green")


def spread(depths, values):
    """Values of each radius with each depth, (radius * depth, ...)."""
    return np.repeat(values, len(depths), axis=0)


def reference_layers(material, depths):
    """tau, ssa, moments, phase function of every case and band, from miepython."""
    reference = REFERENCES[material]
    depth = np.tile(depths, len(reference.effective_radius_um))[:, None]
    extinction = spread(depths, reference.extinction)
    if material == DROPLETS:
        extinction = extinction / extinction[:, [GREEN]]
    return (
        depth * extinction,
        1 - spread(depths, reference.coalbedo),
        spread(depths, reference.moments),
        spread(depths, reference.phase),
    )


def one_layer(liquid, plumes):
    """A kilometre of air."""
    height = jnp.asarray([1000.0, 0.0])
    return Atmosphere(jnp.asarray([9e4, 1e5]), height, liquid, plumes)


def read_out(optics, cosines):
    """tau, ssa, moments, phase function of the only layer."""
    phase = jax.vmap(optics.phase_function)(cosines)[:, 0]
    return optics.tau[0, 0], optics.ssa[0, 0], optics.moments(NUM_MOMENTS)[0], phase


@partial(jax.jit, static_argnums=3)
def cloud_layers(mass, number, cosines, kind):
    """The same of our own clouds, by Mie theory or by Mitchell."""

    def column(mass, number):
        atmosphere = one_layer(LiquidCloud(mass[None], number[None], optics=kind), {})
        in_band = jax.vmap(lambda band: read_out(liquid_cloud(atmosphere, band), cosines))
        return in_band(several_bands(tuple(BANDS), float))

    return jax.vmap(column)(mass, number)


@partial(jax.jit, static_argnums=0)
def plume_layers(species, radii, depths, cosines):
    """The same of our own plumes."""

    def column(radius, depth):
        plume = mie_plume(species, depth, radius, base=0.0, top=1000.0)
        empty = jnp.zeros(1)
        atmosphere = one_layer(LiquidCloud(empty, empty), {species: plume})
        in_band = jax.vmap(lambda band: read_out(aerosol(atmosphere, species, band), cosines))
        return in_band(several_bands(tuple(BANDS), float))

    return jax.vmap(column)(radii, depths)


def by_greenstein(layers, cosines):
    """The same of plumes with phase functions of Henyey and Greenstein."""
    g = np.asarray(layers[2])[..., 1:2]
    greenstein = (1 - g**2) / (1 + g**2 - 2 * g * np.asarray(cosines)) ** 1.5
    return [*layers[:2], g ** np.arange(NUM_MOMENTS), greenstein]


def cases():
    """Names of the cases: material, effective radius and depth, as the layers are ordered."""
    return [
        (material, float(radius), float(depth))
        for material, reference in REFERENCES.items()
        for radius in reference.effective_radius_um
        for depth in (CLOUD_DEPTHS if material == DROPLETS else PLUME_DEPTHS)
    ]


def layers(kinds):
    """Layers of each of `kinds`, all cases in one row: "ours", "simpler" or "reference"."""
    cosines = jnp.asarray(mie_reference.cos_scattering(GEOMETRIES))
    found = {kind: [] for kind in kinds}
    for material, reference in REFERENCES.items():
        depths = CLOUD_DEPTHS if material == DROPLETS else PLUME_DEPTHS
        radii = spread(depths, reference.effective_radius_um)
        depth = np.tile(depths, len(reference.effective_radius_um))
        if material == DROPLETS:
            q_ext = spread(depths, reference.extinction)[:, GREEN]
            mass = jnp.asarray(depth * 4 * WATER_DENSITY * 1e-6 * radii / (3 * q_ext))
            number = from_effective_radius(mass, jnp.asarray(1e-6 * radii), "cloud").number_path
            ours = cloud_layers(mass, number, cosines, "mie")
        else:
            ours = plume_layers(material, jnp.asarray(radii), jnp.asarray(depth), cosines)
        found["ours"].append(ours)
        found["reference"].append(reference_layers(material, depths))
        if "simpler" not in kinds:
            continue
        if material == DROPLETS:
            found["simpler"].append(cloud_layers(mass, number, cosines, "mitchell"))
        else:
            found["simpler"].append(by_greenstein(ours, cosines))
    return {
        kind: [np.concatenate([np.asarray(x) for x in same]) for same in zip(*parts, strict=True)]
        for kind, parts in found.items()
    }


def reflectance(columns, num_streams, num_doublings):
    """BRF (case, band, geometry)."""
    tau, ssa, moments, phase = columns
    # Geometry by geometry: so few columns are all solved by one program.
    views = [
        toa_brf(
            tau[..., None],
            ssa[..., None],
            moments[..., None, :],
            0.1,
            np.cos(sun),
            np.cos(view),
            azimuth,
            num_streams=num_streams,
            num_doublings=num_doublings,
            phase_function=phase[..., k, None],
        )
        for k, (sun, view, azimuth) in enumerate(np.radians(GEOMETRIES))
    ]
    return np.stack(views, axis=-1)


def reflectances(kinds, num_streams):
    """BRF (case, band, geometry) of each of `kinds`."""
    columns = layers(kinds)
    thickest = max(tau.max() for tau, *_ in columns.values())
    lowest = np.cos(np.radians(GEOMETRIES[:, :2])).min()
    enough = sufficient_doublings(float(thickest), float(lowest), num_streams)
    return {kind: reflectance(x, num_streams, enough) for kind, x in columns.items()}


def assert_near(ours, theirs):
    """Assert that ours are those of the reference, and print how near they are."""
    error, names = np.abs(ours - theirs), cases()
    for material in REFERENCES:
        mine = np.array([name[0] == material for name in names])
        print(f"{material}: |dbrf| of the table {error[mine].max():.1e}")
    worst = np.unravel_index(error.argmax(), error.shape)
    where = names[worst[0]], list(BANDS)[worst[1]], GEOMETRIES[worst[2]]
    print("largest:", where)
    assert error.max() <= BRF, (error.max(), where)


def test_brf_of_tables_and_of_miepython():
    brf = reflectances(("ours", "reference"), 8)
    assert_near(brf["ours"], brf["reference"])


@pytest.mark.slow
def test_brf_of_tables_and_of_miepython_at_16_streams():
    """The simpler optics are printed for the record."""
    brf = reflectances(("ours", "simpler", "reference"), 16)
    assert_near(brf["ours"], brf["reference"])
    error, names = np.abs(brf["simpler"] - brf["reference"]), cases()
    for material in REFERENCES:
        for depth in CLOUD_DEPTHS if material == DROPLETS else PLUME_DEPTHS:
            mine = np.array([(name[0], name[2]) == (material, depth) for name in names])
            part = error[mine]
            line = f"median {np.median(part):.1e}, max {part.max():.1e}"
            print(f"{material}, simpler optics at {depth:g}: {line}")
