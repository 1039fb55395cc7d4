"""A run as one page: HTML that carries its images, styles and formulas with it and loads nothing.

nbconvert renders cells and outputs. The prose is MyST, which nbconvert does not know: myst-parser renders it here
through docutils, with the cross-references that need the whole book (figures, equations, citations, pages) written out.
"""

from __future__ import annotations

import html
import io
import posixpath
import re
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geokalman.reproduce import contents
from geokalman.reproduce.display import FIGURE_TYPE, TABLE_TYPE

if TYPE_CHECKING:
    from nbformat import NotebookNode

_EXTENSIONS = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath", "tasklist"]
_ROLE = re.compile(r"\{(numref|eq|cite:p|cite:t|cite|doc|ref|term|download|abbr)\}`([^`]+)`")
_MATH_FENCE = re.compile(r"^```\{math\}\n(?::label: *(\S+)\n)?\n?(.*?)^```$", re.M | re.S)
_LABELLED = re.compile(r"^\$\$(.+?)\$\$ *(?:\(([\w:.-]+)\))$", re.M | re.S)
_STYLE = """
body { max-width: 60rem; margin: 2rem auto; padding: 0 1rem; font: 16px/1.55 system-ui, sans-serif; }
body { color: #1a1a1a; background: #fff; }
pre { overflow-x: auto; padding: .6rem .8rem; background: #f6f7f8; border-radius: 4px; font-size: .85rem; }
img { max-width: 100%; height: auto; }
figure { margin: 1.2rem 0; } figcaption, caption { color: #444; font-size: .92rem; text-align: left; }
table { border-collapse: collapse; margin: 1rem 0; font-size: .92rem; display: block; overflow-x: auto; }
th, td { padding: .25rem .7rem; border-bottom: 1px solid #ddd; vertical-align: top; }
.jp-InputPrompt, .jp-OutputPrompt, .prompt, .anchor-link, .headerlink { display: none; }
aside { border-left: 4px solid #0072b2; padding: .2rem 1rem; margin: 1rem 0; background: #f4f8fb; }
aside.changed { border-color: #d55e00; background: #fdf3ec; }
.admonition-title, .topic-title { font-weight: 600; }
"""


def render(notebook: NotebookNode, root: Path, name: str) -> str:
    """Self-contained HTML of an executed notebook."""
    from nbconvert import HTMLExporter
    from pygments.formatters import HtmlFormatter

    prose = _Prose(notebook, root, name)
    exporter = HTMLExporter(template_name="basic", filters={"markdown2html": prose.html})
    body, _ = exporter.from_notebook_node(prose.numbered(notebook))
    heading = re.search(r"^# +(.+)$", "\n".join(c.source for c in notebook.cells if c.cell_type == "markdown"), re.M)
    title = html.escape(heading[1] if heading else name)
    style = _STYLE + HtmlFormatter().get_style_defs(".highlight")
    script = f"<script>{_mathjax()}</script>\n" if prose.has_math else ""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width">\n'
        f"<title>{title}</title>\n<style>{style}</style>\n{script}</head>\n"
        f"<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )


def _mathjax() -> str:
    """MathJax 3 with its glyphs as one script, from the package that the book uses; nothing where it is missing."""
    try:
        package = distribution("sphinx-mathjax-offline")
    except PackageNotFoundError:
        return ""
    script = Path(str(package.locate_file("sphinx-mathjax-offline/static/mathjax/tex-svg.js"))).read_text(
        encoding="utf-8"
    )
    settings = 'window.MathJax = {tex: {inlineMath: [["\\\\(", "\\\\)"]]}, options: {enableMenu: false}};\n'
    return settings + script.replace("https://cdn.jsdelivr.net/npm/", "")  # it would ask there for speech on request


