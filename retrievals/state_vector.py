r"""From numbers without bounds to the smoke that they stand for, and what is known beforehand.

The retrieval's unknowns are a vector x that may take any real value, so that the minimisation
needs no constraints:

.. math::
   \tau_{550} = \frac{\tau_\mathrm{limit}}{1 + e^{-x_0}}, \qquad
   \frac{1 - \omega_b}{\omega_b} = e^{-x_1}\,\frac{1 - \omega_b^0}{\omega_b^0} .

x_0 is the logarithm of the optical depth (plus a constant) as long as that is small beside
`aod_limit`, and never lets an iterate exceed the optical depth for which the solver was prepared.
x_1, if retrieved, shifts the logit of the single-scattering albedo by the same amount in every band
b: the ratio of absorption to scattering changes by one factor, its spectrum stays.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from abi_operator import Plume


class StateVector(eqx.Module):
    """Meaning of x. It is 0-based: x[0] is optical depth, x[1] single-scattering albedo.

    Parameters
    ----------
    retrieve_ssa
        Whether x has its second element.
    aod_limit
        Upper limit of the optical depth at 550 nm, which x only reaches at infinity. [-]
    """

    retrieve_ssa: bool = eqx.field(static=True, default=False)
    aod_limit: float = eqx.field(static=True, default=10.0)

    def __check_init__(self) -> None:
        if not self.aod_limit > 0:
            raise ValueError(f"aod_limit must be positive; got {self.aod_limit}.")

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return 2 if self.retrieve_ssa else 1

    def x(
        self, aod_550: Float[ArrayLike, "*batch"], ssa_shift: Float[ArrayLike, "*batch"] = 0.0
    ) -> Float[Array, "*batch x"]:
        """State vector of an optical depth below `aod_limit` [-] and a shift of the ssa [-]."""
        share = jnp.asarray(aod_550, float) / self.aod_limit
        logit = jnp.log(share) - jnp.log1p(-share)
        if not self.retrieve_ssa:
            return logit[..., None]
        shift = jnp.asarray(ssa_shift, logit.dtype)
        return jnp.stack(jnp.broadcast_arrays(logit, shift), axis=-1)

    def aod_550(self, x: Float[Array, "*batch x"]) -> Float[Array, "*batch"]:
        """Optical depth at 550 nm. [-]"""
        return self.aod_limit * jax.nn.sigmoid(x[..., 0])

    def aod_550_slope(self, x: Float[Array, "*batch x"]) -> Float[Array, "*batch"]:
        """Derivative of `aod_550` in x[0], for the propagation of errors. [-]"""
        return self.aod_limit * jax.nn.sigmoid(x[..., 0]) * jax.nn.sigmoid(-x[..., 0])

    def ssa(
        self, x: Float[Array, "*batch x"], reference: Float[Array, "*batch"]
    ) -> Float[Array, "*batch"]:
        """Single-scattering albedo of a band in which it is `reference` at x[1] = 0. [-]"""
        if not self.retrieve_ssa:
            return reference
        scattering = reference * jax.nn.sigmoid(x[..., 1])
        absorption = (1 - reference) * jax.nn.sigmoid(-x[..., 1])
        return scattering / (scattering + absorption)

    def ssa_slope(
        self, x: Float[Array, "*batch x"], reference: Float[Array, "*batch"]
    ) -> Float[Array, "*batch"]:
        """Derivative of `ssa` in x[1]. [-]"""
        ssa = self.ssa(x, reference)
        return ssa * (1 - ssa)

    def plume(self, x: Float[Array, "*batch x"], plume: Plume) -> Plume:
        """Put x into a plume, of which edges, spectrum and asymmetry are kept."""
        extinction = self.aod_550(x) / (plume.top - plume.base)
        ssa = {band: self.ssa(x, reference) for band, reference in plume.ssa.items()}
        return eqx.tree_at(
            lambda p: (p.extinction_550, p.brightness, p.ssa),
            plume,
            (extinction, jnp.ones_like(extinction), ssa),
        )


class Prior(eqx.Module):
    r"""What is known of x before the measurement, a normal distribution (Rodgers 2000 [1]_).

    Parameters
    ----------
    x_prior
        Its mean; `StateVector.x` makes one of physical quantities. [-]
    S_prior
        Its covariance. [-]

    References
    ----------
    .. [1] C. D. Rodgers, "Inverse Methods for Atmospheric Sounding", World Scientific, 2000,
       doi:10.1142/3171
    """

    x_prior: Float[Array, " x"]
    S_prior: Float[Array, "x x"]

    def residual(self, x: Float[Array, " x"]) -> Float[Array, " x"]:
        r"""Whitened departure :math:`L^{-1}(x - x_a)` with :math:`S_a = L L^T`. [-]"""
        factor = jnp.linalg.cholesky(self.S_prior)
        return jax.scipy.linalg.solve_triangular(factor, x - self.x_prior, lower=True)
