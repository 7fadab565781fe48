"""Commands that are killed, that find no room, or that run at once: is what they leave whole?

Each check returns how often it was tried, what failed, in words, and what happened.
"""

import errno
import os
import resource
import shutil
import signal
import subprocess
import time
from collections import Counter
from contextlib import contextmanager
from functools import partial
from typing import NamedTuple

import numpy as np
from long_runs_files import differences, rubbish, run, start, write_series

from abi_operator.files.abandoned import MARK, PARTS

HOURS = range(16, 22)
SIZE = 12
ROOM = 200_000  # of a disk, or of a file: less than a result takes [byte]


class Found(NamedTuple):
    """What a check found."""

    tried: int
    failed: list[str]
    happened: str


class Place:
    """A folder with inputs, results that nothing disturbed, and results before those.

    Parameters
    ----------
    folder
        An empty one.
    """

    def __init__(self, folder):
        self.folder = folder
        self.series = write_series(folder / "in", SIZE, HOURS)
        self.cache = folder / "programs"
        self.seconds = {}

    def commands(self):
        """Of each command: words, and those of an earlier one of another result in its place."""
        result = self.folder / "simulated" / "out" / "result.nc"
        return {
            "simulate": (
                ["simulate", *self.series, "--out", "out"],
                ["simulate", *self.series, "--time", "0", "--out", "out"],
            ),
            "retrieve": (
                ["retrieve", "smoke", result, "--out", "out/retrieval.nc"],
                ["retrieve", "smoke", result, "--bands", "C01", "--out", "out/retrieval.nc"],
            ),
            "observe": (
                ["observe", result, "--seed", "1", "--out", "out/observed.nc"],
                ["observe", result, "--footprint", "2", "--out", "out/observed.nc"],
            ),
        }

    def undisturbed(self, name):
        """Folders with the result of a command and of the earlier one; each is made once.

        The first of them compiles, which is part of the seconds that it takes.
        """
        folders = [self.folder / f"{name}-{kind}" for kind in ("whole", "before")]
        for folder, words in zip(folders, self.commands()[name], strict=True):
            if not folder.exists():
                folder.mkdir()
                ended = run(words, self.cache, folder)
                assert ended.status == 0, ended.said
                self.seconds.setdefault(name, ended.seconds)
        return folders

    def simulated(self):
        """The result of which the other commands make theirs."""
        folder = self.folder / "simulated"
        if not folder.exists():
            folder.mkdir()
            words = ["simulate", *self.series, "--out", "out"]
            ended = run(words, self.cache, folder)
            assert ended.status == 0, ended.said

    def fresh(self, name, before=None):
        """A new folder, with an earlier result or none."""
        folder = self.folder / name
        shutil.rmtree(folder, ignore_errors=True)
        if before is None:
            folder.mkdir()
        else:
            shutil.copytree(before, folder)
        return folder


def killed(place, name, kills, seed):
    """Kill a command at random moments, and run it again.

    Moments are of its time on processors, so that what else runs moves none. Programs are kept in
    a folder that is empty at first, so that the first kill may fall into compiling; the others are
    drawn of the time that it takes once that is done.
    Every second time the next kill comes before the command has been run again.
    """
    if name != "simulate":
        place.simulated()
    whole, before = place.undisturbed(name)
    words = place.commands()[name][0]
    cache = place.folder / f"{name}-programs"
    rng = np.random.default_rng(seed)
    failed, states = [], Counter()
    compiled = run(words, place.cache, place.fresh("killed", before)).seconds
    folder = place.fresh("killed", before)
    for number in range(kills):
        moment = rng.uniform(0, 1.1) * (compiled if number else place.seconds[name])
        ended = run(words, cache, folder, killed_after=moment)
        states["ended first" if ended.status == 0 else "killed"] += 1
        if ended.status not in (0, -signal.SIGKILL):
            failed.append(f"{name} ended with {ended.status} by itself: {ended.said[-500:]}")
        earlier, later = (differences(x / "out", folder / "out") for x in (before, whole))
        if earlier and later:
            failed.append(f"{name} killed after {moment:.2f} s: {earlier}")
        states["left unfinished"] += bool(rubbish(folder))
        if number % 2 and number < kills - 1:
            continue
        ended = run(words, cache, folder)
        states["went on"] += "simulated before" in ended.said
        found = differences(whole, folder) + rubbish(folder)
        if ended.status or found:
            failed.append(f"{name} again after {moment:.2f} s: {ended.status} {found}")
        folder = place.fresh("killed", before)
    return Found(kills, failed, ", ".join(f"{k} {v}" for k, v in states.items() if v))


