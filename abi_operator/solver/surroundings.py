r"""Layers that stay, above and below others that change: solved once, for any number of those.

A plume that is moved, thickened or fitted changes a few layers of a column; air above it, and air,
cloud and ground below it stay as they are. `surroundings` solves what stays, in all azimuth modes,
and `Surroundings.brf` puts layers in between: its cost is that of those layers alone, for values
and slopes. The result is that of `toa_brf` of the whole column, to rounding. What is kept of a
column (`staying`) are :math:`m (2 n^2 + 4 n + 4)` numbers for m modes and 2n streams and nine
more, 3.4 kB at 8 streams and 21 kB at 16, whatever number of layers it has.

To solve what stays takes about as long as two solutions of the whole column, and has no derivative:
it pays where the same columns are solved several times. No command does; loops over plumes and
retrievals of one's own do (`examples/plume_between_layers.py`).
"""

from typing import Any, Unpack

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from .._keywords import with_keywords
from .all_modes import twice_reflected_between
from .column import Column, Options, longest, promoted
from .door import solve
from .foreknown import expected_between
from .method.single_scatter import direct_transmission
from .method.surface import AnySurface
from .problem import Problem, seen_at_once
from .settings import OfViews, Settings
from .skipping.depths import Depths
from .staying import Kept, numbers_a_column, unpacked


class Surroundings(eqx.Module):
    """What lies above and below some layers of columns, solved; see `surroundings`.

    Parameters
    ----------
    numbers
        What is kept of each column.
    albedo, mu0, mu, relative_azimuth
        As of `toa_brf`.
    settings
        As it was solved, and is to be.
    """

    numbers: Float[Array, "*batch number"]
    albedo: Any
    mu0: Float[Array, "*batch"]
    mu: Float[Array, "*batch"]
    relative_azimuth: Float[Array, "*batch"]
    settings: Settings = eqx.field(static=True)

    def brf(
        self,
        tau: Float[ArrayLike, "*batch layer"],
        ssa: Float[ArrayLike, "*batch layer"],
        moments: Float[ArrayLike, "*batch layer moment"],
        *,
        phase_function: Float[ArrayLike, "*batch layer"] | None = None,
        secant: Float[ArrayLike, "*batch layer"] | None = None,
        num_doublings: int | None = None,
        error_budget: float | None = None,
        check_values: bool | None = None,
    ) -> Float[Array, "*batch"]:
        """Reflectance of the columns with these layers in between, one or more. [-]

        Arguments, and errors raised, are those of `toa_brf`. Differentiable (forward and reverse)
        in every one of them, and in nothing that was solved before. `num_doublings` and
        `check_values` of None are those that the surroundings were solved with. An error budget
        leaves out what the layers between do not need: it is one of the whole reflectance.
        """
        fixed = self.albedo, self.mu0, self.mu, self.relative_azimuth, self.numbers
        albedo, mu0, mu, relative_azimuth, numbers = jax.lax.stop_gradient(fixed)
        column = promoted(
            tau=tau,
            ssa=ssa,
            moments=moments,
            albedo=albedo,
            mu0=mu0,
            mu=mu,
            relative_azimuth=relative_azimuth,
            phase_function=phase_function,
            secant=secant,
            around=numbers,
        )
        now = {"num_doublings": num_doublings, "check_values": check_values}
        now = {name: x for name, x in now.items() if x is not None}
        how = self.settings._replace(error_budget=error_budget, **now)
        return solve(_brf_between, column, how)


@with_keywords(OfViews, Settings())
def surroundings(
    tau: Float[ArrayLike, "*batch layer"],
    ssa: Float[ArrayLike, "*batch layer"],
    moments: Float[ArrayLike, "*batch layer moment"],
    albedo: Float[ArrayLike, "*batch"] | AnySurface,
    mu0: Float[ArrayLike, "*batch"],
    mu: Float[ArrayLike, "*batch"],
    relative_azimuth: Float[ArrayLike, "*batch"],
    *,
    num_above: int,
    phase_function: Float[ArrayLike, "*batch layer"] | None = None,
    secant: Float[ArrayLike, "*batch layer"] | None = None,
    **settings: Unpack[OfViews],
) -> Surroundings:
    """Solve layers that stay, the first `num_above` of which lie above those that change.

    Parameters
    ----------
    tau, ssa, moments, phase_function, secant
        As of `toa_brf`, of the layers that stay, from the top: those above the others, and then
        those below. [-]
    num_above
        How many lie above, from 0 to all of them.
    albedo, mu0, mu, relative_azimuth
        As of `toa_brf`, with one view.
    **settings
        How exactly to solve, then and now: the fields of `Settings` but the error budget.

    Raises
    ------
    ValueError
        As `toa_brf` does; if `num_above` is more layers than there are, or there are several views.
    TypeError
        Where a derivative is taken: there is none in what stays.
    """
    column = promoted(
        tau=tau,
        ssa=ssa,
        moments=moments,
        albedo=albedo,
        mu0=mu0,
        mu=mu,
        relative_azimuth=relative_azimuth,
        phase_function=phase_function,
        secant=secant,
    )
    how = Settings(**settings)
    num_layers = longest(column, how.multiple_views).get("layer", 0)
    if not 0 <= num_above <= num_layers:
        raise ValueError(f"num_above must be 0 to {num_layers}, the layers given; got {num_above}.")
    if how.multiple_views:
        raise ValueError("surroundings are those of one view: multiple_views must be False.")
    num_modes = how.num_streams if how.num_modes is None else how.num_modes
    count = numbers_a_column(how.num_streams, num_modes)
    numbers = solve(Kept(num_above), column, how, gradient=_no_slopes, by_view=count)
    albedo, *angles = jax.tree.map(
        jnp.asarray, (column.albedo, column.mu0, column.mu, column.relative_azimuth)
    )
    return Surroundings(numbers, albedo, *angles, settings=how)


def _no_slopes(tile: Column, options: Options) -> Any:
    raise TypeError(
        "surroundings have no derivative in what stays; take it of toa_brf of the whole column, or "
        "hold what stays with jax.lax.stop_gradient."
    )


def _brf_between(tile: Column, options: Options) -> Float[Array, "view *batch"]:
    """Reflectance of columns whose batch is last, with layers in between."""
    assert tile.around is not None
    kept = unpacked(tile.around, options)
    problem = Problem(tile._replace(albedo=jnp.zeros_like(tile.mu0)), options)
    layers, directions = problem.layers, problem.directions
    scattered, passed, below = kept.once
    through = direct_transmission(layers.tau, tile.mu, directions.sun_secants)
    at_once = scattered + passed * (seen_at_once(problem) + through * below)
    known = problem.doublings
    if options.error_budget is not None:
        *around, peaked = kept.depths
        around = Depths(*around)
        known = expected_between(tile, layers, directions, at_once, around, peaked)
    between = layers, directions, kept.below(), kept.above, tile.relative_azimuth
    return at_once + 0.5 * twice_reflected_between(*between, known, options)
