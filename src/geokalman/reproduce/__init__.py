"""The machinery of the book: parameters, execution, records, claims and the command line. It imports no application."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from geokalman.reproduce.errors import Misuse

if TYPE_CHECKING:
    from geokalman.reproduce.record import Notebook

__all__ = ["Misuse", "Notebook"]


def __getattr__(name: str) -> Any:
    # Late, so that the command line starts without numpy and matplotlib.
    if name == "Notebook":
        from geokalman.reproduce.record import Notebook

        return Notebook
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
