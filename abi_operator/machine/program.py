"""What the door asks of a program of columns that do not see each other."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol, Self

from jaxtyping import Array, Float

from .slopes import Leaves
from .told import AtOnce


class Program(Protocol):
    """What is solved, hashable: equal programs are compiled once.

    Arguments are a list of arrays with the axes of the batch first, which broadcast; but `value`
    and `value_and_slopes` are of a tile of columns, arrays with one axis of the batch, the last.
    """

    @property
    def own_axes(self) -> tuple[int, ...]:
        """Number of axes of each argument that belong to one column."""
        ...

    def known(self, leaves: Leaves, what: Any) -> Self:
        """The program of `what` is wanted of columns that can be read."""
        ...

    def unknown(self, what: Any) -> Self:
        """The program of `what` is wanted of columns that cannot be read."""
        ...

    def own_result(self, leaves: Leaves) -> Any:
        """What `value` gives of one column: a pytree of `jax.ShapeDtypeStruct`."""
        ...

    def widths(self, leaves: Leaves, what: Any) -> Sequence[int]:
        """Numbers of columns that are worth a program of what is wanted, rising."""
        ...

    def tile(self, leaves: Leaves, what: Any) -> int:
        """Columns that are solved together, at most, for what is wanted."""
        ...

    @property
    def need(self) -> Callable[[Leaves], Float[Array, " batch"]] | None:
        """How much of each column ``*own batch`` is solved: those that need alike share a tile.

        None where all columns need as much.
        """
        ...

    @property
    def at_once(self) -> AtOnce | None:
        """What tells the value of some columns without `value`; None where nothing does."""
        ...

    def value(self, leaves: Leaves) -> Any:
        """Of a tile ``*own batch``, a pytree of arrays whose last axis is the batch."""
        ...

    def value_and_slopes(
        self, leaves: Leaves, wanted: tuple[bool, ...]
    ) -> tuple[Any, list[Float[Array, "row *own batch"]]]:
        """The same, and the slope of every row of it in the arguments that are wanted.

        Rows number the entries of a column's result: those of its first array in order, then those
        of its second, and so on (`slopes_by_reverse_mode`, `slopes_by_copies`).
        """
        ...
