"""What a running notebook tells where there is no terminal."""

import io
import json
import re
import sys
import time

import pytest

from execbook import progress
from execbook.progress import Display, _loop


def test_a_line_when_it_starts_now_and_then_and_when_it_ends(monkeypatch, tmp_path):
    stream = io.StringIO()  # capsys may lose what is written while it is read
    monkeypatch.setattr(sys, "stderr", stream)
    with Display(every=0.05) as display, display.notebook("toy/01-line") as tell:
        tell(3, 19, tmp_path / "report")
        while "cell 3 of 19" not in stream.getvalue():
            time.sleep(0.05)
    first, *between, last = stream.getvalue().splitlines()
    [second, *_] = [line for line in between if "cell 3" in line]  # one before the first cell, where it is slow
    assert first == "toy/01-line starts"
    assert re.fullmatch(r"\.\.\. toy/01-line: cell 3 of 19, \d+ s", second)
    assert re.fullmatch(r"toy/01-line took \d+\.\d s", last)


def test_a_failing_one_says_so_and_a_quick_one_only_starts_and_ends(capsys):
    with pytest.raises(ValueError), Display() as display, display.notebook("toy/01-line"):
        raise ValueError
    assert re.fullmatch(r"toy/01-line starts\ntoy/01-line failed after \d+\.\d s\n", capsys.readouterr().err)


def test_the_share_done_and_what_was_expected(monkeypatch, tmp_path):
    report = {"what": "normal equations", "share": 0.42, "left": 240.0, "expected": "may take about 7 min"}
    (tmp_path / "report").write_text(json.dumps(report))
    stream, end = io.StringIO(), time.monotonic() + 60
    monkeypatch.setattr(sys, "stderr", stream)
    with Display(every=0.02) as display, display.notebook("toy/01-line") as tell:
        tell(3, 7, tmp_path / "report")
        while stream.getvalue().count("...") < 2 and time.monotonic() < end:
            time.sleep(0.01)
    lines = stream.getvalue().splitlines()
    assert lines.count("toy/01-line: may take about 7 min") == 1
    assert "... toy/01-line: cell 3 of 7, normal equations 42 %, about 4 min to go, 0 s" in lines


@pytest.mark.parametrize(
    "report, words",
    [
        ({}, ""),
        ({"expected": "may take about 7 min"}, ""),
        ({"what": "runs", "share": 0.0, "left": None}, ", runs 0 %"),
        ({"what": "runs", "share": 0.5, "left": 30.0}, ", runs 50 %, about 30 s to go"),
        ({"what": "runs", "share": 1.0, "left": 0.0}, ""),
    ],
)
def test_words_on_a_loop(report, words):
    assert _loop(report) == words


@pytest.fixture
def clock(monkeypatch):
    """A clock that is set by hand."""
    at = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: at[0])
    return at


@pytest.fixture
def reporter(tmp_path, monkeypatch, clock):
    monkeypatch.setenv(progress.VARIABLE, str(tmp_path / "report"))
    return progress.Reporter()


def test_the_time_left_follows_from_the_time_it_took(reporter, tmp_path, clock):
    reporter("orbits", 0.0)
    assert progress.read(tmp_path / "report") == {"what": "orbits", "share": 0.0, "left": None}
    clock[0] += 30.0
    reporter("orbits", 0.2)
    assert progress.read(tmp_path / "report") == {"what": "orbits", "share": 0.2, "left": pytest.approx(120.0)}
    clock[0] += 10.0
    reporter("normal equations", 0.0)
    clock[0] += 10.0
    reporter("normal equations", 0.5)
    assert progress.read(tmp_path / "report")["left"] == pytest.approx(10.0)
    clock[0] += 5.0
    reporter("normal equations", 0.1)  # the same loop begins again
    clock[0] += 1.0
    reporter("normal equations", 0.5)
    assert progress.read(tmp_path / "report")["left"] == pytest.approx(1.0)


def test_a_step_is_told_at_once(reporter, tmp_path):
    """The next one may take hours."""
    reporter("runs", 0.0)
    reporter("runs", 0.01)
    assert progress.read(tmp_path / "report")["share"] == 0.01


def test_it_tells_now_and_then_and_always_the_end(reporter, tmp_path, clock):
    for k in range(11):
        reporter("runs", k / 1000)
        clock[0] += 0.06
    assert progress.read(tmp_path / "report")["share"] == 0.009
    reporter("runs", 1.0)
    assert progress.read(tmp_path / "report")["share"] == 1.0


def test_what_is_expected_stays_beside_the_loop(reporter, tmp_path):
    reporter.expect("may take about 7 min")
    reporter("orbits", 0.0)
    assert progress.read(tmp_path / "report")["expected"] == "may take about 7 min"


def test_nobody_asked_and_nobody_told(tmp_path, monkeypatch):
    monkeypatch.delenv(progress.VARIABLE, raising=False)
    progress.Reporter()("orbits", 0.5)
    assert progress.read(tmp_path / "report") == {}
    (tmp_path / "report").write_text("{")
    assert progress.read(tmp_path / "report") == {}


def test_a_report_that_cannot_be_written_is_no_fault(tmp_path, monkeypatch):
    monkeypatch.setenv(progress.VARIABLE, str(tmp_path / "gone" / "report"))
    progress.Reporter()("orbits", 0.5)


def test_a_report_is_whole(reporter, tmp_path):
    reporter("orbits", 0.0)
    assert [p.name for p in tmp_path.iterdir()] == ["report"] and json.loads((tmp_path / "report").read_text())


@pytest.mark.parametrize(
    "seconds, text",
    [(0.2, "about 1 s"), (89, "about 89 s"), (95, "about 2 min"), (420, "about 7 min"), (5300, "about 88 min"),
     (6 * 3600, "about 6 h"), (86400, "about 24 h"), (3e6, "about 35 days")],
)  # fmt: skip
def test_times_in_words(seconds, text):
    assert progress.duration(seconds) == text
