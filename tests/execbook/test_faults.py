"""Faults of the machine on the smallest real part of the book: one of its notebooks, its configuration, its data.

The page `practice/faults` lists every fault with its test.
"""

from __future__ import annotations

import os
import re
import resource
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
PAGE = "airborne-gravity/01-chain"


def clone(root: Path, page: str) -> Path:
    """A clone-like folder that holds one notebook of the book, and all of its data."""
    book, paper = root / "book", page.partition("/")[0]
    for folder in ("book/_ext", "book/_static", "data"):
        shutil.copytree(PROJECT / folder, root / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in (book / paper, book / "practice"):
        folder.mkdir()
    glossary = "practice/glossary"
    copied = "_config.yml", "execbook.toml", "references.bib", "rules.yml", f"{paper}/claims.yml"
    for name in (*copied, f"{page}.md", f"{glossary}.md"):
        shutil.copyfile(PROJECT / "book" / name, book / name)
    shutil.copyfile(PROJECT / "environment.txt", root / "environment.txt")
    (book / "index.md").write_text("# A part of the book\n")
    (book / "practice" / "rerun.md").write_text("(verdicts)=\n# Rerun\n\n```{bibliography}\n```\n")
    links = re.findall(r"\{doc\}`(?:[^`<]*<)?([\w./-]+)>?`", (book / f"{page}.md").read_text())
    linked = sorted({os.path.normpath(f"{paper}/{link}") for link in links} - {page, glossary})
    for name in linked:
        (book / name).parent.mkdir(exist_ok=True)
        (book / f"{name}.md").write_text(f"# Stands for {name}\n")
    files = "".join(f"- file: {name}\n" for name in (page, *linked, glossary, "practice/rerun"))
    (book / "_toc.yml").write_text(f"format: jb-book\nroot: index\nchapters:\n{files}")
    return root


@pytest.fixture(scope="module")
def made(tmp_path_factory, geokalman):
    """The part, built once; read only."""
    root = clone(tmp_path_factory.mktemp("made") / "clone", PAGE)
    done = geokalman(root, "build")
    assert done.returncode == 0, done.stderr
    return root


@pytest.fixture
def part(made, tmp_path):
    """A copy of the built part, to be damaged."""
    return shutil.copytree(made, tmp_path / "clone")


def products(root: Path) -> dict[str, bytes]:
    """Everything that a build makes but the files that hold times, the page that shows them and the index of its words."""
    timed = ("provenance.json", ".made.json", "searchindex.js", f"{PAGE.rpartition('/')[2]}.html")
    built = root / "book" / "_build"
    kinds = ("runs", "metrics", "html")
    found = [p for kind in kinds for p in (built / kind).rglob("*") if p.is_file()]
    return {p.relative_to(built).as_posix(): p.read_bytes() for p in sorted(found) if not p.name.endswith(timed)}


def unfinished(root: Path) -> list[Path]:
    return [p for kind in ("book/_build", "runs") for p in (root / kind).rglob(".*.partial-*")]


def until(found, process: subprocess.Popen) -> None:
    """Wait until something is found; a process that ends before is a fault of the test."""
    while not found():
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)


def test_nothing_changed_nothing_done(part, geokalman):
    before = {p: p.stat().st_mtime_ns for p in (part / "book" / "_build" / "html").rglob("*")}
    done = geokalman(part, "build")
    assert "0 executed, 1 up to date, 0 failed" in done.stderr
    assert {p: p.stat().st_mtime_ns for p in (part / "book" / "_build" / "html").rglob("*")} == before


def test_damaged_and_deleted_pages_are_made_anew(part, made, geokalman):
    html = part / "book" / "_build" / "html"
    (html / "index.html").unlink()
    style = html / "_static" / "book.css"
    style.write_bytes(style.read_bytes()[:-1])
    done = geokalman(part, "build")
    assert "0 executed, 1 up to date, 0 failed" in done.stderr and products(part) == products(made)


def test_a_damaged_result_is_computed_anew(part, made, geokalman):
    metrics = part / "book" / "_build" / "runs" / PAGE / "metrics.json"
    metrics.write_text(metrics.read_text().replace("1", "2"))
    assert "1 executed, 0 up to date, 0 failed" in geokalman(part, "build", "--no-html").stderr
    assert products(part) == products(made)


