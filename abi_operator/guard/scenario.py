"""Scenarios: functions that return the states to be guarded."""

import importlib
import importlib.util
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ..atmosphere import State
from ..files import InputError
from .standard import standard_columns

STANDARD = "standard"
"""Name of the project's own columns as a scenario."""

_FORM = "write it as module:function or file.py:function"


def load_scenario(text: str) -> Callable[[], Any]:
    """The function that a text names.

    Parameters
    ----------
    text
        ``"standard"``, ``"module:function"`` or ``"file.py:function"``, the module as Python finds
        it from the working folder. The function takes nothing and returns states by name, or one
        state with one leading axis on every leaf.

    Raises
    ------
    InputError
        Where there is no such file, module or function, or it does not load.
    """
    if text == STANDARD:
        return standard_columns
    place, colon, name = text.rpartition(":")
    if not (colon and place and name):
        raise InputError(f"the scenario {text!r} names no function; {_FORM}.")
    try:
        module = _from_file(Path(place)) if place.endswith(".py") else _from_path(place)
        function = getattr(module, name, None)
    except InputError:
        raise
    except Exception as error:  # whatever ails a module of the user
        raise InputError(f"the scenario {text!r} does not load ({_said(error)}).") from error
    if not callable(function):
        raise InputError(f"{place} has no function {name!r}; {_FORM}.")
    return function


def states_of(text: str) -> State | Mapping[str, State]:
    """Call the function that a text names, and see that it returned states.

    Raises
    ------
    InputError
        As `load_scenario`, and where the function fails or returns something else.
    """
    function = load_scenario(text)
    try:
        states = function()
    except Exception as error:  # whatever ails a function of the user
        raise InputError(f"the scenario {text!r} failed ({_said(error)}).") from error
    each = list(states.values()) if isinstance(states, Mapping) else [states]
    strange = [type(state).__name__ for state in each if not isinstance(state, State)]
    if strange or not each:
        raise InputError(
            f"the scenario {text!r} returned {strange[0] if strange else 'nothing'} where states "
            "by name, or one State with a leading axis, are expected."
        )
    return states


def _from_file(path: Path):
    if not path.is_file():
        raise InputError(f"the scenario's file {path} does not exist; {_FORM}.")
    name = f"_scenario_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def _from_path(name: str):
    # Installed commands do not look for modules in the working folder; python -m does.
    here = str(Path.cwd())
    sys.path.insert(0, here)
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(here)


def _said(error: Exception) -> str:
    return f"{type(error).__name__}: {error}".splitlines()[0]
