"""One word means one thing: class names that several modules share are in the table of CONTRIBUTING.md."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
VAGUE = {"true", "trip", "craft", "told", "found", "word", "one"}
"""Names that do not say what they hold."""


def table(text: str) -> set[str]:
    """Read the words from the table under `## Words`."""
    section = text.partition("\n## Words\n")[2].partition("\n## ")[0]
    return set(re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE))


def classes(package: Path) -> dict[str, list[str]]:
    """Public class names -> the modules that define them."""
    found = defaultdict(list)
    for path in sorted(package.rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found[node.name].append(str(path.relative_to(package)))
    return found


def vague(package: Path) -> list[str]:
    """Arguments and functions, public or not, with a name that does not say what it holds."""
    found = []
    for path in sorted(package.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            name = getattr(node, "arg", None) if isinstance(node, ast.arg) else None
            name = node.name if isinstance(node, ast.FunctionDef) else name
            if name in VAGUE:
                found.append(f"{path.relative_to(package)}:{node.lineno}: {name}")
    return found


def test_a_name_that_modules_share_has_one_meaning() -> None:
    shared = {name for name, modules in classes(ROOT / "src" / "geokalman").items() if len(modules) > 1}
    assert shared == table((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"))


@pytest.mark.parametrize("package", ["geokalman", "execbook"])
def test_names_say_what_they_hold(package: str) -> None:
    assert not vague(ROOT / "src" / package)


def test_the_guard_bites(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("class Flight: pass\nclass _Own: pass\n")
    (tmp_path / "b.py").write_text("class Flight: pass\nclass _Own: pass\ndef f(true): pass\n")
    assert [name for name, modules in classes(tmp_path).items() if len(modules) > 1] == ["Flight"]
    assert vague(tmp_path) == ["b.py:3: true"]
    assert table("## Other\n| `Orbit` | x |\n\n## Words\n\n| `Truth` | x |\n\n## More\n| `Line` | x |\n") == {"Truth"}
