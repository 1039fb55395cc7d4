"""Stored references: a run against them key by key, declared guards, anchors, and `geokalman check`."""

import json
import shutil

import numpy as np
import pytest

from execbook import check, reference, renewal, settings
from execbook.errors import Fault, Misuse

NUMBERS = {"a": {"value": 1.0, "unit": "m"}, "tiny": {"value": 3e-13, "unit": "m/s"}}


@pytest.fixture
def stored(toy, new_run):
    """A clone with a stored reference of one run."""
    renewal.store(toy, {"native": new_run(toy / "run", NUMBERS)})
    return toy


def problems(root, folder):
    return {d.key: d.problem for d in reference.differences(root, folder) if d.problem}


def test_the_same_run_agrees_and_arrays_are_sampled(stored):
    assert problems(stored, stored / "run") == {}
    entries, samples = reference.load(stored, "toy/01-line", "paper")
    assert entries["a"] == {"value": 1.0, "unit": "m", "spread": 0.0}
    assert entries["x"] == {"shape": [1001], "stride": 3, "unit": "m", "spread": 0.0} and samples["x"].size == 334


@pytest.mark.parametrize(
    "metrics, found",
    [
        ({"a": {"value": 1.0 + 0.9e-9, "unit": "m"}}, {"tiny": "no longer recorded"}),
        (NUMBERS | {"a": {"value": 1.0 + 1.1e-9, "unit": "m"}}, {"a": "beyond rel 1e-09"}),
        (NUMBERS | {"a": {"value": 1.0, "unit": "km"}}, {"a": "its unit was m, now it is km"}),
        (NUMBERS | {"a": {"value": None, "unit": "m"}}, {"a": "finite in one of the two only"}),
        (NUMBERS | {"b": {"value": 1.0, "unit": "m"}}, {"b": "not in the reference"}),
    ],
)
def test_numbers_that_move(stored, new_run, metrics, found):
    assert problems(stored, new_run(stored / "other", metrics)) == found


@pytest.mark.parametrize(
    "x, found",
    [
        (np.linspace(0.0, 1.0, 1001) + 0.9e-9, None),
        (np.linspace(0.0, 1.0, 1001) + 1.2e-9, "differs by up to 1.2e-09, beyond rel 1e-09 of 0.999"),
        (np.linspace(0.0, 1.0, 1000), "its shape was [1001], now it is [1000]"),
        (np.full(1001, np.nan), "differs by up to 0, beyond rel 1e-09 of 0.999"),
    ],
)
def test_arrays_that_move(stored, new_run, x, found):
    assert problems(stored, new_run(stored / "other", NUMBERS, {"x": x})).get("x") == found


GUARDS = """
- {notebook: toy/01-line, key: "t*", mode: paper, max: 1.0e-9, why: it is chaotic}
- {notebook: toy/01-line, key: x, none: true, why: it is where a maximum lies}
"""


def test_declared_guards_stand_before_the_rule(stored, new_run):
    path = stored / "tests" / "reference" / "toy" / "guards.yml"
    path.write_text(GUARDS)
    moved = NUMBERS | {"tiny": {"value": 9e-10, "unit": "m/s"}}
    assert problems(stored, new_run(stored / "other", moved, {"x": np.ones(3)})) == {}
    moved["tiny"] = {"value": 1.1e-9, "unit": "m/s"}
    assert problems(stored, new_run(stored / "other", moved)) == {"tiny": "beyond max 1e-09"}
    path.write_text(GUARDS.replace("paper", "quick").replace("none: true", "size: 1.5"))
    found = problems(stored, new_run(stored / "other", moved, {"x": np.linspace(0.0, -1.6, 1001)}))
    assert found["tiny"] == "beyond rel 1e-09" and "beyond size 1.5" in found["x"]
    path.write_text(GUARDS.replace("why: it is chaotic", "because: it is chaotic"))
    with pytest.raises(Fault, match=r"toy/guards.yml, guard 0.why: Field required"):
        reference.guards(stored, "toy")


def test_no_run_and_no_readable_reference(stored):
    with pytest.raises(Misuse, match="is no folder of a run"):
        reference.read_run(stored / "book")
    reference.path_of(stored, "toy/01-line", "paper").write_text("{")
    with pytest.raises(Fault, match="tests/reference/toy/01-line.json .*cannot be read"):
        reference.differences(stored, stored / "run")
    reference.path_of(stored, "toy/01-line", "paper").write_text('{"a": {"value": 1, "unit": "m"}}')
    with pytest.raises(Fault, match="The stored reference of a is malformed: it has no 'spread'"):
        reference.differences(stored, stored / "run")


ANCHORS = [{"value": 49, "rel": 1e-3, "source": "section 2"}, {"max": 50, "source": "section 3"}]


def write_anchors(root, mode="paper", key="line.mean", anchors=ANCHORS):
    path = reference.path_of(root, "toy/01-line", mode)
    entries = json.loads(path.read_text()) if path.is_file() else {}
    entries.setdefault(key, {})["anchors"] = anchors
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(entries))


