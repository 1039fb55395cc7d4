"""Renewing the references: what is stored of runs in several settings, what stays, and why it is done."""

import json
import shutil

import numpy as np
import pytest

from execbook import graph, reference, renewal, settings
from execbook.errors import Fault, Misuse

NAME = "toy/01-line"
X = np.linspace(0.0, 1.0, 1001)


def numbers(a=1.0, tiny=3e-13):
    return {"a": {"value": a, "unit": "m"}, "tiny": {"value": tiny, "unit": "m/s"}}


@pytest.fixture
def settle(toy, new_run):
    """Function that stores runs, setting -> (numbers, array); gives what moved and what is stored."""

    def stored(moves=True, **runs):
        folders = {setting: new_run(toy / setting, metrics, {"x": x}) for setting, (metrics, x) in runs.items()}
        moved = renewal.store(toy, folders, moves)
        return [d.key for d in moved], reference.load(toy, NAME, "paper")[0]

    return stored


def test_a_spread_is_stored_with_each_number(settle):
    moved, entries = settle(
        native=(numbers(), X), avx2=(numbers(1.0 + 2**-30, 2e-13), X), other=(numbers(1.0 - 2**-31, -7e-13), X + 1e-8)
    )
    assert moved == ["a", "tiny"]
    assert entries["a"] == {"value": 1.0, "unit": "m", "spread": 2**-30 + 2**-31}
    assert entries["tiny"] == {"value": 3e-13, "unit": "m/s", "spread": 1e-12, "largest": 7e-13}
    assert entries["x"] == {"shape": [1001], "stride": 3, "unit": "m", "spread": pytest.approx(1e-8)}


def test_a_spread_never_shrinks_while_the_value_stays(settle):
    settle(native=(numbers(), X), avx2=(numbers(1.0 + 1e-6, -7e-13), X + 1e-6))
    moved, entries = settle(native=(numbers(1.0 + 1e-7, 4e-13), X))
    assert moved == []
    assert entries["a"] == {"value": 1.0, "unit": "m", "spread": pytest.approx(1e-6)}
    assert entries["tiny"] == {"value": 3e-13, "unit": "m/s", "spread": pytest.approx(1e-12), "largest": 7e-13}
    assert entries["x"]["spread"] == pytest.approx(1e-6)
    _, entries = settle(native=(numbers(1.0 - 2e-6), X))  # another processor, still within the tolerance
    assert entries["a"] == {"value": 1.0, "unit": "m", "spread": pytest.approx(2e-6)}


def test_a_value_that_moved_starts_anew(settle):
    settle(native=(numbers(), X), avx2=(numbers(1.0 + 1e-6), X + 1e-6))
    moved, entries = settle(native=(numbers(2.0), X + 1.0), avx2=(numbers(2.0 + 1e-8), X + 1.0))
    assert moved == ["a", "x"]
    assert entries["a"] == {"value": 2.0, "unit": "m", "spread": pytest.approx(1e-8)}
    assert entries["x"]["spread"] == 0.0 and entries["tiny"]["value"] == 3e-13


def test_without_leave_to_move_only_spreads_grow(settle):
    settle(native=(numbers(), X))
    moved, entries = settle(False, native=(numbers(2.0, 3.1e-13), X), avx2=(numbers(2.0), X + 1e-9))
    assert moved == ["a", "tiny"] and entries["a"] == {"value": 1.0, "unit": "m", "spread": 0.0}
    assert entries["x"]["spread"] == pytest.approx(1e-9)


def test_what_a_setting_does_not_record_has_no_spread_there(settle):
    few = {k: v for k, v in numbers().items() if k == "a"} | {"b": {"value": None, "unit": ""}}
    _, entries = settle(native=(numbers() | {"b": {"value": None, "unit": ""}}, X), avx2=(few, X[:-1]))
    assert {key: entry["spread"] for key, entry in entries.items()} == {"a": 0.0, "b": 0.0, "tiny": 0.0, "x": 0.0}


