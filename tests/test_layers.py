"""Who may import whom, as CONTRIBUTING.md says: read from the sources, so that no import has to happen."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "geokalman"
APPLICATIONS = {"grace", "attitude", "airborne", "radioastron", "pulsar"}
GROUND = {"constants", "files", "reading", "style", "sources", "compilation", "memory", "progress"}
MODELS = {"physics", "leastsquares", "kalman"}
ALLOWED = {
    **{application: {application} | MODELS | GROUND for application in APPLICATIONS},
    "reproduce": {"reproduce"} | GROUND,
    "physics": {"physics", "leastsquares", "kalman"} | GROUND,
    "leastsquares": {"leastsquares", "kalman"} | GROUND,
    "kalman": {"kalman"},
    "constants": set(),
    "files": {"constants"},
    "reading": set(),
    "style": set(),
    "sources": {"compilation"},
    "compilation": set(),
    "memory": set(),
    "progress": set(),
    "": {"sources"},  # the package itself
}
OUTSIDE = {
    "kalman": {"numpy", "scipy", "numba"},
    "style": {"matplotlib"},
    "sources": set(),
    "compilation": set(),
    "memory": set(),
    "progress": set(),
    "files": set(),
    "reading": set(),
    "constants": set(),
}
MODULES = sorted(PACKAGE.rglob("*.py"))


def part_of(path: Path) -> str:
    """First name below the package: the folder or module that a file belongs to."""
    inside = path.relative_to(PACKAGE)
    return "" if inside.name == "__init__.py" and len(inside.parts) == 1 else inside.parts[0].removesuffix(".py")


def imports(path: Path) -> set[str]:
    """Absolute dotted names that a file imports, anywhere in it; `from a import b` gives a and a.b."""
    found = set()
    package = ["geokalman", *path.relative_to(PACKAGE).parts[:-1]]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            name = ".".join([*base, *([node.module] if node.module else [])])
            found.update([name, *(f"{name}.{alias.name}" for alias in node.names)])
    return found


def own(path: Path) -> set[str]:
    """Parts of the package that a file imports."""
    parts = {name.split(".")[1] for name in imports(path) if name.startswith("geokalman.")}
    return {part for part in parts if (PACKAGE / part).is_dir() or (PACKAGE / f"{part}.py").is_file()}


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_run_downward(path):
    part = part_of(path)
    assert part in ALLOWED, f"{part} is new: say here and in CONTRIBUTING.md what it may import"
    assert own(path) <= ALLOWED[part]


@pytest.mark.parametrize(
    "path", [p for p in MODULES if part_of(p) in OUTSIDE], ids=lambda p: str(p.relative_to(PACKAGE))
)
def test_what_stands_low_stands_on_little(path):
    outside = (
        {name.split(".")[0] for name in imports(path)} - {"geokalman", "__future__"} - set(sys.stdlib_module_names)
    )
    assert outside <= OUTSIDE[part_of(path)]


ESTIMATORS = [p for p in MODULES if p.stem == "estimate"]


@pytest.mark.parametrize("path", ESTIMATORS, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_estimators_never_see_truth(path):
    """Neither themselves nor through a module of their own application."""
    seen, todo = set(), {path}
    while todo:
        current = todo.pop()
        seen.add(current)
        names = {n.rpartition(".")[2] for n in imports(current) if n.startswith(f"geokalman.{part_of(path)}.")}
        todo |= {p for p in (path.with_name(f"{n}.py") for n in names) if p.is_file()} - seen
    assert not {p.stem for p in seen} & {"simulate", "assess", "figures"}


def test_there_are_estimators_to_hold_to_it():
    assert ESTIMATORS


@pytest.mark.parametrize("path", sorted((ROOT / "book").glob("*/[0-9]*.md")), ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_notebooks_use_applications_and_the_recorder_only(path):
    cells = re.findall(r"^```\{code-cell\}.*?\n(?::.*\n)*(.*?)^```", path.read_text(encoding="utf-8"), re.M | re.S)
    names = {n for cell in cells for n in re.findall(r"^\s*(?:from|import) +(geokalman[\w.]*)", cell, re.M)}
    assert cells and not [n for n in names if n.startswith("geokalman.reproduce.")]


def test_the_rule_itself_bites(tmp_path, monkeypatch):
    """An upward import, written in each of the forms that Python has, is seen."""
    monkeypatch.setitem(globals(), "PACKAGE", tmp_path)
    (tmp_path / "kalman").mkdir()
    (tmp_path / "grace").mkdir()
    for text in (
        "from geokalman import grace",
        "import geokalman.grace.model",
        "from ..grace import model",
        "def f():\n    from .. import grace",
    ):
        (tmp_path / "kalman" / "x.py").write_text(text)
        assert own(tmp_path / "kalman" / "x.py") == {"grace"}, text
