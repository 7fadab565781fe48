"""The azimuth modes of the multiple scattering, one stack each."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.kernels import one_kernel
from .absorption import absorbing_half_layer, of_layer
from .adding import Emission, Top, add_emitting_layer, add_layer, top
from .bordered import Bordered, Vector
from .delta_m import ScaledLayers
from .doublings import Doublings
from .ground import black
from .layer import ModeKernels, conservative, half_layer, layer_matrix, node_functions
from .legendre import associated_legendre


class Directions(eqx.Module):
    """The beams, and how each is attenuated.

    Parameters
    ----------
    cosines
        mu0, then mu of each view. [-]
    sun_secants
        1 / mu0 in every layer, or the slant path of a beam over a spherical Earth. [-]
    """

    cosines: Float[Array, "beam *batch"]
    sun_secants: Float[Array, "layer *batch"]

    def secants(self, sun: Float[Array, "*batch"]) -> Float[Array, "beam *batch"]:
        """Secants of all beams in a layer whose sun has this one."""
        return jnp.concatenate([sun[None], 1 / self.cosines[1:]])


class LegendreTables(NamedTuple):
    """Legendre functions of all modes, split by the parity of l + m (even builds A, odd B)."""

    nodes: tuple[Float[Array, "mode node degree"], Float[Array, "mode node degree"]]
    beams: tuple[Float[Array, "mode beam degree *batch"], Float[Array, "mode beam degree *batch"]]

    def kernels(self, m: int) -> tuple[ModeKernels, ModeKernels]:
        """Of one mode, for A and for B."""
        a, b = (mode_kernels(n[m], v[m]) for n, v in zip(self.nodes, self.beams, strict=True))
        return a, b


def mode_kernels(
    nodes: Float[Array, "node degree"], beams: Float[Array, "beam degree *batch"]
) -> ModeKernels:
    """Kernels of one mode and parity from its rows of the tables."""
    return ModeKernels(nodes[:, None, :] * nodes[None], nodes, beams)


def legendre_tables(
    num_streams: int, num_modes: int, cosines: Float[Array, "beam *batch"]
) -> LegendreTables:
    """Evaluate the functions of all modes at the nodes, and at the beams over their cosines."""
    at_nodes = node_functions(num_streams, num_modes)
    even, odd = (
        jnp.stack([jnp.asarray(at_nodes[m, d].T, cosines.dtype) for m, d in rows])
        for rows in _rows_of_parities(num_modes)
    )
    return LegendreTables((even, odd), _at_beams(num_streams, num_modes, cosines))


@partial(jax.custom_jvp, nondiff_argnums=(0, 1))
def _at_beams(num_streams: int, num_modes: int, cosines: Array) -> tuple[Array, ...]:
    """Functions of both parities over the cosines, with slopes beside the values in derivatives:
    backwards that is one sum, and no second loop over the degrees."""
    # A loop over degrees of which each kernel takes less than its start.
    return one_kernel(_over_cosines(num_streams, num_modes), 1, num_beams=len(cosines))(cosines)


@_at_beams.defjvp
def _(num_streams: int, num_modes: int, primals: Any, tangents: Any) -> Any:
    (cosines,), (change,) = primals, tangents

    def with_slopes(cosines: Array) -> tuple[Any, Any]:
        of = _over_cosines(num_streams, num_modes)
        return jax.jvp(of, (cosines,), (jnp.ones_like(cosines),))

    found, slopes = one_kernel(with_slopes, 1, num_beams=len(cosines))(cosines)
    return found, tuple(x * change[None, :, None] for x in slopes)


def _over_cosines(num_streams: int, num_modes: int) -> Callable[[Array], tuple[Array, ...]]:
    def at(cosines: Array) -> tuple[Array, ...]:
        found = associated_legendre(num_modes, num_streams, cosines) / cosines
        return tuple(
            jnp.swapaxes(jnp.stack([found[m, d] for m, d in rows]), 1, 2)
            for rows in _rows_of_parities(num_modes)
        )

    return at


def _rows_of_parities(num_modes: int) -> list[list[tuple[int, slice]]]:
    """Of each mode, the degrees of even l + m, then those of odd."""
    return [[(m, slice((m + p) % 2, None, 2)) for m in range(num_modes)] for p in (0, 1)]


def weighted_moments(layers: ScaledLayers) -> Float[Array, "parity layer degree *batch"]:
    r""":math:`\omega(2l+1)\chi_l` of even and of odd degrees."""
    num_degrees = layers.moments.shape[1]
    degree = 2 * jnp.arange(num_degrees, dtype=layers.tau.dtype) + 1
    weight = degree.reshape(-1, *(1,) * (layers.tau.ndim - 1)) * layers.ssa[:, None]
    moments = weight * layers.moments
    return jnp.stack([moments[:, 0::2], moments[:, 1::2]])


def emitting_mean(
    layers: ScaledLayers,
    tables: LegendreTables,
    directions: Directions,
    ground: Bordered,
    emission: Emission,
    one: Vector,
    planck_jumps: Float[Array, "layer *batch"] | None,
    *,
    doublings: Doublings,
    single_scattering: bool,
) -> tuple[Top, Emission]:
    """Mode 0, the only one in which energy is kept, with light that ground and layers emit or lose.

    Parameters
    ----------
    layers, tables, directions
        Scaled layers, top first, with as many moments as streams; Legendre functions; beams.
    ground
        Its admittance in mode 0.
    doublings, single_scattering
        See `higher_modes`.
    emission, one
        Light of the ground (`adding.emitting_ground`); the vector of isotropic light.
    planck_jumps
        Increase of the Planck function from top to bottom of each layer; None for cold air.
    """

    def add(carry, x, kernels, directions, one):
        (stack, emission), (layer, planck_jump) = carry, x
        a, b_inverse, ones = _mean_of_layer(layer, kernels, directions, single_scattering)
        tau, doublings = layer[0], layer[-1]
        driven = b_inverse @ one
        if emission.absorbed is None:
            half = half_layer(a, b_inverse, tau, doublings)
            return add_emitting_layer(stack, emission, *half, tau, planck_jump, driven, None)
        emits = None if planck_jump is None else one
        half = absorbing_half_layer(a, b_inverse, tau, doublings, ones, emits)
        return add_emitting_layer(stack, emission, *half[:2], tau, planck_jump, driven, half[2])

    xs = (_properties_of_the_mean(layers, directions, doublings), planck_jumps)
    shared = tables.kernels(0), directions, one
    stack, emission = _scan_upwards(add, (ground, emission), xs, *shared)
    return top(stack), emission


def _scan_upwards(add: Callable, stack: Any, layers: Any, kernels: Any, *shared: Any) -> Any:
    """Add the layers from the ground up, each as one kernel.

    Reverse mode keeps the stack between layers and computes each layer again: a quarter of the
    time of writing down all that happens in it, and a fraction of the memory.
    """
    num_nodes, num_beams = len(kernels[0].nodes), len(kernels[0].beams)
    add = one_kernel(add, num_nodes, num_beams=num_beams)

    def step(stack, layer):
        return add(stack, layer, kernels, *shared), None

    return jax.lax.scan(jax.checkpoint(step), stack, layers, reverse=True)[0]


def _properties_of_the_mean(
    layers: ScaledLayers, directions: Directions, doublings: Doublings
) -> tuple[Any, ...]:
    moments = weighted_moments(layers)
    return (layers.tau, layers.coalbedo, directions.sun_secants, *moments, doublings)


def _mean_of_layer(
    layer, kernels, directions, single_scattering
) -> tuple[Bordered, Bordered, Vector]:
    """A, the inverse of B, and A 1."""
    _, coalbedo, sun, moments_a, moments_b, _ = layer
    secants = directions.secants(sun)
    a = layer_matrix(kernels[0], moments_a, secants, single_scattering)
    a = conservative(a, coalbedo)
    b_inverse = layer_matrix(kernels[1], moments_b, secants, single_scattering).inverse()
    return a, b_inverse, of_layer(coalbedo, secants, kernels[0])


def higher_modes(
    layers: ScaledLayers,
    tables: LegendreTables,
    directions: Directions,
    grounds: Bordered | None,
    relative_azimuth: Float[Array, "view *batch"],
    *,
    doublings: Doublings,
    single_scattering: bool,
) -> Float[Array, "view *batch"]:
    r"""Sum over the modes m > 0 of :math:`(-1)^m \cos(m\,\Delta\phi)` times twice their reflection.

    Parameters
    ----------
    layers, tables, directions
        See `emitting_mean`.
    grounds
        Admittances of the ground, modes 1, 2, ... on the first axis of every leaf; None for a
        Lambertian ground, which these modes do not see.
    relative_azimuth
        Of each view, 0 in backscatter. [rad]
    doublings
        Of each layer.
    single_scattering
        Whether the modes contain the light scattered once in a layer and nowhere else.
    """
    moments = weighted_moments(layers)
    dtype, num_streams = relative_azimuth.dtype, layers.moments.shape[1]

    def add(stack, layer, kernels, directions):
        tau, sun, moments_a, moments_b, doublings = layer
        secants = directions.secants(sun)
        a = layer_matrix(kernels[0], moments_a, secants, single_scattering)
        b_inverse = layer_matrix(kernels[1], moments_b, secants, single_scattering).inverse()
        admittance, impedance = half_layer(a, b_inverse, tau, doublings)
        return add_layer(stack, admittance, impedance, tau)

    def step(total, x):
        m, ground, nodes, beams = x
        if ground is None:
            ground = black(directions.cosines, num_streams)
        kernels = tuple(mode_kernels(n, v) for n, v in zip(nodes, beams, strict=True))
        parities = moments[m % 2], moments[1 - m % 2]
        xs = (layers.tau, directions.sun_secants, *parities, doublings)
        stack = _scan_upwards(add, ground, xs, kernels, directions)
        sign = jnp.where(m % 2 == 0, 2, -2).astype(dtype)
        angle = m.astype(dtype) * relative_azimuth
        return total + sign * jnp.cos(angle) * top(stack).reflection(), None

    num_modes = tables.nodes[0].shape[0]
    orders = jnp.arange(1, num_modes)
    later = jax.tree.map(lambda table: table[1:], (tables.nodes, tables.beams))
    total, _ = jax.lax.scan(step, jnp.zeros_like(relative_azimuth), (orders, grounds, *later))
    return total