def kept_when_told_to_end(place):
    """SIGTERM in a series says what is kept, and the same command goes on with it."""
    whole, before = place.undisturbed("simulate")
    words = place.commands()["simulate"][0]
    folder = place.fresh("told", before)
    with start(words, place.cache, folder) as process:
        while process.poll() is None and not list(folder.glob(f".out-*/{PARTS}/*.npz")):
            time.sleep(0.005)
        process.send_signal(signal.SIGTERM)
        said, _ = process.communicate()
    failed = []
    if process.returncode != 128 + signal.SIGTERM or "what was simulated is kept" not in said:
        failed.append(f"{process.returncode}: {said}")
    again = run(words, place.cache, folder)
    failed += differences(whole, folder) + rubbish(folder)
    if "simulated before, by a run that had ended early" not in again.said:
        failed.append(again.said)
    return Found(1, failed, said.strip().splitlines()[-1].replace(str(folder), "FOLDER"))


def out_of_room(place, name):
    """Files that may not be as large as a result: one sentence, and the earlier result whole."""
    if name != "simulate":
        place.simulated()
    _, before = place.undisturbed(name)
    folder = place.fresh("limited", before)
    largest = max(x.stat().st_size for x in (folder / "out").iterdir())
    size = min(ROOM, largest // 2)
    limit = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (size, size))
    ended = run(place.commands()[name][0], place.cache, folder, preexec_fn=limit)
    return _refused(place, ended, folder / "out", before / "out", "cannot be written")


def full_disk(place, name):
    """The same on a disk that is full, which root can mount."""
    if name != "simulate":
        place.simulated()
    _, before = place.undisturbed(name)
    with mounted(place.fresh("disk"), "size=600k") as folder:
        shutil.copytree(before / "out", folder / "out")
        free = shutil.disk_usage(folder).free
        (folder / "filler").write_bytes(b"0" * max(0, free - ROOM // 4))
        ended = run(place.commands()[name][0], place.cache, folder)
        return _refused(place, ended, folder / "out", before / "out", "cannot be written")


def read_only(place, name):
    """A disk that can only be read."""
    if name != "simulate":
        place.simulated()
    _, before = place.undisturbed(name)
    with mounted(place.fresh("disk"), "size=4m") as folder:
        shutil.copytree(before / "out", folder / "out")
        subprocess.run(["mount", "-o", "remount,ro", folder], check=True)
        ended = run(place.commands()[name][0], place.cache, folder)
        return _refused(place, ended, folder / "out", before / "out", os.strerror(errno.EROFS))


def _refused(place, ended, folder, before, words):
    """A command that could not write has said so in one sentence."""
    lines = [x for x in ended.said.splitlines() if not x.startswith("warning: compiled programs")]
    failed = [] if ended.status == 2 else [f"exit status {ended.status}: {ended.said[-800:]}"]
    if len(lines) != 1 or words not in lines[0]:
        failed.append(f"said: {ended.said[-800:]}")
    failed += [f"earlier result: {x}" for x in differences(before, folder)]
    parts = [x.parent for x in folder.parent.glob(f".*/{PARTS}/*.npz")]
    kept = {x for folder in parts for x in (folder, folder.parent, folder.parent / MARK)}
    names = [folder.parent / x for x in rubbish(folder.parent)]
    failed += [f"left {x}" for x in names if x not in kept]
    said = lines[-1] if lines else ""
    return Found(1, failed, said.replace(str(place.folder), "FOLDER"))


@contextmanager
def mounted(folder, options):
    """A file system in memory, of so much room."""
    subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", folder], check=True)
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", folder], check=True)


def at_once(place, rounds):
    """Two series with other times and pictures into one folder, over a third one."""
    whole, before = place.undisturbed("simulate")
    words = place.commands()["simulate"][0]
    other = [*words[:-2], "--time", "1,2,3", "--out", "out"]
    folder = place.fresh("other")
    assert run(other, place.cache, folder).status == 0
    others = place.folder / "other-whole"
    shutil.rmtree(others, ignore_errors=True)
    folder.rename(others)
    failed, won = [], Counter()
    for _ in range(rounds):
        folder = place.fresh("both", before)
        both = [start(x, place.cache, folder) for x in (words, other)]
        said = [process.communicate()[0] for process in both]
        for process, text in zip(both, said, strict=True):
            if process.returncode:
                failed.append(f"exit status {process.returncode}: {text[-500:]}")
        found = [differences(x, folder) for x in (whole, others)]
        won["first" if not found[0] else "second" if not found[1] else "neither"] += 1
        if all(found) or rubbish(folder):
            failed.append(f"{found} {rubbish(folder)}")
    return Found(rounds, failed, ", ".join(f"{k} was last {v}" for k, v in won.items()))
