"""The chapters that teach, at quick scale: numbers as stored, figures drawn, promises of the text held."""

from __future__ import annotations

import re
from pathlib import Path

import numba
import pytest

from execbook import reference
from execbook.project import root as project_root

PART = "foundations"
ROOT = project_root(Path(__file__).parent)
CHAPTERS = tuple(sorted(p.stem for p in (ROOT / "book" / PART).glob("[0-9]*.md")))
EQUATIONS, CITATIONS, EXERCISES = 12, 8, 3
"""Fewest of each in a chapter."""


def text_of(name: str) -> str:
    return (ROOT / "book" / PART / f"{name}.md").read_text(encoding="utf-8")


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="hundreds of flights take long in plain Python")
@pytest.mark.parametrize("name", CHAPTERS)
def test_stored_reference(run_notebook, assert_held, name):
    stored = reference.path_of(ROOT, f"{PART}/{name}", "quick")
    assert stored.is_file(), f"{name} has no reference; store one: make reference REASON=... (it needs make book)"
    assert_held(reference.differences(ROOT, run_notebook(PART, name), "quick"))


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="hundreds of flights take long in plain Python")
@pytest.mark.parametrize("name", CHAPTERS)
def test_figures_are_drawn_twice_with_their_data(run_notebook, assert_drawn, name):
    assert_drawn(run_notebook(PART, name))


@pytest.mark.parametrize("name", CHAPTERS)
def test_a_chapter_has_what_a_chapter_needs(name):
    text = text_of(name)
    assert len(set(re.findall(r"^:label: (eq-[\w-]+)$", text, re.M))) >= EQUATIONS
    cited = [key for keys in re.findall(r"\{cite:[pt]\}`([^`]+)`", text) for key in keys.split(",")]
    assert len({key.strip() for key in cited}) >= CITATIONS
    asked = re.findall(r"^:label: (ex-[\w-]+)$", text, re.M)
    assert len(asked) >= EXERCISES
    assert sorted(asked) == sorted(re.findall(r"^`+\{solution-start\} (\S+)$", text, re.M))
    assert "Predict, then run" in text and "## Summary" in text and "## The same on GRACE" in text
    assert "## Public functions used here" in text
