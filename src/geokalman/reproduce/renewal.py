"""Renewing the stored references: from the book's runs and from quick runs, with a reason that is written down."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from geokalman.reproduce import check, claims, execute, graph, notebooks, reference
from geokalman.reproduce.errors import Misuse
from geokalman.reproduce.progress import Display


def renew(root: Path, reason: str, names: Sequence[str] | None = None, quick: bool = True) -> int:
    """Renew the references of `names` (default: all notebooks), print what moved, note the reason; gives how many.

    Raises Misuse where the reason is empty, or a notebook's run in the book is not from the present sources.
    """
    if not reason.strip():
        raise Misuse(
            'references are renewed for a reason: --reason "why the numbers move" (it goes into CHANGELOG.md).'
        )
    names = list(names or notebooks.names(root))
    for name in names:
        if not graph.is_fresh(graph.run_folder(root, name), graph.key(root, name)):
            raise Misuse(f"{name} has no run from the present sources; make book executes it, then renew.")
    moved = 0
    for name in names:
        moved += _store(root, name, "paper", graph.run_folder(root, name))
    if quick:
        with tempfile.TemporaryDirectory() as scratch, Display() as display:
            for name in names:
                with display.notebook(f"{name} (quick)") as progress:
                    folder = execute.run(
                        root, name, out=Path(scratch) / name, quick=True, page=False, progress=progress
                    )
                moved += _store(root, name, "quick", folder)
    if moved:
        reference.note_reason(root, reason.strip(), moved)
    if claims.papers(root) and (root / "README.md").is_file() and not claims.readme_agrees(root):
        sys.stdout.write("README.md shows other verdicts than the ledgers: geokalman claims --readme renews them.\n")
    return moved


def _store(root: Path, name: str, mode: str, folder: Path) -> int:
    found = reference.renew(root, folder)
    for difference in found:
        sys.stdout.write(f"{name} ({mode}) {check.describe(difference)}\n")
    return len(found)
