"""The folder in which a kernel is talked to."""

import os
import shutil
import stat
import subprocess
import sys
import tempfile

import pytest

from execbook import sockets
from execbook.errors import Fault


@pytest.fixture
def home(monkeypatch):
    """A folder for temporary files of its own, with a short path."""
    made = tempfile.mkdtemp(prefix="home-", dir="/tmp")
    monkeypatch.setattr(tempfile, "tempdir", made)
    yield made
    shutil.rmtree(made)


def test_it_is_ours_alone_and_goes(home):
    with sockets.folder() as one, sockets.folder() as two:
        assert one != two and one.parent == two.parent
        assert stat.S_IMODE(one.stat().st_mode) == 0o700
        assert len(os.listdir(home)) == 2  # the second call spares the first one's, whose process lives
    assert os.listdir(home) == []


def test_it_goes_with_an_error_too(home):
    with pytest.raises(RuntimeError), sockets.folder():
        raise RuntimeError
    assert os.listdir(home) == []


def test_those_of_killed_processes_are_cleared_and_nothing_else(home):
    child = subprocess.Popen([sys.executable, "-c", "pass"])
    child.wait()
    for name in (
        f"execbook-kernel-{child.pid}-x",
        "execbook-kernel-none-x",
        "geokalman-numba-0",
        f"other-{child.pid}-x",
    ):
        os.mkdir(os.path.join(home, name))
    with sockets.folder():
        assert len(os.listdir(home)) == 4
    assert sorted(os.listdir(home)) == ["execbook-kernel-none-x", "geokalman-numba-0", f"other-{child.pid}-x"]


def test_too_long_a_path_is_refused(home, monkeypatch):
    deep = os.path.join(home, "d" * 90)
    os.mkdir(deep)
    monkeypatch.setattr(tempfile, "tempdir", deep)
    with pytest.raises(Fault, match=f"^The path {deep} is too long for sockets; let TMPDIR name a shorter one"):
        with sockets.folder():
            pass
    assert os.listdir(deep) == []


def test_no_folder_for_temporary_files(home, monkeypatch):
    (lambda path: open(path, "w").close())(os.path.join(home, "file"))
    monkeypatch.setattr(tempfile, "tempdir", os.path.join(home, "file"))
    with pytest.raises(Fault, match="a file stands where a folder is needed; let TMPDIR name a folder"):
        with sockets.folder():
            pass


def without_network() -> list[str]:
    """Words before a command that take the network from it, the loopback interface too; none where not permitted."""
    for words in (["unshare", "-n"], ["unshare", "-rn"]):
        if shutil.which("unshare") and subprocess.run([*words, "true"], capture_output=True).returncode == 0:
            return words
    return []


@pytest.mark.skipif(not without_network(), reason="a process of its own network is not permitted here")
def test_without_any_network_a_notebook_runs(toy):
    command = [*without_network(), sys.executable, "-m", "geokalman.cli", "run", "toy/02-constant"]
    done = subprocess.run(command, cwd=toy, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert (toy / "runs" / "toy" / "02-constant" / "paper" / "page.html").is_file()
