"""What the solver's doors share: from promoted arguments to a program for any number of columns."""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..machine.door import Leaves, enter
from ..machine.sizes import chunks_of_columns, tile_size
from ..machine.slopes import chosen, slopes_by_reverse_mode
from ..machine.told import AtOnce
from .checks import check_arguments, check_in_memory
from .column import (
    Column,
    Options,
    aligned,
    check_shapes,
    choose_doublings,
    longest,
    names,
    own_axes,
)
from .foreknown import need
from .glimpse import Glimpse, can_be_seen
from .method.doublings import unknown_doublings
from .settings import Settings, check_settings
from .skipping import budget, company


def solve(
    tile: Callable[[Column, Options], Any],
    column: Column,
    settings: Settings,
    *,
    gradient: Callable[[Column, Options], tuple[Any, Column]] | None = None,
    faint: Callable[[Column, Options], Glimpse] | None = None,
    by_view: Any = True,
    given: Column | None = None,
) -> Any:
    """Solve columns, with derivatives, `jax.vmap` and threads as they are cheapest.

    Parameters
    ----------
    tile
        Maps columns whose batch is last (`column.aligned`) to a pytree of arrays ``*view batch``.
    column
        What to solve: promoted arguments.
    settings
        How to solve it.
    gradient
        Maps such columns to what `tile` gives and to a `Column` of slopes, ``row *own batch`` in
        place of each ``*own batch``; see `machine.program.Program`. None is reverse mode through
        `tile`.
    faint
        Maps such columns to what `tile` gives of those that need no solution; see `glimpse`.
    by_view
        Which results of `tile` have an axis of views: a pytree of bools of the same structure. One
        of the results may be so many numbers a column, which is said in place of False.
    given
        What the caller gave, where that is not the column to solve: its values are checked.
    """
    options = _options(column, settings)
    if settings.check_values:
        arguments = _values(given or column)
        check_arguments(arguments, series_summed=options.tms and "phase_function" not in arguments)
    leaves, structure = jax.tree.flatten(column)
    # Those of None are checked by the program, which knows what can be read under derivatives too.
    checked = settings.check_values is not None
    several = settings.multiple_views
    how = options, several, structure, by_view, checked, column.tau.dtype
    program = _Program(tile, gradient, faint, *how)
    return enter(program, leaves)


def _values(column: Column) -> dict[str, Any]:
    """Arguments whose values have a range."""
    arguments = column._replace(around=None)._asdict()
    return {name: x for name, x in arguments.items() if x is not None}


def _options(column: Column, settings: Settings) -> Options:
    """What of the settings is static in the program, refused where it is out of range."""
    check_settings(settings)
    num_streams, delta_m = settings.num_streams, settings.delta_m
    check_shapes(column, num_streams + 1 if delta_m else num_streams, settings.multiple_views)
    return Options(
        num_streams,
        num_streams if settings.num_modes is None else settings.num_modes,
        delta_m,
        settings.single_scattering == "tms",
        settings.num_doublings,
        error_budget=settings.error_budget,
    )


