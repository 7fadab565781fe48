"""Levels at the edges of plumes, so that no layer is partly inside of one."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .atmosphere import Atmosphere, State


def with_plume_edges(atmosphere: Atmosphere) -> Atmosphere:
    r"""Insert levels at the base and the top of every plume: two more for each.

    A layer mixes what it holds. One that a plume fills in part spreads it over all of its height,
    so that the light of a column moves a little, and its derivative in base and top in steps, as
    an edge goes from level to level. With levels that go with the edges both are smooth, which
    retrievals of height need. Optical depths stay what they are. Reflectances move by 1e-5 where
    layers are 400 m thick, and by some 1e-4 where an edge lies in a cloud's layer.

    Between two levels temperature is linear in height and pressure exponential (linear where it
    is 0 at the upper one); what a layer holds (particles, vapour, ozone) is divided in proportion
    to air, by difference of pressure, and its sum is kept. Derivatives go through edges and levels
    alike.

    New levels lie 1 mm inside the plume (1/4 m in float32), one more for each plume before it. So
    an edge that meets a level, the ground or another edge leaves a thin layer there and not an
    empty one, of which what scatters in it would have no derivative; where it does, derivatives are
    those of a shrinking plume. Edges above the air leave such a layer at its top.

    Parameters
    ----------
    atmosphere
        One column or a batch.

    Returns
    -------
    The same column on levels that include its plumes' edges.
    """
    if not atmosphere.plumes:
        return atmosphere
    atmosphere = jax.tree.map(jnp.asarray, atmosphere)
    function = _with_edges
    for _ in range(atmosphere.height.ndim - 1):
        function = jax.vmap(function)
    return function(atmosphere)


def moves_plume_edges(changed: Callable[[Array], State], size: int) -> bool:
    """Whether the base or the top of any plume depends on so many numbers.

    Parameters
    ----------
    changed
        From these numbers to a column, or a batch; its slopes are looked at where all are 0.1.
    size
        How many numbers.
    """

    def edges(x: Float[Array, " x"]) -> list[Array]:
        plumes = changed(x).atmosphere.plumes
        return [edge for plume in plumes.values() for edge in (plume.base, plume.top)]

    slopes = jax.jacfwd(edges)(jnp.full(size, 0.1))
    return any(bool(np.any(np.asarray(slope))) for slope in slopes)


def _with_edges(atmosphere: Atmosphere) -> Atmosphere:
    pressure, height = atmosphere.pressure, atmosphere.height
    edges = _edges(atmosphere)
    # Should an edge still meet a level, the order is of no consequence.
    order = jnp.argsort(-jnp.concatenate([height, edges]), stable=True)
    levels = jnp.concatenate([height, edges])[order]
    # Layer of the old ones in which each new one lies.
    parent = jnp.cumsum(order < height.size)[:-1] - 1
    upper, lower = height[parent], height[parent + 1]
    flat = upper <= lower
    thickness = jnp.where(flat, 1, upper - lower)
    share_above = jnp.where(flat, 0, (upper - levels[:-1]) / thickness)
    share_below = jnp.where(flat, 1, (upper - levels[1:]) / thickness)
    air_above, air_below = (
        _share_of_air(pressure[parent], pressure[parent + 1], x) for x in (share_above, share_below)
    )
    part = air_below - air_above

    def at_levels(values: Array, share: Array) -> Array:
        inside = values[parent] + share * (values[parent + 1] - values[parent])
        return jnp.concatenate([inside, values[-1:]])

    def divided(amount: Array) -> Array:
        return part * amount[parent]

    def particles(of: Any) -> Any:
        return replace(of, mass_path=divided(of.mass_path), number_path=divided(of.number_path))

    changes: dict[str, Any] = {
        "pressure": at_levels(pressure, air_above),
        "height": levels,
        "liquid": particles(atmosphere.liquid),
        "hydrometeors": {k: particles(x) for k, x in atmosphere.hydrometeors.items()},
    }
    if atmosphere.temperature is not None:
        changes["temperature"] = at_levels(atmosphere.temperature, share_above)
    if atmosphere.gases is not None:
        gases = atmosphere.gases
        changes["gases"] = replace(gases, vapour=divided(gases.vapour), ozone=divided(gases.ozone))
    return replace(atmosphere, **changes)


def _edges(atmosphere: Atmosphere) -> Float[Array, " edge"]:
    """Heights above sea level of the new levels: inside of the plumes, and of the air. [m]"""
    height = atmosphere.height
    apart = height.dtype.type(1e-3 if np.finfo(height.dtype).eps < 1e-12 else 0.25)
    edges = []
    for number, name in enumerate(sorted(atmosphere.plumes), start=1):
        plume = atmosphere.plumes[name]
        base = height[-1] + plume.base + number * apart
        top = height[-1] + plume.top - number * apart
        for edge, place in ((base, 2 * number), (top, 2 * number + 1)):
            lowest, highest = height[-1] + place * apart, height[0] - place * apart
            edge = jnp.where(edge < highest, edge, highest)
            edges.append(jnp.where(edge > height[-1], edge, lowest))
    return jnp.stack(edges)


def _share_of_air(
    upper: Float[Array, " layer"], lower: Float[Array, " layer"], share: Float[Array, " layer"]
) -> Float[Array, " layer"]:
    """Share of a layer's air that is above a height, by the share of its thickness. [-]

    Exactly 0 at its upper and 1 at its lower level.
    """
    exponential = (upper > 0) & (lower > upper * (1 + 1e-6))
    ratio = jnp.where(exponential, lower, 2.0) / jnp.where(exponential, upper, 1.0)
    steepness = jnp.log(ratio)
    return jnp.where(exponential, jnp.expm1(share * steepness) / jnp.expm1(steepness), share)
