"""Every page of the book in a headless browser, from the disk: light and dark, wide and narrow."""

from __future__ import annotations

import functools
import html
import re
import threading
import urllib.parse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path

import pytest

from geokalman.reproduce import contents

pytestmark = pytest.mark.browser

WIDE, PHONE = {"width": 1280, "height": 900}, {"width": 390, "height": 844}
_LOOK = """() => ({
  math: document.querySelectorAll('span.math, div.math').length,
  unrendered: [...document.querySelectorAll('span.math, div.math')]
    .filter(e => !e.querySelector('mjx-container')).length,
  failed: document.querySelectorAll('mjx-merror').length,
  theme: document.documentElement.dataset.theme,
  silent: [...document.images]
    .filter(i => !i.hasAttribute('alt') || (!i.alt.trim() && i.closest('article'))).map(i => i.src),
  broken: [...document.images].filter(i => i.complete && !i.naturalWidth && i.offsetParent).map(i => i.src),
  shown: [...document.querySelectorAll('img.twin-light, img.twin-dark')]
    .filter(i => i.offsetParent).map(i => i.className),
  twins: document.querySelectorAll('img.twin-light').length,
  wide: document.documentElement.scrollWidth - document.documentElement.clientWidth,
})"""


@dataclass
class Visit:
    """What one page did when it was opened in one theme and width."""

    page: str
    theme: str
    width: int
    requests: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    seen: dict = field(default_factory=dict)
    violations: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        return f"{self.page} ({self.theme}, {self.width} px)"


def pages(book: Path) -> list[str]:
    return sorted(p.relative_to(book).as_posix() for p in book.rglob("*.html") if "_static" not in p.parts)


@pytest.fixture(scope="module")
def visits(browser, book: Path) -> list[Visit]:
    axe = files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")
    found = []
    for theme, viewport in (("light", WIDE), ("dark", WIDE), ("light", PHONE)):
        context = browser.new_context(color_scheme=theme, viewport=viewport)
        for name in pages(book):
            found.append(_visit(context.new_page(), book / name, Visit(name, theme, viewport["width"]), axe))
        context.close()
    return found


def _visit(page, path: Path, visit: Visit, axe: str) -> Visit:
    page.on("request", lambda request: visit.requests.append(request.url))
    page.on("requestfailed", lambda request: visit.missing.append(request.url))
    page.on("pageerror", lambda error: visit.errors.append(str(error)))
    page.on("console", lambda message: visit.errors.append(message.text) if message.type == "error" else None)
    page.goto(path.as_uri())
    page.evaluate("() => window.MathJax && MathJax.startup ? MathJax.startup.promise.then(() => true) : true")
    visit.seen = page.evaluate(_LOOK)
    page.add_style_tag(content="* { animation: none !important; transition: none !important; }")
    page.evaluate("() => document.querySelectorAll('details').forEach(d => d.open = true)")
    page.evaluate(axe)
    options = "{runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa'], resultTypes: ['violations'], preload: false}"
    found = page.evaluate(f"() => axe.run(document, {options})")
    visit.violations = [f"{v['id']}: {n['target']} {n['html'][:120]}" for v in found["violations"] for n in v["nodes"]]
    visit.seen["wide open"] = page.evaluate(
        "document.documentElement.scrollWidth - document.documentElement.clientWidth"
    )
    page.close()
    return visit


def none_of(visits: list[Visit], what: Callable[[Visit], object]) -> None:
    """Fail with all that `what` finds, page by page."""
    found = [f"{visit}: {what(visit)}" for visit in visits if what(visit)]
    if found:
        pytest.fail("\n".join(found), pytrace=False)


def test_every_page_of_the_contents_is_there(visits: list[Visit], book: Path) -> None:
    wanted = {f"{name}.html" for name in contents.pages(book.parent / "site" / "_toc.yml")}
    assert "index.html" in wanted and wanted | {"search.html"} <= {visit.page for visit in visits}


def test_nothing_is_asked_of_another_host(visits: list[Visit]) -> None:
    none_of(visits, lambda v: [u for u in v.requests if not u.startswith(("file:", "data:", "blob:"))])


def test_no_file_is_missing(visits: list[Visit]) -> None:
    none_of(visits, lambda v: v.missing or v.seen["broken"])


def test_no_script_fails(visits: list[Visit]) -> None:
    none_of(visits, lambda v: v.errors)


def test_equations_are_rendered(visits: list[Visit]) -> None:
    assert sum(visit.seen["math"] for visit in visits) > 0
    none_of(visits, lambda v: v.seen["unrendered"] or v.seen["failed"])


def test_images_have_a_text_alternative(visits: list[Visit]) -> None:
    none_of(visits, lambda v: v.seen["silent"])


def test_the_theme_of_the_reader_decides_which_twin_is_shown(visits: list[Visit]) -> None:
    assert sum(visit.seen["twins"] for visit in visits) > 0
    none_of(visits, lambda v: v.seen["theme"] != v.theme)
    none_of(visits, lambda v: len(v.seen["shown"]) != v.seen["twins"])
    none_of(visits, lambda v: [name for name in v.seen["shown"] if f"twin-{v.theme}" not in name])


def test_a_phone_does_not_scroll_sideways(visits: list[Visit]) -> None:
    narrow = [visit for visit in visits if visit.width == PHONE["width"]]
    assert narrow
    none_of(narrow, lambda v: max(v.seen["wide"], v.seen["wide open"]) > 0)


def test_accessibility(visits: list[Visit]) -> None:
    none_of(visits, lambda v: "".join(f"\n  {violation}" for violation in v.violations))


@pytest.fixture(scope="module")
def served(book: Path) -> Iterator[str]:
    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(book))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.mark.parametrize("word", ["UKF", "geoid"])
@pytest.mark.parametrize("where", ["disk", "server"])
def test_search_finds(browser, book: Path, served: str, where: str, word: str) -> None:
    page = browser.new_page(viewport=WIDE)
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(f"{book.as_uri() if where == 'disk' else served}/index.html")
    page.locator(".search-button-field, .search-button").first.click()
    page.locator("#search-input").last.fill(word)
    page.keyboard.press("Enter")
    page.wait_for_url(f"**/search.html?q={word}*")
    page.wait_for_selector("#search-results li a")
    assert page.locator("#search-results li a").count() > 0
    page.wait_for_function("document.querySelector('.search-summary')?.textContent.match(/[1-9]/)")
    assert not errors
    page.close()


def test_every_download_and_link_leads_somewhere(book: Path) -> None:
    dead, found = [], 0
    for name in pages(book):
        for link in re.findall(r'<a\b[^>]*\bhref="([^"#]+)', (book / name).read_text(encoding="utf-8")):
            url = urllib.parse.urlsplit(html.unescape(link))
            if not url.scheme:
                found += 1
                if not ((book / name).parent / urllib.parse.unquote(url.path)).exists():
                    dead.append(f"{name}: {link}")
    assert found > 0
    assert not dead
