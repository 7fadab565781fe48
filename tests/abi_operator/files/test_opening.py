"""A file in which the library finds no end."""

from threading import Event

import pytest
import typer
import xarray as xr

from abi_operator.commands import one_sentence
from abi_operator.files import InputError, opening
from abi_operator.files.netcdf import open_netcdf


def test_nobody_waits_endlessly(tmp_path, monkeypatch):
    path, other = tmp_path / "never.nc", tmp_path / "other.nc"
    for each in (path, other):
        xr.Dataset({"x": ("y", [1.0, 2.0])}).to_netcdf(each)
    go_on, ended, real = Event(), Event(), xr.open_dataset

    def lost(*given, **how):
        go_on.wait()
        ended.set()
        raise OSError("too late")

    monkeypatch.setattr(opening, "PATIENCE", 0.01)
    monkeypatch.setattr(xr, "open_dataset", lost)
    with pytest.raises(InputError, match=r"never.nc does not open in 0.01 s: it is damaged"):
        open_netcdf(path)
    assert opening.never_opened() == [str(path)]
    left = []
    monkeypatch.setattr(opening.os, "_exit", left.append)
    with pytest.raises(typer.Exit), one_sentence():
        open_netcdf(path)
    assert left == [2]  # and not through the library's end, under its search
    monkeypatch.setattr(xr, "open_dataset", real)
    monkeypatch.setattr(opening, "PATIENCE", 60.0)
    with pytest.raises(InputError, match=r"other.nc cannot be opened: .* still at .*never.nc"):
        open_netcdf(other)
    go_on.set()
    ended.wait()
    for thread in opening._late.values():
        thread.join()
    assert opening.never_opened() == []
    with pytest.raises(typer.Exit), one_sentence():
        open_netcdf(tmp_path / "none.nc")
    assert left == [2]
    with open_netcdf(other) as dataset:
        assert dataset["x"].values.tolist() == [1.0, 2.0]


def test_what_the_library_says_is_passed_on(tmp_path, monkeypatch):
    path = tmp_path / "file.nc"
    xr.Dataset({"x": ("y", [1.0, 2.0])}).to_netcdf(path)

    def broken(*given, **how):
        raise TypeError("no attribute")

    monkeypatch.setattr(xr, "open_dataset", broken)
    with pytest.raises(InputError, match=r"file.nc cannot be read as NetCDF \(no attribute\)"):
        open_netcdf(path)
