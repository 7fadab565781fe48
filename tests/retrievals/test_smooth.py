"""An image retrieved as a whole, under the veil."""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy
from veil import TWO, seen

from retrievals import (
    Minimiser,
    Observation,
    Prior,
    Quantity,
    ResultCode,
    StateVector,
    Unbounded,
    measurement,
    retrieve_pixels,
)
from retrievals.input_checks import checked
from retrievals.kinds import BANDS
from retrievals.quantities import replaced
from retrievals.smooth import (
    joint_cost,
    joint_gradient,
    linearised,
    retrieve_smooth,
    smoothness,
)
from retrievals.smooth.retrieval import _descended

SHAPE, LENGTH = (16, 16), 3.0
PRIOR = Prior(np.asarray(TWO.vector.x(0.3, 0.0)), np.diag([0.8**2, 0.05**2]))


gradient = jax.jit(joint_gradient)  # one program, and not one for every operation


def precision(smooth, num_pixels):
    """Q as a matrix."""
    return np.asarray(jax.jit(smooth.__call__)(np.eye(num_pixels)))


@pytest.fixture(scope="module")
def image():
    """Observations, states, and x drawn from the prior with the smoothness of the retrieval."""
    rng = np.random.default_rng(6)
    smooth = smoothness(np.ones(SHAPE, bool), LENGTH)
    root = np.linalg.cholesky(np.linalg.inv(precision(smooth, 256)))
    x = PRIOR.x_prior + (root @ rng.standard_normal((256, 2))) @ np.sqrt(PRIOR.S_prior)
    ground = rng.uniform(0.03, 0.2, (256, 1)) * np.ones(3)
    clean = np.asarray(seen(TWO, x, ground))
    noisy = clean + 8 * measurement(clean, BANDS).sigma * rng.standard_normal(clean.shape)
    observation = measurement(noisy, BANDS)
    worse = type(observation)(observation.measured, 8 * observation.sigma)
    return worse, ground, x, smooth


def test_single_pixels_keep_their_own_prior():
    smooth = smoothness(np.ones((31, 31), bool), LENGTH)
    matrix = precision(smooth, 961)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
    np.testing.assert_allclose(smooth.diagonal(), np.diagonal(matrix), rtol=1e-12)
    covariance = np.linalg.inv(matrix).reshape(31, 31, 31, 31)[15, 15]
    # Five lengths from the edges, where the rest of the correlation is 2 %.
    assert covariance[15, 15] == pytest.approx(1, abs=1e-3)
    # The sum over the waves of an endless grid, and Matern's correlation of smoothness 1,
    # (h / l) K_1(h / l), from which a grid of so few pixels a length departs by 0.03.
    wave = 2 * np.pi * np.arange(256) / 256
    spectrum = (1 + 2 * LENGTH**2 * (2 - np.cos(wave)[:, None] - np.cos(wave))) ** -2
    for lag, matern in ((3, 0.602), (6, 0.280)):
        expected = np.mean(spectrum * np.cos(lag * wave)) / np.mean(spectrum)
        assert covariance[15, 15 + lag] == pytest.approx(expected, abs=2e-3)
        assert expected == pytest.approx(matern, abs=0.03)


@pytest.mark.parametrize("length", [1.5, 10.0])
def test_a_small_patch_keeps_it_too(length):
    """A pixel alone, two, a row and a corner: they had up to 35 times its standard deviation."""
    chosen = np.zeros((9, 12), bool)
    chosen[0, 0] = chosen[2, 4:6] = chosen[4, :11] = chosen[6:, 3] = chosen[8, 3:7] = True
    matrix = precision(smoothness(chosen, length), chosen.sum())
    np.testing.assert_allclose(np.diagonal(np.linalg.inv(matrix)), 1, rtol=1e-6)


def test_a_large_patch_keeps_it_nearly(monkeypatch):
    """By draws, to four of their standard errors, 0.044 in a standard deviation."""
    exact = smoothness(np.ones((20, 20), bool), LENGTH).sigma
    monkeypatch.setattr("retrievals.smooth.precision._MOST_EXACT", 10)
    drawn = smoothness(np.ones((20, 20), bool), LENGTH).sigma
    ratio = np.asarray(drawn / exact)
    assert 0.01 < np.abs(ratio - 1).max() < 4 * 0.044


