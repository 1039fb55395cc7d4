"""Ctrl-C, SIGTERM, SIGHUP and kill -9 at any moment: one sentence, no process left, what was good kept.

No test waits for seconds: a cell, a Sphinx extension or an import says in a file or by a signal that its moment is there.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

SENTENCE = "geokalman: interrupted; what was finished stays."
SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
FOR_EVER = "import re; re.fullmatch('(a+)+b', 'a' * 99)"  # never lets another thread of the kernel run
STALL = """
import os, pathlib, subprocess, time
def stall(app):
    child = subprocess.Popen(["sleep", "600"])
    pathlib.Path("{pids}.new").write_text(f"{{os.getpid()}} {{child.pid}}")
    os.rename("{pids}.new", "{pids}")
    time.sleep(600)
def setup(app):
    app.connect("builder-inited", stall)
"""
CONFIG = "title: toy\nsphinx:\n  local_extensions: {stall: _ext}\n"
LIMIT = 900  # s; only what hangs for ever meets it


@pytest.fixture
def start() -> Iterator[Callable[..., subprocess.Popen]]:
    """Starts the command in a clone as the console script does, with the signals that are `ignored`; killed at last."""
    begun = []

    def begin(root: Path, *words: str, ignored: tuple[signal.Signals, ...] = (), code: str = "") -> subprocess.Popen:
        def dispositions() -> None:
            for number in SIGNALS:
                signal.signal(number, signal.SIG_IGN if number in ignored else signal.SIG_DFL)

        words = ("-c", f"{code}\nimport geokalman_entry\ngeokalman_entry.main()", *words)
        begun.append(
            subprocess.Popen(
                [sys.executable, *words],
                cwd=root,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                preexec_fn=dispositions,
                env={k: v for k, v in os.environ.items() if not k.startswith("EXECBOOK")},
            )  # fmt: skip
        )
        return begun[-1]

    yield begin
    for process in begun:
        process.kill()
        process.communicate()


@pytest.fixture
def pids_in(wait_for) -> Callable[[Path, subprocess.Popen], list[int]]:
    """Waits for the file in which the children of a process have told their numbers; gives these."""

    def wait(path: Path, process: subprocess.Popen) -> list[int]:
        wait_for(path.exists, process)
        return [int(word) for word in path.read_text().split()]

    return wait


@pytest.fixture
def wait_for_end_of(wait_for) -> Callable[[list[int]], None]:
    return lambda pids: wait_for(lambda: not any(alive(pid) for pid in pids))


def alive(pid: int) -> bool:
    """Is there such a process, not counting one that only waits to be noted by its parent?"""
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def stuck(root: Path, work: str = FOR_EVER) -> Path:
    """Let the second notebook tell its process, and that of a child, and then work for ever; gives the file told in."""
    path, pids = root / "book" / "toy" / "02-constant.md", root / "pids"
    cell = (
        "import os, subprocess, time\n"
        "child = subprocess.Popen(['sleep', '600'])\n"
        f"open('{pids}.new', 'w').write(f'{{os.getpid()}} {{child.pid}}')\n"
        f"os.rename('{pids}.new', '{pids}')\n{work}"
    )
    path.write_text(path.read_text().replace("half = 0.5", cell))
    return pids


@pytest.fixture
def in_html(built: Path, tmp_path: Path) -> Path:
    """A built clone with a good book of old, whose Sphinx gets stuck."""
    root = shutil.copytree(built, tmp_path / "clone")
    (root / "book" / "_config.yml").write_text(CONFIG)
    (root / "book" / "_ext").mkdir()
    (root / "book" / "_ext" / "stall.py").write_text(STALL.format(pids=root / "pids"))
    (root / "book" / "_toc.yml").write_text(
        "format: jb-book\nroot: toy/index\nchapters: [{file: toy/01-line}, {file: toy/02-constant}]\n"
    )
    (root / "book" / "_build" / "html").mkdir()
    (root / "book" / "_build" / "html" / "index.html").write_text("the last good book")
    return root


def left_over(root: Path) -> list[str]:
    return [p.name for p in root.rglob(".*") if ".partial-" in p.name or ".old-" in p.name]


@pytest.mark.parametrize("command, number", [*(("run", number) for number in SIGNALS), ("build", signal.SIGTERM)])
def test_a_signal_while_a_notebook_runs(toy, start, pids_in, wait_for_end_of, command, number):
    pids = stuck(toy)
    process = start(toy, *{"run": ["run", "toy/02-constant"], "build": ["build"]}[command])
    told = pids_in(pids, process)
    process.send_signal(number)
    out, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 128 + number and out == ""
    assert err.splitlines()[-1] == SENTENCE and "Traceback" not in err and "FAILED" not in err
    wait_for_end_of(told)
    assert left_over(toy) == []


@pytest.mark.parametrize("number", SIGNALS[:2])
def test_a_signal_while_the_html_is_made(in_html, start, pids_in, wait_for_end_of, number):
    process = start(in_html, "build")
    told = pids_in(in_html / "pids", process)
    process.send_signal(number)
    out, err = process.communicate(timeout=LIMIT)
    assert (process.returncode, out, err) == (128 + number, "", f"{SENTENCE}\n")
    wait_for_end_of(told)
    assert (in_html / "book" / "_build" / "html" / "index.html").read_text() == "the last good book"
    assert left_over(in_html) == []


def test_kernels_end_with_a_killed_parent(toy, start, pids_in, wait_for_end_of):
    """Also one that computes and never looks up, and the processes that it has started."""
    pids = stuck(toy)
    process = start(toy, "run", "toy/02-constant")
    told = pids_in(pids, process)
    process.kill()
    wait_for_end_of(told)


def test_sphinx_ends_with_a_killed_parent(in_html, start, pids_in, wait_for_end_of):
    process = start(in_html, "build")
    told = pids_in(in_html / "pids", process)
    process.kill()
    wait_for_end_of(told)
    assert (in_html / "book" / "_build" / "html" / "index.html").read_text() == "the last good book"


def test_in_the_background_ctrl_c_is_ignored_but_reaches_cells(toy, start, pids_in, wait_for):
    """A shell starts a background job with SIGINT ignored: so it stays, but a cell can be interrupted, and we ended."""
    caught, go = toy / "caught", toy / "go"
    work = (
        "import pathlib, signal\n"
        "try:\n    os.kill(os.getpid(), signal.SIGINT)\n    time.sleep(600)\n"
        f"except KeyboardInterrupt:\n    pathlib.Path('{caught}').touch()\n"
        "blocked = subprocess.run([sys.executable, '-c', 'import signal; print(signal.getsignal(signal.SIGINT))'],"
        " capture_output=True, text=True).stdout\n"
        f"assert 'default_int_handler' in blocked, blocked\nwhile not os.path.exists('{go}'):\n    time.sleep(0.02)"
    )
    pids = stuck(toy, f"import sys\n{work}\nhalf = 0.5")
    process = start(toy, "run", "toy/02-constant", ignored=(signal.SIGINT,))
    pids_in(pids, process)
    wait_for(caught.exists, process)
    process.send_signal(signal.SIGINT)
    go.touch()
    out, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 0 and out.strip() == str(toy / "runs/toy/02-constant/paper"), err


def test_in_the_background_sigterm_works(toy, start, pids_in, wait_for_end_of):
    told = pids_in(stuck(toy), process := start(toy, "run", "toy/02-constant", ignored=(signal.SIGINT, signal.SIGHUP)))
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGHUP)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 143 and err.splitlines()[-1] == SENTENCE
    wait_for_end_of(told)


def test_a_second_ctrl_c_changes_nothing(toy, start, pids_in, wait_for_end_of):
    told = pids_in(stuck(toy), process := start(toy, "run", "toy/02-constant"))
    for _ in range(3):
        process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 130 and err.count(SENTENCE) == 1
    wait_for_end_of(told)
    assert left_over(toy) == []


def test_a_signal_while_waiting_for_another_run(toy, start, pids_in, wait_for):
    """The second run into one folder waits for the first, and may be ended meanwhile."""
    told = pids_in(stuck(toy), first := start(toy, "run", "toy/02-constant", "--out", "mine"))
    waits = "import filelock\nacquire = filelock.FileLock._acquire\ntried = 0\n"
    waits += (
        "def tell(self):\n    acquire(self)\n    global tried\n    tried += not self.is_locked\n"
        "    if tried == 2: open('waits', 'w').close()\n"
        "filelock.FileLock._acquire = tell"
    )
    second = start(toy, "run", "toy/02-constant", "--out", "mine", code=waits)
    wait_for((toy / "waits").exists, second)
    second.send_signal(signal.SIGTERM)
    _, err = second.communicate(timeout=LIMIT)
    assert second.returncode == 143 and err.splitlines()[-1] == SENTENCE
    assert first.poll() is None and all(map(alive, told))


IMPORTS = ["geokalman", "geokalman.cli", "execbook.cli", "typer", "numpy", "numpy.linalg", "pydantic"]
AT_IMPORT = """
import os, signal, sys
class Finder:
    def find_spec(name, path=None, target=None):
        if name == {name!r}:
            os.kill(os.getpid(), signal.{number})
