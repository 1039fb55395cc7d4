"""Whole or not at all: files and folders that a fault interrupts leave what stood there."""

import errno
import os
import subprocess
import sys
import threading

import pytest
from filelock import FileLock

from execbook import atomic
from execbook.errors import Fault


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


def test_what_a_living_process_has_not_finished_stays(tmp_path):
    """As of a notebook open in Jupyter, whose folder has the number of its process."""
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    name = f".interactive.partial-{child.pid}"
    (tmp_path / name).mkdir()
    (tmp_path / f".mine.partial-{os.getpid()}").mkdir()
    assert atomic.unfinished(tmp_path) == {"interactive", "mine"}
    atomic.sweep(tmp_path)
    assert sorted(os.listdir(tmp_path)) == sorted([name, f".mine.partial-{os.getpid()}"])
    child.communicate()
    atomic.sweep(tmp_path)
    assert os.listdir(tmp_path) == [f".mine.partial-{os.getpid()}"]


@pytest.mark.parametrize("number, why", [(errno.ENOSPC, "the disk is full; free some space"),
                                         (errno.EROFS, "the file system is read-only; {} must be a folder that"),
                                         (errno.EACCES, "permission denied; {} must be a folder that you may write to"),
                                         (errno.ENOLCK, "No locks available; {} must be a folder that")])  # fmt: skip
def test_a_lock_that_the_system_refuses_is_one_sentence(tmp_path, monkeypatch, number, why):
    real = os.open

    def refuse(path, *rest, **options):
        if os.fspath(path).endswith("build.lock"):
            raise OSError(number, os.strerror(number))
        return real(path, *rest, **options)

    monkeypatch.setattr(os, "open", refuse)
    cache = tmp_path / ".cache"
    with (
        pytest.raises(
            Fault, match=f"^Cannot write {cache}/build.lock: {why.format(cache)}.*; nothing there was changed"
        ),
        atomic.locked(cache / "build.lock"),
    ):
        raise AssertionError


def test_a_file_in_the_place_of_the_folder_of_locks(tmp_path):
    (tmp_path / ".cache").touch()
    with pytest.raises(Fault, match=r"locks/x.lock: a file stands where a folder is needed; .*locks must be a folder"):
        with atomic.locked(tmp_path / ".cache" / "locks" / "x.lock"):
            raise AssertionError


def test_a_folder_in_the_place_of_a_lock(tmp_path):
    (tmp_path / "x.lock").mkdir()
    with pytest.raises(Fault, match="^Cannot write .*x.lock: "), atomic.locked(tmp_path / "x.lock"):
        raise AssertionError


def test_who_comes_second_says_so_and_waits(tmp_path):
    first, order = FileLock(tmp_path / "x.lock"), []
    first.acquire()
    waits = threading.Event()

    def second() -> None:
        with atomic.locked(tmp_path / "x.lock", waits.set):
            order.append("second")

    thread = threading.Thread(target=second)
    thread.start()
    assert waits.wait(60)
    order.append("first")
    first.release()
    thread.join(60)
    assert order == ["first", "second"]


def test_an_error_of_the_work_is_no_error_of_the_lock(tmp_path):
    with pytest.raises(OSError, match="of the work"), atomic.locked(tmp_path / "x.lock"):
        raise OSError("of the work")
    with atomic.locked(tmp_path / "x.lock", lambda: pytest.fail("it was not released")):
        pass


@pytest.fixture
def product(tmp_path):
    """A folder with files and the record of them."""
    (tmp_path / "pages").mkdir()
    (tmp_path / "pages" / "one.html").write_text("one")
    (tmp_path / "index.html").write_text("index")
    atomic.write_json(tmp_path / "made.json", {"key": "k", "files": atomic.digests(tmp_path, "made.json")})
    return tmp_path


@pytest.mark.parametrize(
    "path, damage",
    [
        ("pages/one.html", lambda p: p.write_text("onf")),
        ("pages/one.html", lambda p: p.write_text("")),
        ("index.html", lambda p: p.unlink()),
        ("made.json", lambda p: p.unlink()),
        ("made.json", lambda p: p.write_text("{")),
        ("made.json", lambda p: p.write_text("[]")),
        ("made.json", lambda p: p.write_text('{"key": "k"}')),
        ("made.json", lambda p: p.write_text('{"key": "k", "files": {"../x": "0"}}')),
    ],
)
def test_a_product_is_intact_or_damaged(product, path, damage):
    assert atomic.intact(product, "made.json", "k") and not atomic.intact(product, "made.json", "other")
    damage(product / path)
    assert not atomic.intact(product, "made.json", "k")
