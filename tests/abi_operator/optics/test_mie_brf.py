"""End to end: what errors of the tables of Mie theory do to the reflectance of clouds and plumes.

One layer over ground of albedo 0.1, in every band, for sun and view in the glory, the rainbow,
sideways and forward (75 degrees each, turned by 30). Optics are our own or straight from miepython
(`mie_reference`); both clouds have the same mass of water, both plumes the same optical depth at
550 nm: that of the reference.
"""

import jax
import jax.numpy as jnp
import mie_reference
import numpy as np
import pytest

from abi_operator.atmosphere import Atmosphere, LiquidCloud
from abi_operator.bands import BANDS
from abi_operator.constants import WATER_DENSITY
from abi_operator.optics import aerosol, from_effective_radius, liquid_cloud, mie_plume
from abi_operator.optics.mie_table import DROPLETS
from abi_operator.solver import toa_brf

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


@jax.jit
def cloud_layers(mass, number, cosines):
    """The same of our own clouds, by Mie theory and by Mitchell."""

    def column(mass, number, optics):
        atmosphere = one_layer(LiquidCloud(mass[None], number[None], optics=optics), {})
        bands = [read_out(liquid_cloud(atmosphere, band), cosines) for band in BANDS.values()]
        return [jnp.stack(x) for x in zip(*bands, strict=True)]

    return [
        jax.vmap(lambda m, n, kind=kind: column(m, n, kind))(mass, number)
        for kind in ("mie", "mitchell")
    ]


def plume_layers(species, radii, depths, cosines):
    """The same of our own plumes; the second by Henyey and Greenstein."""

    @jax.jit
    def layers(radii, depths):
        def column(radius, depth):
            plume = mie_plume(species, depth, radius, base=0.0, top=1000.0)
            empty = jnp.zeros(1)
            atmosphere = one_layer(LiquidCloud(empty, empty), {species: plume})
            optics = [aerosol(atmosphere, species, band) for band in BANDS.values()]
            bands = [read_out(one, cosines) for one in optics]
            return [jnp.stack(x) for x in zip(*bands, strict=True)]

        return jax.vmap(column)(radii, depths)

    mie = layers(radii, depths)
    g = np.asarray(mie[2])[..., 1:2]
    greenstein = (1 - g**2) / (1 + g**2 - 2 * g * np.asarray(cosines)) ** 1.5
    return mie, [*mie[:2], g ** np.arange(NUM_MOMENTS), greenstein]


@pytest.fixture(scope="module")
def layers():
    """Ours, the simpler optics and the reference, stacked: (3, case, ...), and names of cases."""
    cosines = jnp.asarray(mie_reference.cos_scattering(GEOMETRIES))
    stacks, names = [], []
    for material, reference in REFERENCES.items():
        depths = CLOUD_DEPTHS if material == DROPLETS else PLUME_DEPTHS
        radii = spread(depths, reference.effective_radius_um)
        depth = np.tile(depths, len(reference.effective_radius_um))
        if material == DROPLETS:
            q_ext = spread(depths, reference.extinction)[:, GREEN]
            mass = jnp.asarray(depth * 4 * WATER_DENSITY * 1e-6 * radii / (3 * q_ext))
            number = from_effective_radius(mass, jnp.asarray(1e-6 * radii), "cloud").number_path
            ours, simple = cloud_layers(mass, number, cosines)
        else:
            radii, depths_ = jnp.asarray(radii), jnp.asarray(depth)
            ours, simple = plume_layers(material, radii, depths_, cosines)
        theirs = reference_layers(material, depths)
        triples = zip(ours, simple, theirs, strict=True)
        stacks.append([np.stack([np.asarray(x) for x in triple]) for triple in triples])
        names += [(material, float(r), float(d)) for r, d in zip(radii, depth, strict=True)]
    return [np.concatenate(x, axis=1) for x in zip(*stacks, strict=True)], names


@pytest.mark.parametrize("num_streams", [8, 16])
def test_brf_of_tables_and_of_miepython(layers, num_streams):
    (tau, ssa, moments, phase), names = layers
    kinds = slice(None) if num_streams == 8 else [0, 2]  # the simpler optics are for the record
    sun, view, azimuth = np.radians(GEOMETRIES).T
    values = toa_brf(
        tau[kinds][..., None, None],
        ssa[kinds][..., None, None],
        moments[kinds][..., None, None, :],
        0.1,
        np.cos(sun),
        np.cos(view),
        azimuth,
        num_streams=num_streams,
        phase_function=phase[kinds][..., None],
    )
    ours, theirs = np.asarray(values[0]), np.asarray(values[-1])
    error = np.abs(ours - theirs)
    for material in REFERENCES:
        mine = np.array([name[0] == material for name in names])
        line = f"{num_streams} streams, {material}: |dbrf| of the table {error[mine].max():.1e}"
        if num_streams == 8:
            simple = np.abs(np.asarray(values[1]) - theirs)[mine]
            depths = sorted({name[2] for name, m in zip(names, mine, strict=True) if m})
            for k, depth in enumerate(depths):
                part = simple[k :: len(depths)]
                line += f"; simpler optics at {depth:g}: median {np.median(part):.1e}, "
                line += f"max {part.max():.1e}"
        print(line)
    worst = np.unravel_index(error.argmax(), error.shape)
    where = names[worst[0]], list(BANDS)[worst[1]], GEOMETRIES[worst[2]]
    print("largest:", where)
    assert error.max() <= BRF, (error.max(), where)
