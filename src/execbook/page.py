"""A run as one page that carries its images, styles and formulas with it and loads nothing.

The run is staged as a page of the book is; Sphinx gives its body, which is wrapped here with all that it needs.
"""

from __future__ import annotations

import base64
import html
import json
import re
import shutil
import tempfile
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import nbformat

from execbook import blocks, contents, stage
from execbook.errors import Fault
from execbook.html import run_python

_CONF = """
extensions = ["myst_nb", "sphinx.ext.mathjax", "sphinx_design", "sphinxcontrib.bibtex"]
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


def render(root: Path, name: str, run: Path) -> str:
    """Give the self-contained HTML of the run in the folder `run`."""
    with tempfile.TemporaryDirectory(prefix="execbook-page-") as work:
        site, made = Path(work) / "site", Path(work) / "made"
        notebook = stage.stage_notebook(name, run, site / "page.files", offer=False)
        metrics = json.loads((run / "metrics.json").read_text(encoding="utf-8"))
        blocks.insert_own(notebook, name, metrics, root, lenient=True)
        for cell in notebook.cells:
            cell.source = _titled(cell.source, root, name) if cell.cell_type == "markdown" else cell.source
        if any("{cite" in cell.source for cell in notebook.cells):
            notebook.cells.append(nbformat.v4.new_markdown_cell("```{bibliography}\n```", id="references"))
        nbformat.write(notebook, site / "index.ipynb")
        (site / "conf.py").write_text(_CONF, encoding="utf-8")
        (site / "references.bib").touch()
        if (root / "book" / "references.bib").is_file():
            shutil.copyfile(root / "book" / "references.bib", site / "references.bib")
        code, said = run_python("-m", "sphinx", "-q", "-b", "json", str(site), str(made))
        if code:
            raise Fault(f"The page of {name} was not made; Sphinx said: {' '.join(said.split())}.")
        page = json.loads((made / "index.fjson").read_text(encoding="utf-8"))
        body = re.sub(r'src="([^":]+\.png)"', lambda image: f'src="{_inlined(made / image[1])}"', page["body"])
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
    here = f"{name.partition('/')[0]}/"

    def title(match: re.Match[str]) -> str:
        page = match[1].removesuffix(".md")
        return contents.title(root, page.lstrip("/") if page.startswith("/") else here + page.removeprefix("./"))

    return re.sub(r"\{doc\}`([^`<]+)`", title, text)


def _inlined(image: Path) -> str:
    return f"data:image/png;base64,{base64.b64encode(image.read_bytes()).decode()}"


def _mathjax() -> str:
    """Give MathJax 3 with its glyphs as one script, or nothing where the package is missing."""
    try:
        package = distribution("sphinx-mathjax-offline")
    except PackageNotFoundError:
        return ""
    path = Path(str(package.locate_file("sphinx-mathjax-offline/static/mathjax/tex-svg.js")))
    settings = 'window.MathJax = {tex: {inlineMath: [["\\\\(", "\\\\)"]]}, options: {enableMenu: false}};\n'
    # without the host that it would ask for speech on request
    return settings + path.read_text(encoding="utf-8").replace("https://cdn.jsdelivr.net/npm/", "")
