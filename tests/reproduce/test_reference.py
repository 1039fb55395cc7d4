"""Stored references: a run against them key by key, renewing with a reason, anchors, and `geokalman check`."""

import json
import shutil

import numpy as np
import pytest

from geokalman.reproduce import check, graph, reference
from geokalman.reproduce.errors import Fault, Misuse

NUMBERS = {"a": {"value": 1.0, "unit": "m"}, "tiny": {"value": 3e-13, "unit": "m/s"}}


def make_run(folder, metrics=NUMBERS, arrays=None, mode="paper", notebook="toy/01-line"):
    """A run folder as a notebook leaves it, without running one."""
    arrays = {"x": np.linspace(0.0, 1.0, 1001)} if arrays is None else arrays
    folder.mkdir(parents=True, exist_ok=True)
    described = {k: {"shape": list(a.shape), "unit": "m"} for k, a in arrays.items()}
    (folder / "provenance.json").write_text(
        json.dumps({"notebook": notebook, "mode": mode, "parameters": {}, "arrays": described})
    )
    (folder / "metrics.json").write_text(json.dumps(metrics))
    np.savez(folder / "arrays.npz", **arrays)
    return folder


@pytest.fixture
def stored(toy):
    """A clone with a stored reference of one run."""
    moved = reference.renew(toy, make_run(toy / "run"))
    assert [d.key for d in moved] == ["a", "tiny"]
    return toy


def problems(root, folder):
    return {d.key: d.problem for d in reference.differences(root, folder) if d.problem}


def test_the_same_run_agrees_and_arrays_are_sampled(stored):
    assert problems(stored, stored / "run") == {}
    entries, samples = reference.load(stored, "toy/01-line", "paper")
    assert entries["a"] == {"value": 1.0, "unit": "m", "rel": 1e-6}
    assert entries["x"] == {"shape": [1001], "stride": 3, "unit": "m", "rel": 1e-6} and samples["x"].size == 334


@pytest.mark.parametrize(
    "metrics, found",
    [
        ({"a": {"value": 1.0 + 0.9e-6, "unit": "m"}}, {"tiny": "no longer recorded"}),
        (NUMBERS | {"a": {"value": 1.0 + 1.1e-6, "unit": "m"}}, {"a": "beyond rel 1e-06"}),
        (NUMBERS | {"a": {"value": 1.0, "unit": "km"}}, {"a": "its unit was m, now it is km"}),
        (NUMBERS | {"a": {"value": None, "unit": "m"}}, {"a": "finite in one of the two only"}),
        (NUMBERS | {"b": {"value": 1.0, "unit": "m"}}, {"b": "not in the reference"}),
    ],
)
def test_numbers_that_move(stored, metrics, found):
    assert problems(stored, make_run(stored / "other", metrics)) == found


@pytest.mark.parametrize(
    "x, found",
    [
        (np.linspace(0.0, 1.0, 1001) + 0.9e-6, None),
        (np.linspace(0.0, 1.0, 1001) + 1.2e-6, "differs by up to 1.2e-06, beyond rel 1e-06 of 0.999"),
        (np.linspace(0.0, 1.0, 1000), "its shape was [1001], now it is [1000]"),
        (np.full(1001, np.nan), "differs by up to 0, beyond rel 1e-06 of 0.999"),
    ],
)
def test_arrays_that_move(stored, x, found):
    assert problems(stored, make_run(stored / "other", arrays={"x": x})).get("x") == found


@pytest.mark.parametrize(
    "tolerance, value, good",
    [({"max": 1e-9}, 9e-10, True), ({"max": 1e-9}, 2e-9, False), ({"min": 0.5}, 0.4, False),
     ({"factor": 2}, 5e-13, True),
     ({"factor": 2}, -3e-13, False), ({"abs": 1e-12}, 1.2e-12, True), ({"abs": 1e-12}, 1.4e-12, False)],
)  # fmt: skip
def test_tolerances_stand_beside_the_key_and_survive_renewal(stored, tolerance, value, good):
    path = reference.path_of(stored, "toy/01-line", "paper")
    entries = json.loads(path.read_text())
    entries["tiny"] = {"value": 3e-13, "unit": "m/s", **tolerance}
    path.write_text(json.dumps(entries))
    run = make_run(
        stored / "other", NUMBERS | {"tiny": {"value": value, "unit": "m/s"}, "a": {"value": 2.0, "unit": "m"}}
    )
    assert ("tiny" not in problems(stored, run)) == good
    reference.renew(stored, run)
    renewed = json.loads(path.read_text())["tiny"]
    assert renewed == {"value": value, "unit": "m/s", **tolerance}


def test_renewing_what_did_not_move_writes_nothing(stored):
    path = reference.path_of(stored, "toy/01-line", "paper")
    before = path.stat().st_mtime_ns
    run = make_run(stored / "other", NUMBERS | {"a": {"value": 1.0 + 1e-9, "unit": "m"}})
    assert reference.renew(stored, run) == [] and path.stat().st_mtime_ns == before


def test_quick_runs_have_a_reference_of_their_own(stored):
    run = make_run(stored / "quick", mode="quick")
    with pytest.raises(
        Fault, match=r"toy/01-line has no reference at quick scale \(tests/reference/toy/01-line.quick.json\); make one"
    ):
        reference.differences(stored, run)
    reference.renew(stored, run)
    assert problems(stored, run) == {}


def test_runs_of_ones_own_are_no_reference(toy):
    with pytest.raises(Misuse, match="was run with parameters of its own"):
        reference.renew(toy, make_run(toy / "run", mode="custom"))


