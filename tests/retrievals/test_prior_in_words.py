"""What products say of their priors."""

import numpy as np

from retrievals import Prior
from retrievals.kinds import vector_of
from retrievals.prior_file import read_prior
from retrievals.prior_in_words import prior_in_words

NAMES = ("aod_550", "ssa_shift")


def test_what_is_declared_and_what_a_file_says(tmp_path):
    vector = vector_of("ash", False, True)
    path = tmp_path / "prior.toml"
    path.write_text("[effective_radius_um]\nmean = 4\nsigma = 2.5\n")
    words = "aod_550 0.4, x +/- 1.5; effective_radius_um 4 +/- 2.5 um"
    assert prior_in_words(read_prior(str(path), vector), vector.names) == (
        f"normal distribution: {words}"
    )


def test_distributions_of_x():
    mean, covariance = np.array([-0.5, 0.0]), np.diag([4.0, 0.25])
    alone = "normal distribution of x: aod_550 -0.5 +/- 2; ssa_shift 0 +/- 0.5"
    assert prior_in_words(Prior(mean, covariance), NAMES) == alone
    together = Prior(mean, covariance + 0.1 * (1 - np.eye(2)))
    assert prior_in_words(together, NAMES) == f"{alone}; correlated"
    each = Prior(np.tile(mean, (3, 1)), covariance)
    assert prior_in_words(each, NAMES) == "normal distribution of x, one of each pixel"
    assert prior_in_words(None, NAMES) == "none"
