"""Priors as users write them down."""

import numpy as np
import pytest

from abi_operator.files import InputError
from retrievals.kinds import vector_of
from retrievals.prior_file import DECLARED, read_prior

VECTOR = vector_of("smoke", retrieve_ssa=True)


def test_a_file_says_mean_and_sigma_in_the_unit_of_the_quantity(tmp_path):
    path = tmp_path / "prior.toml"
    path.write_text("[aod_550]\nmean = 0.5\nsigma = 0.01\n")
    vector = read_prior(str(path), VECTOR)
    assert vector.names == VECTOR.names
    prior = vector.prior()
    x, sigma = prior.x_prior, np.sqrt(np.diag(prior.S_prior))
    values = [np.asarray(VECTOR.values(x + k * sigma)["aod_550"]) for k in (-1, 0, 1)]
    np.testing.assert_allclose(values, [0.49, 0.5, 0.51], atol=2e-4)
    assert sigma[1] == VECTOR.quantities[1].sigma  # not in the file
    assert read_prior(DECLARED, VECTOR) is VECTOR


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[aod]\nmean = 1.0\nsigma = 1.0", "has aod; retrieved is aod_550, ssa_shift"),
        ("[aod_550]\nmean = 1.0", "needs numbers mean and sigma"),
        ("[aod_550]\nmean = 1.0\nsigma = -1.0", "sigma above 0"),
        ("[aod_550]\nmean = 20\nsigma = 1.0", "20 is no possible mean of aod_550"),
        ("[aod_550]\nmean = 1.0\nsigma = inf", "sigma above 0 and finite"),
        ("[aod_550]\nmean = true\nsigma = 1.0", "needs numbers"),
        ("[aod_550]\nmean = 1.0\nsigma = 1" + 400 * "0", "sigma above 0 and finite"),
        ("[aod_550]\nmean = 1" + 400 * "0" + "\nsigma = 1.0", "needs numbers"),
        ("aod_550 = 3", "needs numbers mean and sigma"),
        ("[aod_550", "cannot be read"),
        # Of more digits than Python makes an integer of, and in more brackets than it can count.
        ("[aod_550]\nmean = 1" + 5000 * "0" + "\nsigma = 1.0", "cannot be read"),
        ("aod_550 = " + 100_000 * "[", "cannot be read"),
    ],
)
def test_what_a_file_may_not_say(tmp_path, text, words):
    path = tmp_path / "prior.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        read_prior(str(path), VECTOR)


def test_a_file_has_to_be_there(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_prior(str(tmp_path / "none.toml"), VECTOR)
