"""What a running notebook tells where there is no terminal."""

import re
import time

import pytest

from geokalman.reproduce.progress import Display


def test_a_line_when_it_starts_now_and_then_and_when_it_ends(capsys):
    told = ""
    with Display(every=0.05) as display, display.notebook("toy/01-line") as progress:
        progress(3, 19)
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
