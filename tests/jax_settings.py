"""Settings of JAX for a while."""

from contextlib import contextmanager

import jax


@contextmanager
def settings(**values):
    """Settings of JAX, put back afterwards."""
    previous = {name: getattr(jax.config, name) for name in values}
    try:
        for name, value in values.items():
            jax.config.update(name, value)
        yield
    finally:
        for name, value in previous.items():
            jax.config.update(name, value)
