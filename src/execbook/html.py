"""Sphinx: the book in place of the last good one, and a run as a page of its own."""

from __future__ import annotations

import hashlib
import html
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from importlib.metadata import distribution, version
from pathlib import Path

import nbformat

from execbook import atomic, blocks, children, contents
from execbook.display import inlined
from execbook.errors import Fault
from execbook.stage import alone, stage_notebook

_ENGINE = (
    "jupyter-book", "sphinx", "sphinx-book-theme", "pydata-sphinx-theme", "myst-nb", "myst-parser", "docutils",
    "sphinxcontrib-bibtex", "sphinx-design", "sphinx-exercise", "sphinx-mathjax-offline",
)  # fmt: skip
_RECORD = ".made.json"
_ANSI = re.compile(r"\x1b\[[0-9;]*m")
_SHOWN = 40  # warnings in the message; all of them are in the log
_CONF = """
extensions = ["myst_nb", "sphinx.ext.mathjax", "sphinx_design", "sphinx_exercise", "sphinxcontrib.bibtex"]
nb_execution_mode = "off"
html_permalinks = False
myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath", "tasklist"]
numfig = math_numfig = True
numfig_format = {"figure": "Figure %s", "table": "Table %s"}
math_eqref_format = "Eq. {number}"
bibtex_bibfiles = ["references.bib"]
bibtex_reference_style = "author_year"
"""
_STYLE = """
body { max-width: 60rem; margin: 2rem auto; padding: 0 1rem; font: 16px/1.55 system-ui, sans-serif; }
body { color: #1a1a1a; background: #fff; }
pre { overflow-x: auto; padding: .6rem .8rem; background: #f6f7f8; border-radius: 4px; font-size: .85rem; }
img { max-width: 100%; height: auto; }
figure { margin: 1.2rem 0; } figcaption, caption { color: #444; font-size: .92rem; text-align: left; }
table { border-collapse: collapse; margin: 1rem 0; font-size: .92rem; display: block; overflow-x: auto; }
th, td { padding: .25rem .7rem; border-bottom: 1px solid #ddd; vertical-align: top; }
.headerlink { display: none; } .admonition-title { font-weight: 600; }
aside, .admonition { border-left: 4px solid #0072b2; padding: .2rem 1rem; margin: 1rem 0; background: #f4f8fb; }
aside.changed { border-color: #d55e00; background: #fdf3ec; }
"""


def build(root: Path) -> Path:
    """Build `book/_build/html/` from `book/_build/site/`; a warning is an error.

    Nothing is done where the book was made from the same sources by the same versions, and no file of it is damaged or
    gone since. Returns the folder of the book. Raises Fault with Sphinx's warnings, of which `book/_build/html.log` has
    all; the last good book stays then.
    """
    site, book = root / "book" / "_build" / "site", root / "book" / "_build" / "html"
    if not (site / "_toc.yml").is_file():
        raise Fault(f"{site} holds no staged book; the command build stages it first.")
    with atomic.explained(book), alone(book):
        key = _content_key(site)
        if not atomic.intact(book, _RECORD, key):
            made = _jupyter_book(site, atomic.partial_path(book), book.with_name("html.log"))
            shutil.rmtree(made / "_sources", ignore_errors=True)
            atomic.write_json(made / _RECORD, {"key": key, "files": atomic.digests(made, _RECORD)})
            atomic.swap_folder(made, book)
    return book


def _content_key(site: Path) -> str:
    """Hash the staged sources, this module and the versions of the tools that make HTML."""
    parts = [atomic.sha256(Path(__file__)), *(f"{name}=={version(name)}" for name in _ENGINE)]
    parts += [f"{name} {digest}" for name, digest in atomic.digests(site, "").items()]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _jupyter_book(site: Path, work: Path, log: Path) -> Path:
    start = "from jupyter_book.cli.main import main; main()"
    code, said = _python("-c", start, "build", site, "--path-output", work, "--all", "-W", "-n", "--keep-going")
    text = said.replace(f"{site}{os.sep}", "book/_build/site/")
    log.write_text(text, encoding="utf-8")
    made = work / "_build" / "html"
    if not code and (made / "index.html").is_file():
        return made
    lines = [line for line in text.splitlines() if line.strip()]
    found = [line for line in lines if re.search(r"\b(WARNING|ERROR|CRITICAL|SEVERE)\b", line)]
    shown = "\n".join(found[:_SHOWN] or lines[-_SHOWN:])
    more = f"\n... and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    raise Fault(f"The book was not made (the last good one stays); Sphinx said:\n{shown}{more}\nThe whole is in {log}.")


