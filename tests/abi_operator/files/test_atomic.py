"""Output that is there whole or not at all."""

import errno
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import numpy as np
import pytest

from abi_operator.files import InputError, Parts, check_output_folder, output_folder
from abi_operator.files.abandoned import MARK


def test_files_appear_when_the_block_ends(tmp_path):
    target = tmp_path / "deep" / "out"
    with output_folder(target) as folder:
        (folder / "a.nc").write_text("new")
        (folder / "maps").mkdir()
        (folder / "maps" / "b.png").write_text("map")
        assert not target.exists()
        assert folder.stat().st_dev == tmp_path.stat().st_dev
    assert (target / "a.nc").read_text() == "new"
    assert (target / "maps" / "b.png").read_text() == "map"
    assert not folder.exists()


def test_a_link_to_a_folder_is_followed(tmp_path):
    """It may lead to another file system, on which the unfinished files have to be."""
    there = tmp_path / "elsewhere" / "runs"
    there.mkdir(parents=True)
    (tmp_path / "out").symlink_to(there)
    check_output_folder(tmp_path / "out")
    with output_folder(tmp_path / "out") as folder:
        assert folder.parent == there.parent
        (folder / "a").write_text("new")
    assert (there / "a").read_text() == "new" and (tmp_path / "out").is_symlink()


def test_files_of_the_same_name_are_replaced_and_others_stay(tmp_path):
    target = tmp_path / "out"
    target.mkdir()
    (target / "a").write_text("old")
    (target / "b").write_text("old")
    with output_folder(target) as folder:
        (folder / "a").write_text("new")
    assert {f.name: f.read_text() for f in target.iterdir()} == {"a": "new", "b": "old"}
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_nothing_is_left_after_an_error(tmp_path, error):
    with pytest.raises(error), output_folder(tmp_path / "deep" / "out") as folder:
        (folder / "a").write_text("half")
        raise error
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_way_is_named(tmp_path):
    (tmp_path / "out").write_text("file")
    for path in (tmp_path / "out", tmp_path / "out" / "run"):
        with pytest.raises(InputError, match="out is a file where a folder is needed"):
            with output_folder(path):
                pass


def test_a_folder_in_a_file_s_way_is_named_and_nothing_moved(tmp_path):
    (tmp_path / "out" / "b").mkdir(parents=True)
    with pytest.raises(InputError, match="b is a folder where a file is to be"):
        with output_folder(tmp_path / "out") as folder:
            (folder / "a").write_text("new")
            (folder / "b").write_text("new")
    assert not (tmp_path / "out" / "a").exists()


