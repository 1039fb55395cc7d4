"""The code cells of the notebooks: short lines, no name that is undefined or unused."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import jupytext
import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted(p for p in (ROOT / "book").glob("*/[0-9]*.md"))
LONGEST, LONGEST_PARAMETER = 100, 200
"""Columns of a line; a parameter has its value, range, unit and meaning on one line."""


def cells(text: str) -> list[tuple[list[str], str]]:
    """Tags and source of the code cells of a MyST notebook."""
    found = jupytext.reads(text, fmt="md:myst").cells
    return [(cell.metadata.get("tags", []), cell.source) for cell in found if cell.cell_type == "code"]


def long_lines(text: str) -> list[str]:
    """Lines of the cells that are too long."""
    return [
        line
        for tags, source in cells(text)
        for line in source.splitlines()
        if len(line) > (LONGEST_PARAMETER if "parameters" in tags else LONGEST)
    ]


def name_faults(sources: dict[str, str], folder: Path) -> str:
    """What ruff says of the names in the cells, nothing where all are defined and used."""
    for name, text in sources.items():
        code = "\n\n".join(source for _, source in cells(text))
        (folder / f"{name}.py").write_text(code, encoding="utf-8")
    command = [sys.executable, "-m", "ruff", "check", "--isolated", "--select", "F", "--output-format", "concise", "."]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    return "" if done.returncode == 0 else done.stdout + done.stderr


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_lines_are_short(path: Path) -> None:
    assert long_lines(path.read_text(encoding="utf-8")) == []


def test_names_are_defined_and_used(tmp_path: Path) -> None:
    sources = {f"{p.parent.name}_{p.stem}": p.read_text(encoding="utf-8") for p in NOTEBOOKS}
    assert len(sources) > 50
    assert name_faults(sources, tmp_path) == ""


def test_the_guards_bite(tmp_path: Path) -> None:
    notebook = "```{code-cell} ipython3\nimport os\nprint(undefined)\n```\n"
    header = "---\njupytext:\n  text_representation: {extension: .md, format_name: myst}\n---\n\n"
    found = name_faults({"planted": header + notebook}, tmp_path)
    assert "F401" in found and "F821" in found
    wide = f"```{{code-cell}} ipython3\nx = '{'a' * 100}'\n```\n"
    assert len(long_lines(header + wide)) == 1 and not long_lines(header + notebook)
