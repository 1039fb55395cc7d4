"""Every page of the book in a headless browser, from the disk: light and dark, wide and narrow."""

from __future__ import annotations

import functools
import html
import re
import shutil
import threading
import urllib.parse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from toybook import PROJECT

from execbook import contents, explore
from geokalman.kalman import Model, Sensor, chi_square_bounds, gaussian, nis, run, van_loan
from geokalman.pair import simulate
from geokalman.pair.model import Scenario

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
def axe() -> str:
    """The source of axe-core."""
    return files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")


# Each look at half of the pages is a group of its own, so that workers share them (`--dist loadgroup`). axe takes most
# of the time: two looks show it both themes and both widths.
LOOKS = [
    pytest.param((theme, viewport, half, audited), id=f"{theme}-{viewport['width']}-{half}",
                 marks=pytest.mark.xdist_group(f"{theme}-{viewport['width']}-{half}"))
    for theme, viewport, audited in (("dark", WIDE, True), ("light", PHONE, True), ("light", WIDE, False))
    for half in (0, 1)
]  # fmt: skip


@pytest.fixture(scope="module", params=LOOKS)
def visits(request, browser, axe: str, book: Path) -> list[Visit]:
    theme, viewport, half, audited = request.param
    context = browser.new_context(color_scheme=theme, viewport=viewport)
    page = context.new_page()
    found = [
        _visit(page, book / name, Visit(name, theme, viewport["width"]), axe if audited else None)
        for name in pages(book)[half::2]
    ]
    context.close()
    return found


def _visit(page, path: Path, visit: Visit, axe: str | None) -> Visit:
    heard: dict[str, Callable] = {
        "request": lambda request: visit.requests.append(request.url),
        "requestfailed": lambda request: visit.missing.append(request.url),
        "pageerror": lambda error: visit.errors.append(str(error)),
        "console": lambda message: visit.errors.append(message.text) if message.type == "error" else None,
    }
    page.goto("about:blank")  # what the page before still does is over
    for event, note in heard.items():
        page.on(event, note)
    page.goto(path.as_uri())
    page.evaluate("() => window.MathJax && MathJax.startup ? MathJax.startup.promise.then(() => true) : true")
    visit.seen = page.evaluate(_LOOK)
    page.add_style_tag(content="* { animation: none !important; transition: none !important; }")
    page.evaluate("() => document.querySelectorAll('details').forEach(d => d.open = true)")
    if axe:
        visit.violations = _audit(page, axe)
    visit.seen["wide open"] = page.evaluate(
        "document.documentElement.scrollWidth - document.documentElement.clientWidth"
    )
    for event, note in heard.items():
        page.remove_listener(event, note)
    return visit


def _audit(page, axe: str) -> list[str]:
    page.evaluate(axe)
    options = "{runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa'], resultTypes: ['violations'], preload: false}"
    found = page.evaluate(f"() => axe.run(document, {options})")
    return [f"{v['id']}: {n['target']} {n['html'][:120]}" for v in found["violations"] for n in v["nodes"]]


def apart(visit: Visit) -> list[str]:
    """What is wrong with the twins of a page: its theme, a twin too many or few, the twin of the other theme."""
    theme = [] if visit.seen["theme"] == visit.theme else [f"theme {visit.seen['theme']}"]
    count = [] if len(visit.seen["shown"]) == visit.seen["twins"] else ["a twin is missing or shown beside the other"]
    return [*theme, *count, *(name for name in visit.seen["shown"] if f"twin-{visit.theme}" not in name)]


FAULTS: dict[str, Callable[[Visit], object]] = {
    "another host is asked": lambda v: [u for u in v.requests if not u.startswith(("file:", "data:", "blob:"))],
    "a file is missing": lambda v: v.missing or v.seen["broken"],
    "a script fails": lambda v: v.errors,
    "an equation is not rendered": lambda v: v.seen["unrendered"] or v.seen["failed"],
    "an image has no text alternative": lambda v: v.seen["silent"],
    "the twin of the other theme is shown": apart,
    "a phone scrolls sideways": lambda v: v.width == PHONE["width"] and max(v.seen["wide"], v.seen["wide open"]) > 0,
    "somebody is shut out": lambda v: v.violations,
}


def test_every_page_of_the_contents_is_there(book: Path) -> None:
    wanted = {f"{name}.html" for name in contents.pages(book.parents[2])}
    assert "index.html" in wanted and wanted | {"search.html"} <= set(pages(book))
    text = "".join((book / name).read_text(encoding="utf-8") for name in pages(book))
    assert 'class="math' in text and "twin-light" in text  # there is something to look at


