"""How many bytes a NetCDF file needs by its own header, and whether it has them.

The library that reads the classic formats gives zeros for what lies behind a file's end, so that a
copy that broke off looks like calm, clear air. HDF5's own library refuses one, in words about
something else. Layouts are those of the NetCDF classic format specification (CDF-1, CDF-2, CDF-5;
appendix B of the NetCDF user's guide) and of the HDF5 file format specification, version 3.0
(II.A, superblocks 0 to 3).
"""

import struct
from math import prod
from os import PathLike
from pathlib import Path
from typing import BinaryIO

from .errors import InputError

# Beginning of a file that is none of NetCDF's, and what it is.
_OTHER_FORMATS = {
    b"\x0e\x03\x13\x01": "an HDF4 file",
    b"GRIB": "a GRIB file",
    b"\x1f\x8b": "compressed by gzip",
    b"PK\x03\x04": "a ZIP archive",
    b"II*\0": "a TIFF picture",
    b"MM\0*": "a TIFF picture",
    b"\x89PNG": "a PNG picture",
}

# Size of a value by its number of type in the classic formats: byte, char, short, int, float,
# double, ubyte, ushort, uint, int64, uint64. [byte]
_TYPE_SIZES = dict(enumerate((1, 1, 2, 4, 4, 8, 1, 2, 4, 8, 8), start=1))
_DIMENSIONS, _VARIABLES, _ATTRIBUTES = 10, 11, 12
_UNLIMITED = 0

_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
# Bytes before the addresses of a superblock, by its version, and which address is the file's end.
_SUPERBLOCKS = {0: (24, 2), 1: (28, 2), 2: (12, 2), 3: (12, 2)}


def check_complete(path: str | PathLike[str], advice: str) -> None:
    """Raise `InputError` for a file that ends before its header says, or is of another format.

    A file of no known format passes: whoever reads it will say so.

    Parameters
    ----------
    path
        A file.
    advice
        What to give in place of a file of another format.
    """
    with Path(path).open("rb") as file:
        size = file.seek(0, 2)
        file.seek(0)
        start = file.read(8)
        for magic, words in _OTHER_FORMATS.items():
            if start.startswith(magic):
                raise InputError(f"{path} is {words}, not NetCDF; {advice}.")
        if not size:
            raise InputError(f"{path} is empty; copy it again.")
        try:
            needed = _classic_size(file, start[3]) if _is_classic(start) else _hdf5_size(file, size)
        except EOFError:
            raise InputError(
                f"{path} ends after {size} bytes, within its own header; copy it again."
            ) from None
    if needed is not None and size < needed:
        raise InputError(
            f"{path} ends after {size} of the {needed} bytes that its header tells of; copy it "
            "again, or wait until it is written."
        )


def _is_classic(start: bytes) -> bool:
    return start[:3] == b"CDF" and start[3:4] in (b"\x01", b"\x02", b"\x05")


class _Header:
    """Numbers of a classic header, one after the other.

    Parameters
    ----------
    file
        Positioned behind the magic number.
    version
        1 (classic), 2 (64-bit offset) or 5 (64-bit data): how wide counts and offsets are.
    """

    def __init__(self, file: BinaryIO, version: int):
        self._file = file
        self._count = ">Q" if version == 5 else ">I"
        self._offset = ">I" if version == 1 else ">Q"

    def _number(self, layout: str) -> int:
        data = self._file.read(struct.calcsize(layout))
        if len(data) < struct.calcsize(layout):
            raise EOFError
        return struct.unpack(layout, data)[0]

    def tag(self) -> int:
        """Number of a type, or of what kind of list follows. [-]"""
        return self._number(">I")

    def count(self) -> int:
        """How many of something, or which."""
        return self._number(self._count)

    def offset(self) -> int:
        """Where data begin. [byte]"""
        return self._number(self._offset)

    def skip(self, num_bytes: int) -> None:
        """Pass over so many bytes and what fills them up to a multiple of four."""
        self._file.seek(_padded(num_bytes), 1)

    def list_length(self, kind: int) -> int:
        """Length of the list that begins here; `KeyError` where it is of another kind. [-]"""
        tag, length = self.tag(), self.count()
        if tag != kind and (tag or length):
            raise KeyError(tag)
        return length

    def skip_name(self) -> None:
        """Pass over a name."""
        self.skip(self.count())

    def skip_attributes(self) -> None:
        """Pass over a list of attributes; a type that is not known ends it with `KeyError`."""
        for _ in range(self.list_length(_ATTRIBUTES)):
            self.skip_name()
            size = _TYPE_SIZES[self.tag()]
            self.skip(size * self.count())


def _classic_size(file: BinaryIO, version: int) -> int | None:
    """Bytes that a classic file needs; None where the header is none. [byte]

    Sizes are derived from dimensions, since ``vsize`` is too narrow for large variables. What fills
    the last variable up to a multiple of four is not needed, and the records of a single record
    variable are not filled up.
    """
    file.seek(4)
    header = _Header(file, version)
    num_records = header.count()
    if num_records == (1 << 64 if version == 5 else 1 << 32) - 1:  # streaming: not known
        num_records = 0
    try:
        lengths = []
        for _ in range(header.list_length(_DIMENSIONS)):
            header.skip_name()
            lengths.append(header.count())
        header.skip_attributes()
        ends, records = [], []
        for _ in range(header.list_length(_VARIABLES)):
            header.skip_name()
            shape = [lengths[header.count()] for _ in range(header.count())]
            header.skip_attributes()
            size = _TYPE_SIZES[header.tag()]
            header.count()  # vsize
            begin = header.offset()
            if shape and shape[0] == _UNLIMITED:
                records.append((begin, size * prod(shape[1:])))
            else:
                ends.append(begin + size * prod(shape))
        ends.append(file.tell())
    except (KeyError, IndexError):
        return None
    if num_records and records:
        single = len(records) == 1
        stride = records[0][1] if single else sum(_padded(size) for _, size in records)
        ends += [begin + (num_records - 1) * stride + size for begin, size in records]
    return max(ends)


def _padded(size: int) -> int:
    return -(-size // 4) * 4


def _hdf5_size(file: BinaryIO, size: int) -> int | None:
    """Bytes that an HDF5 file needs; None where the file is none. [byte]

    The superblock is at the beginning of the file or, behind a block of the user's, at byte 512,
    1024, 2048 and so on.
    """
    start = 0
    while start < size:
        file.seek(start)
        if file.read(8) == _HDF5_SIGNATURE:
            break
        start = 2 * start or 512
    else:
        return None
    fields = file.read(64)
    if len(fields) < 64:
        raise EOFError
    if fields[0] not in _SUPERBLOCKS:
        return None
    first, which = _SUPERBLOCKS[fields[0]]
    width = fields[1] if fields[0] >= 2 else fields[5]
    if width not in (2, 4, 8):
        return None
    position = first - len(_HDF5_SIGNATURE) + which * width
    address = fields[position : position + width]
    return None if address == b"\xff" * width else int.from_bytes(address, "little")
