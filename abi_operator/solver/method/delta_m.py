"""delta-M scaling of sharp forward peaks."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float


class ScaledLayers(NamedTuple):
    """Layers whose forward peak is counted as unscattered; see `delta_m`.

    `coalbedo` is 1 - ssa, formed directly; `scattering_ratio` is omega / (1 - omega f) of the
    unscaled albedo, by which the exact single scattering is weighted.
    """

    tau: Float[Array, "layer *batch"]
    ssa: Float[Array, "layer *batch"]
    coalbedo: Float[Array, "layer *batch"]
    moments: Float[Array, "layer moment *batch"]
    scattering_ratio: Float[Array, "layer *batch"]


def delta_m(
    tau: Float[Array, "layer *batch"],
    ssa: Float[Array, "layer *batch"],
    moments: Float[Array, "layer moment *batch"],
    num_streams: int,
) -> ScaledLayers:
    r"""Scale away the forward peak that `num_streams` streams cannot resolve.

    With f = chi_N and N = `num_streams`: :math:`\tau' = (1-\omega f)\tau`,
    :math:`\omega' = (1-f)\omega/(1-\omega f)`, :math:`\chi'_l = (\chi_l - f)/(1-f)` for l < N.
    Absorption, tau (1 - omega), is unchanged. At f = 1, where all scattered light goes straight on,
    the layer is what it is a rounding below: one that scatters next to nothing.

    Parameters
    ----------
    tau, ssa
        Extinction optical depth and single-scattering albedo of each layer. [-]
    moments, num_streams
        Legendre moments, chi_0 = 1, without the factor 2l + 1; at least N + 1 of them. [-]

    References
    ----------
    .. [1] W. J. Wiscombe, "The delta-M method", J. Atmos. Sci., 34, 1408-1422, 1977,
       doi:10.1175/1520-0469(1977)034<1408:TDMRYA>2.0.CO;2
    """
    f = moments[:, num_streams]
    # The quotients below have limits at f = 1. A difference keeps the slope in f.
    f = f - jnp.where(f < 1, 0, jnp.finfo(f.dtype).epsneg.astype(f.dtype))
    rest = 1 - ssa * f
    # A quotient takes as long as ten products.
    ratio, per_rest = 1 / (1 - f[:, None]), 1 / rest
    scaled = (moments[:, :num_streams] - f[:, None]) * ratio
    scattering_ratio = ssa * per_rest
    return ScaledLayers(
        rest * tau, (1 - f) * scattering_ratio, (1 - ssa) * per_rest, scaled, scattering_ratio
    )


def unscaled(
    tau: Float[Array, "layer *batch"],
    ssa: Float[Array, "layer *batch"],
    moments: Float[Array, "layer moment *batch"],
    num_streams: int,
) -> ScaledLayers:
    """The same layers with f = 0, for a calculation without delta-M."""
    return ScaledLayers(tau, ssa, 1 - ssa, moments[:, :num_streams], ssa)
