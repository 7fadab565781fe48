"""Phase functions, their series and the light scattered once, which no mode holds.

The columns of `plumes`, in 17 directions at 4 streams; their errors are in `test_published`.
"""

import numpy as np
from columns import STANDARD
from plumes import AZIMUTH, COLUMNS, MU, columns, delta_m_alone

from abi_operator.solver import toa_brf

NUM_STREAMS, LONGEST = 4, 65
# Parts of each layer, for `STANDARD` doublings to be enough.
DIVISORS = np.array([1, 3, 1])


def cosine_of_scattering():
    """(column, view)"""
    mu0 = columns()[-1][:, None]
    return -MU * mu0 - np.sqrt((1 - MU**2) * (1 - mu0**2)) * np.cos(AZIMUTH)


def series(moments):
    """Phase functions (column, view, layer) as the sum of some moments' series."""
    degrees = np.arange(moments.shape[-1])
    polynomials = np.polynomial.legendre.legvander(cosine_of_scattering(), degrees[-1])
    return np.einsum("l,ckl,cvl->cvk", 2 * degrees + 1, moments, polynomials)


def exact():
    """The phase functions: 257 moments of g = 0.86 lack nothing beyond 1e-14."""
    return series(columns()[2])


def uncorrected():
    """What to pass as phase functions for the light scattered once to be delta-M's own."""
    moments = columns()[2]
    return series(moments[..., :NUM_STREAMS] - moments[..., NUM_STREAMS, None])


def in_parts(x):
    """Layers on the last axis, the plume's as several."""
    return np.repeat(x, DIVISORS, axis=-1)


def solve(phase_function=None, layers=None, albedo=None, **options):
    """brf (column, view) with phase functions given or, where they are not, as series."""
    tau, ssa, moments = columns()[:3] if layers is None else layers
    own_albedo, mu0 = columns()[3:]
    albedo = own_albedo if albedo is None else albedo
    num_moments = LONGEST
    if phase_function is not None:
        options["phase_function"], num_moments = in_parts(phase_function), NUM_STREAMS + 1
    moments = moments[..., :num_moments]
    moments = np.pad(moments, [(0, 0), (0, 0), (0, num_moments - moments.shape[-1])])
    layers = in_parts(tau / DIVISORS), in_parts(ssa), np.repeat(moments, DIVISORS, axis=-2)
    layers = [x[:, None] for x in layers]
    others = albedo[:, None], mu0[:, None], MU, AZIMUTH
    # Series that are cut off are below 0 here and there.
    options = {"check_values": False, **STANDARD, **options}
    return np.asarray(toa_brf(*layers, *others, **options))


def test_phase_functions_may_come_as_series():
    """Moments or their sum give the same reflectance; a sum can also stand for no correction."""
    short = series(columns()[2][..., :LONGEST])
    np.testing.assert_allclose(solve(), solve(short), rtol=1e-12)
    plain = solve(single_scattering=None)
    np.testing.assert_allclose(plain, solve(uncorrected()), rtol=1e-10)
    scaled_by_hand = solve(layers=delta_m_alone(NUM_STREAMS)[:3])
    np.testing.assert_allclose(plain, scaled_by_hand, rtol=1e-10)


def test_dropped_modes():
    """Errors fall with the modes kept, and no mode holds the light scattered once."""
    whole = solve(exact())
    one, two = (np.abs(solve(exact(), num_modes=m) / whole - 1).max(axis=-1) for m in (1, 2))
    assert (two < one).all()
    halved = solve(exact() / 2)
    fewer, halved_fewer = solve(exact(), num_modes=2), solve(exact() / 2, num_modes=2)
    responses = whole - halved, fewer - halved_fewer
    assert (responses[0] > 0).all()
    # Differences of reflectances of order 1 in float64.
    np.testing.assert_allclose(*responses, rtol=0, atol=1e-13)


def test_dropped_modes_leave_thin_layers_alone():
    """All that a thin column over black ground sends back is scattered once."""
    _, ssa, moments, albedo, mu0 = columns()
    tau = np.tile([3e-7, 5e-7, 2e-7], (len(COLUMNS), 1))
    result = solve(exact(), layers=(tau, ssa, moments), albedo=0 * albedo, num_modes=2)
    once = np.sum((ssa * tau)[:, None] * exact(), axis=-1) / (4 * mu0[:, None] * MU)
    # What is attenuated or scattered again is smaller by the slant depth, below 1e-5; a phase
    # function of 0.03 meets light scattered again at 1.
    np.testing.assert_allclose(result, once, rtol=3e-4)


def test_several_views_with_phase_functions_are_single_ones():
    tau, ssa, moments, albedo, mu0 = columns()
    layers = in_parts(tau / DIVISORS), in_parts(ssa), np.repeat(moments, DIVISORS, axis=1)
    together = toa_brf(
        *layers, albedo, mu0, MU, AZIMUTH, multiple_views=True,
        phase_function=np.swapaxes(in_parts(exact()), 1, 2), **STANDARD,
    )  # fmt: skip
    np.testing.assert_allclose(together, solve(exact()), rtol=1e-12)
