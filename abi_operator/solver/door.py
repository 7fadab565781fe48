"""What the solver's doors share: from promoted arguments to a program for any number of columns."""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from ..machine.batching import tile_size
from ..machine.door import Leaves, enter
from ..machine.independent_columns import independent_columns
from ..machine.slopes import slopes_by_reverse_mode
from .checks import check_arguments, check_in_memory
from .column import (
    Column,
    Options,
    check_options,
    check_shapes,
    choose_doublings,
    names,
    own_axes,
    solved,
)
from .method.doublings import unknown_doublings


def prepare(
    column: Column,
    *,
    num_streams: int,
    num_modes: int | None,
    delta_m: bool,
    single_scattering: str | None,
    multiple_views: bool,
    num_doublings: int | None,
    check_values: bool | None,
    checked: Column | None = None,
    error_budget: float | None = None,
) -> Options:
    """What every door does with its promoted arguments before the program: check and choose.

    Values are checked here where they must be, in `checked` if the column to solve is not what the
    caller gave; where they may be that is left to `solve`.
    """
    check_options(num_streams, num_modes, single_scattering, num_doublings, error_budget)
    check_shapes(column, num_streams + 1 if delta_m else num_streams, multiple_views)
    if check_values:
        given = (column if checked is None else checked)._asdict()
        summed = single_scattering == "tms" and column.phase_function is None
        check_arguments({k: x for k, x in given.items() if x is not None}, series_summed=summed)
    return Options(
        num_streams,
        num_streams if num_modes is None else num_modes,
        delta_m,
        single_scattering == "tms",
        num_doublings,
        error_budget=None if error_budget is None else float(error_budget),
    )


def solve(
    tile: Callable[[Column, Options], Any],
    column: Column,
    options: Options,
    multiple_views: bool,
    gradient: Callable[[Column, Options], tuple[Any, Column]] | None = None,
    by_view: Any = True,
    check_values: bool | None = None,
) -> Any:
    """Solve columns, with derivatives, `jax.vmap` and threads as they are cheapest.

    Parameters
    ----------
    tile
        Maps columns whose batch is last (`column.aligned`) to a pytree of arrays ``*view batch``.
    column, options, multiple_views
        What to solve.
    gradient
        As in `independent_columns`, of `tile`.
    by_view
        Which results of `tile` have an axis of views: a pytree of bools of the same structure.
    check_values
        None to check values where there are any, under derivatives and `jax.vmap` too.
    """
    leaves, structure = jax.tree.flatten(column)
    checked = check_values is not None
    program = _Program(tile, gradient, options, multiple_views, structure, by_view, checked)
    return enter(program, leaves)


class _Program(NamedTuple):
    """`machine.door.Program` of a door's arguments; for slopes it has a number of doublings."""

    tile: Callable[[Column, Options], Any]
    gradient: Callable[[Column, Options], tuple[Any, Column]] | None
    options: Options
    multiple_views: bool
    structure: Any
    by_view: Any
    checked: bool

    @property
    def own_axes(self) -> tuple[int, ...]:
        return _own_axes(self.structure, self.multiple_views)

    def known(self, leaves: Leaves, what: Any) -> "_Program":
        column = jax.tree.unflatten(self.structure, leaves)
        if not self.checked:
            check_in_memory(column._asdict())
        if what == "value" or self.options.num_doublings is not None:
            return self._replace(checked=True)
        number = choose_doublings(column, self.options.num_streams)
        return self._replace(options=self.options._replace(num_doublings=number), checked=True)

    def unknown(self, what: Any) -> "_Program":
        if what == "value" or self.options.num_doublings is not None:
            return self._replace(checked=True)
        number = unknown_doublings(self.options.num_streams)
        options = self.options._replace(num_doublings=number, unread=True)
        return self._replace(options=options, checked=True)

    def own_result(self, leaves: Leaves) -> Any:
        column = jax.tree.unflatten(self.structure, leaves)
        views = ()
        if self.multiple_views:
            views = (max(column.mu.shape[-1], column.relative_azimuth.shape[-1]),)
        dtype = jnp.result_type(*leaves)
        return jax.tree.map(
            lambda has: jax.ShapeDtypeStruct(views if has else (), dtype), self.by_view
        )

    def widths(self, leaves: Leaves, what: Any) -> tuple[int, ...]:
        tile = tile_size(self.options.num_streams, leaves[0].dtype)
        # At few streams a chunk is solved in few times what it needs to begin and to end.
        brief = self.options.num_streams <= 8
        return (8, tile, 8 * tile, 16 * tile) if brief else (8, tile, 8 * tile)

    def value(self, leaves: Leaves) -> Any:
        column = jax.tree.unflatten(self.structure, leaves)
        gradient = self.gradient
        solve = independent_columns(
            lambda tile: self.tile(tile, self.options),
            tile_size(self.options.num_streams, jnp.result_type(*leaves)),
            None if gradient is None else lambda tile: gradient(tile, self.options),
        )
        return solved(column, self.multiple_views, solve)

    def value_and_slopes(self, leaves: Leaves, wanted: tuple[bool, ...]) -> tuple[Any, list[Any]]:
        return slopes_by_reverse_mode(self.value, leaves, wanted, self.own_axes)


@cache
def _own_axes(structure: Any, multiple_views: bool) -> tuple[int, ...]:
    return tuple(len(own_axes(name, multiple_views)) for name in names(structure))
