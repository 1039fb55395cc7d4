"""Sphinx: the book as HTML in place of the last good one, and a run as one page that loads nothing."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from execbook import atomic, children
from execbook.errors import Fault
from execbook.stage import alone

_ENGINE = (
    "jupyter-book", "sphinx", "sphinx-book-theme", "pydata-sphinx-theme", "myst-nb", "myst-parser", "docutils",
    "sphinxcontrib-bibtex", "sphinx-design", "sphinx-mathjax-offline",
)  # fmt: skip
_RECORD = ".made.json"
_ANSI = re.compile(r"\x1b\[[0-9;]*m")
_SHOWN = 40  # warnings in the message; all of them are in the log


class BookError(Fault):
    """The HTML was not made; the message carries the warnings. The last good book stays where it was."""


def build(root: Path, strict: bool = True) -> Path:
    """Build `book/_build/html/` from `book/_build/site/`; nit-picky and with warnings as errors if `strict`.

    Nothing is done where the book was made from the same sources by the same versions, and no file of it is damaged or
    gone since. Returns the folder of the book. Raises BookError with Sphinx's warnings; `book/_build/html.log` has all.
    """
    site, html = root / "book" / "_build" / "site", root / "book" / "_build" / "html"
    if not (site / "_toc.yml").is_file():
        raise BookError(f"{site} holds no staged book; the command build stages it first.")
    with atomic.explained(html), alone(html):
        key = _content_key(site)
        if not atomic.intact(html, _RECORD, key):
            made = _jupyter_book(site, atomic.partial_path(html), strict, html.with_name("html.log"))
            shutil.rmtree(made / "_sources", ignore_errors=True)
            atomic.write_json(made / _RECORD, {"key": key, "files": atomic.digests(made, _RECORD)})
            atomic.swap_folder(made, html)
    return html


def _content_key(site: Path) -> str:
    """Hash the staged sources, this module and the versions of the tools that make HTML of them."""
    parts = [atomic.sha256(Path(__file__)), *(f"{name}=={version(name)}" for name in _ENGINE)]
    parts += [f"{name} {digest}" for name, digest in atomic.digests(site, "").items()]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def run_python(*words: str) -> tuple[int, str]:
    """Run Python with these words, ended with this process; gives its exit code and what it said."""
    # -P: modules in the folder where the user stands, such as an html.py, are not those of the library
    environment = {**os.environ, "PYTHONHASHSEED": "0", "NO_COLOR": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    with children.started([sys.executable, "-P", *words], **streams, text=True, env=environment) as process:
        said, _ = process.communicate()
    return process.returncode, _ANSI.sub("", said)


def _jupyter_book(site: Path, work: Path, strict: bool, log: Path) -> Path:
    start = "from jupyter_book.cli.main import main; main()"
    words = ["-c", start, "build", str(site), "--path-output", str(work), "--all"]
    code, said = run_python(*words, *(["-W", "-n", "--keep-going"] if strict else []))
    text = said.replace(f"{site}{os.sep}", "book/_build/site/")
    log.write_text(text, encoding="utf-8")
    made = work / "_build" / "html"
    if code or not (made / "index.html").is_file():
        raise BookError(_explain(text, log))
    return made


def _explain(text: str, log: Path) -> str:
    lines = text.splitlines()
    found = [line for line in lines if re.search(r"\b(WARNING|ERROR|CRITICAL|SEVERE)\b", line)]
    shown = found[:_SHOWN] or [line for line in lines if line.strip()][-_SHOWN:]
    more = f"\n... and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    return "the book was not made (the last good one stays); Sphinx said:\n" + "\n".join(shown) + more + f"\nAll: {log}"
