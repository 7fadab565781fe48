r"""Nonlinear least squares at one pixel: the x that explains the reflectances best.

Minimised is the sum of squares of whitened residuals (Rodgers 2000, doi:10.1142/3171, Eq. 5.3),

.. math:: \sum_b \frac{(F_b(x) - y_b)^2}{\sigma_b^2} + (x - x_a)^T S_a^{-1} (x - x_a),

whose second part, the prior, may be missing. Nothing here knows smoke.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

from abi_operator import State

from .diagnostics import averaging_kernel, posterior_covariance
from .forward import ForwardModel
from .observation import Observation
from .prior import Prior

SOLVERS: dict[str, Callable[[float], optx.AbstractLeastSquaresSolver]] = {
    "dogleg": lambda tolerance: optx.Dogleg(tolerance, tolerance),
    "levenberg_marquardt": lambda tolerance: optx.LevenbergMarquardt(tolerance, tolerance),
    "gauss_newton": lambda tolerance: optx.GaussNewton(tolerance, tolerance),
}
"""Solvers of optimistix by name.

BFGS is none of them: a minimiser that knows the sum of squares alone ended far from the minimum on
one of twelve pixels and took four times the steps on the others."""


class Minimiser(NamedTuple):
    """How to minimise, and when to end.

    Parameters
    ----------
    tolerance
        Largest change of x, whitened by its prior where there is one, and of the cost, in the last
        step; relative where these are above 1. Convergence being quadratic, what is left is far
        smaller, so that with a prior 1e-2 moves nothing beside the posterior error. None for 1e-2
        with a prior and 1e-6 without. Larger ones than 1e-2 are no looser with `coarse_to_fine`,
        whose last step is below 0.05 posterior standard deviations. [-]
    max_steps
        Evaluations of the forward model that are allowed, with its Jacobian; many pixels together
        are given these in rounds of 8, the last one whole. With `coarse_to_fine` those of both
        forward models, three at least; two fifths of them may be damped steps. [-]
    solver
        One of `SOLVERS`. Of 2,048 random pixels of smoke at 4 streams, three unknowns from C01 to
        C03, dogleg explained 99.9 % and Levenberg-Marquardt 97.0, in 12 and 22 steps.
    starts
        ``"scan"``: at the lowest minimum of a coarse scan of the cost and, where there is another,
        at the second lowest too; ``"prior"``: at the mean of the prior, which takes half the time
        and sees no second solution.
    max_starts
        Of a scan: how often a pixel may begin whose fit is poor, or that has no more measurements
        than unknowns and may have several solutions. Of 10,000 random pixels of smoke, three
        unknowns from three bands, 8 explain 99.97 %, and 98 % of those whose first solution is not
        the truth are told to have another (`benchmarks/retrievals_against_truth.py`).
    coarse_to_fine
        Whether with a prior the scan and the first steps are by fewer streams (`coarse_to_fine`);
        not where the tolerance is below 1e-2. All these steps are of Gauss and Newton, damped where
        that is needed, whatever the `solver`.
    """

    tolerance: float | None = None
    max_steps: int = 40
    solver: str = "dogleg"
    starts: str = "scan"
    max_starts: int = 8
    coarse_to_fine: bool = True

    def chosen(self, with_prior: bool) -> "Minimiser":
        """The same with all that was left open, or `ValueError` for what cannot be."""
        if self.solver not in SOLVERS:
            raise ValueError(f"no solver {self.solver!r}; choose from {', '.join(SOLVERS)}.")
        tolerance = self.tolerance
        if tolerance is None:
            tolerance = 1e-2 if with_prior else 1e-6
        if not tolerance > 0 or min(self.max_steps, self.max_starts) < 1:
            raise ValueError(
                f"tolerance must be above 0, max_steps and max_starts 1 or more; got {tolerance}, "
                f"{self.max_steps} and {self.max_starts}."
            )
        if self.starts not in ("scan", "prior") or (self.starts == "prior" and not with_prior):
            raise ValueError(
                f"starts must be 'scan', or with a prior 'prior'; got {self.starts!r}."
            )
        return self._replace(tolerance=tolerance)


DEFAULT_MINIMISER = Minimiser()


class Inversion(eqx.Module):
    """Outcome of a minimisation.

    Parameters
    ----------
    x
        The solution. [-]
    covariance, averaging_kernel
        Its posterior covariance, and its sensitivity to the truth. [-]
    measurement_cost, prior_cost
        Sums of squared whitened residuals, the parts of the cost. [-]
    num_steps
        Evaluations of the forward model. [-]
    converged
        Whether the tolerance was met, by the last step or by the one that is next.
    """

    x: Float[Array, "*batch x"]
    covariance: Float[Array, "*batch x x"]
    averaging_kernel: Float[Array, "*batch x x"]
    measurement_cost: Float[Array, "*batch"]
    prior_cost: Float[Array, "*batch"]
    num_steps: Int[Array, "*batch"]
    converged: Bool[Array, "*batch"]

    @property
    def cost(self) -> Float[Array, "*batch"]:
        """Sum of squares of all whitened residuals. [-]"""
        return self.measurement_cost + self.prior_cost


def invert(
    forward: ForwardModel,
    observation: Observation,
    state: State,
    x_first: Float[Array, " x"],
    prior: Prior | None = None,
    minimiser: Minimiser = DEFAULT_MINIMISER,
) -> Inversion:
    """Find x at one pixel; what that measures and how the column is never raises.

    Parameters
    ----------
    forward
        The forward model, with enough doublings (`prepared`).
    observation, state
        What was measured, and all that is known of the column. A state that is not finite ends in
        an inversion that is not `converged`.
    x_first
        Where to begin. [-]
    prior
        What is known of x beforehand, of this pixel.
    minimiser
        How, and when to end.

    Returns
    -------
    Inversion
        Where it ended; of a pixel that has not `converged`, too.

    Raises
    ------
    ValueError
        Where the minimiser is none (`Minimiser.chosen`).
    """
    how = minimiser.chosen(prior is not None)
    tolerance = max(how.tolerance or 0.0, _smallest_tolerance(x_first.dtype))
    pixel = Pixel.of(forward, observation, state, x_first, prior)
    here, num_steps, successful = descended(pixel, pixel.z(x_first), how, tolerance)
    # The step of Gauss and Newton from the last linearisation costs nothing more. A cost known to
    # its last digits only may refuse it: that is the end, too.
    step = here.step
    settled = _negligible(step, here.z, tolerance)
    settled &= _negligible(here.jacobian @ step, here.residual, tolerance)
    return pixel.inversion(here, num_steps, successful | settled)


class Linear(NamedTuple):
    """All residuals of one pixel about one z, and their Jacobian."""

    z: Float[Array, " x"]
    residual: Float[Array, " residual"]
    jacobian: Float[Array, "residual x"]

    @property
    def step(self) -> Float[Array, " x"]:
        """That of Gauss and Newton."""
        covariance = posterior_covariance(self.jacobian)
        return -covariance @ (self.jacobian.T @ self.residual)

    @property
    def left(self) -> Float[Array, " residual"]:
        """Residuals after it."""
        return self.residual + self.jacobian @ self.step


class Pixel(eqx.Module):
    """The residuals of one pixel as a function of z, which is x whitened by its prior.

    Without a prior z is x. With one, of which z is the unit normal, z stands among the residuals
    after those of the measurements.
    """

    forward: ForwardModel = eqx.field(static=True)
    observation: Observation
    state: State
    origin: Float[Array, " x"]
    root: Float[Array, "x x"]
    with_prior: bool = eqx.field(static=True)

    @classmethod
    def of(
        cls,
        forward: ForwardModel,
        observation: Observation,
        state: State,
        x: Float[Array, " x"],
        prior: Prior | None,
    ) -> "Pixel":
        """The pixel with x of this size and type."""
        origin = jnp.zeros_like(x) if prior is None else jnp.asarray(prior.x_prior)
        root = jnp.eye(x.size, dtype=x.dtype) if prior is None else prior.root
        return cls(forward, observation, state, origin, root, prior is not None)

    def x(self, z: Float[Array, " x"]) -> Float[Array, " x"]:
        """The state vector of z."""
        return self.origin + self.root @ z

    def z(self, x: Float[Array, " x"]) -> Float[Array, " x"]:
        """z of a state vector."""
        return _solved(self.root, x - self.origin)

    def __call__(self, z: Float[Array, " x"]) -> Float[Array, " residual"]:
        """All residuals, whitened."""
        measurement = self.observation.departure(self.forward, self.x(z), self.state)
        return jnp.concatenate([measurement, z]) if self.with_prior else measurement

    def linear(self, z: Float[Array, " x"]) -> Linear:
        """The same, linearised."""
        return Linear(z, *value_and_jacobian(self, z))

    def inversion(self, here: Linear, num_steps: Array, converged: Array) -> "Inversion":
        """What has been found: a step on from the last linearisation if converged, or there."""
        covariance = posterior_covariance(here.jacobian)
        z = jnp.where(converged, here.z + here.step, here.z)
        residual = jnp.where(converged, here.left, here.residual)
        num_bands = len(self.forward.bands)
        kernel = averaging_kernel(covariance, here.jacobian[:num_bands])
        return Inversion(
            x=self.x(z),
            covariance=self.root @ covariance @ self.root.T,
            averaging_kernel=self.root @ _solved(self.root, kernel.T, trans=1).T,
            measurement_cost=jnp.sum(residual[:num_bands] ** 2),
            prior_cost=jnp.sum(residual[num_bands:] ** 2),
            num_steps=jnp.asarray(num_steps),
            converged=converged,
        )


def descended(
    pixel: Pixel, z: Float[Array, " x"], how: Minimiser, tolerance: float
) -> tuple[Linear, Array, Array]:
    """The linearisation where a minimisation ended, its evaluations, and its success.

    A last step that was rejected is none: it ended where that began.
    """

    def linearised(z: Float[Array, " x"], _: None) -> tuple[Array, Linear]:
        # A value whose derivative is the small matrix itself: optimistix carries the linear map
        # from step to step, and would otherwise carry every intermediate of the solver.
        here = pixel.linear(jax.lax.stop_gradient(z))
        return here.residual + here.jacobian @ (z - here.z), here

    solution = optx.least_squares(
        linearised,
        SOLVERS[how.solver](tolerance),
        z,
        has_aux=True,
        max_steps=how.max_steps,
        throw=False,
    )
    successful = solution.result == optx.RESULTS.successful
    # `solution.aux` is that of the accepted step before (since optimistix 0.1.0), the state's that
    # of the solution.
    return solution.state.aux, jnp.asarray(solution.stats["num_steps"]), successful


def _solved(root: Array, right: Array, trans: int = 0) -> Array:
    return jax.scipy.linalg.solve_triangular(root, right, trans=trans, lower=True)


def _smallest_tolerance(dtype: Any) -> float:
    """What rounding leaves of a reflectance factor, beside its noise: no step is smaller. [-]"""
    return 1e4 * float(jnp.finfo(dtype).eps)


def _negligible(change: Array, of: Array, tolerance: float) -> Array:
    """As optimistix judges a step; what is not finite is not negligible."""
    return jnp.all(jnp.abs(change) < tolerance * (1 + jnp.abs(of)))


def value_and_jacobian(
    function: Callable[[Array], Array], x: Float[Array, " x"]
) -> tuple[Float[Array, " residual"], Float[Array, "residual x"]]:
    """Value and forward-mode Jacobian, of which the value is computed once."""

    def along(direction: Float[Array, " x"]) -> tuple[Array, Array]:
        return jax.jvp(function, (x,), (direction,))

    return jax.vmap(along, out_axes=(None, 1))(jnp.eye(x.shape[0], dtype=x.dtype))
