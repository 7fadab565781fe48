r"""Columns whose layers scatter so little that the ground is seen through them nearly as it is.

A clear sky at 1.6 um scatters a thousandth of the light that crosses it. What is scattered once
towards the view is added exactly to every column; what is left of the ground's light is then, to
first order in the scattering,

.. math::
   a\,e^{-s_0(A + B(\mu_0)) - s(A + B(\mu))}
   \left(1 + \sum_{s_0, s} s\,\frac{F(\mu)}{S}
   \sum\omega\tau\left[(s - D)t + \tfrac12(s - D)^2t^2\right] + a b\,e^{-DA}\right),

with the albedo a, the secants of the sun and the view, the depths S that scatters and A that
absorbs, of which t is below the middle of a layer. Of light along :math:`\mu` the part F is
scattered into the half of all directions that it came along, and the part B = S - F into the other;
b is that of isotropic light:

.. math::
   F(\mu) = \tfrac12\sum_l (2l+1)\,h_l\,P_l(\mu)\sum\omega\tau\chi_l, \qquad
   b = 2S - \sum_l (2l+1)\,h_l^2\sum\omega\tau\chi_l, \qquad h_l = \int_0^1 P_l\,d\mu.

It goes on along a mean secant D, to and from the ground. A sun through a sphere is attenuated by
its secants and scattered by 1 / mu0, so that more of its light reaches the ground than that, by
:math:`F(\mu_0)(1/\mu_0 - s_0)`, to first order. No layer is doubled or added. How much this may
miss is known beforehand: of the ground's light the square of what is sent back, and a share of what
is scattered where light absorbs; and of the air's what is scattered twice,

.. math:: \frac{1}{4\mu_0\mu}\sum_l(2l+1)\left(\sum\omega\tau\chi_l\right)^2,

where most of it goes. Where that is within the budget (`budget.OF_FAINT`) a column has this light
instead of a sum over modes, and is not solved (`solver.glimpse`). Derivatives are always those of
the sum. `benchmarks/fit_faint.py` has what this misses beside that estimate.
"""

from collections.abc import Sequence
from functools import cache

import jax.numpy as jnp
from jaxtyping import Array, Float
from numpy.polynomial import Legendre

from ...machine.algebra import total
from .budget import Faint
from .depths import DIFFUSE, Depths
from .one_pass import Scattered

_SCATTERED = 2.4  # mean secant of light that thin air sends on to all sides alike
_UNSURE = 0.6  # share of what absorbs along it that is not known better
_OPAQUE = 1e6  # depth below what scatters, or half its square, of which nothing is seen
_TWICE = 2.0  # what is scattered twice and more, over what thin layers send to one another


def of_sunlight(
    layers: Depths,
    scattered: Scattered,
    albedo: Float[Array, "*batch"],
    mu0: Float[Array, "*batch"],
    mu: Float[Array, "view *batch"],
) -> Faint:
    """Twice the reflectance by the ground, as the sum over modes has it.

    Parameters
    ----------
    layers, scattered, albedo
        Of the air and the ground.
    mu0, mu
        Cosines of the zenith angles of the sun and the views. [-]
    """
    depth = scattered.moments[0]
    some = jnp.maximum(depth, jnp.finfo(depth.dtype).tiny)
    absorbed, sun_secant = layers.absorbed, scattered.slant / some  # where it is scattered
    forward = [_forward(scattered.moments, x) for x in (mu0[None], mu)]
    secants = sun_secant[None], 1 / mu
    back = [s * (depth - f) for s, f in zip(secants, forward, strict=True)]
    on = [s * f for s, f in zip(secants, forward, strict=True)]
    again = albedo * _back_to_ground(scattered.moments)
    to_ground = jnp.exp(scattered.slant - layers.slant - back[0])
    to_view = jnp.exp(-absorbed / mu - back[1])
    seen = albedo * to_ground * to_view
    longer = [s - _SCATTERED for s in secants]
    # A bound, of which the square is finite: through as much as that no light is seen.
    once, squared = (jnp.minimum(x / some, _OPAQUE) for x in scattered.over_absorbers)
    more = total([x * y * (once + y * squared) for x, y in zip(on, longer, strict=True)])
    bent = 1 / mu0 - sun_secant
    more = more + forward[0][0] * bent
    light = seen * (1 + more + again * jnp.exp(-_SCATTERED * absorbed))
    # Light that is scattered out of a beam may meet next to nothing where that is absorbed.
    cubes = [jnp.abs(absorbed * x) ** 3 / 6 for x in longer]
    diffuse = jnp.exp(-DIFFUSE * absorbed)
    unsure = [diffuse * jnp.minimum(_UNSURE * absorbed + x, 1) for x in cubes]
    paths = albedo * (to_view * on[0] * unsure[0] + to_ground * on[1] * unsure[1])
    turned = back[0] + back[1] + again + depth * jnp.abs(bent)
    # Nor does it take the sun's way through what absorbs.
    astray = depth * jnp.abs(bent * longer[0]) * absorbed
    missing = paths + seen * (turned**2 + _UNSURE * absorbed * again + astray)
    missing = jnp.max(missing + _TWICE * _twice(scattered.moments) / (mu0 * mu), axis=0)
    return Faint(2 * light, missing)


def _forward(
    moments: Sequence[Float[Array, "*batch"]], mu: Float[Array, "view *batch"]
) -> Float[Array, "view *batch"]:
    """F of the above."""
    found, before, here = moments[0] * jnp.ones_like(mu), jnp.ones_like(mu), mu
    for degree in range(1, len(moments)):
        if degree % 2:
            found = found + (2 * degree + 1) * _half(degree) * moments[degree] * here
        before, here = here, ((2 * degree + 1) * mu * here - degree * before) / (degree + 1)
    return 0.5 * found


def _back_to_ground(moments: Sequence[Float[Array, "*batch"]]) -> Float[Array, "*batch"]:
    """b of the above."""
    odd = range(1, len(moments), 2)
    return moments[0] - total([(2 * k + 1) * _half(k) ** 2 * moments[k] for k in odd])


def _twice(moments: Sequence[Float[Array, "*batch"]]) -> Float[Array, "*batch"]:
    """What thin layers scatter to one another, times mu0 and mu; less where they are not thin."""
    per_depth = 1 / (1 + moments[0])
    return total([(0.5 * k + 0.25) * (x * per_depth) ** 2 for k, x in enumerate(moments)])


@cache
def _half(degree: int) -> float:
    """Integral of a Legendre polynomial from 0 to 1."""
    return float(Legendre.basis(degree).integ()(1) - Legendre.basis(degree).integ()(0))
