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


class Minimiser(NamedTuple):
    """When a minimisation ends.

    Parameters
    ----------
    tolerance
        Largest change of x, and of the whitened residuals, in the last step; relative where these
        are above 1. Convergence being quadratic, what is left is far smaller. [-]
    max_steps
        Evaluations of the forward model with its Jacobian that are allowed; many pixels together
        are given these in rounds of 8, the last one whole. [-]
    """

    tolerance: float = 1e-6
    max_steps: int = 40


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
    """Find x at one pixel; never raises for values.

    Parameters
    ----------
    forward
        The forward model.
    observation, state
        What was measured, and all that is known of the column. A state that is not finite ends in
        an inversion that is not `converged`.
    x_first
        Where to begin. [-]
    prior
        What is known of x beforehand, of this pixel.
    minimiser
        How, and when to end.
    """

    def whitened(x: Float[Array, " x"]) -> Float[Array, " residual"]:
        measurement = observation.residual(forward(x, state))
        return measurement if prior is None else jnp.concatenate([measurement, prior.residual(x)])

    def linearised(x: Float[Array, " x"], _: None) -> tuple[Array, tuple[Array, Array]]:
        # A value whose derivative is the small matrix itself: optimistix carries the linear map
        # from step to step, and would otherwise carry every intermediate of the solver.
        here = jax.lax.stop_gradient(x)
        residual, jacobian = _value_and_jacobian(whitened, here)
        return residual + jacobian @ (x - here), (residual, jacobian)

    tolerance = max(minimiser.tolerance, _smallest_tolerance(x_first.dtype))
    solution = optx.least_squares(
        linearised,
        optx.LevenbergMarquardt(tolerance, tolerance),
        x_first,
        has_aux=True,
        max_steps=minimiser.max_steps,
        throw=False,
    )
    # These belong to the last iterate but one, which differs by less than the tolerance.
    residual, jacobian = solution.aux
    num_bands = len(forward.bands)
    covariance = posterior_covariance(jacobian)
    # A cost known to its last digits only may refuse every further step: that is the end, too.
    step = covariance @ (jacobian.T @ residual)
    settled = _negligible(step, solution.value, tolerance)
    settled &= _negligible(jacobian @ step, residual, tolerance)
    return Inversion(
        x=solution.value,
        covariance=covariance,
        averaging_kernel=averaging_kernel(covariance, jacobian[:num_bands]),
        measurement_cost=jnp.sum(residual[:num_bands] ** 2),
        prior_cost=jnp.sum(residual[num_bands:] ** 2),
        num_steps=jnp.asarray(solution.stats["num_steps"]),
        converged=(solution.result == optx.RESULTS.successful) | settled,
    )


def _smallest_tolerance(dtype: Any) -> float:
    """What rounding leaves of a reflectance factor, beside its noise: no step is smaller. [-]"""
    return 1e4 * float(jnp.finfo(dtype).eps)


def _negligible(change: Array, of: Array, tolerance: float) -> Array:
    """As optimistix judges a step; what is not finite is not negligible."""
    return jnp.all(jnp.abs(change) < tolerance * (1 + jnp.abs(of)))


def _value_and_jacobian(
    function: Callable[[Array], Array], x: Float[Array, " x"]
) -> tuple[Float[Array, " residual"], Float[Array, "residual x"]]:
    """Value and forward-mode Jacobian, of which the value is computed once."""

    def along(direction: Float[Array, " x"]) -> tuple[Array, Array]:
        return jax.jvp(function, (x,), (direction,))

    return jax.vmap(along, out_axes=(None, 1))(jnp.eye(x.shape[0], dtype=x.dtype))
