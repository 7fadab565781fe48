"""Reads damaged copies of a file, in a process of its own with a limit on memory and time.

    python hostile.py FORMAT FILE FIRST COUNT

One line for each copy, JSON: its number, "read", "refused" or "failed", and what was said. A copy
is made from its number alone. `test_files.py` starts this, and goes on behind one that ended it.
"""

import faulthandler
import json
import resource
import signal
import sys
import traceback
import warnings
from pathlib import Path

import netCDF4
import numpy as np
from hostile_readers import NETCDF, READERS

from abi_operator.files import InputError, opening

SEED = 7
MEMORY = 3 << 30  # of addresses: JAX and its threads take most of it [byte]
SECONDS = 20  # a copy may take
PATIENCE = 5.0  # with its opening [s]


def damaged(original, number, kind):
    """Bytes of a file after an accident, or a file that another program might have written."""
    rng = np.random.default_rng([SEED, number])
    data = bytearray(original)
    place = int(rng.integers(len(data)))
    # Heads and tables are at the beginning, where most is decided.
    if rng.random() < 0.5:
        place = int(len(data) * rng.random() ** 4)
    length = int(min(len(data) - place, 2 ** rng.integers(1, 13)))
    accident = rng.integers(7)
    if accident == 0:
        return bytes(data[:place])
    if accident == 1:
        for _ in range(int(2 ** rng.integers(0, 8))):
            data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
    elif accident == 2:
        data[place : place + length] = bytes([rng.choice([0, 255])]) * length
    elif accident == 3:
        data[place : place + length] = rng.bytes(length)
    elif accident == 4:
        del data[place : place + length]
    elif accident == 5:
        data[place:place] = data[: len(data) // 2]
    else:
        data[place] = int(rng.integers(256))
    return bytes(data)


def rewritten(path, number):
    """Change a variable, an attribute or a name of a NetCDF file, as its library lets one do."""
    rng = np.random.default_rng([SEED, 1, number])
    with netCDF4.Dataset(path, "a") as file:
        name = str(rng.choice(list(file.variables)))
        array = file[name]
        change = rng.integers(6)
        if change == 0:
            file.renameVariable(name, "X" + name)
        elif change == 1:
            dimension = str(rng.choice(list(file.dimensions)))
            file.renameDimension(dimension, "x_" + dimension)
        elif change == 2 and array.ncattrs():
            array.delncattr(str(rng.choice(array.ncattrs())))
        elif change == 3:
            array.setncattr(str(rng.choice(["units", "scale_factor", "add_offset"])), "no number")
        elif change == 4 and array.size and np.issubdtype(array.dtype, np.floating):
            array.set_auto_maskandscale(False)
            values = array[...]
            flat = np.array(values).reshape(-1)
            flat[rng.integers(flat.size)] = rng.choice([np.nan, np.inf, -1e30, 1e30])
            array[...] = flat.reshape(np.shape(values))
        elif file.ncattrs():
            file.setncattr(str(rng.choice(file.ncattrs())), np.float64(rng.normal()))


def one(kind, original, number, path):
    """What a reader makes of one copy."""
    path.write_bytes(
        original if number % 4 == 0 and kind in NETCDF else damaged(original, number, kind)
    )
    if number % 4 == 0 and kind in NETCDF:
        rewritten(path, number)
    try:
        nonsense = "; ".join(filter(None, (read.nonsense for read in READERS[kind](path))))
    except InputError as error:
        said = str(error)
        return ("refused", said) if said.strip() else ("failed", "an error without words")
    except BaseException as error:
        last = traceback.extract_tb(error.__traceback__)
        ours = [f"{Path(x.filename).name}:{x.lineno}" for x in last if "abi_operator" in x.filename]
        return "failed", f"{type(error).__name__}: {error} at {' '.join(ours)}"
    return ("failed", f"read without a word: {nonsense}") if nonsense else ("read", "")


def main():
    kind, file, first, count = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    faulthandler.enable()
    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    opening.PATIENCE = PATIENCE
    original = file.read_bytes()
    for number in range(first, first + count):
        print(json.dumps([number, "begun", ""]), flush=True)
        path = file.with_name(f"damaged-{number}-{file.name}")
        signal.alarm(SECONDS)  # ends the process, also inside a library
        verdict, said = one(kind, original, number, path)
        signal.alarm(0)
        path.unlink()
        print(json.dumps([number, verdict, said]), flush=True)
        opening.leave_where_the_library_is_lost(0)  # which opens no further copy


if __name__ == "__main__":
    main()
