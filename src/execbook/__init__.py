"""The machinery of an executable book: parameters, runs, records, claims and the command."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from execbook.errors import Misuse

if TYPE_CHECKING:
    from execbook.record import Notebook

__all__ = ["Misuse", "Notebook"]


def __getattr__(name: str) -> Any:
    # Late, so that the command line starts without numpy and matplotlib.
    if name == "Notebook":
        from execbook.record import Notebook

        return Notebook
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
