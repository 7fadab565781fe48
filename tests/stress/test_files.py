"""Damaged copies of every format are read or refused in words: no crash, no hang, no flood."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

from abi_operator.demo import write_demo
from abi_operator.files import InputError, ResultWriter, read_result, read_wrf, reading
from abi_operator.nomenclature import SCENARIO

FORMATS = ("wrf", "mcd43", "plume", "result", "prior")
PRIOR = "# what is known\n[aod_550]\nmean = 0.5\nsigma = 0.3\n"
NETCDF = ("wrf", "mcd43", "result")
HUNG = f"ended with {-signal.SIGALRM}:"
HOSTILE = Path(__file__).with_name("hostile.py")
ROOT = Path(__file__).parents[2]
SIZES = {"band": 2, "layer": 3, "level": 4, "y": 4, "x": 3}
TIMES = np.array(["2007-10-23T18:00:00"], "datetime64[ns]")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A small file of every format."""
    folder = tmp_path_factory.mktemp("files")
    demo = write_demo(folder, size=8)
    found = {"wrf": demo.wrf, "mcd43": demo.albedo, "plume": demo.plume}
    found["prior"] = folder / "prior.toml"
    found["prior"].write_text(PRIOR)
    found["result"] = folder / "result.nc"
    write_result(found["result"])
    return found


def write_result(path):
    rng = np.random.default_rng(7)

    def values(*dims):
        return dims, rng.uniform(size=[SIZES[dim] for dim in dims])

    position = {name: values("y", "x") for name in ("latitude", "longitude")}
    fields = {name: values(*v.dims) for name, v in SCENARIO.items() if name not in position}
    fields["quality_flag"] = ("y", "x"), rng.integers(0, 32, (4, 3))
    fields |= {name: values("band", "y", "x") for name in ("reflectance_factor", "brf")}
    scene = xr.Dataset(fields, {"band": ["C01", "C02"], "time": TIMES[0], **position})
    attributes = {"bands": "C01 C02"}
    with ResultWriter(path, times=TIMES, shape=(4, 3), attributes=attributes) as writer:
        writer.write(0, slice(0, 4), scene)


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
        path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
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
    hung = [number for number, said in failed.items() if said.startswith(HUNG)]
    if kind in NETCDF:  # `open_netcdf` tells of it
        assert len(hung) <= 1 + count / 200, hung
        failed = {number: said for number, said in failed.items() if number not in hung}
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
