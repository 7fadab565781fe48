"""The test of a fit: noise passes, and each kind of structure is told by its own number."""

import numpy as np

from retrievals.tuning import misfit

BANDS = ("C01", "C02")
COUNTS = np.ones((2, 40, 50), bool)


def noise(seed):
    return np.random.default_rng(seed).standard_normal(COUNTS.shape)


def test_noise_of_the_stated_size_is_no_misfit():
    """In 400 draws chi-square scatters as it should, and fewer than one in a hundred is told."""
    tests = [misfit(noise(seed), COUNTS, BANDS, 0.0) for seed in range(400)]
    departures = np.array([test.chi_square.departure for test in tests])
    assert abs(departures.mean()) < 0.2 and abs(departures.std() - 1) < 0.12  # 3 sigma of 400
    alike = np.array([test.alike["C01"].departure for test in tests])
    assert abs(alike.mean()) < 0.2 and abs(alike.std() - 1) < 0.12
    assert sum(test.found for test in tests) <= 4
    assert "no misfit found" in tests[0].sentence


def test_larger_residuals_a_mean_and_likeness_are_told_apart():
    larger = misfit(1.2 * noise(1), COUNTS, BANDS, 0.0)
    assert (
        larger.found
        and larger.chi_square.departure > 10
        and "reduced chi-square" in larger.sentence
    )
    shifted = noise(2)
    shifted[1] += 0.15
    found = misfit(shifted, COUNTS, BANDS, 0.0)
    assert len(found.reasons) == 1 and "mean residual" in found.sentence and "C02" in found.sentence
    wave = 0.5 * np.sin(np.arange(50) / 5)
    found = misfit(noise(3) + wave, COUNTS, BANDS, 0.0)
    assert any("neighbours' residuals in C01" in reason for reason in found.reasons)


def test_what_does_not_count_does_not():
    counts = COUNTS.copy()
    counts[:, :, 25:] = False
    counts[1] = False
    fields = np.where(counts, noise(4), 1e3)
    found = misfit(fields, counts, BANDS, 3.0)
    assert not found.found and list(found.by_band) == ["C01"]
    assert found.alike["C01"].scatter == 1 / np.sqrt(40 * 24 + 39 * 25)
    expected = np.sum(fields[0, :, :25] ** 2) / (40 * 25 - 3)
    np.testing.assert_allclose(found.chi_square.value, expected)


def test_less_noise_than_is_assumed_is_said():
    found = misfit(0.5 * noise(5), COUNTS, BANDS, 0.0)
    assert not found.found and "closer than noise allows" in found.sentence


def test_what_is_no_number_is_a_misfit():
    """In one pixel or all of them: a model that gives none has not explained what was observed."""
    found = misfit(np.full((1, 3, 3), np.nan), np.ones((1, 3, 3), bool), ("C01",), 0.0)
    assert found.found and "no finite number, as residuals are none in C01" in found.sentence
    for lost in (np.nan, np.inf):
        fields = noise(6)
        fields[1, 2, 3] = lost
        found = misfit(fields, COUNTS, BANDS, 3.0)
        assert len(found.reasons) == 1 and found.reasons[0].endswith("residuals are none in C02")
    unknown = misfit(noise(6), COUNTS, BANDS, np.nan)  # as of a covariance that is none
    assert unknown.reasons == ["reduced chi-square is no finite number"]
