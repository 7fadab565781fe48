"""Blocks of a scene that an earlier run of the same has solved, by all that the numbers hang on.

A part is named by a digest of the block's scenario and of what solves it: its numbers, the settings
and the code. So whatever is different, a file, an option or a version, is solved anew, and what is
found is what would be computed.
"""

import hashlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import xarray as xr

from ..files import Parts
from ..machine.kept import state_of_code


def solved_or_found(
    parts: Parts | None,
    scenario: xr.Dataset,
    settings: Mapping[str, Any],
    solve: Callable[[], dict[str, np.ndarray]],
) -> dict[str, np.ndarray]:
    """What `solve` returns, from the parts where it is there, and kept among them where not.

    Parameters
    ----------
    parts
        Where to look, and to keep it; None not to.
    scenario, settings
        Of what `solve` makes its numbers.
    solve
        Returns arrays by name.
    """
    code = None if parts is None else state_of_code()
    if parts is None or code is None:
        return solve()
    name = part_name(scenario, {"code": code, **settings})
    found = parts.find(name)
    if found is None:
        found = solve()
        parts.keep(name, found)
    return found


def part_name(scenario: xr.Dataset, settings: Mapping[str, Any]) -> str:
    """Digest of all that is in a scenario, and of settings that `repr` tells apart."""
    digest = hashlib.sha256(repr(sorted(settings.items())).encode())
    digest.update(repr(sorted(scenario.attrs.items())).encode())
    for name in sorted(map(str, scenario.variables)):
        array = scenario[name]
        values = np.ascontiguousarray(array.values)
        digest.update(repr((name, array.dims, values.shape, values.dtype.str)).encode())
        digest.update(
            repr(values.tolist()).encode() if values.dtype.hasobject else values.tobytes()
        )
    return digest.hexdigest()