def test_anchors_are_held_with_the_reference_and_stay_when_it_is_renewed(stored, new_run):
    write_anchors(stored, key="a", anchors=[{"value": 1, "abs": 0.1, "source": "s"}, {"max": 0.5, "source": "t"}])
    write_anchors(stored, key="gone", anchors=[{"max": 1, "source": "u"}])
    found = {(d.key, d.source): d.problem for d in reference.differences(stored, stored / "run") if d.source}
    assert found == {("a", "s"): "", ("a", "t"): "beyond max 0.5", ("gone", "u"): "not recorded"}
    renewal.store(stored, {"native": new_run(stored / "other", NUMBERS | {"a": {"value": 2.0, "unit": "m"}})})
    entry = reference.load(stored, "toy/01-line", "paper")[0]["a"]
    assert entry["value"] == 2.0 and [a["source"] for a in entry["anchors"]] == ["s", "t"]


def test_a_scale_with_anchors_alone_has_no_other_reference(toy, new_run):
    write_anchors(toy, "mid", "a", [{"value": 1, "abs": 0.1, "source": "s"}])
    assert [d.problem for d in reference.differences(toy, new_run(toy / "run", NUMBERS), "mid")] == [""]
    renewal.store(toy, {"native": toy / "run"})
    assert reference.load(toy, "toy/01-line", "paper")[0].keys() == {"a", "tiny", "x"}


@pytest.mark.parametrize(
    "anchor, sentence",
    [
        ({"value": 1, "rel": 1}, "An anchor of a is malformed: source: Field required"),
        ({"value": 1, "source": "s"}, "malformed: a tolerance is exactly one"),
        ({"rel": 1, "source": "s"}, "an anchor without a value has size, min or max"),
    ],
)
def test_malformed_anchors(stored, anchor, sentence):
    write_anchors(stored, key="a", anchors=[anchor])
    with pytest.raises(Fault, match=sentence):
        reference.differences(stored, stored / "run")


@pytest.fixture(scope="module")
def good(built, tmp_path_factory, geokalman):
    """A built clone whose references, anchors, verdicts and README all agree."""
    root = shutil.copytree(built, tmp_path_factory.mktemp("good") / "clone")
    write_anchors(root)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(settings, "names", lambda: [settings.NATIVE])
        done = geokalman(root, "reference", "--reason", "the first ones")
    assert done.returncode == 0, done.stderr
    assert geokalman(root, "claims", "--readme").returncode == 0
    return root


def test_check_of_a_good_book(good, geokalman):
    done = geokalman(good, "check")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "3 stored numbers, 2 anchors, 2 claims (1 near a threshold): 0 problems\n"
    assert "the first ones" in (good / "CHANGELOG.md").read_text()
    assert (good / "tests" / "reference" / "toy" / "01-line.quick.json").is_file()


SPOILT = [
    ("tests/reference/toy/01-line.json", lambda t: t.replace('"value": 49.0', '"value": 49.1'),
     "toy/01-line: line.mean: 49.00000 m, stored is 49.10000 m: beyond rel 1e-09."),
    ("tests/reference/toy/02-constant.json", None, "toy/02-constant has no reference at paper scale"),
    ("tests/reference/toy/01-line.json", lambda t: t.replace('"max": 50', '"max": 40'),
     "toy/01-line: line.mean: 49.00000 m, its anchor (section 3) is nothing m: beyond max 40."),
    ("tests/reference/toy/guards.yml", lambda _: "- {notebook: toy/01-line, key: gone.*, none: true, why: x}",
     "tests/reference/toy/guards.yml guards gone.* of toy/01-line, which records nothing of that name."),
    ("book/toy/claims.yml", lambda t: t.replace("factor: 10", "factor: 1e3"),
     "claim steeper: not-reproduced (; ours 49.00 m (line mean) not > 1000 × 3.000 m (quotient)), expected reproduced."),
    ("book/toy/claims.yml", lambda t: t.replace("verdict: reproduced", "verdict: not-reproduced", 1),
     "claim mean: reproduced (accepted ±0.1 %; ours 49.0), expected not-reproduced."),
    ("README.md", lambda t: t.replace("| 2 | 2 |", "| 2 | 1 |"),
     "README.md: its verdicts are not those of the ledgers"),
    ("book/_build/runs/toy/01-line/provenance.json", None, "toy/01-line has no run in the book"),
    ("book/_build/runs/toy/01-line/figures/line.csv", lambda t: t + "1,2\n",
     "its run is older than its sources, or damaged"),
    ("book/_build/runs/toy/01-line/tables/numbers.csv", lambda t: t.splitlines()[0] + "\nmean,\n",
     "toy/01-line: column 'value [m]' of table numbers is empty."),
]  # fmt: skip


@pytest.mark.parametrize("path, edit, sentence", SPOILT)
def test_check_finds_what_moved(good, tmp_path, monkeypatch, path, edit, sentence):
    root = shutil.copytree(good, tmp_path / "clone")
    monkeypatch.setenv("EXECBOOK_ROOT", str(root))
    if edit is None:
        (root / path).unlink()
    else:
        (root / path).write_text(edit((root / path).read_text() if (root / path).exists() else ""))
    assert any(sentence in problem for problem in check.check(root).problems), check.check(root).problems
