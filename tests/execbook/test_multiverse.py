"""Readings of a paper: what may be declared, how worlds are drawn, and how claims are counted in them."""

import math
from collections import Counter

import numpy as np
import pytest

from execbook import claims, multiverse, reference
from execbook.errors import Fault, Misuse

READINGS = """
- id: smoother
  asks: is the filter followed by a smoother?
  passage: section 4, not said
  default: smoothed
  options:
  - {id: smoothed, says: by a fixed-interval smoother}
  - {id: filtered, says: the filter alone, passage: section 2}
- id: height
  asks: how high is the orbit?
  passage: not given
  default: 480
  range: [440, 500]
  unit: km
"""
CLAIM = claims.Claim(
    id="fine", where="Table 1", source="Table 1", says="x", printed=1.0, metric="toy/01-line:std", accept={"rel": 0.1},
    verdict="depends-on-the-reading",
)  # fmt: skip


@pytest.fixture
def declared(toy) -> list[multiverse.Choice]:
    (toy / "book" / "toy" / "readings.yml").write_text(READINGS)
    return multiverse.choices(toy, "toy")


def run(world):
    """Fine where smoothed, and above 470 km."""
    good = world["smoother"] == "smoothed" and world["height"] > 470.0
    return {"toy/01-line:std": 1.05 if good else 2.0}


def counted(declared, size, seed):
    worlds = multiverse.draw(declared, size, seed)
    held = multiverse.survived(lambda c, t: claims.judge(c, t).holds, [CLAIM], [run(w) for w in worlds])
    return {key: {"value": value, "unit": ""} for key, value in multiverse.count(declared, worlds, held).items()}


def test_every_option_occurs_equally_often_and_a_range_is_filled_evenly(declared):
    worlds = multiverse.draw(declared, 60, 1)
    assert Counter(world["smoother"] for world in worlds) == {"smoothed": 30, "filtered": 30}
    heights = np.sort([world["height"] for world in worlds])
    edges = 440.0 + np.arange(61)
    assert (edges[:-1] <= heights).all() and (heights <= edges[1:]).all()
    assert [world["world"] for world in worlds] == list(range(1, 61))
    assert multiverse.default(declared) == {"world": 0, "smoother": "smoothed", "height": 480.0}


def test_draws_are_the_seeds(declared):
    assert multiverse.draw(declared, 7, 3) == multiverse.draw(declared, 7, 3) != multiverse.draw(declared, 7, 4)


def test_choices_are_independent(declared):
    worlds = multiverse.draw(declared, 4000, 5)
    smoothed = np.array([world["smoother"] == "smoothed" for world in worlds])
    heights = np.array([world["height"] for world in worlds])
    assert abs(np.corrcoef(smoothed, heights)[0, 1]) < 4.0 / math.sqrt(4000)


def test_a_share_reproduces_under_other_seeds_within_its_error(declared):
    shares = [multiverse.share_of("fine", counted(declared, 100, seed)) for seed in range(20)]
    deviations = [(share.part - 0.25) / share.error for share in shares]  # half the options, half the range
    assert np.abs(deviations).max() < 4.0 and abs(np.mean(deviations)) < 1.5


def test_a_share_by_option_and_the_choice_that_decides(declared):
    share = multiverse.share_of("fine", counted(declared, 400, 1))
    assert share.worlds == 400 and share.groups["smoother"]["filtered"] == 0.0
    assert share.groups["height"]["below"] == 0.0 and share.groups["height"]["above"] == pytest.approx(0.5, abs=0.1)
    assert share.decided_by in ("smoother", "height")


@pytest.mark.parametrize(
    ("groups", "part", "decides"),
    [
        ({"a": {"x": 1.0, "y": 0.0}, "b": {"x": 0.5, "y": 0.5}}, 0.5, "a"),
        ({"a": {"x": 0.5, "y": 0.5}, "b": {"x": 0.5, "y": 0.5}}, 0.5, None),
        ({"a": {"x": 0.6, "y": 0.4}, "b": {"x": 0.9, "y": 0.9, "z": 0.0, "w": 0.0}}, 0.45, "b"),
        ({"a": {"x": 0.52, "y": 0.48}}, 0.5, None),  # no more than the worlds' own scatter
        ({"a": {"x": 1.0, "y": 1.0}}, 1.0, None),
    ],
)
def test_the_first_split_of_a_tree(groups, part, decides):
    assert multiverse._decisive(groups, 100, part) == decides


def test_a_claim_whose_numbers_no_world_gives_has_no_share(declared):
    other = CLAIM.model_copy(update={"id": "other", "metric": "toy/01-line:mean"})
    assert multiverse.survived(lambda c, t: claims.judge(c, t).holds, [other], [run({"smoother": "filtered"})]) == {}
    assert multiverse.share_of("other", counted(declared, 4, 1)) is None


def test_a_number_that_is_not_finite_does_not_hold():
    results = [{"toy/01-line:std": value} for value in (1.0, math.nan, math.inf)]
    held = multiverse.survived(lambda c, t: claims.judge(c, t).holds, [CLAIM], results)
    assert held == {"fine": [True, False, False]}


def test_a_stored_share_may_move_by_its_sampling_error(declared):
    stored = counted(declared, 100, 1)
    share = multiverse.share_of("fine", stored)
    assert multiverse.guarded("share.fine", stored) == share.error
    assert multiverse.guarded("part.smoother.smoothed.fine", stored) > share.error  # half the worlds
    assert multiverse.guarded("worlds", stored) is None
    entries = {key: entry | {"spread": 0.0} for key, entry in stored.items()}
    page = reference.Stored.__new__(reference.Stored)
    page.name, page.mode, page.entries, page.samples, page._guards, page._usual = (
        "toy/90-readings", "paper", entries, {}, [], 0.0,
    )  # fmt: skip
    _, allowed = page.allowed("share.fine")
    assert allowed.holds(share.part + 0.99 * share.error, share.part)
    assert not allowed.holds(share.part + 1.01 * share.error, share.part)
    assert page.allowed("count.fine")[1].rel == 1e-9


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("default: smoothed", "default: both", "choice smoother: the default is one of two or more"),
        ("range: [440, 500]", "range: [500, 440]", r"choice height: the range \[500, 440\] is empty"),
        ("  range: [440, 500]\n", "", "choice height: a choice has options or a range"),
        ("id: filtered", "id: smoothed", "choice smoother: an option is named twice"),
        ("default: 480", "default: high", "choice height: the default of a range is a number"),
        ("id: height", "id: smoother", "a choice is named twice"),
        ("asks: how high is the orbit?", "ask: x", "choice height: asks: Field required"),
        (READINGS, "a: 1", "holds no list of choices"),
        (READINGS, "- [", "line 1: "),
    ],
)
def test_malformed_readings_name_file_and_choice(toy, old, new, sentence):
    (toy / "book" / "toy" / "readings.yml").write_text(READINGS.replace(old, new))
    with pytest.raises(Fault, match=f"^book/toy/readings.yml[,:] ?{sentence}|^book/toy/readings.yml {sentence}"):
        multiverse.choices(toy, "toy")


def test_a_paper_without_readings(toy):
    with pytest.raises(Misuse, match="'toy' declares no readings: book/toy/readings.yml is missing"):
        multiverse.choices(toy, "toy")