def test_no_run_and_no_readable_reference(stored):
    with pytest.raises(Misuse, match="is no folder of a run"):
        reference.read_run(stored / "book")
    reference.path_of(stored, "toy/01-line", "paper").write_text("{")
    with pytest.raises(Fault, match="tests/reference/toy/01-line.json .*cannot be read"):
        reference.differences(stored, stored / "run")
    reference.path_of(stored, "toy/01-line", "paper").write_text('{"a": {"value": 1, "unit": "m", "rel": 1, "abs": 2}}')
    with pytest.raises(Fault, match="the stored reference of a is malformed: .*exactly one of rel, abs"):
        reference.differences(stored, stored / "run")


def test_the_reason_goes_into_the_changelog(toy):
    reference.note_reason(toy, "first", 1)
    assert (
        toy / "CHANGELOG.md"
    ).read_text() == "# Changelog\n\n## Unreleased\n\n- References renewed (1 number moved or new): first\n\n"
    (toy / "CHANGELOG.md").write_text("# Changelog\n\n## [Unreleased]\n\n- earlier\n\n## 0.1.0\n")
    reference.note_reason(toy, "better", 2)
    text = (toy / "CHANGELOG.md").read_text()
    assert (
        text == "# Changelog\n\n## [Unreleased]\n\n- References renewed (2 numbers moved or new): better\n"
        "- earlier\n\n## 0.1.0\n"
    )


ANCHORS = """
- {notebook: toy/01-line, mode: book, key: line.mean, value: 49, rel: 1e-3}
- {notebook: toy/01-line, mode: book, key: line.mean, max: 50}
- {notebook: toy/01-line, mode: quick, key: line.mean, value: 4, abs: 0.1}
"""


def write_anchors(root, text=ANCHORS):
    path = root / "tests" / "reference" / "toy" / "anchors.yml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def test_anchors(toy):
    write_anchors(toy)
    found = reference.anchors(toy, "toy")
    assert [a.mode for a in found] == ["book", "book", "quick"]
    assert [d.problem for d in reference.hold(found, {"line.mean": {"value": 49.04, "unit": "m"}})] == [
        "",
        "",
        "beyond abs 0.1",
    ]
    assert [d.problem for d in reference.hold(found[:1], {})] == ["not recorded"]
    assert reference.anchors(toy, "other") == []


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("- {notebook: a, mode: huge, key: x, max: 1}", "anchor 1: mode Input should be 'quick'"),
        ("- {notebook: a, mode: book, key: x, value: 1}", "anchor 1: tolerance .*exactly one"),
        ("- {notebook: a, mode: book, key: x, rel: 1}", r"anchor 1 \(x\) has no value; only max and min stand alone"),
        ("- [", "anchors.yml: line 1"),
    ],
)
def test_malformed_anchors(toy, text, sentence):
    write_anchors(toy, text)
    with pytest.raises(Fault, match=sentence):
        reference.anchors(toy, "toy")


@pytest.fixture(scope="module")
def good(built, tmp_path_factory, geokalman):
    """A built clone whose references, anchors, verdicts and README all agree."""
    root = shutil.copytree(built, tmp_path_factory.mktemp("good") / "clone")
    write_anchors(root)
    done = geokalman(root, "reference", "--reason", "the first ones")
    assert done.returncode == 0, done.stderr
    assert geokalman(root, "claims", "--readme").returncode == 0
    return root


def test_check_of_a_good_book(good, geokalman):
    done = geokalman(good, "check")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "3 stored numbers, 2 anchors, 2 claims: 0 problems\n"
    assert "the first ones" in (good / "CHANGELOG.md").read_text()
    assert (good / "tests" / "reference" / "toy" / "01-line.quick.json").is_file()


SPOILT = [
    ("tests/reference/toy/01-line.json", lambda t: t.replace('"value": 49.0', '"value": 49.1'),
     "toy/01-line: line.mean: 49.00000 m, stored is 49.10000 m: beyond rel 1e-06."),
    ("tests/reference/toy/02-constant.json", None, "toy/02-constant has no reference at paper scale"),
    ("tests/reference/toy/anchors.yml", lambda t: t.replace("max: 50", "max: 40"),
     "toy/01-line, anchor line.mean: 49.00000 m, stored is nothing m: beyond max 40."),
    ("tests/reference/toy/anchors.yml", lambda t: t.replace("01-line", "09-gone"),
     "names toy/09-gone, which is no notebook"),
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
    monkeypatch.setenv("GEOKALMAN_ROOT", str(root))
    if edit is None:
        (root / path).unlink()
    else:
        (root / path).write_text(edit((root / path).read_text()))
    assert any(sentence in problem for problem in check.check(root).problems), check.check(root).problems


@pytest.mark.parametrize(
    "reason, sentence",
    [([], "references are renewed for a reason"), (["--reason", "x", "toy/03"], "'toy/03' is no notebook")],
)
def test_no_renewal_without_reason_or_notebook(good, geokalman, reason, sentence):
    done = geokalman(good, "reference", *reason)
    assert done.returncode == 2 and sentence in done.stderr


def test_no_renewal_from_an_old_run(good, tmp_path, geokalman):
    root = shutil.copytree(good, tmp_path / "clone")
    shutil.rmtree(graph.run_folder(root, "toy/01-line"))
    done = geokalman(root, "reference", "--reason", "x", "--no-quick")
    assert (
        done.returncode == 2 and "toy/01-line has no run from the present sources; make book executes it" in done.stderr
    )
