"""Who may import whom, as CONTRIBUTING.md says: read from the sources, so that no import has to happen."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

import execbook
from execbook import notebooks

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "geokalman"
APPLICATIONS = {"pair", "grace", "attitude", "airborne", "radioastron", "pulsar"}
GROUND = {"constants", "data", "reading", "style", "compilation", "memory", "progress"}
MODELS = {"physics", "leastsquares", "kalman"}
ALLOWED = {
    **{application: {application} | MODELS | GROUND for application in APPLICATIONS},
    "cli": set(),
    "physics": {"physics", "leastsquares", "kalman"} | GROUND,
    "leastsquares": {"leastsquares", "kalman"} | GROUND,
    "kalman": {"kalman", "compilation"},
    "constants": set(),
    "data": set(),
    "reading": set(),
    "style": set(),
    "compilation": set(),
    "memory": set(),
    "progress": set(),
    "": set(),  # the package itself
}
OUTSIDE = {
    "kalman": {"numpy", "scipy", "numba"},
    "style": {"matplotlib"},
    "compilation": {"numba"},
    "cli": {"execbook"},
    "": set(),
    "memory": set(),
    "progress": set(),
    "data": set(),
    "reading": set(),
    "constants": set(),
}
MODULES = sorted(PACKAGE.rglob("*.py"))
ESTIMATORS = [p for p in MODULES if p.stem == "estimate"]


def part_of(path: Path) -> str:
    """First name below the package: the folder or module that a file belongs to."""
    inside = path.relative_to(PACKAGE)
    return "" if inside.name == "__init__.py" and len(inside.parts) == 1 else inside.parts[0].removesuffix(".py")


def imported(text: str, package: tuple[str, ...] = ()) -> set[str]:
    """Absolute dotted names that a Python text imports, anywhere in it; `from a import b` gives a.b."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            found.update(".".join([*base, *filter(None, [node.module]), alias.name]) for alias in node.names)
    return found


def imports(path: Path) -> set[str]:
    """What a module of the package imports."""
    return imported(path.read_text(encoding="utf-8"), ("geokalman", *path.relative_to(PACKAGE).parts[:-1]))


def upward(path: Path) -> set[str]:
    """Parts of the package that a file imports and must not."""
    parts = {name.split(".")[1] for name in imports(path) if name.startswith("geokalman.")}
    known = {part for part in parts if (PACKAGE / part).is_dir() or (PACKAGE / f"{part}.py").is_file()}
    return known - ALLOWED[part_of(path)]


def outside(path: Path) -> set[str]:
    """Libraries that a file imports and must not."""
    libraries = {name.split(".")[0] for name in imports(path)} - {"geokalman", "__future__", *sys.stdlib_module_names}
    return libraries - OUTSIDE[part_of(path)]


def truth_seen(path: Path) -> set[str]:
    """Modules with truth in them that an estimator imports, itself or through a module of its own application."""
    seen, todo = set(), {path}
    while todo:
        current = todo.pop()
        seen.add(current)
        names = {n.split(".")[2] for n in imports(current) if n.startswith(f"geokalman.{part_of(path)}.")}
        files = {path.with_name(n) / "__init__.py" for n in names} | {path.with_name(f"{n}.py") for n in names}
        todo |= {p for p in files if p.is_file()} - seen
    return {p.parent.name if p.stem == "__init__" else p.stem for p in seen} & {
        "simulate",
        "truth",
        "assess",
        "experiment",
        "figures",
    }


def machinery(code: str) -> set[str]:
    """What a notebook's code takes from the machinery beside what that offers to notebooks."""
    offered = {f"execbook.{name}" for name in execbook.__all__}
    return {name for name in imported(code) if f"{name}.".startswith("execbook.")} - offered


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_run_downward(path):
    assert part_of(path) in ALLOWED, "a new part: say here and in CONTRIBUTING.md what it may import"
    assert not upward(path)


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_the_command_alone_knows_the_machinery(path):
    assert part_of(path) == "cli" or not {name for name in imports(path) if name.split(".")[0] == "execbook"}


