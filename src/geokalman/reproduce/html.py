"""The book as HTML: Jupyter Book over the staged sources, in place of the last good one only when it is whole."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from geokalman.files import sha256
from geokalman.reproduce import children
from geokalman.reproduce.atomic import digests, explained, intact, partial_path, swap_folder, write_json
from geokalman.reproduce.errors import Fault
from geokalman.reproduce.stage import alone

_ENGINE = ("jupyter-book", "sphinx", "sphinx-book-theme", "pydata-sphinx-theme", "myst-nb", "myst-parser", "docutils",
           "sphinxcontrib-bibtex", "sphinx-design", "sphinx-mathjax-offline")  # fmt: skip
_RECORD = ".made.json"
_ANSI = re.compile(r"\x1b\[[0-9;]*m")
_SHOWN = 40  # warnings in the message; all of them stand in the log


class BookError(Fault):
    """The HTML was not made; the message carries the warnings. The last good book stays where it was."""


def build(root: Path, strict: bool = True) -> Path:
    """Build `book/_build/html/` from `book/_build/site/`; nit-picky and with warnings as errors if `strict`.

    Nothing is done where the book was made from the same sources by the same versions, and no file of it is damaged or
    gone since. Returns the folder of the book.
    Raises BookError with Sphinx's warnings, or with the end of its log, which stands in `book/_build/html.log`.
    """
    site, html = root / "book" / "_build" / "site", root / "book" / "_build" / "html"
    if not (site / "_toc.yml").is_file():
        raise BookError(f"{site} holds no staged book; `geokalman build` (or make book) stages it first.")
    with explained(html), alone(html):
        key = content_key(site)
        if not intact(html, _RECORD, key):
            made = _jupyter_book(site, partial_path(html), strict, html.with_name("html.log"))
            shutil.rmtree(made / "_sources", ignore_errors=True)
            write_json(made / _RECORD, {"key": key, "files": digests(made, _RECORD)})
            swap_folder(made, html)
    return html


def content_key(site: Path) -> str:
    """SHA-256 (hex) over the staged sources, this module and the versions of the tools that make HTML of them."""
    digest = hashlib.sha256(sha256(Path(__file__)).encode())
    for name in _ENGINE:
        digest.update(f"{name}=={version(name)}\n".encode())
    for path in sorted(p for p in site.rglob("*") if p.is_file()):
        digest.update(f"{path.relative_to(site).as_posix()} {sha256(path)}\n".encode())
    return digest.hexdigest()


def _jupyter_book(site: Path, work: Path, strict: bool, log: Path) -> Path:
    start = "from jupyter_book.cli.main import main; main()"
    # -P: modules in the folder where the user stands, such as an html.py, are not those of the library
    command = [sys.executable, "-P", "-c", start, "build", str(site), "--path-output", str(work), "--all"]
    if strict:
        command += ["-W", "-n", "--keep-going"]
    environment = {**os.environ, "PYTHONHASHSEED": "0", "NO_COLOR": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    with children.started(command, **streams, text=True, env=environment) as sphinx:
        said, _ = sphinx.communicate()
    text = _ANSI.sub("", said).replace(f"{site}{os.sep}", "book/_build/site/")
    log.write_text(text, encoding="utf-8")
    made = work / "_build" / "html"
    if sphinx.returncode or not (made / "index.html").is_file():
        raise BookError(_explain(text, log))
    return made


def _explain(text: str, log: Path) -> str:
    lines = text.splitlines()
    found = [line for line in lines if re.search(r"\b(WARNING|ERROR|CRITICAL|SEVERE)\b", line)]
    shown = found[:_SHOWN] or [line for line in lines if line.strip()][-_SHOWN:]
    more = f"\n... and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    return "the book was not made (the last good one stays); Sphinx said:\n" + "\n".join(shown) + more + f"\nAll: {log}"
