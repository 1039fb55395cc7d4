"""Every public function of the core shows an example, and every example gives what it says."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from geokalman import kalman, leastsquares
from geokalman.physics import harmonics

MODULES = [importlib.import_module(f"geokalman.kalman.{found.name}") for found in pkgutil.iter_modules(kalman.__path__)]
MODULES += [kalman, leastsquares, harmonics]
APPLICATIONS = (
    "pair.model", "pair.estimate", "grace.estimate", "attitude.experiment", "airborne.estimate", "radioastron.estimate",
    "pulsar.estimate",
)  # fmt: skip
SHOWN = [importlib.import_module(f"geokalman.{name}") for name in ("physics.sphere", "physics.field", *APPLICATIONS)]
KERNELS = ("geokalman.kalman.dense", "geokalman.kalman.loop")


def documented(module: ModuleType) -> Iterator[tuple[str, str]]:
    """Names and docstrings of the functions and classes that a module defines."""
    for name, value in vars(module).items():
        value = inspect.unwrap(value) if callable(value) else value
        if getattr(value, "__module__", None) == module.__name__ and inspect.isroutine(value) | inspect.isclass(value):
            yield name, value.__doc__ or ""


def without_example(module: ModuleType) -> list[str]:
    """Names of the public functions with no example; kernels, which trust their arguments, need none."""
    trusting = "" if module.__name__ in KERNELS else ("_step", "_loop")
    return [
        name
        for name, doc in documented(module)
        if ">>>" not in doc and not name.startswith("_") and not name.endswith(trusting)
        and inspect.isroutine(inspect.unwrap(getattr(module, name)))
    ]  # fmt: skip


@pytest.mark.parametrize("module", [*MODULES, *SHOWN], ids=lambda module: module.__name__.partition(".")[2])
def test_examples_give_what_they_say(module: ModuleType):
    result = doctest.testmod(module, extraglobs={"np": np})
    assert result.failed == 0 and (result.attempted or module not in SHOWN)


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__.rpartition(".")[2])
def test_every_public_function_has_one(module: ModuleType):
    assert without_example(module) == []


def test_a_function_without_one_is_found():
    planted = ModuleType("planted")
    exec("def bare(): 'Do.'\ndef shown(): '>>> 1'\ndef bare_step(): 'Do.'", vars(planted))
    assert without_example(planted) == ["bare"]


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__.rpartition(".")[2])
def test_summaries_are_one_short_line(module: ModuleType):
    docs = [*documented(module), ("module", module.__doc__ or "")]
    lines = {name: (doc.splitlines() + ["", ""])[:2] for name, doc in docs if doc}
    assert {name: first for name, (first, second) in lines.items() if len(first) > 88 or second.strip()} == {}


def test_the_complete_example_is_short():
    lines = [line for line in kalman.__doc__.splitlines() if line.lstrip().startswith((">>>", "..."))]
    assert 15 < len(lines) <= 40


def test_the_readme_shows_it() -> None:
    readme = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    shown = readme.partition("```pycon\n")[2].partition("```")[0]
    assert [e.source for e in doctest.DocTestParser().get_examples(shown)] == [
        e.source for e in doctest.DocTestParser().get_examples(kalman.__doc__)
    ]
