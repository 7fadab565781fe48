"""Damaged copies of every format are read or refused in words: no crash, no hang, no flood."""

import json
import os
import subprocess
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from hostile_readers import NETCDF, READERS
from originals import changed, write_originals

from abi_operator.files import (
    InputError,
    Parts,
    note_files,
    noted_files,
    read_result,
    read_wrf,
    reading,
)
from abi_operator.guard.baseline import read_baseline
from abi_operator.sensitivity.commands import read_image
from retrievals.product_file import read_retrieval

FORMATS = ("wrf", "mcd43", "plume", "result", "prior")
FORMATS += ("fires", "observed", "radiance", "imagery", "retrieval", "baseline", "part")
HOSTILE = Path(__file__).with_name("hostile.py")
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A small file of every format."""
    folder = tmp_path_factory.mktemp("files")
    return write_originals(folder)


def verdicts(kind, file, first, count):
    """What became of each copy; one that ended the process has failed."""
    found, end = {}, first + count
    while first < end:
        command = [
            sys.executable,
            "-P",
            str(HOSTILE),
            kind,
            str(file),
            str(first),
            str(end - first),
        ]
        path = os.pathsep.join(
            [str(ROOT), str(HOSTILE.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
        )
        environment = os.environ | {"PYTHONPATH": path, "OMP_NUM_THREADS": "1"}
        run = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=500)
        for line in run.stdout.splitlines():
            number, verdict, said = json.loads(line)
            found[number] = verdict, said
            first = number + 1
        ended = [n for n, (verdict, _) in found.items() if verdict == "begun"]
        for number in ended:
            found[number] = "failed", f"ended with {run.returncode}: {run.stderr[-500:]}"
        assert found, run.stderr
    return found


def assert_in_words(kind, file, first, count):
    found = verdicts(kind, file, first, count)
    assert len(found) == count
    failed = {number: said for number, (verdict, said) in found.items() if verdict == "failed"}
    assert not failed, "\n".join(f"{number}: {said}" for number, said in failed.items())
    refused = sum(verdict == "refused" for verdict, _ in found.values())
    assert refused > count / 5  # the damage is seen


@pytest.mark.parametrize("kind", ["wrf", "plume"])
def test_damaged_files_are_refused_in_words(kind, files):
    assert_in_words(kind, files[kind], 0, 40)


@pytest.mark.slow
@pytest.mark.parametrize("kind", FORMATS)
def test_hundreds_of_damaged_files_are_refused_in_words(kind, files, scale):
    assert_in_words(kind, files[kind], 0, max(50, int(scale * 600)))


def emptied(path, dimension, target):
    """A copy of a file of which a dimension is 0 long."""
    with netCDF4.Dataset(path) as file, netCDF4.Dataset(target, "w") as copy:
        copy.setncatts({name: file.getncattr(name) for name in file.ncattrs()})
        for name, dim in file.dimensions.items():
            copy.createDimension(name, None if name == dimension else dim.size)
        for name, array in file.variables.items():
            packed = {x: array.getncattr(x) for x in array.ncattrs()}
            fill = packed.pop("_FillValue", None)
            ours = copy.createVariable(name, array.dtype, array.dimensions, fill_value=fill)
            ours.setncatts(packed)
            array.set_auto_maskandscale(False)
            ours.set_auto_maskandscale(False)
            if dimension not in array.dimensions:
                ours[...] = array[...]
    return target


@pytest.mark.parametrize("kind", NETCDF)
def test_files_without_any_value_are_refused_in_words(kind, files):
    """Whichever dimension is empty: what is read all the same has values, and right ones."""
    original = files[kind]
    with netCDF4.Dataset(original) as file:
        dimensions = list(file.dimensions)
    refused = []
    for dimension in dimensions:
        copy = emptied(original, dimension, original.with_name(f"empty_{dimension}.nc"))
        try:
            for read in READERS[kind](copy):
                assert np.size(read.values) and not read.nonsense, (dimension, read.name)
        except InputError as error:
            refused.append(dimension)
            assert copy.name in str(error), error
        finally:
            copy.unlink()
    assert refused, dimensions


def test_numbers_that_are_unpacked_by_words_are_refused(files, tmp_path):
    path = tmp_path / "model.nc"
    path.write_bytes(files["wrf"].read_bytes())
    with netCDF4.Dataset(path, "a") as file:
        file["T"].setncattr("scale_factor", "one")
    with pytest.raises(InputError, match="scale_factor of T in .* is 'one', which is no number"):
        read_wrf(path, 0)


def test_what_cannot_be_read_later_is_told(files, tmp_path):
    path = tmp_path / "result.nc"
    data = bytearray(files["result"].read_bytes())
    with netCDF4.Dataset(files["result"]) as file:
        packed = file["brf"].filters()["zlib"]
    assert packed  # so that damage to the values is seen
    with read_result(files["result"]) as result:
        result.load()
    for start in range(len(data) // 4, len(data), 97):
        data[start] ^= 255
    path.write_bytes(data)
    with pytest.raises(InputError, match="result.nc cannot be read"):
        with reading(str(path)), read_result(path) as result:
            result.load()
    with pytest.raises(RuntimeError, match="another"):
        with reading("a file"):
            raise RuntimeError("another")


def test_every_format_has_its_damaged_copies(files):
    assert set(files) == set(READERS) == set(FORMATS)
    assert NETCDF == tuple(kind for kind in READERS if files[kind].read_bytes()[:4] == b"\x89HDF")


@pytest.mark.parametrize("kind", FORMATS)
def test_the_originals_are_read(kind, files):
    assert not [read.nonsense for read in READERS[kind](files[kind]) if read.nonsense]


def test_names_in_a_result_lead_nowhere_else(files, tmp_path):
    """A run replaces the pictures that the result before it names: those of its own folder."""
    folder = tmp_path / "out"
    (folder / "sub").mkdir(parents=True)
    for place in (tmp_path / "a.png", folder / "sub" / "b.png", folder / "c.png"):
        place.touch()
    names = ["../a.png", str(tmp_path / "a.png"), "sub/b.png", "./c.png", "..", "", "c.png"]
    (folder / "result.nc").write_bytes(files["result"].read_bytes())
    note_files(folder / "result.nc", names)
    assert noted_files(folder / "result.nc") == ["c.png"]


def test_parts_that_are_not_as_they_were_kept_are_computed_again(tmp_path):
    parts, kept = Parts(tmp_path), {"brf": np.ones(3), "flag": np.arange(3)}
    parts.keep("one", kept)
    (path,) = tmp_path.rglob("*.npz")
    assert parts.find("one").keys() == kept.keys()
    whole = path.read_bytes()
    for place in range(8, len(whole)):
        if whole[place : place + 4] == b"PK\1\2":
            break
    # A method of compression that there is none of, and one that is not installed everywhere.
    for method in (b"\x63\0", b"\x0c\0"):
        path.write_bytes(whole[: place + 10] + method + whole[place + 12 :])
        assert parts.find("one") is None
    np.savez(path, brf=kept["brf"], names_of_arrays=["brf", "flag"])  # an array is gone
    assert parts.find("one") is None
    with path.open("wb") as file:  # code would run
        np.savez(file, brf=np.array([Ran()], object), names_of_arrays=["brf"])
    assert parts.find("one") is None and not Ran.ran


class Ran:
    """What runs code of its choice when it is unpickled."""

    ran = False

    def __reduce__(self):
        return setattr, (Ran, "ran", True)


def test_an_image_that_cannot_be_read_is_told(files, tmp_path):
    data = bytearray(files["result"].read_bytes())
    for start in range(len(data) // 4, len(data), 97):
        data[start] ^= 255
    path = tmp_path / "result.nc"
    path.write_bytes(data)
    with pytest.raises(InputError, match="result.nc cannot be read"):
        read_image(path, 0)


def infinite(file):
    file["jacobian"][0, 0, 0] = np.inf


def listed(file):
    file.settings = "[1]"


def nested(file):
    file.requested_bands = 100_000 * "["


def packed(file):
    file["value"].add_offset = "one"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (infinite, "jacobian in .* is infinite"),  # within its own tolerance of any number
        (listed, "settings that are no names"),
        (nested, "is no baseline"),
        (packed, "add_offset of value in .* is no number"),
        (lambda file: file.renameDimension("input", "other"), "along"),
    ],
)
def test_baselines_that_cannot_be_compared_are_refused(change, words, files, tmp_path):
    path = changed(files["baseline"], tmp_path / "baseline.nc", change)
    with pytest.raises(InputError, match=words):
        read_baseline(path)


def too_deep(file):
    file["aod_550"][0] = 1e30


def no_error(file):
    file["aod_550_sigma"][0] = np.nan


def other_bands(file):
    file.bands = "C01 C05"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (too_deep, r"aod_550 in .* is 1e\+30 at .* pixels whose result_code is success"),
        (no_error, "aod_550_sigma in .* is nan"),
        (other_bands, "does not tell of its bands"),
        (lambda file: file.delncattr("bands"), "does not tell of its bands"),
        (lambda file: file.setncattr("kind", "fog"), "retrieval of 'fog', which is none"),
        (lambda file: file.setncattr("aod_limit", "none"), "aod_limit in .* is no limit"),
    ],
)
def test_retrievals_that_cannot_be_scored_are_refused(change, words, files, tmp_path):
    path = changed(files["retrieval"], tmp_path / "retrieval.nc", change)
    with pytest.raises(InputError, match=words):
        read_retrieval(path)


def test_a_retrieval_with_half_of_its_intervals_is_refused(files, tmp_path):
    with read_retrieval(files["retrieval"]) as whole:
        whole.drop_vars("aod_550_upper_95").to_netcdf(tmp_path / "retrieval.nc")
    with pytest.raises(InputError, match="has no aod_550_upper_95"):
        read_retrieval(tmp_path / "retrieval.nc")


def darker_than_dark(file):
    file["CMI"][5, 5] = -1e30


@pytest.mark.parametrize(
    ("kind", "change", "words"),
    [
        ("imagery", darker_than_dark, "less than noise leaves of the dark"),
        ("imagery", lambda file: file["band_id"].__setitem__(0, -2), "band_id in .* above 0"),
        ("radiance", lambda file: file["esun"].__setitem__(..., np.nan), "esun in .* is .nan."),
    ],
)
def test_observations_that_are_none_are_refused(kind, change, words, files):
    path = changed(files[kind], files[kind].with_name("observed-otherwise.nc"), change)
    with pytest.raises(InputError, match=words):
        list(READERS[kind](path))
