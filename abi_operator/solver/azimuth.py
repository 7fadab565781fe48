"""The azimuth modes of the multiple scattering, one stack each."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .adding import add_layer, reflection_corner
from .bordered import Bordered
from .delta_m import ScaledLayers
from .ground import lambertian
from .layer import ModeKernels, conservative, half_layer, layer_matrix, node_functions
from .legendre import associated_legendre


def multiple_scattering(
    layers: ScaledLayers,
    albedo: Float[Array, "*batch"],
    mu0: Float[Array, "*batch"],
    mu: Float[Array, "*batch"],
    relative_azimuth: Float[Array, "*batch"],
    *,
    num_modes: int,
    num_doublings: int,
    single_scattering: bool,
) -> Float[Array, "*batch"]:
    r"""Bidirectional reflectance factor of the layers over a Lambertian ground.

    .. math:: \sum_m \frac{2-\delta_{m0}}{2\mu_0}(-1)^m \cos(m\,\Delta\phi)\, R_m

    with :math:`\Delta\phi` = `relative_azimuth`, 0 in backscatter, and R_m the sun -> view entry of
    the reflection in mode m.

    Parameters
    ----------
    layers
        Scaled layers, top first, with as many moments as streams.
    albedo, mu0, mu, relative_azimuth
        Ground and directions. [-], [-], [-], [rad]
    num_modes, num_doublings
        Azimuth modes to sum; doublings of each layer.
    single_scattering
        Whether the modes contain the light scattered once in a layer and nowhere else.
    """
    dtype = mu0.dtype
    num_streams = layers.moments.shape[1]
    secants = jnp.stack([1 / mu0, 1 / mu])
    degree = 2 * jnp.arange(num_streams, dtype=dtype) + 1
    weight = degree.reshape(-1, *(1,) * mu0.ndim) * layers.ssa[:, None]
    moments = weight * layers.moments
    by_degree_parity = jnp.stack([moments[:, 0::2], moments[:, 1::2]])

    nodes = node_functions(num_streams, num_modes)
    borders = associated_legendre(num_modes, num_streams, jnp.stack([mu0, mu]))
    functions = []
    for parity in (0, 1):
        # Entry m of these holds the degrees with l + m even (parity 0) or odd.
        node = jnp.stack(
            [jnp.asarray(nodes[m, (m + parity) % 2 :: 2].T, dtype) for m in range(num_modes)]
        )
        border = jnp.stack([borders[m, (m + parity) % 2 :: 2] for m in range(num_modes)])
        functions.append((node, jnp.swapaxes(border, 1, 2)))

    def mode_reflection(m, kernels_a, kernels_b):
        moments_a, moments_b = by_degree_parity[m % 2], by_degree_parity[1 - m % 2]
        first = m == 0
        ground = lambertian(jnp.where(first, albedo, 0), mu0, mu, num_streams)

        def add(stack: Bordered, layer):
            tau, coalbedo, chi_a, chi_b = layer
            a = layer_matrix(kernels_a, chi_a, secants, single_scattering)
            b = layer_matrix(kernels_b, chi_b, secants, single_scattering)
            exact = conservative(a, coalbedo)
            a = jax.tree.map(lambda x, y: jnp.where(first, x, y), exact, a)
            admittance, impedance = half_layer(a, b, tau, num_doublings)
            return add_layer(stack, admittance, impedance, tau), None

        xs = (layers.tau, layers.coalbedo, moments_a, moments_b)
        stack, _ = jax.lax.scan(add, ground, xs, reverse=True)
        return reflection_corner(stack, mu)

    def kernels(function):
        node, border = function
        return ModeKernels(node[:, None, :] * node[None], node, border)

    def step(total, x):
        m, function_a, function_b = x
        reflection = mode_reflection(m, kernels(function_a), kernels(function_b))
        sign = jnp.where(m % 2 == 0, 1, -1).astype(dtype)
        factor = jnp.where(m == 0, 1, 2).astype(dtype) * sign
        angle = m.astype(dtype) * relative_azimuth
        return total + factor * jnp.cos(angle) * reflection / (2 * mu0), None

    total, _ = jax.lax.scan(step, jnp.zeros_like(mu0), (jnp.arange(num_modes), *functions))
    return total
