"""Mass without number, number without mass, traces and floods of both: optics of clouds."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import REPEATABLE, all_finite, array, powers
from hypothesis import given

from abi_operator import Atmosphere, Hydrometeor, LiquidCloud
from abi_operator.bands import BANDS
from abi_operator.optics import CLASSES, hydrometeor, liquid_cloud

COUNT, BAND, NUM_MOMENTS = 16, "C05", 9
# Most that a scheme may say, and least; the largest mass weighs as much as all air.
MASS = {
    np.float64: array(powers(-300, 4, 5e-324, 1e-12, 1e-3), COUNT),
    np.float32: array(powers(-36, 4, 1e-45, 1e-12, 1e-3), COUNT),
}
NUMBER = {
    np.float64: array(powers(-300, 300, 5e-324, 1.0, 1e10), COUNT),
    np.float32: array(powers(-36, 36, 1e-45, 1.0, 1e10), COUNT),
}
KINDS = ("mie", "mitchell", "rain", "snow", "graupel")


def optics_of(kind, mass, number, band=BAND, crystals="fu"):
    """Optical depth, its scattering part and moments of a column of such layers."""
    levels = np.linspace(0, 1, COUNT + 1).astype(mass.dtype)
    nothing = LiquidCloud(jnp.zeros_like(mass), jnp.zeros_like(mass))
    liquid = LiquidCloud(mass, number, kind) if kind in KINDS[:2] else nothing
    others = {} if kind in KINDS[:2] else {kind: Hydrometeor(mass, number, crystals)}
    air = Atmosphere(1e5 * levels, 2e4 * levels[::-1], liquid, {}, hydrometeors=others)
    band = BANDS[band]
    found = hydrometeor(air, kind, band) if others else liquid_cloud(air, band)
    return found.extinction[0], found.scatterers[0].scattering, found.moments(NUM_MOMENTS)


def judged(kind, mass, number, *how):
    """The same, and slopes of the sum of each in mass and number."""

    def total(mass, number):
        tau, scattering, moments = optics_of(kind, mass, number, *how)
        return jnp.sum(tau) + jnp.sum(scattering) + jnp.sum(moments)

    return optics_of(kind, mass, number, *how), jax.grad(total, argnums=(0, 1))(mass, number)


judge = jax.jit(judged, static_argnums=(0, 3, 4))


def assert_right(kind, mass, number, *how):
    (tau, scattering, moments), slopes = judge(kind, mass, number, *how)
    tau, scattering, moments = (np.asarray(x) for x in (tau, scattering, moments))
    assert all_finite([tau, scattering, moments, *slopes])
    assert (tau >= 0).all() and (scattering >= 0).all()
    assert (scattering <= tau * (1 + 4 * np.finfo(tau.dtype).eps)).all()
    assert (np.abs(moments) <= 1 + 1e-5).all()
    assert (np.abs(moments[:, 0] - 1) <= 4 * np.finfo(tau.dtype).eps).all()
    assert (tau[(mass == 0) | (number == 0)] == 0).all()


SLOW = [
    pytest.param(kind, dtype, marks=pytest.mark.slow)
    for kind in KINDS
    for dtype in (np.float64, np.float32)
    if (kind, dtype) not in (("mie", np.float64), ("rain", np.float32))
]


@pytest.mark.parametrize(("kind", "dtype"), [("mie", np.float64), ("rain", np.float32), *SLOW])
def test_optics_are_finite(kind, dtype):
    @given(MASS[dtype], NUMBER[dtype])
    @REPEATABLE
    def of(mass, number):
        with np.errstate(under="ignore"):
            assert_right(kind, mass.astype(dtype), number.astype(dtype))

    of()


# Classes that are not among `KINDS`, and all in bands of other light; both shapes of crystals.
OTHERS = [name for name in CLASSES if name not in KINDS]
CRYSTALS = [name for name, optics in CLASSES.items() if optics.asymmetry == "fu1996"]
MORE = [(name, BAND, "fu", dtype) for name in OTHERS for dtype in (np.float64, np.float32)]
MORE += [(name, band, "fu", np.float64) for name in (*KINDS, *OTHERS) for band in ("C01", "C07")]
MORE += [(name, BAND, "rough", dtype) for name in CRYSTALS for dtype in (np.float64, np.float32)]


@pytest.mark.parametrize(
    ("kind", "band", "crystals", "dtype"),
    [("ice", "C07", "rough", np.float64)]
    + [pytest.param(*some, marks=pytest.mark.slow) for some in MORE],
)
def test_optics_of_every_class_are_finite(kind, band, crystals, dtype):
    @given(MASS[dtype], NUMBER[dtype])
    @REPEATABLE
    def of(mass, number):
        with np.errstate(under="ignore"):
            assert_right(kind, mass.astype(dtype), number.astype(dtype), band, crystals)

    of()


@pytest.mark.parametrize(
    ("kind", "how", "dtype"),
    [("mie", (), np.float64), ("rain", (), np.float32), ("ice", ("C07", "rough"), np.float64)],
)
def test_what_is_no_number_is_not_an_empty_layer(kind, how, dtype):
    """Not told apart inside `jax.jit`, a cloud would go missing; a layer without mass is empty
    whatever its number."""
    mass, number = np.full(COUNT, 1e-2, dtype), np.full(COUNT, 1e9, dtype)
    mass[:3], number[2:5] = (np.nan, np.nan, 0.0), np.nan
    (tau, scattering, _), _ = judge(kind, mass, number, *how)
    unknown = np.isin(np.arange(COUNT), (0, 1, 3, 4))
    for found in (np.asarray(tau), np.asarray(scattering)):
        np.testing.assert_array_equal(np.isnan(found), unknown)
    assert tau[2] == 0
