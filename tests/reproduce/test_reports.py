"""What a running notebook tells, and what the display reads of it."""

import json

import pytest

from geokalman.reproduce import reports


@pytest.fixture
def clock(monkeypatch):
    """A clock that is set by hand."""
    at = [100.0]
    monkeypatch.setattr(reports.time, "monotonic", lambda: at[0])
    return at


@pytest.fixture
def reporter(tmp_path, monkeypatch, clock):
    monkeypatch.setenv(reports.VARIABLE, str(tmp_path / "report"))
    return reports.Reporter()


def test_the_time_left_follows_from_the_time_it_took(reporter, tmp_path, clock):
    reporter("orbits", 0.0)
    assert reports.read(tmp_path / "report") == {"what": "orbits", "share": 0.0, "left": None}
    clock[0] += 30.0
    reporter("orbits", 0.2)
    assert reports.read(tmp_path / "report") == {"what": "orbits", "share": 0.2, "left": pytest.approx(120.0)}
    clock[0] += 10.0
    reporter("normal equations", 0.0)
    clock[0] += 10.0
    reporter("normal equations", 0.5)
    assert reports.read(tmp_path / "report")["left"] == pytest.approx(10.0)
    clock[0] += 5.0
    reporter("normal equations", 0.1)  # the same loop begins again
    clock[0] += 1.0
    reporter("normal equations", 0.5)
    assert reports.read(tmp_path / "report")["left"] == pytest.approx(1.0)


def test_it_tells_now_and_then_and_always_the_end(reporter, tmp_path, clock):
    for k in range(11):
        reporter("runs", k / 1000)
        clock[0] += 0.06
    assert reports.read(tmp_path / "report")["share"] == 0.009
    reporter("runs", 1.0)
    assert reports.read(tmp_path / "report")["share"] == 1.0


def test_what_is_expected_stays_beside_the_loop(reporter, tmp_path):
    reporter.expect("may take about 7 min")
    reporter("orbits", 0.0)
    assert reports.read(tmp_path / "report")["expected"] == "may take about 7 min"


def test_nobody_asked_and_nobody_told(tmp_path, monkeypatch):
    monkeypatch.delenv(reports.VARIABLE, raising=False)
    reports.Reporter()("orbits", 0.5)
    assert reports.read(tmp_path / "report") == {}
    (tmp_path / "report").write_text("{")
    assert reports.read(tmp_path / "report") == {}


def test_a_report_that_cannot_be_written_is_no_fault(tmp_path, monkeypatch):
    monkeypatch.setenv(reports.VARIABLE, str(tmp_path / "gone" / "report"))
    reports.Reporter()("orbits", 0.5)


def test_a_report_is_whole(reporter, tmp_path):
    reporter("orbits", 0.0)
    assert [p.name for p in tmp_path.iterdir()] == ["report"] and json.loads((tmp_path / "report").read_text())


@pytest.mark.parametrize(
    "seconds, text",
    [(0.2, "about 1 s"), (89, "about 89 s"), (95, "about 2 min"), (420, "about 7 min"), (5300, "about 88 min"),
     (6 * 3600, "about 6 h"), (86400, "about 24 h"), (3e6, "about 35 days")],
)  # fmt: skip
def test_times_in_words(seconds, text):
    assert reports.duration(seconds) == text
