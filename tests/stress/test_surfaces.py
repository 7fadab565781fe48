"""Every ground at every angle, grazing ones above all."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import REPEATABLE, all_finite, among, array
from hypothesis import given

from abi_operator.solver import Lambertian
from abi_operator.surface import LandAndSea, RossLi, brightened, ocean

COUNT = 16
COSINES = array(among(1e-6, 1.0, 1e-3, np.nextafter(1.0, 0.0), 0.5), COUNT)
AZIMUTHS = array(among(0.0, 2 * np.pi, np.pi, 1e-9), COUNT)
SHARES = array(among(0.0, 1.0), COUNT)
WINDS = array(among(0.0, 60.0, 1e-12, 37.0), COUNT)


def grounds(share, wind):
    return {
        "Lambertian": Lambertian(share),
        "Ross-Li": RossLi(share, 0.5 * share, 0.2 * share),
        "ocean": ocean(wind, "C02"),
    }


def mixed_grounds(share, wind, volume, geometric):
    """Grounds of two parts, with kernel weights of any sign, and grounds that were brightened."""
    coast = LandAndSea(RossLi(share, volume, geometric), ocean(wind, "C07"), share)
    return {
        "land": coast.land,
        "sea": coast.sea,
        "land and sea": coast,
        "brighter": brightened(coast, 0.3 * share),
        "darker": brightened(Lambertian(share), -0.3 * share),
    }


def judged(name, share, wind, mu_out, mu_in, azimuth):
    """Reflectance there and back, and the slopes of its sum in everything."""

    def total(*arguments):
        share, wind, *angles = arguments
        found = grounds(share, wind)[name].brdf(*angles)
        return jnp.sum(found), jnp.broadcast_to(found, mu_out.shape)

    every = share, wind, mu_out, mu_in, azimuth
    slopes, found = jax.grad(total, argnums=tuple(range(5)), has_aux=True)(*every)
    back = grounds(share, wind)[name].brdf(mu_in, mu_out, azimuth)
    return found, jnp.broadcast_to(back, found.shape), slopes


judge = jax.jit(judged, static_argnums=0)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", ["Lambertian", "Ross-Li", "ocean"])
@given(SHARES, WINDS, COSINES, COSINES, AZIMUTHS)
@REPEATABLE
def test_reflectance_is_finite_and_reciprocal(name, dtype, share, wind, mu_out, mu_in, azimuth):
    arguments = [x.astype(dtype) for x in (share, wind, mu_out, mu_in, azimuth)]
    found, back, slopes = judge(name, *arguments)
    assert all_finite([found, *slopes])
    # Sun and view enter sums and products alone, of which the largest terms may cancel.
    rounding = 100 * np.finfo(dtype).eps * np.maximum(1, np.abs(found))
    assert (np.abs(np.asarray(found) - np.asarray(back)) <= rounding).all()
    if name == "ocean":
        foam = 2.95e-6 * wind**3.52
        assert (np.asarray(found)[foam <= 1] >= 0).all()


MIXED = "land", "sea", "land and sea", "brighter", "darker"
WEIGHTS = array(among(-1.0, 1.0, 0.0, 1e-12), COUNT)
ORDERS = 0, 1, 7


def judged_modes(name, fields, angles):
    """Reflectance and its modes there and back, and slopes of all of them in everything."""

    def of(fields, mu_out, mu_in, azimuth):
        ground = mixed_grounds(*fields)[name]
        there, back = jnp.stack([mu_out, mu_in]), jnp.stack([mu_in, mu_out])
        modes = jax.vmap(lambda m: ground.modes(m, there, back))(jnp.asarray(ORDERS))
        modes = jnp.broadcast_to(modes, (len(ORDERS), *there.shape))
        plain = jnp.broadcast_to(ground.brdf(there, back, azimuth), there.shape)
        return jnp.concatenate([plain[None], modes])

    found, pull = jax.vjp(of, fields, *angles)
    return found, pull(jnp.ones_like(found))


judge_modes = jax.jit(judged_modes, static_argnums=0)


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", MIXED)
def test_modes_are_finite_and_reciprocal(name, dtype):
    @given(SHARES, WINDS, WEIGHTS, WEIGHTS, COSINES, COSINES, AZIMUTHS)
    @REPEATABLE
    def of(share, wind, volume, geometric, mu_out, mu_in, azimuth):
        fields = tuple(x.astype(dtype) for x in (share, wind, volume, geometric))
        angles = tuple(x.astype(dtype) for x in (mu_out, mu_in, azimuth))
        found, slopes = judge_modes(name, fields, angles)
        found = np.asarray(found)
        assert all_finite([found, *jax.tree.leaves(slopes)])
        found, back = found[:, 0], found[:, 1]
        # Kernels and glints of both parts may cancel.
        rounding = 100 * np.finfo(dtype).eps * np.maximum(1, np.abs(found))
        assert (np.abs(found - back) <= rounding).all()
        if name == "sea":
            # The mean over azimuths of what is below 0 nowhere.
            assert (found[:2, 2.95e-6 * wind**3.52 <= 1] >= 0).all()

    of()