@pytest.mark.parametrize("name", ["ephemeris", "gravity"])
def test_damaged_data_stop_the_build_once(part, geokalman, name):
    path = max((p for p in (part / "data").rglob("*") if p.is_file()), key=lambda p: (name in str(p), p.stat().st_size))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    done = geokalman(part, "build")
    inside = path.relative_to(part).as_posix()
    assert done.returncode == 1
    assert re.fullmatch(
        rf"geokalman: {path} has SHA-256 .*; restore it with: git checkout -- {inside} .*\n", done.stderr
    )


def test_killed_while_a_notebook_runs_and_resumed(part, made, geokalman):
    shutil.rmtree(part / "book" / "_build")
    process = geokalman(part, "build", wait=False)
    until(lambda: unfinished(part), process)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert unfinished(part)
    done = geokalman(part, "build")
    assert done.returncode == 0, done.stderr
    assert not unfinished(part) and products(part) == products(made)


def test_killed_while_pages_are_made_and_resumed(part, made, geokalman):
    built = part / "book" / "_build"
    shutil.rmtree(built / "html")
    process = geokalman(part, "build", wait=False)
    until(lambda: list(built.glob(".html.partial-*/_build/html/index.html")), process)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert not (built / "html").exists()
    done = geokalman(part, "build")
    assert done.returncode == 0, done.stderr
    assert not unfinished(part) and products(part) == products(made)


@pytest.mark.parametrize("words", [["run", PAGE, "V=70"], ["build", "--no-html"]], ids=["a run", "a build"])
def test_what_a_killed_run_left_is_cleared_by_the_next(part, geokalman, words):
    process = geokalman(part, "run", PAGE, "V=60", wait=False)
    until(lambda: unfinished(part), process)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert unfinished(part)
    assert geokalman(part, *words).returncode == 0 and not unfinished(part)


def test_a_disk_without_room_for_a_byte_leaves_the_last_book(part, made, geokalman):
    def full():
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

    source = part / "book" / f"{PAGE}.md"
    source.write_text(source.read_text().replace("V = 65.0 ", "V = 66.0 "))
    done = geokalman(part, "build", preexec_fn=full)
    assert done.returncode == 1 and "Traceback" not in done.stderr, done.stderr
    assert "Cannot write" in done.stderr.splitlines()[-1]
    assert products(part) == products(made) and not unfinished(part)


def test_what_memory_cannot_hold_is_refused_before_anything_is_computed(tmp_path, geokalman):
    """274 GB, on a machine that gives six: refused where the parameters are checked, with the degree that fits."""

    def six():
        resource.setrlimit(resource.RLIMIT_AS, (6 * 10**9, 6 * 10**9))

    root = clone(tmp_path / "clone", "grace-fusion/05-recovery")
    done = geokalman(root, "run", "grace-fusion/05-recovery", "n_max=360", preexec_fn=six)
    assert done.returncode == 1
    sentence = (
        r"FAILED grace-fusion/05-recovery: cell \[4\]: TooLarge: The normal matrix of 130317 coefficients to degree 360, "
        r"with its inverse, needs 274 GB of memory, and [\d.]+ [GM]B are available; an n_max of \d+ fits\."
    )
    assert re.search(sentence, done.stderr), done.stderr
    assert not (root / ".cache" / "memo").exists()  # no orbit was flown


def test_every_fault_of_the_page_has_its_test():
    """The table of `practice/faults` names test functions that exist, each fault at least one."""
    page = (PROJECT / "book" / "practice" / "faults.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| ") and not line.startswith(("| Fault", "| ---"))]
    assert len(rows) > 30
    defined = {
        (path.name, name)
        for path in (PROJECT / "tests").rglob("test_*.py")
        for name in re.findall(r"^def (test_\w+)", path.read_text(encoding="utf-8"), re.M)
    }
    for row in rows:
        named = re.findall(r"`(test_\w+\.py)::(test_\w+)`", row)
        assert named, row
        assert set(named) <= defined, (row, set(named) - defined)