def test_neighbours_are_those_that_are_retrieved():
    chosen = np.ones((2, 2, 3), bool)  # two images
    chosen[0, 0, 1] = False
    smooth = smoothness(chosen, 1.0)
    pairs = {tuple(sorted(p)) for p in np.stack([smooth.one, smooth.other], axis=1).tolist()}
    # rows 0 . 1 / 2 3 4 and 5 6 7 / 8 9 10
    first = {(0, 2), (1, 4), (2, 3), (3, 4)}
    second = {(5, 6), (6, 7), (8, 9), (9, 10), (5, 8), (6, 9), (7, 10)}
    assert pairs == first | second
    with pytest.raises(ValueError, match="above 0 pixels; got 0"):
        smoothness(chosen, 0.0)
    with pytest.raises(ValueError, match="at most 8192 pixels, as .* got 100000"):
        smoothness(chosen, 1e5)


def test_the_gradient_is_that_of_the_cost(image):
    observation, ground, _, smooth = image
    _, usable, prior = checked(TWO, observation, PRIOR)
    rng = np.random.default_rng(3)
    z, along = rng.standard_normal((2, 256, 2))
    here = linearised(TWO, usable, ground, prior, z)
    slope = 2 * float(np.sum(np.asarray(gradient(here, smooth, z)) * along))

    def cost(step):
        there = z + step * along
        return joint_cost(linearised(TWO, usable, ground, prior, there), smooth, there)

    step = 1e-5  # the error of differences is its square, that of rounding 1e-16 / step of the cost
    np.testing.assert_allclose((cost(step) - cost(-step)) / (2 * step), slope, rtol=1e-7)


def test_a_joint_image_is_better_than_its_pixels(image):
    observation, ground, x, smooth = image
    alone = retrieve_pixels(TWO, observation, ground, prior=PRIOR)
    found = retrieve_smooth(TWO, observation, ground, prior=PRIOR, smooth=smooth)
    assert np.mean(found.codes == ResultCode.SUCCESS) > 0.97
    errors = [np.sqrt(np.mean((r.inversion.x - x) ** 2, axis=0)) for r in (alone, found)]
    # The brightness of the ground is known well by single pixels, the optical depth is not.
    assert (errors[1] < np.array([0.8, 0.95]) * errors[0]).all()
    # At the minimum the gradient vanishes, and the covariance is the inverse of A.
    _, usable, prior = checked(TWO, observation, PRIOR)
    sigma = np.sqrt(np.diagonal(PRIOR.S_prior))
    z = (found.inversion.x - PRIOR.x_prior) / sigma
    here = linearised(TWO, usable, ground, prior, z)
    first = linearised(TWO, usable, ground, prior, 0 * z)
    gradients = [np.abs(gradient(h, smooth, at)).max() for h, at in ((here, z), (first, 0 * z))]
    assert gradients[0] < 1e-2 * gradients[1]
    blocks = scipy.linalg.block_diag(*np.einsum("pbx,pby->pxy", here.jacobian, here.jacobian))
    matrix = blocks + np.kron(precision(smooth, 256), np.eye(2))
    exact = np.sqrt(np.diagonal(np.linalg.inv(matrix)).reshape(256, 2)) * sigma
    stated = np.sqrt(np.diagonal(found.inversion.covariance, axis1=1, axis2=2))
    # A standard deviation from 32 draws alone would be known to 1 / sqrt(64); most is without them.
    assert np.std(stated / exact) < 0.05 and abs(np.mean(stated / exact) - 1) < 0.02
    np.testing.assert_allclose(stated, exact, rtol=0.2)
    ratio = np.abs(found.inversion.x - x) / stated
    assert abs(np.mean(ratio < 1) - 0.683) < 0.08  # correlated errors: fewer than 512 are free


@dataclass(frozen=True)
class Edge:
    """A forward model that shows x, and is no number beyond 1."""

    vector: StateVector = StateVector((Quantity("q", "1", "", "", Unbounded(), replaced, 1, 0),))
    bands: tuple[str, ...] = ("C01",)

    def __call__(self, x, state):
        return jnp.where(x > 1, jnp.nan, x) + state


def test_what_is_no_number_any_more_is_not_won():
    """The measurement of the second of three pixels leads beyond the edge."""
    sigma = np.full((3, 1), 0.1)
    observation, ground = Observation(np.array([[0.5], [1.5], [0.5]]), sigma), np.zeros((3, 1))
    smooth, prior = smoothness(np.ones((1, 3), bool), 0.3), Prior(np.zeros(1), np.eye(1))
    _, usable, own = checked(Edge(), observation, prior)
    linearise = partial(linearised, Edge(), usable, ground, own)
    z, here, _, _ = _descended(linearise, smooth, np.zeros((3, 1)), 1e-2, 5)
    assert here.fine.all() and (0 < z).all() and (z <= 1).all()
    # It is left there before the steps run out, and only it has not converged.
    _, _, steps, converged = _descended(linearise, smooth, np.zeros((3, 1)), 1e-2, 40)
    assert steps < 40 and converged.tolist() == [True, False, True]
    # Single pixels that end with their first step, there: the code says what the joint ones found.
    how = Minimiser(0.999, starts="prior")
    found = retrieve_smooth(Edge(), observation, ground, prior=prior, smooth=smooth, minimiser=how)
    assert found.codes.tolist() == [ResultCode.SUCCESS, ResultCode.NONFINITE, ResultCode.SUCCESS]


