"""Files that end before their header says are refused, in every format, before a value is read."""

import struct

import netCDF4
import numpy as np
import pytest

from abi_operator.files import InputError, read_mcd43a1, read_wrf, wrf_coordinates
from abi_operator.files.completeness import check_complete

CLASSIC = ("NETCDF3_CLASSIC", "NETCDF3_64BIT_OFFSET", "NETCDF3_64BIT_DATA")
HDF5 = ("NETCDF4", "NETCDF4_CLASSIC")
KINDS = ([], ["i2"], ["S1"], ["f4"], ["i2", "f4"], ["f4", "S1"], ["f8", "i2", "S1"])


@pytest.fixture
def write(tmp_path):
    """A function that writes three columns of records of these types, and returns the path."""

    def write(form, kinds, num_records, fixed=True):
        path = tmp_path / "file.nc"
        with netCDF4.Dataset(path, "w", format=form) as file:
            file.setncatts({"TITLE": "odd", "number": np.int32(3), "some": np.arange(3.0)})
            for name, length in {"record": None, "x": 3, "y": 5}.items():
                file.createDimension(name, length)
            if fixed:
                file.createVariable("fixed", "i2", ("y",))[:] = 7
            for index, kind in enumerate(kinds):
                variable = file.createVariable(f"record{index}", kind, ("record", "x"))
                variable.units = "m"
                if num_records:
                    values = np.full((num_records, 3), b"a" if kind == "S1" else 1)
                    variable[:num_records] = values.astype(kind)
        return path

    return write


def cut(path, num_bytes):
    """Take so many bytes off a file's end."""
    path.write_bytes(path.read_bytes()[:-num_bytes])


@pytest.mark.parametrize("form", [*CLASSIC, *HDF5])
@pytest.mark.parametrize("fixed", [True, False])
@pytest.mark.parametrize("num_records", [0, 1, 4])
def test_whole_files_pass_and_four_bytes_are_missed(write, form, fixed, num_records):
    """Where two variables share records all are filled up to four bytes; a lone one is not."""
    for kinds in KINDS:
        path = write(form, kinds, num_records, fixed)
        size = path.stat().st_size
        check_complete(path, "")
        cut(path, 4)
        with pytest.raises(InputError, match=f"file.nc ends after {size - 4} "):
            check_complete(path, "")


@pytest.mark.parametrize("form", CLASSIC)
def test_not_one_byte_of_a_value_may_be_missing(write, form):
    path = write(form, ["f4"], 4)
    size = path.stat().st_size
    cut(path, 1)
    message = f"ends after {size - 1} of the {size} bytes that its header tells of; copy it again"
    with pytest.raises(InputError, match=message):
        check_complete(path, "")


def test_a_variable_larger_than_its_vsize_can_say(tmp_path):
    """5 GB of float32: vsize is 2^32 - 1 and only the dimensions tell; the file is a hole."""
    names = [struct.pack(">I4s", 4, name) for name in (b"rows", b"cols", b"data")]
    lengths = [struct.pack(">I", length) for length in (50_000, 25_000)]
    nothing = struct.pack(">II", 0, 0)
    dims = struct.pack(">II", 10, 2) + names[0] + lengths[0] + names[1] + lengths[1]
    variable = names[2] + struct.pack(">III", 2, 0, 1) + nothing
    head = b"CDF\x02" + struct.pack(">I", 0) + dims + nothing + struct.pack(">II", 11, 1) + variable
    begin = len(head) + 16
    head += struct.pack(">IIQ", 5, 2**32 - 1, begin)
    path = tmp_path / "large.nc"
    path.write_bytes(head)
    with path.open("r+b") as file:
        file.truncate(begin + 4 * 50_000 * 25_000)
        check_complete(path, "")
        file.truncate(begin + 2**32)
    with pytest.raises(InputError, match=f"of the {begin + 5_000_000_000} bytes"):
        check_complete(path, "")


@pytest.mark.parametrize("version", [0, 1, 2, 3])
def test_every_superblock_of_hdf5_tells_the_end(tmp_path, version):
    """It is the third address, behind 24, 28, 12 and 12 bytes."""
    head = bytes([version, 8, 8, 0]) if version >= 2 else bytes([version, 0, 0, 0, 0, 8, 8, 0])
    head = (b"\x89HDF\r\n\x1a\n" + head).ljust({0: 24, 1: 28, 2: 12, 3: 12}[version], b"\0")
    head += struct.pack("<QQQQ", 0, 2**64 - 1, 1512, 96)
    path = tmp_path / "file.h5"
    for user_block in (b"", b"a block of the user's".ljust(1024)):
        path.write_bytes((user_block + head).ljust(1512, b"\0"))
        check_complete(path, "")
        cut(path, 10)
        with pytest.raises(InputError, match="file.h5 ends after 1502 of the 1512 bytes"):
            check_complete(path, "")


@pytest.mark.parametrize("share", [0.9, 0.5, 0.02])
@pytest.mark.parametrize("read", [wrf_coordinates, lambda path: read_wrf(path, 0)])
def test_a_wrfout_file_that_broke_off_is_refused(write_wrf_twin, read, share):
    path = write_wrf_twin()
    cut(path, round((1 - share) * path.stat().st_size))
    with pytest.raises(InputError, match="wrfout_d01_2007-10-23_18:00:00 ends after .*copy it"):
        read(path)


def test_an_albedo_file_that_broke_off_is_refused(write_albedo_twin):
    path = write_albedo_twin({"Band3": np.full((2, 2, 3, 3), 100, np.int16)})
    cut(path, 100)
    with pytest.raises(InputError, match=r"MCD43A1.nc ends after \d+ of the \d+ bytes"):
        read_mcd43a1(path, ["C01"])


def test_an_empty_file_is_called_empty(tmp_path):
    (tmp_path / "wrfout").touch()
    with pytest.raises(InputError, match="wrfout is empty; copy it again"):
        wrf_coordinates(tmp_path / "wrfout")


@pytest.mark.parametrize("version", [b"\x01", b"\x02", b"\x05"])
def test_a_header_of_nonsense_is_left_to_the_library(tmp_path, version):
    path = tmp_path / "file.nc"
    path.write_bytes(b"CDF" + version + b"\x7f" * 1000)
    check_complete(path, "")
    with pytest.raises(InputError, match="cannot be read as NetCDF"):
        wrf_coordinates(path)


@pytest.mark.parametrize(
    ("start", "words"),
    [
        (b"\x0e\x03\x13\x01", "an HDF4 file"),
        (b"GRIB\0\0\0\2", "a GRIB file"),
        (b"\x1f\x8b\x08", "compressed by gzip"),
        (b"II*\0", "a TIFF picture"),
    ],
)
def test_other_formats_are_called_by_name(tmp_path, start, words):
    path = tmp_path / "file"
    path.write_bytes(start.ljust(2000, b"\0"))
    with pytest.raises(InputError, match=f"file is {words}, not NetCDF; give a WRF output file"):
        read_wrf(path, 0)
    with pytest.raises(InputError, match=f"{words}, not NetCDF; request MCD43A1 from AppEEARS"):
        read_mcd43a1(path, ["C01"])