sys.meta_path.insert(0, Finder)
"""


@pytest.mark.parametrize(
    "name, number", [*((name, "SIGINT") for name in IMPORTS), ("geokalman", "SIGTERM"), ("numpy", "SIGHUP")]
)
def test_a_signal_during_an_import(toy, start, name, number):
    """The first seconds of a command are imports, some of them in its first line, some in C."""
    process = start(toy, "run", "toy/01-line", "--quick", code=AT_IMPORT.format(name=name, number=number))
    out, err = process.communicate(timeout=LIMIT)
    assert (process.returncode, out, err) == (128 + signal.Signals[number], "", f"{SENTENCE}\n")


def test_what_is_written_when_a_signal_comes_is_written_whole(built, tmp_path, start):
    """The command is in the middle of README.md: it may end that, and leaves nothing beside it."""
    root = shutil.copytree(built, tmp_path / "clone")
    shown = (root / "README.md").read_text()
    process = start(
        root, "claims", "--readme",
        code="import os, signal\nfsync = os.fsync\n"
        "def sync(number):\n    os.kill(os.getpid(), signal.SIGTERM)\n    fsync(number)\n"
        "os.fsync = sync",
    )  # fmt: skip
    _, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 143 and err == f"{SENTENCE}\n"
    text = (root / "README.md").read_text()
    assert text != shown and text.endswith("<!-- /verdicts -->\n")
    assert left_over(root) == []