def test_axe_sees_both_themes_and_both_widths() -> None:
    audited = [look.values[0][:2] for look in LOOKS if look.values[0][3]]
    for seen in ("light", "dark"), (WIDE["width"], PHONE["width"]):
        assert set(seen) <= {value for theme, viewport in audited for value in (theme, viewport["width"])}


@pytest.mark.parametrize("fault", FAULTS)
def test_no_page_has_the_fault(visits: list[Visit], fault: str) -> None:
    assert visits and all(visit.seen for visit in visits)
    found = [f"{visit}: {FAULTS[fault](visit)}" for visit in visits if FAULTS[fault](visit)]
    if found:
        pytest.fail("\n".join(found), pytrace=False)


_DOT = "data:image/gif;base64,R0lGODlhAQABAIAAAAAAAP///yH5BAEAAAAALAAAAAABAAEAAAIBRAA7"


@pytest.mark.parametrize(
    ("fault", "planted"),
    [
        (None, f'<img src="{_DOT}" alt="a dot"><span class="math"><mjx-container></mjx-container></span>'),
        ("another host is asked", '<script>fetch("http://127.0.0.1:9/").catch(() => 0)</script>'),
        ("a file is missing", '<link rel="stylesheet" href="lost.css">'),
        ("a script fails", "<script>throw new Error('planted')</script>"),
        ("an equation is not rendered", '<span class="math">x</span>'),
        ("an equation is not rendered", "<mjx-merror>x</mjx-merror>"),
        ("an image has no text alternative", f'<article><img src="{_DOT}" alt=""></article>'),
        ("the twin of the other theme is shown", f'<img class="twin-dark" alt="a dot" src="{_DOT}">'),
        ("a phone scrolls sideways", '<div style="width: 900px">wide</div>'),
        ("somebody is shut out", '<p style="color: #ccc; background: #fff">pale</p>'),
    ],
)
def test_a_planted_fault_is_seen(browser, axe: str, tmp_path: Path, fault: str | None, planted: str) -> None:
    page = f'<html lang="en" data-theme="light"><title>A page</title><main><h1>A page</h1>{planted}</main></html>'
    (tmp_path / "page.html").write_text(f"<!doctype html>{page}", encoding="utf-8")
    context = browser.new_context(color_scheme="light", viewport=PHONE)
    visit = _visit(context.new_page(), tmp_path / "page.html", Visit("page", "light", PHONE["width"]), axe)
    context.close()
    found = {name for name, look in FAULTS.items() if look(visit)}
    assert fault in found if fault else not found, (found, visit)


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


def links(book: Path) -> tuple[list[str], list[str]]:
    """Links and downloads within a book that lead somewhere, and those that do not."""
    found: tuple[list[str], list[str]] = ([], [])
    for name in pages(book):
        for link in re.findall(r'<a\b[^>]*\bhref="([^"#]+)', (book / name).read_text(encoding="utf-8")):
            url = urllib.parse.urlsplit(html.unescape(link))
            if not url.scheme:
                there = ((book / name).parent / urllib.parse.unquote(url.path)).exists()
                found[not there].append(f"{name}: {link}")
    return found


def test_every_download_and_link_leads_somewhere(book: Path) -> None:
    good, dead = links(book)
    assert good and not dead


def test_a_dead_link_is_seen(tmp_path: Path) -> None:
    (tmp_path / "a b.csv").touch()
    (tmp_path / "page.html").write_text(
        '<a class="x" href="a%20b.csv">data</a> <a href="#here">here</a> <a href="https://a.org/gone">there</a> '
        '<a href="gone.html#part">gone</a>',
        encoding="utf-8",
    )
    assert links(tmp_path) == (["page.html: a%20b.csv"], ["page.html: gone.html"])


_EXPLORED = "figure:has(img.explore)"
_INK = """(canvas) => {
  const {width, height} = canvas;
  const pixels = canvas.getContext('2d').getImageData(0, 0, width, height).data;
  const count = {};
  for (let k = 0; k < pixels.length; k += 4)
    if (pixels[k + 3] === 255) count[pixels.slice(k, k + 3)] = (count[pixels.slice(k, k + 3)] ?? 0) + 1;
  return Object.keys(count).filter((colour) => count[colour] > 20);
}"""


def explored(book: Path) -> Path:
    """The first page with a figure to explore."""
    return next(
        book / name for name in pages(book) if "twin-light explore" in (book / name).read_text(encoding="utf-8")
    )


