"""A book that loads nothing from anywhere: MathJax is copied in, scripts of other hosts are dropped."""

from __future__ import annotations

import re
import shutil
from importlib.metadata import distribution
from pathlib import Path

# What a page with TeX can ask for: the loader, its fonts, TeX packages loaded on demand, and speech in English.
_PARTS = ("tex-chtml.js", "output/chtml/fonts/woff-v2", "input/tex/extensions", "a11y", "sre/mathmaps/base.json",
          "sre/mathmaps/en.json")  # fmt: skip
_PRELOADED_FONT = re.compile(r'^\s*<link rel="preload" as="font".*>\n', re.M)  # blocked over file://, and not needed
_MENDED = (  # what the theme leaves without a name or with a role of old
    (
        '<summary><span class="toctree-toggle"',
        '<summary aria-label="Show or hide sections"><span class="toctree-toggle"',
    ),
    ('role="doc-biblioentry"', 'role="listitem"'),
)
_UNWANTED = ("://", "thebe", "require.min.js", "uplot/", "playground.js")  # the last two on demand


def copy_mathjax(app) -> None:
    """Copy the used parts of MathJax 3.2.2 (Apache-2.0) from the wheel of sphinx-mathjax-offline into the output."""
    source = Path(distribution("sphinx-mathjax-offline").locate_file("sphinx-mathjax-offline/static/mathjax"))
    target = Path(app.outdir) / "_static" / "mathjax"
    for part in _PARTS:
        if (source / part).is_dir():
            shutil.copytree(source / part, target / part, dirs_exist_ok=True)
        else:
            (target / part).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source / part, target / part)


def drop_remote(app, pagename, templatename, context, doctree) -> None:
    """Leave out script and style tags that would ask another host, or that only serve such a script."""
    for kind in ("script_files", "css_files"):
        context[kind] = [item for item in context[kind] if not _unwanted(item)]


def _unwanted(item) -> bool:
    name = str(getattr(item, "filename", None) or item or "")
    body = str(getattr(item, "attributes", {}).get("body") or "") if not isinstance(item, str) else ""
    return any(word in name for word in _UNWANTED) or "thebe" in body.lower()


def tidy_pages(app, exception) -> None:
    """Mend the finished pages: no preloading of fonts, roles and names that hold; debugging maps go."""
    if exception or app.builder.format != "html":
        return
    for page in Path(app.outdir).rglob("*.html"):
        text = _PRELOADED_FONT.sub("", page.read_text(encoding="utf-8"))
        for old, new in _MENDED:
            text = text.replace(old, new)
        page.write_text(text, encoding="utf-8")
    for unused in (Path(app.outdir) / "_static").rglob("*.map"):
        unused.unlink()


def setup(app) -> dict:
    app.connect("builder-inited", lambda app: copy_mathjax(app) if app.builder.format == "html" else None)
    app.connect("html-page-context", drop_remote, priority=900)
    app.connect("build-finished", tidy_pages, priority=900)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
