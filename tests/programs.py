"""Programs of the operator's and the solver's doors, for tests that change what these compile."""

import jax

from abi_operator.machine import chunks, door
from abi_operator.machine.kept import Kept


def programs_anew(monkeypatch):
    """Let the doors trace and compile all that they are asked for from here to the test's end.

    Other tests' programs stay where they are, which `jax.clear_caches` would throw away.
    """

    def anew(of, leaves):  # another function, of which JAX has no trace
        return door._wanted(of, leaves)

    program = Kept(anew, recorded=True)
    monkeypatch.setattr(door, "_inside", jax.jit(anew, static_argnums=0))
    monkeypatch.setattr(door, "_alone", lambda: program)
    monkeypatch.setattr(chunks, "_compiled", set())
