"""Kills a writer of results at every step that it takes on the disk, and lets another one go on.

    python long_runs_steps.py FOLDER

One line, JSON: how many steps there were, and what was wrong after which. A step is a call that
makes, renames or removes something. This process forks itself before JAX has any threads.
"""

import contextlib
import json
import os
import shutil
import signal
import sys
import warnings
from pathlib import Path

import numpy as np

from abi_operator.files import Parts, abandoned, output_folder

STEPS = ("mkdir", "open", "rename", "replace", "unlink", "rmdir")
BEFORE = {"a.png": "old", "b.png": "old", "result.nc": "old", "other.txt": "other"}
AFTER = {"b.png": "new", "c.png": "new", "result.nc": "new", "other.txt": "other"}


def write(target, failing):
    """What a simulation does with its folder: a part, pictures, a result; or half of it."""
    with output_folder(target, outdated=lambda: ["a.png", "b.png"], keeps_parts=True) as folder:
        parts = Parts(folder)
        for name in ("first", "second"):
            if parts.find(name) is None:
                parts.keep(name, {"values": np.arange(3.0)})
            if failing and name == "second":
                raise ValueError
        for name in ("b.png", "c.png", "result.nc"):
            (folder / name).write_text("new")


def count_steps(last):
    """Kill this process at its step number `last`, counted from 0; return a list that counts."""
    done = []

    def counted(step):
        def call(*arguments, **keywords):
            if len(done) == last:
                os.kill(os.getpid(), signal.SIGKILL)
            done.append(step.__name__)
            return step(*arguments, **keywords)

        return call

    for name in STEPS:
        setattr(os, name, counted(getattr(os, name)))
    return done


def killed(target, last, failing):
    """Write in a child that is killed; whether it was."""
    child = os.fork()
    if child == 0:
        count_steps(last)
        with contextlib.suppress(ValueError):
            write(target, failing)
        os._exit(0)
    return os.waitpid(child, 0)[1] == signal.SIGKILL


def content(target):
    return {x.name: x.read_text() for x in target.iterdir()} if target.exists() else {}


def wrong(target, was_killed):
    """What is wrong in a folder where a writer was killed, and then where another one has ended."""
    found = []
    names = content(target)
    if names.get("result.nc") == "new" and names != AFTER:
        found.append(f"the result is there and not its pictures: {names}")
    if any(text not in (BEFORE.get(name), AFTER.get(name)) for name, text in names.items()):
        found.append(f"half a file: {names}")
    write(target, failing=False)
    if content(target) != AFTER:
        found.append(f"another run has not mended it: {content(target)}")
    left = [x.name for x in target.parent.iterdir() if x != target]
    return found + ([f"left {left}"] if left else [])


def main():
    root = Path(sys.argv[1])
    warnings.simplefilter("ignore")
    abandoned._LONG_AGO = -1.0
    found, tried = {}, 0
    for failing in (False, True):
        for step in range(1000):
            target = root / f"{failing}-{step}" / "out"
            target.mkdir(parents=True)
            for name, text in BEFORE.items():
                (target / name).write_text(text)
            was_killed = killed(target, step, failing)
            words = wrong(target, was_killed)
            if words:
                found[f"{'failing' if failing else 'whole'} {step}"] = words
            shutil.rmtree(target.parent)
            if not was_killed:
                break
            tried += 1
    print(json.dumps([tried, found]))


if __name__ == "__main__":
    main()
