"""Errors whose message is for the reader: one sentence with the value, where it stood, and what would be right."""

from __future__ import annotations


class Fault(Exception):
    """Something went wrong; the message says it in one sentence, and no traceback adds to it."""

    exit_code = 1

    def _render_traceback_(self) -> list[str]:
        # IPython shows this in place of a traceback, in Jupyter as in an executed notebook.
        return [f"{type(self).__name__}: {self}"]


class Misuse(Fault):
    """What was asked for cannot be done as asked: an unknown name, a wrong value."""

    exit_code = 2