def test_a_pixel_without_measurements_is_filled_and_says_so(image):
    observation, ground, _, smooth = image
    measured = np.array(observation.measured)
    measured[100] = np.nan
    broken = type(observation)(measured, observation.sigma)
    found = retrieve_smooth(TWO, broken, ground, prior=PRIOR, smooth=smooth)
    assert found.codes[100] == ResultCode.INVALID_INPUT
    assert np.isfinite(found.inversion.x).all()
    around = found.inversion.x[[99, 101, 84, 116]]
    assert (np.abs(found.inversion.x[100] - around.mean(axis=0)) < 2 * np.ptp(around, axis=0)).all()


def test_a_pixel_that_nothing_explains_holds_no_other_up(image):
    """Its minimum is reached by small steps, and all pixels had these: none had converged."""
    observation, ground, x, smooth = image
    measured = np.array(observation.measured)
    sigma = np.array(observation.sigma)
    measured[100], sigma[100] = 1.9, 0.003
    broken = Observation(measured, sigma)
    found = retrieve_smooth(TWO, broken, ground, prior=PRIOR, smooth=smooth)
    assert found.codes[100] == ResultCode.POOR_FIT
    row, col = np.divmod(np.arange(256), 16)
    beside = (np.abs(row - 100 // 16) <= 1) & (np.abs(col - 100 % 16) <= 1)
    assert np.mean(found.codes[~beside] == ResultCode.SUCCESS) > 0.95
    assert set(found.codes[beside]) <= {ResultCode.SUCCESS, ResultCode.POOR_FIT}
    success = found.codes == ResultCode.SUCCESS
    sigma = np.sqrt(np.diagonal(found.inversion.covariance, axis1=1, axis2=2))
    held = np.abs(found.inversion.x - x)[success] <= 1.96 * sigma[success]
    assert (held.mean(axis=0) > 0.84).all()


@pytest.mark.parametrize("wrong", ["sigma", "measured", "prior"])
def test_a_pixel_whose_square_is_no_number_spoils_no_other(image, wrong):
    """Others come out as where it measures nothing; with it no sum over the image was a number."""
    observation, ground, _, smooth = image
    arrays = {
        "sigma": np.array(observation.sigma),
        "measured": np.array(observation.measured),
        "prior": np.tile(PRIOR.x_prior, (256, 1)),
    }
    missing = arrays["measured"].copy()
    missing[100] = np.nan
    arrays[wrong][100] = {"sigma": 1e-160, "measured": -1e300, "prior": 1e200}[wrong]
    prior = Prior(arrays["prior"], PRIOR.S_prior)
    broken = Observation(arrays["measured"], arrays["sigma"])
    without = Observation(missing, observation.sigma)
    found = retrieve_smooth(TWO, broken, ground, prior=prior, smooth=smooth)
    expected = retrieve_smooth(TWO, without, ground, prior=PRIOR, smooth=smooth)
    assert found.codes[100] == ResultCode.NONFINITE
    others = np.arange(256) != 100
    np.testing.assert_array_equal(found.codes[others], expected.codes[others])
    sigma = np.sqrt(np.diagonal(expected.inversion.covariance, axis1=1, axis2=2))
    moved = np.abs(found.inversion.x - expected.inversion.x) / sigma
    assert moved[others].max() < 0.1  # what a last step leaves
    assert np.isfinite(found.inversion.covariance[others]).all()


def test_bounds_alone_are_no_success(image):
    """As of single pixels: of what lies above a ceiling neighbours tell, and nothing measured."""
    observation, ground, _, smooth = image
    saturated = np.zeros((256, 3), bool)
    saturated[100] = True
    measured = np.where(saturated, 0.8, 1) * observation.measured
    bounded = Observation(measured, observation.sigma, saturated)
    found = retrieve_smooth(TWO, bounded, ground, prior=PRIOR, smooth=smooth)
    assert found.codes[100] == ResultCode.NOT_OBSERVABLE
    with pytest.raises(ValueError, match="smooth is of 9 pixels, and the observations are of 256"):
        other = smoothness(np.ones((3, 3), bool), LENGTH)
        retrieve_smooth(TWO, bounded, ground, prior=PRIOR, smooth=other)
