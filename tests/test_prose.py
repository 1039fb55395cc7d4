"""The English of the book: short sentences, British spelling, no misspelt word."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from tests.helpers import prose

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    p for p in (ROOT / "book").rglob("*.md") if not {"_build", "api"} & set(p.relative_to(ROOT / "book").parts)
)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT / "book")))
def test_a_page_reads_well(page: Path) -> None:
    assert not prose.faults(page.read_text(encoding="utf-8"))


def test_sentences_have_eighteen_words_on_average() -> None:
    counts = [s.words for page in PAGES for s in prose.sentences(page.read_text(encoding="utf-8")) if s.words]
    assert sum(counts) / len(counts) <= 18


def test_no_word_is_misspelt() -> None:
    names = [str(ROOT / name) for name in ("book", "README.md", "CONTRIBUTING.md", "CHANGELOG.md", "src")]
    skip = "*/_build/*,*.bib,*.png,*.svg,*.json,*.files,*.ipynb,*/_static/*"
    done = subprocess.run(
        [sys.executable, "-m", "codespell_lib", "--skip", skip, "--ignore-words-list", "nd,nees,ond,tung,accreting,shepperd,facor", *names],
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


def test_the_guard_detects_what_it_should() -> None:
    long = "A " + "word " * 30 + "ends."
    page = (
        f"# Title\n\n{long}\n\nIt is simply $1.4\\cdot10^0$ m. Short {{doc}}`a page <b>` here.\n\n| {long} |\n| - |\n"
    )
    assert [line.split(":")[1].strip() for line in prose.faults(page)] == [
        "32 words",
        "'simply'; write nothing",
        "a number times 10^0 or 10^1",
    ]
    assert [s.words for s in prose.sentences(page)] == [32, 5, 4]
    cell = "```{code-cell} ipython3\nnb.figure(caption=(\n 'Behavior of ' 'a filter.'))\n```\n"
    assert "British" in prose.faults(cell)[0]
    assert prose.average("") == 0.0
    assert len(prose.sentences("It holds, e.g. here, in Fig. 3. Two.")) == 2
