"""Keyword arguments that several functions have in common, written down once."""

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar, get_type_hints

P = ParamSpec("P")
R = TypeVar("R")


def with_keywords(keywords: type, defaults: Any) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let a function that ends in ``**given: Unpack[keywords]`` show and know its keywords.

    Its signature then names them one by one, as if they had been written there, and a call with any
    other is a `TypeError` that lists them.

    Parameters
    ----------
    keywords
        A `TypedDict` of the keywords and their types.
    defaults
        A `NamedTuple` that has them among its fields, with their defaults.
    """
    types = get_type_hints(keywords)
    known = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=types[name]
        )
        for name, default in defaults._asdict().items()
        if name in types
    ]

    def decorated(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)
        *own, _ = signature.parameters.values()
        signature = signature.replace(parameters=[*own, *known])
        allowed = frozenset(signature.parameters)

        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            if not allowed.issuperset(kwargs):
                unknown = min(kwargs.keys() - allowed)
                raise TypeError(
                    f"{function.__name__}() got an unexpected keyword argument {unknown!r}; it "
                    f"takes {', '.join(x.name for x in known)}."
                )
            return function(*args, **kwargs)

        call.__dict__["__signature__"] = signature
        return call

    return decorated