def test_a_parent_that_cannot_be_written_to_is_named(tmp_path, monkeypatch):
    def refuse(**_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(tempfile, "mkdtemp", refuse)  # root may write everywhere
    with pytest.raises(InputError, match=r"cannot be written to \(Permission denied\)"):
        with output_folder(tmp_path / "out"):
            pass


def test_a_relative_path_means_where_we_were(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with output_folder("out") as folder:
        (folder / "a").write_text("new")
        (tmp_path / "elsewhere").mkdir()
        os.chdir(tmp_path / "elsewhere")
    assert (tmp_path / "out" / "a").exists()


def test_only_folders_that_runs_have_left_are_removed(tmp_path):
    """Neither those of a run that is alive nor what only looks like one."""
    (tmp_path / ".out-notes").mkdir()
    (tmp_path / ".out-deadruns").mkdir()
    (tmp_path / ".out-deadruns" / MARK).touch()
    with output_folder(tmp_path / "out") as alive, output_folder(tmp_path / "out") as other:
        (alive / "a").write_text("whole")
        (other / "b").write_text("whole")
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == [".out-notes", "out"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a", "b"]


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_a_full_disk_is_said_in_one_sentence(tmp_path, number):
    words = re.escape(os.strerror(number))
    with pytest.raises(InputError, match=rf"cannot be written \({words}\) after 0.0 MB, with .*;"):
        with output_folder(tmp_path / "out") as folder:
            (folder / "a").write_text("half")
            raise OSError(number, os.strerror(number))
    assert list(tmp_path.iterdir()) == []


def test_other_trouble_stays_what_it_is(tmp_path):
    with pytest.raises(RuntimeError, match="^trouble$"), output_folder(tmp_path / "out"):
        raise RuntimeError("trouble")
    with pytest.raises(FileNotFoundError), output_folder(tmp_path / "out"):
        (tmp_path / "nothing").read_text()


def test_outdated_files_go_when_new_ones_come(tmp_path):
    target = tmp_path / "out"
    target.mkdir()
    for name in ("a", "b", "c"):
        (target / name).write_text("old")
    with pytest.raises(ValueError), output_folder(target, outdated=lambda: ["a", "b"]):
        raise ValueError
    assert len(list(target.iterdir())) == 3
    with output_folder(target, outdated=lambda: ["a", "b"]) as folder:
        (folder / "a").write_text("new")
    assert {f.name: f.read_text() for f in target.iterdir()} == {"a": "new", "c": "old"}


def keep(folder, name):
    Parts(folder).keep(name, {"values": np.arange(3.0)})


def test_parts_of_a_run_that_ended_early_are_found_by_the_next_that_keeps_some(tmp_path):
    """And by no other, and not of a folder whose name only begins alike.

    With what was wrong the same command would end again.
    """
    message = r"^a hole; what was simulated is kept in .*, and a run in which this is mended goes o"
    with pytest.raises(InputError, match=message):
        with output_folder(tmp_path / "out", keeps_parts=True) as folder:
            keep(folder, "one")
            (folder / "result.nc").write_text("half")
            raise InputError("a hole.")
    for name, keeps_parts in (("out", False), ("out-2", True)):
        with output_folder(tmp_path / name, keeps_parts=keeps_parts) as other:
            assert Parts(other).find("one") is None
    assert sorted(x.name for x in folder.iterdir()) == [".abi-operator-parts", MARK]
    with output_folder(tmp_path / "out", keeps_parts=True) as again:
        parts = Parts(again)
        np.testing.assert_array_equal(parts.find("one")["values"], np.arange(3.0))
        assert again == folder and parts.find("two") is None and parts.num_found == 1
    assert sorted(x.name for x in tmp_path.iterdir()) == ["out", "out-2"]
    assert list((tmp_path / "out").iterdir()) == []


def test_a_damaged_part_is_none(tmp_path):
    with output_folder(tmp_path / "out", keeps_parts=True) as folder:
        keep(folder, "one")
        (path,) = folder.glob("*/one.npz")
        whole = path.read_bytes()
        for damaged in (b"", whole[:-9], whole[:150] + b"x" + whole[151:]):
            path.write_bytes(damaged)
            assert Parts(folder).find("one") is None


def test_of_two_runs_with_parts_each_has_its_own(tmp_path):
    with output_folder(tmp_path / "out", keeps_parts=True) as one:
        keep(one, "one")
        with output_folder(tmp_path / "out", keeps_parts=True) as other:
            assert other != one and Parts(other).find("one") is None


def test_of_two_runs_one_moves_after_the_other(tmp_path, monkeypatch):
    """And removes the pictures that the other has just put there."""
    target, moved, replace = tmp_path / "out", threading.Event(), os.replace

    def slowly(source, name):
        replace(source, name)
        moved.set()
        threading.Event().wait(0.1)

    def write(words):
        outdated = lambda: [x.name for x in target.glob("*.png")]  # noqa: E731
        with output_folder(target, outdated=outdated) as folder:
            for name in (f"{words}.png", "result.nc"):
                (folder / name).write_text(words)
            if words == "second":
                moved.wait(10)

    monkeypatch.setattr(os, "replace", slowly)
    second = threading.Thread(target=write, args=("second",))
    second.start()
    write("first")
    second.join()
    found = {x.name: x.read_text() for x in target.iterdir()}
    assert found == {"second.png": "second", "result.nc": "second"}


def test_a_folder_that_cannot_be_written_is_named_before_anything_is_computed(
    tmp_path, monkeypatch
):
    target = tmp_path / "out"
    target.mkdir()

    def refuse(dir):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)  # root may write everywhere
    with pytest.raises(InputError, match=r"out cannot be written to \(Read-only file system\)"):
        with output_folder(target):
            raise AssertionError
    assert list(tmp_path.iterdir()) == [target]
    for path in (target, target / "deeper" / "still"):
        with pytest.raises(InputError, match=r"out cannot be written to \(Read-only file system\)"):
            check_output_folder(path)


def test_a_writer_that_is_killed_at_any_step_leaves_what_another_one_mends(tmp_path):
    root = Path(__file__).parents[3]
    script = root / "benchmarks" / "long_runs_steps.py"
    path = os.pathsep.join([str(root), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, "-P", str(script), str(tmp_path)]
    environment = os.environ | {"PYTHONPATH": path}
    ended = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert ended.returncode == 0, ended.stderr
    tried, wrong = json.loads(ended.stdout)
    assert tried > 20 and not wrong
