"""Every ground at every angle, grazing ones above all."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import REPEATABLE, all_finite, among, array
from hypothesis import given

from abi_operator.solver import Lambertian
from abi_operator.surface import RossLi, ocean

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
