"""Programs of the operator's and the solver's doors, for tests that change what these compile."""

from functools import cache

from abi_operator import _chunks, _door


def programs_anew(monkeypatch):
    """Let the doors trace and compile all that they are asked for from here to the test's end.

    Other tests' programs stay where they are, which `jax.clear_caches` would throw away.
    """
    monkeypatch.setattr(_door, "_jitted", cache(_door._jitted.__wrapped__))
    monkeypatch.setattr(_chunks, "_compiled", set())