def _python(*words: str | Path) -> tuple[int, str]:
    """Run Python with these words, ended with this process; gives exit code and output."""
    # -P: modules in the folder where the user stands, such as an html.py, are not those of the library
    environment = {**os.environ, "PYTHONHASHSEED": "0", "NO_COLOR": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    with children.started([sys.executable, "-P", *words], **streams, text=True, env=environment) as process:
        said, _ = process.communicate()
    return process.returncode, _ANSI.sub("", said)


def page_of_run(root: Path, name: str, run: Path) -> str:
    """Give a run as one page, which carries its images, styles and formulas and loads nothing.

    The run is staged as a page of the book is; Sphinx gives its body, which is wrapped here with all that it needs.
    """
    with tempfile.TemporaryDirectory(prefix="execbook-page-") as work:
        site, made = Path(work) / "site", Path(work) / "made"
        metrics = json.loads((run / "metrics.json").read_text(encoding="utf-8"))

        def filled(text: str) -> str:
            return _titled(blocks.fill_own(text, root, name, metrics, lenient=True), root, name)

        notebook = stage_notebook(name, run, site / "page.files", filled, offer=False)
        if any("{cite" in cell.source for cell in notebook.cells):
            notebook.cells.append(nbformat.v4.new_markdown_cell("```{bibliography}\n```", id="references"))
        nbformat.write(notebook, site / "index.ipynb")
        (site / "conf.py").write_text(_CONF, encoding="utf-8")
        (site / "references.bib").touch()
        if (root / "book" / "references.bib").is_file():
            shutil.copyfile(root / "book" / "references.bib", site / "references.bib")
        code, said = _python("-m", "sphinx", "-q", "-b", "json", site, made)
        if code:
            raise Fault(f"The page of {name} was not made; Sphinx said: {' '.join(said.split())}.")
        page = json.loads((made / "index.fjson").read_text(encoding="utf-8"))
        body = re.sub(r'src="([^":]+\.png)"', lambda m: f'src="{inlined((made / m[1]).read_bytes())}"', page["body"])
    body = re.sub(r'<a [^>]*href="(?!#)[^"]*"[^>]*>(.*?)</a>', r"\1", body, flags=re.S)  # other pages are not here
    math = f"<script>{_mathjax()}</script>\n" if 'class="math' in body else ""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width">\n'
        f"<title>{html.escape(re.sub('<[^>]+>', '', page['title']))}</title>\n<style>{_STYLE}</style>\n{math}</head>\n"
        f"<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )


def _titled(text: str, root: Path, name: str) -> str:
    """Write the titles of other pages in the place of references to them."""

    def title(match: re.Match[str]) -> str:
        page = match[1].removesuffix(".md").removeprefix("./")
        return contents.title(root, page[1:] if page.startswith("/") else f"{name.partition('/')[0]}/{page}")

    return re.sub(r"\{doc\}`([^`<]+)`", title, text)


def _mathjax() -> str:
    """Give MathJax 3 with its glyphs as one script."""
    package = distribution("sphinx-mathjax-offline")
    path = Path(str(package.locate_file("sphinx-mathjax-offline/static/mathjax/tex-svg.js")))
    settings = 'window.MathJax = {tex: {inlineMath: [["\\\\(", "\\\\)"]]}, options: {enableMenu: false}};\n'
    # without the host that it would ask for speech on request
    return settings + path.read_text(encoding="utf-8").replace("https://cdn.jsdelivr.net/npm/", "")
