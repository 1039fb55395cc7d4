"""Whole or not at all: files and folders that a fault interrupts leave what stood there."""

import errno
import os

import pytest

from geokalman.reproduce import atomic
from geokalman.reproduce.errors import Fault


def test_a_file_that_fails_half_way_leaves_the_old_one(tmp_path):
    path = tmp_path / "x.txt"
    atomic.write_text(path, "old")
    with pytest.raises(RuntimeError), atomic.open_whole(path) as stream:
        stream.write(b"new")
        raise RuntimeError
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["x.txt"]


@pytest.mark.parametrize(
    "number, why",
    [
        (errno.ENOSPC, "the disk is full"),
        (errno.EDQUOT, "quota"),
        (errno.EACCES, "permission denied"),
        (errno.EROFS, "read-only"),
    ],
)
def test_what_the_system_refuses_is_one_sentence(tmp_path, monkeypatch, number, why):
    path = tmp_path / "x.txt"
    atomic.write_text(path, "old")

    def refuse(_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(Fault, match=f"Cannot write {path}: .*{why}.*; nothing there was changed"):
        atomic.write_text(path, "new")
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["x.txt"]


def test_a_file_where_a_folder_is_needed(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(Fault, match="a file stands where a folder is needed"):
        atomic.write_text(tmp_path / "file" / "x.txt", "new")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_no_permission(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(Fault, match="permission denied"):
        atomic.write_text(tmp_path / "x.txt", "new")


def test_swap_and_sweep(tmp_path):
    target = tmp_path / "run"
    target.mkdir()
    (target / "old").touch()
    new = atomic.partial_path(target)
    new.mkdir()
    (new / "new").touch()
    atomic.swap_folder(new, target)
    assert os.listdir(target) == ["new"] and os.listdir(tmp_path) == ["run"]


def test_sweep_brings_back_what_a_kill_left_between_the_two_renames(tmp_path):
    (tmp_path / ".run.old-12345678").mkdir()
    (tmp_path / ".run.old-12345678" / "kept").touch()
    (tmp_path / ".run.partial-abcdef00").mkdir()
    (tmp_path / ".run2.partial-abcdef00").touch()
    (tmp_path / ".gitignore").touch()
    atomic.sweep(tmp_path, "run")
    assert sorted(os.listdir(tmp_path)) == [".gitignore", ".run2.partial-abcdef00", "run"]
    atomic.sweep(tmp_path)
    assert sorted(os.listdir(tmp_path)) == [".gitignore", "run"] and os.listdir(tmp_path / "run") == ["kept"]


def test_not_a_number_is_no_json(tmp_path):
    with pytest.raises(ValueError):
        atomic.write_json(tmp_path / "x.json", float("nan"))


def test_an_unusual_refusal_of_the_system_names_a_remedy(tmp_path):
    with pytest.raises(Fault, match="Cannot write .*run: File name too long; choose another folder; nothing there was"):
        with atomic.explained(tmp_path / "run"):
            raise OSError(errno.ENAMETOOLONG, "File name too long")
