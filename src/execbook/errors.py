"""Errors for the reader: one sentence with the value, its place, and what would be right."""

from __future__ import annotations

import unicodedata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic import ValidationError


class Fault(Exception):
    """Something went wrong; the message says it in one sentence, and no traceback adds to it."""

    exit_code = 1

    def _render_traceback_(self) -> list[str]:
        # IPython shows this in place of a traceback, in Jupyter as in an executed notebook.
        return [f"{type(self).__name__}: {self}"]


class Misuse(Fault):
    """What was asked for cannot be done as asked: an unknown name, a wrong value."""

    exit_code = 2


def is_plain(text: str) -> bool:
    """Tell whether a text has no control characters and no bytes that are not UTF-8."""
    return not any(unicodedata.category(letter) in ("Cc", "Cs") for letter in text)


def shown(text: str, length: int = 400) -> str:
    """Give a word as it may stand in a message of one line, cut where it is too long."""
    plain = text if is_plain(text) else repr(text)
    return plain if len(plain) <= length else plain[: length - 3] + "..."


def explain(error: ValidationError) -> str:
    """Give what pydantic found as one sentence, each place with its problem."""
    found = [(".".join(map(str, e["loc"])), e["msg"].removeprefix("Value error, ")) for e in error.errors()]
    return "; ".join(dict.fromkeys(": ".join(filter(None, pair)) for pair in found))
