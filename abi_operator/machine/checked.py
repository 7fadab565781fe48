"""What `jax.shard_map` checks, and operations of our own cannot tell it.

Inside, JAX follows which arrays differ from one device to the next, if `check_vma` is left on, and
says so in the type of each. How that is written has changed with versions of JAX, and a loop that
begins with zeros, as the solver's do, must say it of these zeros, too. An operation that is silent
makes an array that differs pass for one that does not, and its gradient is refused by JAX for a
type. So columns that differ are not solved where this is checked.
"""

from collections.abc import Sequence
from typing import Any

import jax


def refuse_checked(operands: Sequence[Any]) -> None:
    """Refuse arrays that JAX follows from one device to the next."""
    if jax.sharding.get_abstract_mesh().empty:
        return
    differing = sorted({str(axis) for x in operands for axis in _varying(jax.typeof(x))})
    if differing:
        raise ValueError(
            f"check_vma=True of jax.shard_map came with columns that vary over {differing} of its "
            "mesh; columns are solved inside jax.shard_map(..., check_vma=False) alone."
        )


def _varying(kind: Any) -> Sequence[Any] | frozenset[Any]:
    """Axes of a mesh along which an array of this type differs, in the words of any JAX."""
    if hasattr(kind, "vma"):  # its older word
        return kind.vma
    return getattr(getattr(kind, "manual_axis_type", None), "varying", ())
