r"""How well a solution is known, and whether it explains the measurement (Rodgers 2000 [1]_).

With residuals whitened, the Jacobian of the measurement's residuals is
:math:`\tilde K = S_\epsilon^{-1/2} K`; no other matrix is needed.

References
----------
.. [1] C. D. Rodgers, "Inverse Methods for Atmospheric Sounding", World Scientific, 2000,
   sections 2.3, 2.4 and 12.3, doi:10.1142/3171
"""

import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float


def posterior_covariance(jacobian: Float[Array, "residual x"]) -> Float[Array, "x x"]:
    r"""Covariance :math:`\hat S = (J^T J)^{-1}` of x, from all whitened residuals. [-]

    It is not finite where the residuals do not determine x.
    """
    return jnp.linalg.inv(jacobian.T @ jacobian)


def averaging_kernel(
    covariance: Float[Array, "x x"], measurement_jacobian: Float[Array, "band x"]
) -> Float[Array, "x x"]:
    r"""Sensitivity :math:`A = \hat S \tilde K^T \tilde K` of the solution to the truth. [-]

    The unit matrix where there is no prior; its trace is the degrees of freedom for signal.
    """
    return covariance @ measurement_jacobian.T @ measurement_jacobian


def probability_of_cost(
    cost: Float[Array | np.ndarray, " pixel"], degrees_of_freedom: int | np.ndarray
) -> np.ndarray:
    """Probability that noise alone makes a minimum cost as large as this, or larger. [-]

    Parameters
    ----------
    cost
        Sum of squared whitened residuals at the minimum, chi-square distributed. [-]
    degrees_of_freedom
        Residuals minus unknowns, 1 or more. [-]
    """
    return scipy.special.gammaincc(np.asarray(degrees_of_freedom) / 2, np.asarray(cost) / 2)
