"""Every public function of the core shows an example, and every example gives what it says."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
from pathlib import Path
from types import ModuleType

import pytest

from geokalman import kalman

MODULES = [importlib.import_module(f"geokalman.kalman.{found.name}") for found in pkgutil.iter_modules(kalman.__path__)]
BY_HAND = ("predict", "update", "gate", "redundancy_numbers", "sigma_points", "whiten_columns")
STEPS = ("linear", "extended", "unscented", "robust", "whitening")


@pytest.mark.parametrize("module", [kalman, *MODULES], ids=lambda module: module.__name__.rpartition(".")[2])
def test_examples_give_what_they_say(module: ModuleType):
    assert doctest.testmod(module).failed == 0


def test_every_public_function_has_one():
    public = [getattr(kalman, name) for name in kalman.__all__]
    for module in (m for m in MODULES if m.__name__.rpartition(".")[2] in STEPS):
        public += [value for name, value in vars(module).items() if name in BY_HAND]
    functions = [value for value in public if inspect.isfunction(value)]
    assert len(functions) > 15
    assert [f.__qualname__ for f in functions if ">>>" not in (f.__doc__ or "")] == []


def test_the_complete_example_is_short():
    lines = [line for line in kalman.__doc__.splitlines() if line.lstrip().startswith((">>>", "..."))]
    assert 15 < len(lines) <= 40


def test_the_readme_shows_it() -> None:
    readme = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    shown = readme.partition("```pycon\n")[2].partition("```")[0]
    assert [e.source for e in doctest.DocTestParser().get_examples(shown)] == [
        e.source for e in doctest.DocTestParser().get_examples(kalman.__doc__)
    ]
