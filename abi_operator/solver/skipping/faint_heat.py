r"""Thermal light of columns whose layers scatter hardly anything (`faint`).

Air that scatters backwards a share of the light gives back that of others, of much the same
temperature: it has the light of air that emits as much as beams lose in it. The ground is seen
through it as in `faint`. What this may miss is what is turned round, wherever it is, and where
nobody knows how bright that is: at every level no brighter than the light from below that nothing
has scattered and the layer itself, as much of it as the view sees from the top,

.. math::
   s\sum_k e^{-sT_k}\,\omega_k(1-g_k)\tau_k\,(L\uparrow_k + B_k + |D_k|),

with the optical depth T above, the Planck function B at a layer's upper face and its increase D;
and what is turned back to the ground, which reflects it. Air through which nobody sees the ground
hides that it is hot.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from .budget import Faint
from .depths import DIFFUSE, Depths
from .one_pass import Passing


def of_heat(
    layers: Depths,
    albedo: Float[Array, "*batch"],
    secant: Float[Array, "*batch"],
    air: Passing,
    from_ground: Float[Array, "*batch"],
) -> Faint:
    """Thermal light towards the only view.

    Parameters
    ----------
    layers, albedo
        Of the air and the ground.
    secant
        Of the view. [-]
    air
        Its light. [radiance unit]
    from_ground
        What the ground emits. [radiance unit]
    """
    ground = from_ground + albedo * air.down
    back = albedo * layers.backward * jnp.exp(-DIFFUSE * layers.absorbed)
    through = jnp.exp(-secant * (layers.absorbed + 0.5 * layers.backward))
    reflected = albedo * layers.backward * through * (ground + air.hottest)
    return Faint(air.up + through * ground * (1 + back), air.turned + reflected)
