r"""Columns whose layers scatter so little that the ground is seen through them nearly as it is.

A clear sky at 1.6 um scatters a thousandth of the light that crosses it. What is scattered once
towards the view is added exactly to every column; what is left of the ground's light is then, to
first order in the scattering,

.. math::
   a\,e^{-\sum_i (s_{0,i} + s)\,\tau_i (1 - \omega_i + \beta_i)}
   \left(1 + a \cdot 2\,\textstyle\sum_i \beta_i\tau_i\, e^{-D\sum_i(1-\omega_i)\tau_i}\right),
   \qquad \beta_i = \tfrac12\omega_i(1 - g_i),

with the albedo a, the secants s of the sun and the view, and the share beta of what is
scattered that goes back; the other half of it goes on as if nothing had been there, to and from the
ground. D is the mean secant of diffuse light. No layer is doubled or added. How large the terms are
that this treats in the mean, and how large what it leaves out, is known beforehand: where that is
within the budget (`budget.OF_FAINT`) a column has this light instead of a sum over modes
(`gradient.mode_sum`, `gradient.emission`), and a tile of such columns is not solved. Derivatives
are always those of the sum.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from . import budget
from .budget import Expected, Faint
from .depths import Depths
from .heat import Unscattered

_DIFFUSE = 1.66  # mean secant of diffuse light: W. M. Elsasser, 1942, Harvard Meteorol. Stud. 6


def of_sunlight(
    layers: Depths,
    albedo: Float[Array, "*batch"],
    mu: Float[Array, "view *batch"],
    sun_secant: Float[Array, "*batch"],
    aside: Float[Array, "*batch"],
) -> Faint:
    """Twice the reflectance by the ground, as the sum over modes has it.

    Parameters
    ----------
    layers, albedo
        Of the air and the ground.
    mu, sun_secant
        Cosines of the views' zenith angles, and secant of the sun's beam at the top. [-]
    aside
        A generous estimate of what is scattered twice (`budget.expected`). [-]
    """
    seen = albedo * jnp.exp(-layers.slant_back - _lost(layers) / mu)
    shed = layers.backward * (0.5 * (sun_secant + 1 / mu) + albedo)
    missing = jnp.max(seen * shed, axis=0) + aside
    return Faint(2 * seen * (1 + albedo * _back_to_ground(layers)), missing)


def _lost(layers: Depths) -> Float[Array, "*batch"]:
    """What a beam loses straight down, for what is scattered forwards goes on. [-]"""
    return layers.absorbed + 0.5 * layers.backward


def _back_to_ground(layers: Depths) -> Float[Array, "*batch"]:
    """Share of isotropic light on the ground that the air sends back to it. [-]"""
    return layers.backward * jnp.exp(-_DIFFUSE * layers.absorbed)


def of_heat(
    layers: Depths,
    albedo: Float[Array, "*batch"],
    secant: Float[Array, "*batch"],
    planck: Float[Array, "level *batch"],
    air: Unscattered,
    from_ground: Float[Array, "*batch"],
) -> Faint:
    """Thermal light towards the only view, without that of the top level, as the sum has it.

    Parameters
    ----------
    layers, albedo
        Of the air and the ground.
    secant
        Of the view. [-]
    planck
        Planck function at the levels. [radiance unit]
    air
        Light of layers that emit as much as beams lose in them.
    from_ground
        What the ground emits. [radiance unit]
    """
    ground = from_ground + albedo * air.down
    seen = jnp.exp(-secant * _lost(layers)) * ground * (1 + albedo * _back_to_ground(layers))
    missing = layers.backward * (secant + albedo) * (ground + jnp.max(planck, axis=0))
    return Faint(air.up + seen - planck[0], missing)


def unless_faint(
    known: Expected, error_budget: float, solved: Callable[[], Float[Array, "*view batch"]]
) -> Float[Array, "*view batch"]:
    """What is `solved`, but where no more than the budget allows is missing of faint light.

    Nothing is solved where all columns are so.
    """
    faint = known.faint
    if faint is None:
        return solved()
    enough = faint.missing <= budget.OF_FAINT * error_budget * known.least
    return jax.lax.cond(
        jnp.all(enough), lambda: faint.light, lambda: jnp.where(enough, faint.light, solved())
    )