def test_what_did_not_move_is_not_written_again(settle, toy):
    settle(native=(numbers(), X))
    path = reference.path_of(toy, NAME, "paper")
    before = [p.stat().st_mtime_ns for p in (path, path.with_suffix(".npz"))]
    settle(native=(numbers(), X))
    assert [p.stat().st_mtime_ns for p in (path, path.with_suffix(".npz"))] == before


def test_quick_runs_have_a_reference_of_their_own(toy, new_run):
    renewal.store(toy, {"native": new_run(toy / "run", numbers())})
    run = new_run(toy / "quick", numbers(), mode="quick")
    with pytest.raises(
        Fault, match=r"toy/01-line has no reference at quick scale \(tests/reference/toy/01-line.quick.json\); make one"
    ):
        reference.differences(toy, run)
    renewal.store(toy, {"native": run})
    assert not [d for d in reference.differences(toy, run) if d.problem]


def test_runs_of_ones_own_are_no_reference(toy, new_run):
    with pytest.raises(Misuse, match="was run with other parameters"):
        renewal.store(toy, {"native": new_run(toy / "run", numbers(), mode="custom")})


def test_the_reason_goes_into_the_changelog(toy):
    renewal.note_reason(toy, "first", 1)
    assert (
        toy / "CHANGELOG.md"
    ).read_text() == "# Changelog\n\n## Unreleased\n\n- References renewed (1 number moved or new): first\n\n"
    (toy / "CHANGELOG.md").write_text("# Changelog\n\n## [Unreleased]\n\n- earlier\n\n## 0.1.0\n")
    renewal.note_reason(toy, "better", 2)
    text = (toy / "CHANGELOG.md").read_text()
    assert (
        text == "# Changelog\n\n## [Unreleased]\n\n- References renewed (2 numbers moved or new): better\n"
        "- earlier\n\n## 0.1.0\n"
    )


def test_a_page_is_renewed_alone_in_all_settings(built, tmp_path, geokalman, monkeypatch):
    root = shutil.copytree(built, tmp_path / "clone")
    both = settings.names()[:: max(1, len(settings.names()) - 1)]  # the first and the last are enough
    monkeypatch.setattr(settings, "names", lambda: both)
    done = geokalman(root, "reference", "--reason", "the first one", NAME)
    assert done.returncode == 0, done.stderr
    made = root / "book" / "_build" / "settings"
    runs = {p.parent.relative_to(made).as_posix() for p in made.rglob("provenance.json")}
    wanted = {f"{s}/{m}/{NAME}" for s in settings.names() for m in ("quick", "paper")} - {f"native/paper/{NAME}"}
    assert runs == wanted
    for run in runs:
        told = json.loads((made / run / "provenance.json").read_text())["setting"]
        assert told["threads"] == 1 and (told["numba"] == "generic") == run.startswith("no-fma")
    assert [p.name for p in (root / "tests" / "reference" / "toy").glob("*.json")] == [
        "01-line.json",
        "01-line.quick.json",
    ]
    done = geokalman(root, "portable", NAME)
    assert (done.returncode, done.stdout) == (0, "0 numbers beyond their tolerance so far\n"), done.stderr
    assert "starts" not in done.stderr, "the runs are fresh"


@pytest.mark.parametrize(
    "reason, sentence",
    [([], "A renewal needs a reason"), (["--reason", "x", "toy/03"], "'toy/03' is no notebook")],
)
def test_no_renewal_without_reason_or_notebook(built, geokalman, reason, sentence):
    done = geokalman(built, "reference", *reason)
    assert done.returncode == 2 and sentence in done.stderr


def test_no_renewal_from_an_old_run(built, tmp_path, geokalman):
    root = shutil.copytree(built, tmp_path / "clone")
    shutil.rmtree(graph.run_folder(root, "toy/01-line"))
    done = geokalman(root, "reference", "--reason", "x", "--no-quick")
    assert (
        done.returncode == 2 and "toy/01-line has no run from the present sources; make book executes it" in done.stderr
    )
