"""The chapters of the foundations at the quick scale: stored references, figures, and what a chapter has to have."""

from __future__ import annotations

import re
from pathlib import Path

import numba
import pytest

from execbook import notebooks, reference
from execbook.project import root as project_root

PART = "foundations"
ROOT = project_root(Path(__file__).parent)
CHAPTERS = tuple(sorted(p.stem for p in (ROOT / "book" / PART).glob("[0-9]*.md")))
compiled = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="hours of orbit take minutes in plain Python")


def text(name: str) -> str:
    return (ROOT / "book" / PART / f"{name}.md").read_text(encoding="utf-8")


def lacks(page: str) -> list[str]:
    """What a chapter must have and has not."""
    bare = re.sub(r"```\{code-cell\}.*?```", "", page, flags=re.S)
    cited = {key for keys in re.findall(r"\{cite:[tp]\}`([^`]+)`", bare) for key in keys.split(",")}
    exercises = set(re.findall(r"\{exercise-start\}.*\n:label: (\S+)", bare))
    solved = set(re.findall(r"\{solution-start\} (\S+)\n:class: dropdown", bare))
    wanted = {
        "eight works cited": len(cited) >= 8,
        "twelve numbered equations": len(re.findall(r"^:label: eq-", bare, re.M)) >= 12,
        "three exercises": len(exercises) >= 3,
        "a hidden solution of each": exercises == solved,
        "a cell to predict": "Predict, then run" in bare and "{dropdown} Answer" in bare,
        "GRACE": "\n## The same on GRACE\n" in bare,
        "a summary": "\n## Summary\n" in bare,
        "its public functions": "\n## Public functions used here\n" in bare,
    }
    return [what for what, there in wanted.items() if not there]


@pytest.mark.parametrize("name", CHAPTERS)
def test_a_chapter_has_all_its_parts(name):
    assert lacks(text(name)) == []


def test_a_part_that_is_not_there_is_seen():
    assert "a summary" in lacks(text(CHAPTERS[0]).replace("## Summary", "## End"))
    assert lacks(text(CHAPTERS[0]).replace(":class: dropdown", "", 1)) == ["a hidden solution of each"]


@pytest.mark.parametrize("name", CHAPTERS)
def test_every_check_of_a_formula_holds(name):
    """A key that ends in `agree`, `agrees` or `stationary` is one where a formula was compared with the code."""
    stored = reference.load(ROOT, f"{PART}/{name}", "paper")[0]
    checks = {key: entry for key, entry in stored.items() if re.search(r"\.(agrees?|stationary)$", key)}
    assert all(entry["value"] == 1.0 for entry in checks.values())
    assert all(f'"{key}"' in notebooks.code(notebooks.read(ROOT, f"{PART}/{name}")) for key in checks)


@compiled
@pytest.mark.parametrize("name", CHAPTERS)
def test_stored_reference(run_notebook, assert_held, name):
    assert_held(reference.differences(ROOT, run_notebook(PART, name), "quick"))


@compiled
@pytest.mark.parametrize("name", CHAPTERS)
def test_figures_are_drawn_twice_with_their_data(run_notebook, assert_drawn, name):
    assert_drawn(run_notebook(PART, name))