class _Program(NamedTuple):
    """`machine.program.Program` of a door's arguments; for slopes it has a number of doublings."""

    solve: Callable[[Column, Options], Any]
    gradient: Callable[[Column, Options], tuple[Any, Column]] | None
    faint: Callable[[Column, Options], Glimpse] | None
    options: Options
    multiple_views: bool
    structure: Any
    by_view: Any
    checked: bool
    dtype: Any
    of_slopes: bool = False

    @property
    def own_axes(self) -> tuple[int, ...]:
        return _own_axes(self.structure, self.multiple_views)

    def known(self, leaves: Leaves, what: Any) -> "_Program":
        column = jax.tree.unflatten(self.structure, leaves)
        if not self.checked:
            check_in_memory(_values(column))
        program = self._of(what)
        if what == "value" or self.options.num_doublings is not None:
            return program
        number = choose_doublings(column, self.options.num_streams)
        return program._replace(options=self.options._replace(num_doublings=number))

    def unknown(self, what: Any) -> "_Program":
        program = self._of(what)
        if what == "value" or self.options.num_doublings is not None:
            return program
        number = unknown_doublings(self.options.num_streams, self.dtype)
        return program._replace(options=self.options._replace(num_doublings=number, unread=True))

    def _of(self, what: Any) -> "_Program":
        return self._replace(checked=True, of_slopes=what != "value")

    def own_result(self, leaves: Leaves) -> Any:
        column = jax.tree.unflatten(self.structure, leaves)
        views = (longest(column, True)["view"],) if self.multiple_views else ()
        dtype = jnp.result_type(*leaves)

        def own(has: bool | int) -> Any:
            axes = (views if has else ()) if isinstance(has, bool) else (has,)
            return jax.ShapeDtypeStruct(axes, dtype)

        return jax.tree.map(own, self.by_view)

    def widths(self, leaves: Leaves, what: Any) -> tuple[int, ...]:
        streams, dtype = self.options.num_streams, leaves[0].dtype
        return chunks_of_columns(streams, dtype, self._in_order, self._rounds(what))

    def tile(self, leaves: Leaves, what: Any) -> int:
        dtype = jnp.result_type(*leaves)
        alone = what != "value" and leaves[0].shape[-1] == 1  # the optical depths' layers
        return tile_size(self.options.num_streams, dtype, self._rounds(what), alone)

    def _rounds(self, what: Any) -> bool:
        """Whether most is solved in single precision: not slopes of what emits, or of layers
        between others that stay."""
        in_sunlight = {"solar_irradiance", "around"}.isdisjoint(names(self.structure))
        rounds = self.options.delta_m and budget.rounds(self.options.error_budget)
        return rounds and (what == "value" or in_sunlight)

    @property
    def need(self) -> Callable[[Leaves], Array] | None:
        return self._needed if self._in_order else None

    def _needed(self, leaves: Leaves) -> Array:
        return need(self._aligned(leaves), self.options, self.of_slopes)

    @property
    def at_once(self) -> AtOnce | None:
        if self.faint is None:
            return None
        given = jax.tree.unflatten(self.structure, self.own_axes)
        return self._glimpsed if can_be_seen(given, self.options) else None

    def _glimpsed(self, leaves: Leaves) -> tuple[Any, Array]:
        assert self.faint is not None and self.options.error_budget is not None
        found = self.faint(self._aligned(leaves), self.options)
        return self._outward(found.light), found.enough(self.options.error_budget)

    @property
    def _in_order(self) -> bool:
        skips = self.options.error_budget is not None
        return skips and self.options.num_streams >= company.SORTED_FROM

    def value(self, leaves: Leaves) -> Any:
        return self._outward(self.solve(self._aligned(leaves), self.options))

    def value_and_slopes(self, leaves: Leaves, wanted: tuple[bool, ...]) -> tuple[Any, list[Any]]:
        if self.gradient is None:
            return slopes_by_reverse_mode(self.value, leaves, wanted)
        column, pull_back = jax.vjp(self._aligned, leaves)
        value, slopes = self.gradient(column, self.options)
        own = jax.vmap(lambda row: pull_back(row)[0])(slopes)
        return self._outward(value), chosen(own, wanted)

    def _aligned(self, leaves: Leaves) -> Column:
        return aligned(jax.tree.unflatten(self.structure, leaves), self.multiple_views)

    def _outward(self, result: Any) -> Any:
        """Results of a tile, without the axis of the one view where there are not several."""
        if self.multiple_views:
            return result

        def outward(has: bool | int, x: Array) -> Array:
            return x.reshape(x.shape[-1:]) if isinstance(has, bool) else x

        return jax.tree.map(outward, self.by_view, result)


@cache
def _own_axes(structure: Any, multiple_views: bool) -> tuple[int, ...]:
    return tuple(len(own_axes(name, multiple_views)) for name in names(structure))