class _Prose:
    """The words of one notebook: MyST to HTML, with numbers for its figures, tables and equations."""

    def __init__(self, notebook: NotebookNode, root: Path, name: str) -> None:
        self.root, self.paper = root, name.partition("/")[0]
        self.labels: dict[str, str] = {}
        self.has_math = False
        counts = {"Figure": 0, "Table": 0, "Eq.": 0}
        self._equation = 0

        def number(kind: str, label: str) -> None:
            counts[kind] += 1
            self.labels[label] = f"{kind} {counts[kind]}"

        for cell in notebook.cells:
            if cell.cell_type == "markdown":
                for match in _LABELLED.finditer(_MATH_FENCE.sub(_as_dollars, cell.source)):
                    number("Eq.", match[2])
            for output in cell.get("outputs", []):
                for kind, mime in (("Figure", FIGURE_TYPE), ("Table", TABLE_TYPE)):
                    if mime in output.get("data", {}):
                        number(kind, output.data[mime]["name"])

    def numbered(self, notebook: NotebookNode) -> NotebookNode:
        """A copy whose figures and tables say their number before the caption."""
        import copy

        notebook = copy.deepcopy(notebook)
        for cell in notebook.cells:
            for output in cell.get("outputs", []):
                data = output.get("data", {})
                for mime, tag in ((FIGURE_TYPE, "<figcaption>"), (TABLE_TYPE, "<caption>")):
                    if mime in data:
                        label = data[mime]["name"]
                        text = _dollars(data["text/html"])
                        self.has_math |= text != data["text/html"]
                        data["text/html"] = (
                            f'<div id="{label}">'
                            + text.replace(tag, f"{tag}<b>{self.labels[label]}.</b> ", 1)
                            + "</div>"
                        )
        return notebook

    def html(self, source: str, *_: Any, **__: Any) -> str:
        """HTML of one cell of MyST."""
        from docutils.core import publish_parts
        from myst_parser.parsers.docutils_ import Parser

        text = _LABELLED.sub(self._tagged, _MATH_FENCE.sub(_as_dollars, source))
        text = _ROLE.sub(lambda m: self._written_out(m[1], m[2]), text)
        text = re.sub(r"^\(([\w:.-]+)\)=$", "", text, flags=re.M)
        text = re.sub(r"(?<!!)\[([^\]]+)\]\((?!https?:|#)[^)]*\)", r"\1", text)  # pages of the book are not here
        levels = [len(m) for m in re.findall(r"^(#+) ", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S), re.M)]
        settings = {
            "myst_enable_extensions": _EXTENSIONS, "myst_all_links_external": True, "math_output": "MathJax ignored",
            "report_level": 5, "halt_level": 6, "warning_stream": io.StringIO(), "embed_stylesheet": False,
            "doctitle_xform": False, "initial_header_level": min(levels, default=1), "raw_enabled": True,
            "file_insertion_enabled": False,
        }  # fmt: skip
        body = publish_parts(text, parser=Parser(), writer_name="html5", settings_overrides=settings)["body"]
        self.has_math |= 'class="math' in body
        return body

    def _tagged(self, match: re.Match[str]) -> str:
        body, label = match[1].strip(), match[2]
        number = self.labels[label].removeprefix("Eq. ")
        return f'<span id="{label}"></span>\n\n$$\n{body} \\tag{{{number}}}\n$$'

    def _written_out(self, role: str, content: str) -> str:
        shown, _, target = content.rpartition("<")
        shown, target = (shown.strip(), target.rstrip(">").strip()) if shown else ("", content.strip())
        if role in ("numref", "eq", "ref") and target in self.labels:
            return f"[{self.labels[target] if '%s' in shown or not shown else shown}](#{target})"
        if role.startswith("cite"):
            authors = [_author_year(self.root, key.strip()) for key in target.split(",")]
            if role == "cite:t":
                return "; ".join(f"{a} ({y})" for a, y in authors)
            return f"({'; '.join(f'{a} {y}' for a, y in authors)})"
        if role == "doc" and not shown:
            inside = posixpath.normpath(posixpath.join("/", self.paper, target)).removesuffix(".md")
            return contents.title(self.root, inside.lstrip("/"))
        return shown or target


def _as_dollars(match: re.Match[str]) -> str:
    return f"$$\n{match[2].strip()}\n$$" + (f" ({match[1]})" if match[1] else "")


def _dollars(text: str) -> str:
    r"""TeX between dollar signs in HTML as \(...\), which MathJax reads."""
    parts = re.split(r"(data:image/png;base64,[^\"]*)", text)
    return "".join(p if k % 2 else re.sub(r"\$([^$\n]+)\$", r"\\(\1\\)", p) for k, p in enumerate(parts))


def _author_year(root: Path, key: str) -> tuple[str, str]:
    """Family name(s) and year of a reference of the book, or the key where it is not there."""
    path = root / "book" / "references.bib"
    if path.is_file():
        from pybtex.database import parse_string

        entries = parse_string(path.read_text(encoding="utf-8"), "bibtex").entries
        if key in entries:
            names = [" ".join(p.last_names) for p in entries[key].persons.get("author", [])]
            authors = names[0] + " et al." if len(names) > 2 else " & ".join(names)
            return authors or key, entries[key].fields.get("year", "n.d.")
    return key, "not in the bibliography"
