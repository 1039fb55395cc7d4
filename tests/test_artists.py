"""Every function that draws a figure is called by a test of its own application: read from the sources."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "geokalman"
APPLICATIONS = sorted({path.parent.name for path in PACKAGE.glob("*/figures*") if path.suffix in ("", ".py")})


def sources_of(folder: Path) -> dict[str, str]:
    """Texts of the modules of an application by name; those of a package within it together by the package's."""
    found: dict[str, str] = {}
    for path in sorted(folder.rglob("*.py")):
        name = path.stem if path.parent == folder else path.parent.name
        found[name] = found.get(name, "") + path.read_text(encoding="utf-8") + "\n"
    return found


def drawing(text: str) -> set[str]:
    """Public functions of a module that return a Figure."""
    functions = [node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]
    return {f.name for f in functions if f.name[0] != "_" and f.returns and ast.unparse(f.returns).endswith("Figure")}


def called(text: str) -> set[str]:
    """Names `module.function` that the test functions of a file call; what stands beside them does not count."""
    tests = [n for n in ast.parse(text).body if isinstance(n, ast.FunctionDef) and n.name.startswith("test_")]
    used = [node for test in tests for node in ast.walk(test) if isinstance(node, ast.Attribute)]
    return {f"{node.value.id}.{node.attr}" for node in used if isinstance(node.value, ast.Name)}


def untested(sources: dict[str, str], tests: list[str]) -> set[str]:
    """Drawing functions of the modules (name -> text) that no test calls."""
    return {f"{module}.{name}" for module, text in sources.items() for name in drawing(text)} - set().union(
        *map(called, tests)
    )


@pytest.mark.parametrize("application", APPLICATIONS)
def test_every_figure_has_its_test(application):
    sources = sources_of(PACKAGE / application)
    assert any(map(drawing, sources.values()))
    assert not untested(sources, [p.read_text(encoding="utf-8") for p in (ROOT / "tests" / application).glob("*.py")])


def test_a_figure_without_a_test_is_seen():
    source = {"figures": "def a() -> Figure: ...\ndef b() -> Figure: ...\ndef _c() -> Figure: ...\ndef d() -> int: ..."}
    called_by_a_test = "def test_b():\n    figures.b()\n    x.a()"
    only_beside_one = "SMOKE = {'a': lambda: figures.a()}\ndef helper():\n    figures.a()"
    assert untested(source, [called_by_a_test, only_beside_one]) == {"figures.a"}


def test_the_figures_of_a_package_are_seen(tmp_path):
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "one.py").write_text("def a() -> Figure: ...")
    (tmp_path / "figures" / "two.py").write_text("def b() -> Figure: ...")
    assert untested(sources_of(tmp_path), ["def test_a():\n    figures.a()"]) == {"figures.b"}