def test_the_machinery_knows_no_algorithm():
    """It serves another book as well: what it needs of a project is declared in `book/execbook.toml`."""
    for path in (PACKAGE.with_name("execbook")).rglob("*.py"):
        assert not {n for n in imported(path.read_text(encoding="utf-8")) if n.split(".")[0] == "geokalman"}, path


@pytest.mark.parametrize(
    "path", [p for p in MODULES if part_of(p) in OUTSIDE], ids=lambda p: str(p.relative_to(PACKAGE))
)
def test_what_stands_low_stands_on_little(path):
    assert not outside(path)


@pytest.mark.parametrize("path", ESTIMATORS, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_estimators_never_see_truth(path):
    assert not truth_seen(path)


def test_there_are_estimators_to_hold_to_it():
    assert {part_of(path) for path in ESTIMATORS} == APPLICATIONS


@pytest.mark.parametrize("name", notebooks.names(ROOT))
def test_notebooks_use_applications_and_the_recorder_only(name):
    code = notebooks.code(notebooks.read(ROOT, name))
    assert "execbook.Notebook" in imported(code)
    assert not machinery(code)


@pytest.fixture
def planted(tmp_path, monkeypatch):
    """A package of three empty parts, and a function that writes a module of it."""
    monkeypatch.setitem(globals(), "PACKAGE", tmp_path)
    for part in ("kalman", "grace", "physics"):
        (tmp_path / part).mkdir()

    def write(name: str, text: str) -> Path:
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


@pytest.mark.parametrize(
    "text",
    [
        "from geokalman import grace",
        "import geokalman.grace.model",
        "from ..grace import model",
        "def f():\n    from .. import grace",
    ],
)
def test_an_upward_import_is_seen_in_every_form(planted, text):
    assert upward(planted("kalman/x.py", text)) == {"grace"}
    assert not upward(planted("grace/x.py", text.replace("grace", "physics")))


def test_a_library_above_its_station_is_seen(planted):
    assert outside(planted("kalman/x.py", "import os, numpy\nfrom matplotlib import pyplot")) == {"matplotlib"}


def test_truth_is_seen_through_a_helper(planted):
    planted("grace/simulate.py", "")
    planted("grace/helper.py", "from geokalman.grace.simulate import fly")
    assert truth_seen(planted("grace/estimate.py", "from geokalman.grace import helper")) == {"simulate"}
    (planted("grace/x.py", "").parent / "figures").mkdir()
    planted("grace/figures/__init__.py", "")
    planted("grace/helper.py", "from geokalman.grace.figures import draw")
    assert truth_seen(planted("grace/estimate.py", "from geokalman.grace import helper")) == {"figures"}
    planted("grace/helper.py", "import numpy")
    assert not truth_seen(planted("grace/estimate.py", "from . import helper"))


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("from execbook import Notebook, Misuse\nfrom geokalman.grace import assess", set()),
        ("from execbook.errors import Misuse", {"execbook.errors.Misuse"}),
        ("import execbook", {"execbook"}),
        ("if True:\n    import execbook.claims", {"execbook.claims"}),
        ("from execbook import claims", {"execbook.claims"}),
    ],
)
def test_a_notebook_that_reaches_into_the_machinery_is_seen(tmp_path, text, found):
    (tmp_path / "book" / "toy").mkdir(parents=True)
    page = (
        "---\nkernelspec: {display_name: Python 3, name: python3}\n---\n# T\n\n```{code-cell} ipython3\n:tags:"
        f" [a]\n\n{text}\n```\n\nprose\n"
    )
    (tmp_path / "book" / "toy" / "01-a.md").write_text(page)
    [name] = notebooks.names(tmp_path)
    assert machinery(notebooks.code(notebooks.read(tmp_path, name))) == found
