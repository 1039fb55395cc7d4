"""Docstrings on the pages of the package as they are written: they are plain text with equations and shapes."""

from __future__ import annotations


def keep(app, what, name, obj, options, lines) -> None:
    """Put the text of a docstring into a literal block."""
    if lines:
        lines[:] = [".. code-block:: text", "", *(f"   {line}".rstrip() for line in lines), ""]


def skip(app, what, name, obj, skipped, options) -> bool | None:
    """Leave out the fields of a named tuple, on which Python itself says nothing but their number."""
    return True if str(getattr(obj, "__doc__", "")).startswith("Alias for field number") else None


def setup(app) -> dict:
    app.connect("autodoc-process-docstring", keep)
    app.connect("autodoc-skip-member", skip)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