@pytest.mark.parametrize("viewport", [WIDE, PHONE], ids=["wide", "phone"])
def test_a_figure_is_explored_from_the_disk(browser, axe: str, book: Path, viewport: dict) -> None:
    context = browser.new_context(color_scheme="light", viewport=viewport)
    page = context.new_page()
    asked: list[str] = []
    errors: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("requestfailed", lambda request: errors.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(explored(book).as_uri())
    figure = page.locator(_EXPLORED).first
    assert not any("uPlot" in url for url in asked)  # only who asks for it loads it
    figure.locator("button.explore-start").focus()
    page.keyboard.press("Enter")
    plot = figure.locator(".uplot").first
    plot.wait_for()
    assert any("uPlot" in url for url in asked) and all(url.startswith(("file:", "data:")) for url in asked)
    assert not figure.locator("img.twin-light").is_visible()
    alt = figure.locator("img.twin-light").get_attribute("alt")
    assert figure.locator(".explore-box").get_attribute("aria-label") == alt
    page.evaluate(axe)
    found = page.evaluate("() => axe.run('.explore-box', {resultTypes: ['violations'], preload: false})")
    assert not found["violations"]
    canvas = plot.locator("canvas")
    look = "(canvas) => new Promise(requestAnimationFrame).then(() => canvas.toDataURL())"
    drawn = canvas.evaluate(look)
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")

    label = figure.locator(".explore-readout").first
    before = label.text_content()
    figure.locator("input[type=range]").focus()
    page.keyboard.press("ArrowRight")
    assert label.text_content() != before  # the slider reads the curves out

    figure.locator("input[type=checkbox]").first.uncheck()
    without = canvas.evaluate(look)
    assert without != drawn
    figure.locator("input[type=checkbox]").first.check()

    over = plot.locator(".u-over").bounding_box()
    page.mouse.move(over["x"] + 0.3 * over["width"], over["y"] + 20)
    page.mouse.down()
    page.mouse.move(over["x"] + 0.6 * over["width"], over["y"] + 22, steps=4)
    page.mouse.up()
    zoomed = canvas.evaluate(look)
    assert zoomed not in (drawn, without)
    page.mouse.dblclick(over["x"] + 0.5 * over["width"], over["y"] + 20)
    assert canvas.evaluate(look) == drawn
    figure.get_by_role("button", name="Zoom in").click()
    assert canvas.evaluate(look) not in (drawn, zoomed)
    figure.get_by_role("button", name="Show the whole").click()
    assert canvas.evaluate(look) == drawn

    colours = page.evaluate("Object.values(window.exploreData)[0].look.grid")
    grids = [",".join(str(int(colour[k : k + 2], 16)) for k in (1, 3, 5)) for colour in colours]
    assert grids[0] in canvas.evaluate(_INK)
    page.evaluate("document.documentElement.dataset.theme = 'dark'")
    canvas.evaluate(look)
    dark = canvas.evaluate(_INK)
    assert grids[1] in dark and grids[0] not in dark  # in the colours of the other theme

    figure.get_by_role("button", name="Back to the picture").click()
    assert figure.locator("img.twin-dark").is_visible() and not plot.is_visible()
    figure.locator("button.explore-start").click()
    assert plot.is_visible() and not errors
    context.close()


def test_without_scripts_the_picture_stays(browser, book: Path) -> None:
    context = browser.new_context(java_script_enabled=False, viewport=WIDE)
    page = context.new_page()
    page.goto(explored(book).as_uri())
    assert page.locator(_EXPLORED).first.locator("img.twin-light").is_visible()
    assert page.locator("button.explore-start").count() == 0
    context.close()


@pytest.fixture(scope="module")
def play() -> dict:
    """What the page of the update gives its playground, with every other position missing."""
    scenario = Scenario(duration=3600.0, gnss_step=60.0, amplitude=0.1, sigma_a=2.5e-6, tau=1.0)
    rng = np.random.default_rng(5)
    truth = simulate.on_the_line(scenario, rng)
    seen = simulate.observe(truth, scenario, rng)
    Phi, Q = van_loan([[0.0, 1.0], [-(scenario.n**2), 0.0]], np.diag([0.0, 1.0]), scenario.step)
    prior = {"mean": seen.prior.mean[:2], "cov": seen.prior.cov[:2, :2]}
    return {
        "script": "playground.js", "minutes": seen.t / 60, "truth": truth.x[:, :2], "gnss": seen.gnss[:, 0],
        "rate": seen.rate[:, 0], "prior": prior, "Phi": Phi, "Q": Q, "bounds": chi_square_bounds([2]),
        "defaults": {"q": 1.25e-11, "gnss": 0.02, "rate": 1e-6, "epoch": 60},
        "colours": dict.fromkeys(("truth", "seen", "estimate", "before"), ["#102030", "#d0e0f0"]),
    }  # fmt: skip


@pytest.fixture
def playground(play: dict, tmp_path: Path) -> Path:
    """A page with a figure to play with, on the disk."""
    for name in ("explore.js", "playground.js", "book.css"):
        shutil.copyfile(PROJECT / "book" / "_static" / name, tmp_path / name)
    (tmp_path / "play.light.js").write_text(explore.script("play", play), encoding="utf-8")
    (tmp_path / "play.light.png").write_bytes((PROJECT / "book" / "_static" / "front.png").read_bytes())
    (tmp_path / "page.html").write_text(
        '<!doctype html><html lang="en" data-theme="light"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        '<title>Play</title><link rel="stylesheet" href="book.css"><script src="explore.js"></script><main><h1>Play</h1>'
        '<figure style="margin: 0"><span class="twins"><img class="twin-light explore" style="max-width: 100%"'
        ' alt="a filter" src="play.light.png"></span></figure></main></html>',
        encoding="utf-8",
    )
    return tmp_path / "page.html"


@pytest.mark.parametrize("setting", [(1.25e-11, 0.02, 1e-6), (1e-14, 0.02, 1e-3), (1e-8, 1.0, 1e-7)])
def test_the_filter_in_the_browser_is_that_of_the_book(browser, play: dict, playground: Path, setting: tuple) -> None:
    q, gnss, rate = setting
    sensors = [
        Sensor(play["gnss"][:, None], [[gnss**2]], H=[[1.0, 0.0]]),
        Sensor(play["rate"][:, None], [[rate**2]], H=[[0.0, 1.0]]),
    ]
    motion = Model(F=play["Phi"], Q=q * play["Q"])
    course = run(gaussian(**play["prior"]), 60 * play["minutes"], motion, sensors)
    page = browser.new_page()
    page.goto(playground.as_uri())
    for name in ("playground.js", "play.light.js"):
        page.add_script_tag(path=playground.with_name(name))
    ours = page.evaluate(
        "(setting) => exploreScripts['playground.js'].filter(exploreData.play, ...setting)", list(setting)
    )
    page.close()
    scale = np.sqrt(np.diagonal(course.cov, axis1=1, axis2=2))
    before = np.sqrt(np.diagonal(course.predicted_cov, axis1=1, axis2=2))
    for state, mean, cov, sigma in (
        (ours, course.mean, course.cov, scale),
        ([epoch["predicted"] for epoch in ours], course.predicted_mean, course.predicted_cov, before),
    ):
        assert (np.abs([epoch["mean"] for epoch in state] - mean) / sigma).max() < 1e-9
        apart = np.abs([epoch["cov"] for epoch in state] - cov)
        assert (apart / (sigma[:, :, None] * sigma[:, None, :])).max() < 1e-9
    np.testing.assert_allclose([epoch["nis"] for epoch in ours], nis(course.whitened)[0], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("viewport", [WIDE, PHONE], ids=["wide", "phone"])
def test_the_playground_is_played_by_keyboard(browser, axe: str, playground: Path, viewport: dict) -> None:
    page = browser.new_page(viewport=viewport)
    asked: list[str] = []
    errors: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(playground.as_uri())
    page.locator("button.explore-start").focus()
    page.keyboard.press("Enter")
    page.wait_for_selector(".playground-nis svg circle")
    assert all(url.startswith("file:") for url in asked) and not any("uPlot" in url for url in asked)
    page.evaluate(axe)
    assert not page.evaluate("() => axe.run('.playground', {resultTypes: ['violations'], preload: false})")[
        "violations"
    ]
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    sliders = page.locator(".playground input[type=range]")
    told = page.locator(".playground output.explore-readout")
    default = told.text_content()
    for number, unit in enumerate(("m²/s³", "m", "m/s", "min")):
        slider = sliders.nth(number)
        assert slider.get_attribute("aria-valuetext").endswith(f" {unit}")
        before = page.locator(".playground").inner_html()
        slider.focus()
        page.keyboard.press("ArrowLeft")
        assert page.locator(".playground").inner_html() != before
    assert told.text_content() != default
    page.get_by_role("button", name="Back to the default setting").click()
    assert told.text_content() == default
    page.evaluate("document.documentElement.dataset.theme = 'dark'")
    page.wait_for_selector(".playground-nis svg circle[fill='#d0e0f0']")
    page.get_by_role("button", name="Back to the picture").click()
    assert page.locator("button.explore-start").is_visible() and not errors
    page.close()
