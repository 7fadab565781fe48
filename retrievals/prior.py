"""What is known before the measurement."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


class Prior(eqx.Module):
    r"""A normal distribution of x (Rodgers 2000 [1]_), one for all pixels or one for each.

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

    x_prior: Float[Array | np.ndarray, "*pixel x"]
    S_prior: Float[Array | np.ndarray, "*pixel x x"]

    @property
    def root(self) -> Float[Array, "x x"]:
        r"""Cholesky factor L of one pixel's covariance, :math:`S_a = L L^T`. [-]"""
        return jnp.linalg.cholesky(self.S_prior)

    def residual(self, x: Float[Array, " x"]) -> Float[Array, " x"]:
        r"""Whitened departure :math:`L^{-1}(x - x_a)` of one pixel. [-]"""
        departure = x - jnp.asarray(self.x_prior)
        return jax.scipy.linalg.solve_triangular(self.root, departure, lower=True)

    def of_pixels(self, num_pixels: int, names: tuple[str, ...]) -> "Prior":
        """The same with one distribution for each pixel, checked.

        Parameters
        ----------
        num_pixels
            How many there are.
        names
            Of the elements of x.

        Raises
        ------
        ValueError
            Where a shape does not fit, or a covariance is not one. Means that are not finite are
            left to the pixels that they belong to; a pixel whose covariance is not finite has a
            mean of NaN instead, too.
        """
        mean, covariance = np.asarray(self.x_prior), np.asarray(self.S_prior)
        size = len(names)
        elements = f"{size} element{'s' if size > 1 else ''} ({', '.join(names)})"
        for label, array, own in (
            ("x_prior", mean, (size,)),
            ("S_prior", covariance, (size, size)),
        ):
            if array.shape not in (own, (num_pixels, *own)):
                raise ValueError(
                    f"{label} has the shape {array.shape}; a state vector of {elements} needs "
                    f"{own}, or {(num_pixels, *own)} for a prior of each pixel."
                )
        if covariance.ndim == 3:
            unknown = np.asarray(~np.isfinite(covariance).all(axis=(1, 2)))
            covariance = np.where(unknown[:, None, None], np.eye(size), covariance)
            mean = np.where(unknown[:, None], np.nan, mean)
        elif not np.isfinite(covariance).all():
            raise ValueError("S_prior of all pixels is not finite; a covariance is.")
        asymmetry = np.abs(covariance - np.swapaxes(covariance, -1, -2))
        if not np.all(asymmetry <= 1e-6 * np.abs(covariance).max()):
            raise ValueError("S_prior is not symmetric; a covariance is.")
        smallest = np.linalg.eigvalsh(covariance).min()
        if not smallest > 0:
            raise ValueError(
                f"S_prior has an eigenvalue of {smallest:.3g}; those of a covariance of {elements} "
                "are above 0."
            )
        return Prior(
            np.broadcast_to(mean, (num_pixels, size)),
            np.broadcast_to(covariance, (num_pixels, size, size)),
        )
