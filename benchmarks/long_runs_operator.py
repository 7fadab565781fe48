"""The operator in threads and in processes of every kind, against the numbers of one thread.

    python long_runs_operator.py KIND

computes in a pool of the KIND, ``dies`` in one whose process is killed, ``dask`` in workers of dask
of which one is, and prints how many of the answers are the same, JSON: those of a pool that hangs
are never printed, which is why it is a process of its own. It is imported by the processes that it
spawns.
"""

import json
import os
import signal
import sys
import tempfile
import warnings
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import abi_operator
from abi_operator import Atmosphere, Geometry, LiquidCloud, State, reflectance_factor, smoke

BANDS = ("C01", "C03")
COUNT = 8  # calls
WORKERS = 4
LETHAL = 3
KINDS = ("threads", "spawn", "forkserver", "fork before JAX", "fork")


def prepare():
    jax.config.update("jax_enable_x64", True)
    if abi_operator.use_compilation_cache() is None:
        warnings.warn("each process compiles for itself", stacklevel=2)


def columns(number):
    """Some columns that differ from call to call."""
    size = 4 + number % 3
    rng = np.random.default_rng(number)
    height = np.linspace(20e3, 0.0, 13)
    pressure = np.broadcast_to(101325 * np.exp(-height / 8000), (size, 13))
    layers = np.zeros((size, 12))
    layers[:, 9] = rng.uniform(0.01, 0.1, size)
    cloud = LiquidCloud(jnp.asarray(layers), jnp.asarray(layers * 1e11))
    plume = smoke(jnp.asarray(rng.uniform(0.1, 2, size)), bands=BANDS)
    air = Atmosphere(pressure, np.broadcast_to(height, (size, 13)), cloud, {"smoke": plume})
    albedo = {band: jnp.asarray(rng.uniform(0, 0.5, size)) for band in BANDS}
    return State(air, albedo, Geometry(*(jnp.full(size, x) for x in (0.6, 0.8, 1.2))))


def answer(number):
    """Values and the gradient of their sum in all of the state, as NumPy's arrays."""
    state = columns(number)
    values, pull = jax.vjp(lambda s: reflectance_factor(s, BANDS, num_streams=2), state)
    (slopes,) = pull(jnp.ones_like(values))
    return [np.asarray(x) for x in jax.tree.leaves((values, slopes))]


def prepared_answer(number):
    prepare()
    return answer(number)


def answer_or_die(number):
    """The same of a worker that is killed at one of the calls, as by a system out of memory."""
    if number == LETHAL:
        os.kill(os.getpid(), signal.SIGKILL)
    return prepared_answer(number)


def same(found, known):
    return all(np.array_equal(x, y) for x, y in zip(found, known, strict=True))


def answers(kind):
    """What a pool of a kind answers."""
    if kind == "threads":
        with ThreadPoolExecutor(WORKERS) as pool:
            return list(pool.map(answer, range(COUNT)))
    context = get_context(kind.partition(" ")[0])
    with ProcessPoolExecutor(2, mp_context=context) as pool:
        return list(pool.map(prepared_answer, range(COUNT)))


def with_a_worker_that_dies():
    """Answers by number that came in time, the error of the others, and answers of a new pool."""
    context = get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        futures = {number: pool.submit(answer_or_die, number) for number in range(COUNT)}
        errors = {n: future.exception() for n, future in futures.items()}
    found = {n: futures[n].result() for n, error in errors.items() if error is None}
    lost = [n for n, error in errors.items() if error is not None]
    assert all(isinstance(errors[n], BrokenProcessPool) for n in lost)
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        again = dict(zip(lost, pool.map(prepared_answer, lost), strict=True))
    return found, str(errors[lost[0]]), again


def answer_after_a_death(number, mark):
    """The same of a worker that is killed at one of the calls, but not when that is asked again."""
    if number == LETHAL and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return prepared_answer(number)


def with_dask():
    """Answers of two workers of dask, and how many have been killed; dask asks others in turn."""
    from distributed import Client, LocalCluster

    with tempfile.TemporaryDirectory() as folder:
        mark = Path(folder) / "died"
        cluster = LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            dashboard_address=None,
            local_directory=folder,
            silence_logs="CRITICAL",
        )
        with cluster, Client(cluster) as client:
            futures = client.map(answer_after_a_death, range(COUNT), mark=mark)
            return dict(enumerate(client.gather(futures))), int(mark.exists())


def main():
    kind = sys.argv[1]
    if kind == "fork before JAX":
        found = answers(kind)
        prepare()
    prepare()
    known = [answer(number) for number in range(COUNT)]
    if kind == "dies":
        before, error, after = with_a_worker_that_dies()
        number = sum(same(x, known[n]) for n, x in (before | after).items())
        print(json.dumps([number, len(before), error]))
        return
    if kind == "dask":
        found, died = with_dask()
        print(json.dumps([sum(same(x, known[n]) for n, x in found.items()), died, ""]))
        return
    if kind != "fork before JAX":
        found = answers(kind)
    print(json.dumps([sum(map(same, found, known)), len(found), ""]))


if __name__ == "__main__":
    main()
