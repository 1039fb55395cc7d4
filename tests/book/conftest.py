"""A browser, and a book to look at: the toy book, or the one that GEOKALMAN_BOOK names (`make check`)."""

from __future__ import annotations

import csv
import itertools
import os
import shutil
import warnings
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest
import toybook
from filelock import FileLock
from matplotlib.figure import Figure

from execbook import execute, notebooks, parameters, reference, settings
from execbook.project import root as project_root


@pytest.fixture
def toy_root(tmp_path: Path) -> Path:
    """A clone-like folder with a small book whose notebook was executed."""
    return toybook.make(tmp_path / "clone")


@pytest.fixture(scope="session")
def book(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the HTML under test."""
    told = os.environ.get("GEOKALMAN_BOOK")
    if told:
        if not (Path(told) / "index.html").is_file():
            pytest.fail(f"GEOKALMAN_BOOK={told} holds no index.html; call `make book` first.")
        return Path(told).resolve()
    from execbook import html, stage

    root = toybook.make(tmp_path_factory.mktemp("browser") / "clone")
    stage.stage(root)
    return html.build(root)


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path of a Chromium; without one the tests skip, or fail where GEOKALMAN_REQUIRE_BROWSER is set."""
    names = ("chromium", "chromium-browser", "google-chrome")
    found = os.environ.get("GEOKALMAN_BROWSER") or next(filter(None, map(shutil.which, names)), None)
    if found is None:
        reason = "no Chromium found; install one (Debian: chromium) or name it by GEOKALMAN_BROWSER"
        if os.environ.get("GEOKALMAN_REQUIRE_BROWSER") == "1":
            pytest.fail(reason)
        pytest.skip(reason)
    return found


@pytest.fixture(scope="session")
def browser(chromium: str) -> Iterator:
    """The browser, headless, without errands of its own."""
    from playwright.sync_api import sync_playwright

    quiet = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-background-networking"]
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=chromium, args=quiet)
        yield started
        started.close()


@pytest.fixture(scope="session")
def run_here() -> Callable[..., Path]:
    """Execute a notebook in this process: without the start of a kernel, which takes longer than most quick runs.

    Called with (paper, name, out, quick=True, themes=1, **parameters); gives the run folder, or raises what a cell
    raises. Of the two themes of a figure, both are always drawn, but only `themes` of them are made into images.
    """
    root = project_root(Path(__file__).parent)
    savefig = Figure.savefig

    def executed(paper: str, name: str, out: Path, quick: bool = True, themes: int = 1, **given) -> Path:
        source = notebooks.read(root, f"{paper}/{name}")
        specification = parameters.specification(source, f"{paper}/{name}")
        values = (dict(specification.quick) if quick else {}) | specification.check(given)
        namespace: dict = {"__name__": "__main__"}
        made = itertools.count()
        with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
            warnings.simplefilter("default")  # as in a kernel
            patch.setenv("EXECBOOK_ROOT", str(root))
            patch.setenv("EXECBOOK_OUT", str(out))
            patch.chdir(root / "book" / paper)
            if themes == 1:  # a figure comes twice, light and dark
                patch.setattr(Figure, "savefig", lambda *a, **k: next(made) % 2 or savefig(*a, **k))
            for cell in source.cells:
                if cell.cell_type == "code":
                    exec(compile(cell.source, f"{paper}/{name}", "exec"), namespace)
                    if "parameters" in cell.metadata.get("tags", []):
                        namespace.update(values)
        return out

    return executed


@pytest.fixture(scope="session")
def run_notebook(tmp_path_factory: pytest.TempPathFactory, run_here) -> Callable[..., Path]:
    """The run folder of a notebook of the book, executed on first use, once for all workers of xdist.

    Called with (paper, name, label="quick", quick=True, **parameters); a label names one choice of parameters. Each
    paper's first notebook is executed as `geokalman run` does, in a kernel of its own; so is every one where this
    process has more than the one thread that the references are computed with. The others are executed here, and in
    kernels by `make book`.
    """
    root = project_root(Path(__file__).parent)
    base, several = tmp_path_factory.getbasetemp(), "PYTEST_XDIST_WORKER" in os.environ

    def executed(paper: str, name: str, label: str = "quick", quick: bool = True, **given) -> Path:
        folder = (base.parent if several else base) / paper
        folder.mkdir(exist_ok=True)
        out = folder / f"{name}-{label}"
        with FileLock(folder / f"{name}-{label}.lock"):
            if not (out / "provenance.json").is_file():
                if given:
                    return run_here(paper, name, out, quick, **given)
                if name.startswith("01-") or settings.present()["threads"] != 1:
                    return execute.run(root, f"{paper}/{name}", out=out, quick=quick, page=False, threads=1)
                return run_here(paper, name, out, quick, themes=2)
        return out

    return executed


@pytest.fixture(scope="session")
def assert_drawn() -> Callable[..., None]:
    """Fails unless a run has figures, each drawn in two themes and, `without_data` excepted, kept with its numbers."""

    def check(folder: Path, without_data: Iterable[str] = ()) -> None:
        figures = reference.read_run(folder)[0]["figures"]
        assert figures, "no figure"
        for figure in figures:
            light, dark = ((folder / "figures" / f"{figure}.{theme}.png").read_bytes() for theme in ("light", "dark"))
            assert min(len(light), len(dark)) > 1000 and light != dark, f"{figure} is not drawn twice"
            if figure not in without_data:
                with open(folder / "figures" / f"{figure}.csv", encoding="utf-8", newline="") as file:
                    table = list(csv.reader(file))
                assert len(table) > 1 and len({len(row) for row in table}) == 1, f"{figure} has no table of numbers"

    return check


@pytest.fixture(scope="session")
def assert_held() -> Callable[[Iterable[reference.Difference]], None]:
    """Fails with every number of a run that is not what is stored or wanted."""

    def check(found: Iterable[reference.Difference]) -> None:
        problems = [f"{d.key}: {d.ours}, wanted {d.stored}, {d.problem}" for d in found if d.problem]
        assert not problems, "\n".join(problems)

    return check
