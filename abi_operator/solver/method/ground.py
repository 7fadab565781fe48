"""The ground under the stack: its admittance and what it emits."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from .bordered import Bordered, Vector
from .quadrature import half_range, node_scales
from .surface import AnySurface


class Grounds(NamedTuple):
    """The ground in all azimuth modes.

    Parameters
    ----------
    mean
        Admittance in mode 0.
    others
        In modes 1, 2, ... on the first axis of every leaf; None is black.
    absorbed
        What a Lambertian one absorbs of isotropic light (`absorbed_by_lambertian`); None of others.
    """

    mean: Bordered
    others: Bordered | None = None
    absorbed: Float[Array, "*batch"] | None = None


def isotropic(num_streams: int, beams: Float[Array, "beam *batch"]) -> Vector:
    r"""Radiance 1 in all directions: :math:`\sqrt{w\mu}` at the nodes, 1 at the beams."""
    scales = node_scales(num_streams)
    nodes = jnp.asarray(scales, beams.dtype).reshape(-1, *(1,) * (beams.ndim - 1))
    return Vector(jnp.broadcast_to(nodes, (scales.size, *beams.shape[1:])), jnp.ones_like(beams))


def _identity(num_nodes: int, like: Float[Array, "*batch"]) -> Float[Array, "node node *#batch"]:
    return jnp.eye(num_nodes, dtype=like.dtype).reshape(num_nodes, num_nodes, *(1,) * like.ndim)


def lambertian(
    albedo: Float[Array, "*batch"], beams: Float[Array, "beam *batch"], num_streams: int
) -> Bordered:
    r"""Admittance of a Lambertian ground in azimuth mode 0; that of every other has albedo 0.

    The reflection is R = 2a v r^T with v = 1 on nodes and views and r = (w mu, 1, 0), so that
    :math:`Y = 1 - 4a/(1+a)\, rr^T` in the symmetric scaling, r = `isotropic`: regular at albedo 1.
    """
    r = isotropic(num_streams, beams)
    factor = 4 * albedo / (1 + albedo)
    core = _identity(r.nodes.shape[0], albedo) - factor * r.nodes[:, None] * r.nodes[None]
    border = -factor * r.nodes[:, None] * r.beams[None]
    return Bordered(core, border, r.beams, -factor * r.beams[1:])


def absorbed_by_lambertian(albedo: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    r"""Y 1 of `lambertian` over 1: what is absorbed of isotropic light, :math:`(1-a)/(1+a)`."""
    return (1 - albedo) / (1 + albedo)


def black(beams: Float[Array, "beam *batch"], num_streams: int) -> Bordered:
    """Admittance 1: no reflection, as a Lambertian ground has in the modes m > 0."""
    return lambertian(jnp.zeros_like(beams[0]), beams, num_streams)


def reflecting(
    surface: AnySurface,
    m: Int[Array, ""] | int,
    beams: Float[Array, "beam *batch"],
    num_streams: int,
) -> Bordered:
    r"""Admittance :math:`2(1+R)^{-1} - 1` of any reciprocal ground in azimuth mode m.

    R_ij = 2 r_i r_j rho_m (-1)^m with r = `isotropic`. Its sun -> view entry is 0: light that the
    ground alone sends from the sun to a view is added exactly, by what air lets pass
    (`single_scatter.direct_transmission`).
    """
    r = isotropic(num_streams, beams)
    nodes = jnp.asarray(half_range(num_streams)[0], beams.dtype)
    nodes = jnp.broadcast_to(nodes.reshape(-1, *(1,) * (beams.ndim - 1)), r.nodes.shape)
    sign = jnp.where(jnp.asarray(m) % 2 == 0, 1, -1).astype(beams.dtype)
    among_nodes = sign * surface.modes(m, nodes[:, None], nodes[None])
    with_beams = sign * surface.modes(m, nodes[:, None], beams[None])
    one_plus = Bordered(
        _identity(nodes.shape[0], beams[0]) + 2 * among_nodes * r.nodes[:, None] * r.nodes[None],
        2 * with_beams * r.nodes[:, None],
        jnp.ones_like(beams),
        jnp.zeros_like(beams[1:]),
    )
    inverse = one_plus.inverse()
    return Bordered(
        2 * inverse.core - _identity(nodes.shape[0], beams[0]),
        2 * inverse.border,
        inverse.diagonal,
        2 * inverse.corner,
    )
