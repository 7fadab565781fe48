r"""Liquid water in the ABI bands: refractive index, and asymmetry factor of its droplets."""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..bands import AnyName, names_of, one_of

# n - ik of liquid water at the centroids of GOES-16. [-] (D. J. Segelstein, "The complex refractive
# index of water", M.S. thesis, University of Missouri-Kansas City, 1981; n interpolated linearly, k
# log-log, from the tables of refractiveindex.info, CC0)
REFRACTIVE_INDEX: dict[str, complex] = {
    "C01": 1.3419 - 7.228e-10j,
    "green": 1.3356 - 2.674e-9j,
    "C02": 1.3312 - 1.569e-8j,
    "C03": 1.3244 - 3.527e-7j,
    "C04": 1.3145 - 6.239e-5j,
    "C05": 1.3094 - 8.859e-5j,
    "C06": 1.2825 - 3.635e-4j,
    "C07": 1.3406 - 3.769e-3j,
}

# Asymmetry factor of gamma distributions (nu = 7) of spheres with this refractive index, against
# effective radius. [um], [-] (Mie theory, miepython 3.3, 40000 diameters in 0.05-500 um equidistant
# in their logarithm, by benchmarks/make_water_tables.py; 2 and 50 um are there so that zero end
# slopes cost nothing in 2.5-40 um)
EFFECTIVE_RADIUS_UM = (2, 2.5, 3, 3.5, 4, 4.5, 5, 6, 7, 8, 10, 12, 15, 20, 30, 40, 50)
# fmt: off
ASYMMETRY: dict[str, tuple[float, ...]] = {
    "C01": (
        0.81724, 0.82779, 0.83471, 0.83989, 0.84395, 0.84724, 0.84995, 0.85418, 0.85734,
        0.85980, 0.86339, 0.86590, 0.86853, 0.87132, 0.87428, 0.87586, 0.87684,
    ),
    "green": (
        0.80853, 0.82245, 0.83073, 0.83657, 0.84110, 0.84477, 0.84781, 0.85257, 0.85613,
        0.85891, 0.86298, 0.86583, 0.86882, 0.87198, 0.87537, 0.87718, 0.87831,
    ),
    "C02": (
        0.79777, 0.81553, 0.82595, 0.83278, 0.83784, 0.84188, 0.84522, 0.85047, 0.85441,
        0.85749, 0.86202, 0.86519, 0.86851, 0.87203, 0.87583, 0.87787, 0.87914,
    ),
    "C03": (
        0.77246, 0.79215, 0.80861, 0.81987, 0.82754, 0.83307, 0.83736, 0.84384, 0.84869,
        0.85249, 0.85811, 0.86207, 0.86624, 0.87069, 0.87551, 0.87812, 0.87978,
    ),
    "C04": (
        0.80315, 0.77875, 0.77538, 0.78433, 0.79614, 0.80694, 0.81582, 0.82845, 0.83657,
        0.84228, 0.85028, 0.85594, 0.86203, 0.86871, 0.87632, 0.88078, 0.88387,
    ),
    "C05": (
        0.82836, 0.80094, 0.78240, 0.77879, 0.78480, 0.79420, 0.80373, 0.81934, 0.83008,
        0.83747, 0.84702, 0.85339, 0.86019, 0.86770, 0.87631, 0.88139, 0.88491,
    ),
    "C06": (
        0.86362, 0.86179, 0.84976, 0.83323, 0.81745, 0.80633, 0.80119, 0.80425, 0.81468,
        0.82566, 0.84278, 0.85367, 0.86362, 0.87370, 0.88565, 0.89309, 0.89848,
    ),
    "C07": (
        0.79407, 0.81948, 0.82874, 0.82834, 0.82176, 0.81151, 0.79983, 0.78018, 0.77301,
        0.77772, 0.80106, 0.82329, 0.84607, 0.86775, 0.89256, 0.90864, 0.92025,
    ),
}
# fmt: on


def droplet_asymmetry(effective_radius_um: Float[Array, "*n"], band: AnyName) -> Float[Array, "*n"]:
    """Asymmetry factor of cloud droplets, constant below 2 and above 50 um. [-]

    Between the radii of the table it is a cubic in the logarithm of radius, with a slope that is
    continuous everywhere and zero at both ends.

    Parameters
    ----------
    effective_radius_um
        Effective radius, above 0. [um]
    band
        Name of the band.
    """
    return interpolate(effective_radius_um, EFFECTIVE_RADIUS_UM, ASYMMETRY, band)


def interpolate(
    x: Float[Array, "*n"],
    nodes: tuple[float | int, ...],
    values: Mapping[str, tuple[float, ...]],
    band: AnyName,
) -> Float[Array, "*n"]:
    """Value of a table in the logarithm of `x`: cubics, constant beyond both ends.

    The slope is continuous everywhere, and zero at both ends.

    Parameters
    ----------
    x
        Where the table is read, above 0.
    nodes, values
        The table of each band; nodes rise.
    band
        Name of the band.
    """
    dtype = x.dtype
    log_nodes = np.log(nodes)
    tables = [_hermite_cubics(log_nodes, np.asarray(values[name])) for name in names_of(band)]
    cubics = jnp.asarray(np.concatenate(tables), dtype)
    knots = jnp.asarray(log_nodes, dtype)
    # Not `jnp.clip`, which would be a kernel of its own within a fence.
    log_x = jax.lax.clamp(knots[0], jnp.log(x), knots[-1])
    interval = jnp.sum(log_x[..., None] >= knots[1:-1], axis=-1, dtype=jnp.int32)
    t = log_x - knots[interval]
    place = one_of(band).place
    row = interval if place is None else interval + place * len(tables[0])
    c0, c1, c2, c3 = jnp.moveaxis(cubics[row], -1, 0)
    return c0 + t * (c1 + t * (c2 + t * c3))


def _hermite_cubics(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Coefficients (interval, power) of cubics in x - x[i]: parabolic slopes, 0 at both ends."""
    width = np.diff(x)
    secant = np.diff(y) / width
    slope = np.zeros_like(y)
    slope[1:-1] = (width[1:] * secant[:-1] + width[:-1] * secant[1:]) / (width[1:] + width[:-1])
    left, right = slope[:-1], slope[1:]
    quadratic = (3 * secant - 2 * left - right) / width
    cubic = (left + right - 2 * secant) / width**2
    return np.stack([y[:-1], left, quadratic, cubic], axis=1)
