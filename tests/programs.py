"""Programs of the operator's and the solver's doors, for tests that change what these compile."""

import jax

from abi_operator import _chunks, _compiler, _door
from abi_operator._kept import Kept


def programs_anew(monkeypatch):
    """Let the doors trace and compile all that they are asked for from here to the test's end.

    Other tests' programs stay where they are, which `jax.clear_caches` would throw away.
    """

    def anew(of, leaves):  # another function, of which JAX has no trace
        return _door._wanted(of, leaves)

    program = Kept(anew, _compiler.options())
    monkeypatch.setattr(_door, "_inside", jax.jit(anew, static_argnums=0))
    monkeypatch.setattr(_door, "_alone", lambda: program)
    monkeypatch.setattr(_chunks, "_compiled", set())
