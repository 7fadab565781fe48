"""The worked examples run, at few streams, and find what they should."""

import information_content
import minimise
import numpy as np
import own_state_vector
import pytest

# As many streams as make programs small; what is tested holds at any number.
STREAMS = 2


@pytest.mark.slow
def test_a_state_vector_of_ones_own():
    found = own_state_vector.study(STREAMS)
    off = np.abs(found["retrieved"] - found["truth"]) / found["sigma"]
    assert off.max() < 1  # no noise: what is off is the prior's pull
    assert (found["sigma"] < 0.2).all()  # less than the priors'


@pytest.mark.slow
def test_bands_add_information_the_less_the_more_there_are():
    told = information_content.study(STREAMS)
    assert sorted(band for band, *_ in told) == sorted(information_content.BANDS)
    degrees, bits = np.array([numbers for _, *numbers in told]).T
    assert (np.diff(degrees) > 0).all() and 0.5 < degrees[0] <= 1 < degrees[-1] < 2
    gains = np.diff(bits, prepend=0)
    assert (gains > 0).all() and gains[0] == gains.max()


@pytest.mark.slow
def test_any_function_of_the_operator_can_be_minimised():
    values, steps = minimise.study(STREAMS)
    # Noise-free, so that only the prior is in the way.
    np.testing.assert_allclose(values, minimise.TRUTH, rtol=0.05)
    assert steps < 60


def test_diagnostics_are_those_of_pyoptimalestimation():
    pytest.importorskip("pyOptimalEstimation")
    from user_jacobian import study

    theirs, ours = study(20, STREAMS)
    assert all(oe.converged for oe in theirs)
    pairs = {
        "jacobian": [oe.K_i[oe.convI].to_numpy() for oe in theirs],
        "posterior_covariance": [oe.S_op.to_numpy() for oe in theirs],
        "averaging_kernel": [oe.A_i[oe.convI] for oe in theirs],
        "degrees_of_freedom": [oe.dgf for oe in theirs],
        "information_content": [oe.H_i[oe.convI] / np.log(2) for oe in theirs],
    }
    for name, expected in pairs.items():
        np.testing.assert_allclose(getattr(ours, name), expected, rtol=1e-5, err_msg=name)
    chi_square = [
        np.sum((oe.y_obs - oe.y_i[oe.convI]) ** 2 / np.diag(oe.S_y.to_numpy())) for oe in theirs
    ]
    np.testing.assert_allclose(ours.chi_square, chi_square, rtol=1e-5)
