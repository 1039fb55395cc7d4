"""What a running notebook tells where there is no terminal."""

import json
import re
import time

import pytest

from geokalman.reproduce.progress import Display, _loop


def test_a_line_when_it_starts_now_and_then_and_when_it_ends(capsys, tmp_path):
    told = ""
    with Display(every=0.05) as display, display.notebook("toy/01-line") as progress:
        progress(3, 19, tmp_path / "report")
        while "cell 3 of 19" not in told:
            told += capsys.readouterr().err
            time.sleep(0.05)
    first, *between, last = (told + capsys.readouterr().err).splitlines()
    [second, *_] = [line for line in between if "cell 3" in line]  # one before the first cell, where it is slow
    assert first == "toy/01-line starts"
    assert re.fullmatch(r"\.\.\. toy/01-line: cell 3 of 19, \d+ s", second)
    assert re.fullmatch(r"toy/01-line took \d+\.\d s", last)


def test_a_failing_one_says_so_and_a_quick_one_only_starts_and_ends(capsys):
    with pytest.raises(ValueError), Display() as display, display.notebook("toy/01-line"):
        raise ValueError
    assert re.fullmatch(r"toy/01-line starts\ntoy/01-line failed after \d+\.\d s\n", capsys.readouterr().err)


def test_the_share_done_and_what_was_expected(capsys, tmp_path):
    report = {"what": "normal equations", "share": 0.42, "left": 240.0, "expected": "may take about 7 min"}
    (tmp_path / "report").write_text(json.dumps(report))
    told, end = "", time.monotonic() + 60
    with Display(every=0.02) as display, display.notebook("toy/01-line") as progress:
        progress(3, 7, tmp_path / "report")
        while told.count("...") < 2 and time.monotonic() < end:
            told += capsys.readouterr().err
    lines = told.splitlines()
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
