"""Inputs of the long runs, commands in processes of their own, and what tells their results apart.

`long_runs.py` and `tests/stress/test_long_runs.py` use it. A command is the package's own as its
entry points give it, whether or not it is installed: `retrieve` and `score` are there, too.
"""

import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import netCDF4
import numpy as np

from abi_operator.demo import write_demo

ROOT = Path(__file__).resolve().parents[1]

# Starts the command line with the commands of the retrievals, killed where it is told to be.
_COMMAND = """
import sys
sys.argv[0] = "abi-operator"
from importlib.metadata import EntryPoint
from abi_operator import cli
entries = [
    EntryPoint(name, f"retrievals.commands:{name}", cli.COMMANDS) for name in ("retrieve", "score")
]
cli.entry_points = lambda group, name=None: [x for x in entries if name in (None, x.name)]
cli.main("abi-operator")
"""

_STAMP = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ")


class Ended(NamedTuple):
    """How a command ended: exit status, what it said, and its time on processors. [s]"""

    status: int
    said: str
    seconds: float


def write_series(folder, size, hours):
    """The demonstration's inputs at several hours of its day, and options to simulate them."""
    demo = write_demo(folder, size=size)
    models = []
    for hour in hours:
        stamp = f"2007-10-23_{hour:02d}:30:00"
        models.append(folder / f"wrfout_d01_{stamp}")
        shutil.copy(demo.wrf, models[-1])
        with netCDF4.Dataset(models[-1], "a") as file:
            file["Times"][0] = np.frombuffer(stamp.encode(), "S1")
    options = ["--albedo", demo.albedo, "--ocean-albedo", "0.03", "--plume", demo.plume]
    return [*models, *options, "--bands", "C01,C02,C03", "--gases", "none"]


def start(arguments, cache, folder, **keywords):
    """A command that has been started in a folder; compiled programs are kept in another."""
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(paths),
        "JAX_COMPILATION_CACHE_DIR": str(cache),
    }
    return subprocess.Popen(
        [sys.executable, "-P", "-c", _COMMAND, *map(str, arguments)],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        **keywords,
    )


def run(arguments, cache, folder, killed_after=None, **keywords):
    """Run a command to its end, or kill it when it has had so many seconds of a processor."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with start(arguments, cache, folder, **keywords) as process:
        while killed_after is not None and process.poll() is None:
            if _processor_time(process.pid) > killed_after:
                process.send_signal(signal.SIGKILL)
                break
            time.sleep(0.002)
        said, _ = process.communicate()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Ended(process.returncode, said, seconds)


def _processor_time(process):
    """What a process has had of processors. [s]"""
    try:
        words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:  # it has ended
        return 0.0
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def differences(folder, other):
    """What differs between two folders of results, in words; nothing where they are the same.

    NetCDF files are compared by the bytes of their variables and by their attributes, but for the
    time at which ``history`` says that they were written; all other files byte by byte.
    """
    names, others = (
        {str(x.relative_to(y)) for x in y.rglob("*") if x.is_file()} for y in (folder, other)
    )
    found = [f"{name} is in one only" for name in sorted(names ^ others)]
    for name in sorted(names & others):
        if name.endswith(".nc"):
            found += [f"{name}: {x}" for x in _netcdf_differences(folder / name, other / name)]
        elif (folder / name).read_bytes() != (other / name).read_bytes():
            found.append(f"{name} has other bytes")
    return found


def _netcdf_differences(path, other):
    described = []
    for place in (path, other):
        with netCDF4.Dataset(place) as file:
            file.set_auto_maskandscale(False)
            described.append(
                {"dimensions": {k: len(v) for k, v in file.dimensions.items()}}
                | {f"attribute {k}": _attribute(file, k) for k in file.ncattrs()}
                | {k: _described(v) for k, v in file.variables.items()}
            )
    one, two = described
    return [name for name in sorted(one.keys() | two.keys()) if one.get(name) != two.get(name)]


def _described(array):
    values = np.asarray(array[...])
    content = values.tolist() if values.dtype.hasobject else values.tobytes()
    attributes = {name: _attribute(array, name) for name in array.ncattrs()}
    return array.dimensions, str(array.dtype), content, attributes


def _attribute(place, name):
    value = place.getncattr(name)
    if name == "history":
        value = _STAMP.sub("then", value)
    return repr((str(np.asarray(value).dtype), np.asarray(value).tolist()))  # no NaN is another


def rubbish(folder):
    """Names of hidden files and folders."""
    return sorted(str(x.relative_to(folder)) for x in folder.rglob(".*"))
