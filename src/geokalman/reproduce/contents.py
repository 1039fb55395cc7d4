"""The table of contents, `book/_toc.yml`: which pages the book has, in the order of reading, and their titles."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import yaml


def pages(toc: Path) -> list[str]:
    """Names (no suffix) of the pages of the table of contents, in its order; none where there is no such file."""
    found: list[str] = []

    def walk(node) -> None:
        if isinstance(node, list):
            for item in node:
                walk(item)
        elif isinstance(node, dict):
            found.extend(str(node[key]) for key in ("root", "file") if key in node)
            for key in ("parts", "chapters", "sections", "entries", "subtrees"):
                walk(node.get(key, []))

    if toc.is_file():
        walk(yaml.safe_load(toc.read_text(encoding="utf-8")))
    return found


def order(root: Path) -> Callable[[str], tuple[int, str]]:
    """Key that sorts papers or pages as the book has them; what it does not list comes last, by name."""
    place: dict[str, int] = {}
    for k, page in enumerate(pages(root / "book" / "_toc.yml")):
        place[page] = k
        place.setdefault(page.partition("/")[0], k)
    return lambda name: (place.get(name, len(place)), name)


def title(root: Path, page: str) -> str:
    """First heading of a page (no suffix), or its name where there is none."""
    source = root / "book" / f"{page}.md"
    heading = re.search(r"^# +(.+)$", source.read_text(encoding="utf-8"), re.M) if source.is_file() else None
    return heading[1].strip() if heading else page.removesuffix("/index")
