"""XLA's threads have a core each while they are woken, and every core before and after."""

import os

import jax.numpy as jnp
import pytest

from abi_operator.machine import lanes

pytestmark = pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="Linux alone tells")


@pytest.fixture
def pool():
    """The pool's threads, as `parted` finds them."""
    jnp.zeros(1).block_until_ready()
    found = lanes._xla_threads(os.getpid())
    if len(found) < 2 or len(found) != len(os.sched_getaffinity(0)):
        pytest.skip("one core, or not a thread for each")
    return found


def places(pool):
    return [os.sched_getaffinity(x) for x in pool]


def test_each_thread_has_a_core_and_then_all(pool):
    cores = os.sched_getaffinity(0)
    with lanes.parted():
        inside = places(pool)
        with lanes.parted():  # another thread of the caller: it is done already
            assert places(pool) == inside
        assert places(pool) == inside
    assert all(len(x) == 1 for x in inside) and set.union(*inside) == cores
    assert places(pool) == [cores] * len(pool)


def test_an_error_inside_leaves_no_thread_on_one_core(pool):
    with pytest.raises(KeyError), lanes.parted():
        raise KeyError
    assert places(pool) == [os.sched_getaffinity(0)] * len(pool)


def test_threads_that_somebody_has_placed_stay_there(pool):
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(pool[0], {max(cores)})
    try:
        before = places(pool)
        with lanes.parted():
            assert places(pool) == before
        assert places(pool) == before
    finally:
        os.sched_setaffinity(pool[0], cores)


def test_a_machine_that_forbids_it_is_no_error(pool, monkeypatch):
    def forbidden(*_):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setaffinity", forbidden)
    with lanes.parted():
        pass
    monkeypatch.setattr(os, "sched_getaffinity", forbidden)
    with lanes.parted():
        pass
