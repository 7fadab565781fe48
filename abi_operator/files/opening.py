"""Opening a NetCDF file in a thread of its own, which is not waited for endlessly.

Within a file damaged just so (one of 600 damaged copies of WRF's output in `tests/stress`, the
485th) the HDF5 library looks for a name for ever. Nothing stops it there but the end of the
process, and until then xarray opens no other file: `open_netcdf` says so of each that is asked for.
A process that ends in the usual way tears the library down under its search and crashes, its work
done: the commands leave at once.
"""

import os
import sys
from os import PathLike
from pathlib import Path
from threading import Thread
from typing import Any

import xarray as xr

from .errors import InputError

PATIENCE = 120.0
"""How long a file may take to be opened, without its values. [s]"""

_late: dict[str, Thread] = {}


def never_opened() -> list[str]:
    """Files that are still being opened, though nobody waits for them any more."""
    return [path for path, thread in _late.items() if thread.is_alive()]


def leave_where_the_library_is_lost(code: int) -> None:
    """End this process here and now, if a file was never opened."""
    if never_opened():
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def opened_in_time(path: str | PathLike[str], **how: Any) -> xr.Dataset:
    """Open a NetCDF file lazily, with times left as numbers.

    Parameters
    ----------
    path
        The file.
    how
        Further arguments of `xarray.open_dataset`.

    Raises
    ------
    InputError
        Where that takes longer than `PATIENCE`, or did of a file before.
    """
    for late in never_opened():
        raise InputError(
            f"{path} cannot be opened: the NetCDF library is still at {late}, in which it finds no "
            "end; leave that file out, and begin again."
        )
    found: list[xr.Dataset | BaseException] = []

    def open_it() -> None:
        try:
            found.append(
                xr.open_dataset(
                    Path(path).absolute(),
                    engine="netcdf4",
                    decode_times=False,
                    decode_timedelta=False,
                    decode_coords=False,
                    **how,
                )
            )
        except BaseException as error:  # raised again where it is waited for
            found.append(error)

    thread = Thread(target=open_it, name="abi-operator-open", daemon=True)
    thread.start()
    thread.join(PATIENCE)
    if not found:
        _late[str(path)] = thread
        raise InputError(
            f"{path} does not open in {PATIENCE:g} s: it is damaged, or its disk does not answer; "
            "copy it again."
        )
    (result,) = found
    if isinstance(result, BaseException):
        raise result
    return result
