"""The notebooks of the primary paper at the scales of the specification: QUICK, and MID (degree 70, 5 days)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numba
import pytest

from execbook import reference
from execbook.project import root as project_root

PAPER = "grace-fusion"
ROOT = project_root(Path(__file__).parent)
QUICK = tuple(sorted(p.stem for p in (ROOT / "book" / PAPER).glob("[0-9]*.md")))
MID = QUICK[:4]
DRAWINGS = ("g01-pair",)
pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="days of orbit take hours in plain Python")


def scales(*runs: tuple[str, tuple[str, ...]]) -> list:
    """Parameters (scale, notebook)."""
    return [pytest.param(scale, name, id=f"{scale}-{name}") for scale, names in runs for name in names]


@pytest.fixture(scope="session")
def run(run_notebook) -> Callable[[str, str], Path]:
    """The run folder of a notebook at a scale."""

    def executed(scale: str, name: str) -> Path:
        given = {"days": 5.0} if scale == "mid" else {}
        return run_notebook(PAPER, name, scale, quick=scale == "quick", **given)

    return executed


@pytest.mark.parametrize(("scale", "name"), scales(("quick", QUICK), ("mid", MID)))
def test_stored_reference(run, assert_held, scale, name):
    stored = reference.path_of(ROOT, f"{PAPER}/{name}", scale)
    assert stored.is_file(), (
        f"{name} has no reference at {scale} scale; store one: make reference REASON=... (it needs make book)"
    )
    assert_held(reference.differences(ROOT, run(scale, name), scale))


@pytest.mark.parametrize(("scale", "name"), scales(("quick", QUICK)))
def test_figures_are_drawn_twice_with_their_data(run, assert_drawn, scale, name):
    assert_drawn(run(scale, name), DRAWINGS)


def test_book_anchors_name_what_is_recorded(run):
    """A key of a paper-scale anchor is recorded by the quick run too, unless it needs degrees above 30 or days above
    5."""
    name = "05-recovery"
    metrics = reference.read_run(run("quick", name))[1]
    stored = reference.load(ROOT, f"{PAPER}/{name}", "paper")[0]
    keys = [key for key, entry in stored.items() if "anchors" in entry]
    missing = [k for k in keys if k not in metrics and not any(word in k for word in ("above30", ".n50.", ".n70."))]
    assert keys and not missing


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        (
            "01-orbits",
            {"a_km": 6400.0},
            r"a_km = 6400 with e = 0.0018: the orbit meets the atmosphere, its perigee is 10.3 km",
        ),
        (
            "05-recovery",
            {"days": 0.2},
            r"377 epochs .* cannot determine the 957 coefficients of degrees 2 to 30; give at least 0.40 days",
        ),
        (
            "03-ekf",
            {"edge": 8000},
            r"edge = 8000 epochs at either end leave nothing of 14401",
        ),
    ],
    ids=["low-orbit", "few-epochs", "large-edge"],
)
def test_a_scenario_that_cannot_be_computed_says_so(run_here, tmp_path, name, given, message):
    with pytest.raises(ValueError, match=message):
        run_here(PAPER, name, tmp_path / "out", **given)
    assert not (tmp_path / "out").exists()
