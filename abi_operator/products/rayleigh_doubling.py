"""Light in one layer of pure air, by doubling: what the tables of `rayleigh_table` hold.

Float64 NumPy, run once at set-up in half a second: the solver, which gives the same, would have to
be compiled for it first.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

_NUM_NODES = 32  # of the quadrature over a hemisphere
_NUM_DOUBLINGS = 30  # so that the first layer scatters once only, with a relative error of 1e-6


class AirLayer(NamedTuple):
    """Pure air over black ground, for every depth.

    Parameters
    ----------
    modes
        Reflection in modes 0, 1 and 2 over the mode's phase function; symmetric. [-]
    transmission
        Of a beam of each cosine, direct and diffuse, as a flux. [-]
    spherical_albedo
        Of the layer lit evenly from all sides. [-]
    """

    modes: Float[np.ndarray, "mode depth cosine cosine"]
    transmission: Float[np.ndarray, "depth cosine"]
    spherical_albedo: Float[np.ndarray, " depth"]


def air_layer(
    tau: Float[np.ndarray, " depth"], mu: Float[np.ndarray, " cosine"], beta2: float
) -> AirLayer:
    """Solve layers of these depths for light that comes and goes at these cosines.

    The cosines ride along as nodes of the quadrature without weight.

    Parameters
    ----------
    tau
        Rayleigh optical depths. [-]
    mu
        Cosines of the zenith angle, above 0. [-]
    beta2
        Coefficient of P_2 in the phase function. [-]

    References
    ----------
    .. [1] J. E. Hansen and L. D. Travis, "Light scattering in planetary atmospheres", Space Sci.
       Rev., 16, 527-610, 1974, doi:10.1007/BF00168069, section 3
    """
    nodes, weights = np.polynomial.legendre.leggauss(_NUM_NODES)
    cosines = np.concatenate([(nodes + 1) / 2, mu])
    weights = np.concatenate([weights / 2, np.zeros_like(mu)]) * 2 * cosines
    seen = slice(_NUM_NODES, None)
    sine = np.sqrt(1 - cosines**2)
    second = 1.5 * cosines**2 - 0.5
    # Coefficients of 1, 2 cos and 2 cos 2 of the azimuth by which light is turned; of light that
    # goes on downwards the middle one has the other sign.
    phases = (
        1 + beta2 * np.outer(second, second),
        -1.5 * beta2 * np.outer(cosines * sine, cosines * sine),
        0.375 * beta2 * np.outer(sine**2, sine**2),
    )
    solved = [
        _doubled(phase, parity, cosines, weights, tau)
        for phase, parity in zip(phases, (1, -1, 1), strict=True)
    ]
    modes = [
        reflection[:, seen, seen] / phase[seen, seen]
        for (reflection, _), phase in zip(solved, phases, strict=True)
    ]
    reflection, diffuse = solved[0]
    flux = np.exp(-tau[:, None] / cosines) + weights @ diffuse
    return AirLayer(np.stack(modes), flux[:, seen], weights @ reflection @ weights)


def _doubled(
    phase: np.ndarray, parity: int, cosines: np.ndarray, weights: np.ndarray, tau: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Reflection and diffuse transmission, ``depth out in``, of one azimuth mode."""
    thin = tau[:, None, None] / 2**_NUM_DOUBLINGS
    once = phase * thin / (4 * np.outer(cosines, cosines))
    reflection, diffuse = once, parity * once
    identity = np.eye(cosines.size)
    for _ in range(_NUM_DOUBLINGS):
        direct = np.exp(-thin / cosines)  # of what comes in; transposed, of what goes out
        leaving = np.swapaxes(direct, 1, 2)
        # Light between the halves: once up and down again, and any number of times.
        twice = reflection @ (weights[:, None] * reflection)
        many = np.linalg.solve(identity - twice * weights, twice)
        down = diffuse + many * direct + many @ (weights[:, None] * diffuse)
        up = reflection * direct + reflection @ (weights[:, None] * down)
        reflection = reflection + leaving * up + diffuse @ (weights[:, None] * up)
        diffuse = leaving * down + diffuse * direct + diffuse @ (weights[:, None] * down)
        thin = 2 * thin
    return reflection, diffuse
