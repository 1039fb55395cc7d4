"""The table of contents, `book/_toc.yml`: pages in the order of reading, and their titles."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path


def pages(root: Path) -> list[str]:
    """List the names (no suffix) of the pages; none where there is no table of contents."""
    toc = root / "book" / "_toc.yml"
    if not toc.is_file():
        return []
    from sphinx_external_toc.parsing import parse_toc_yaml

    return list(parse_toc_yaml(toc))


def order(root: Path) -> Callable[[str], tuple[int, str]]:
    """Give the key that sorts papers or pages as the book has them; others come last, by name."""
    place: dict[str, int] = {}
    for k, page in enumerate(pages(root)):
        place[page] = k
        place.setdefault(page.partition("/")[0], k)
    return lambda name: (place.get(name, len(place)), name)


def title(root: Path, page: str) -> str:
    """Give the first heading of a page (no suffix), or its name where there is none."""
    source = root / "book" / f"{page}.md"
    heading = re.search(r"^# +(.+)$", source.read_text(encoding="utf-8"), re.M) if source.is_file() else None
    return heading[1].strip() if heading else page.removesuffix("/index")
