"""Staging and HTML of a small book: what becomes of a notebook's outputs, and that a page is whole or not there."""

from __future__ import annotations

import errno
import hashlib
import json
import re
import shutil
from pathlib import Path

import nbformat
import numpy as np
import pytest
import toybook

from execbook import blocks, contents, html, reference, stage
from execbook.errors import Fault

RUN = Path("book/_build/runs") / toybook.PAGE


def staged(root: Path) -> nbformat.NotebookNode:
    return nbformat.read(stage.stage(root) / f"{toybook.PAGE}.ipynb", as_version=4)


def text(root: Path, kind: str) -> str:
    return "\n\n".join(cell.source for cell in staged(root).cells if cell.cell_type == kind)


def rerecord(root: Path, change) -> None:
    """Change the executed notebook of the toy page."""
    path = root / RUN / "notebook.ipynb"
    notebook = nbformat.read(path, as_version=4)
    change(notebook)
    nbformat.write(notebook, path)


def test_pages_come_in_the_order_of_the_contents(toy_root: Path) -> None:
    assert contents.pages(toy_root) == ["index", "toy/index", "toy/01-wave", "practice/rerun"]


def test_prose_edited_since_the_run_is_shown_unless_the_code_was_edited_too() -> None:
    cells = nbformat.v4.new_markdown_cell, nbformat.v4.new_code_cell
    executed = nbformat.v4.new_notebook(cells=[cells[0]("# Old"), cells[1]("1 + 1", execution_count=1)])
    source = nbformat.v4.new_notebook(cells=[cells[0]("# New"), cells[0]("More."), cells[1]("1 + 1")])
    shown = stage._with_prose(source, executed)
    assert [cell.source for cell in shown] == ["# New", "More.", "1 + 1"] and shown[2].execution_count == 1
    source.cells[2].source = "1 + 2"
    assert stage._with_prose(source, executed) == executed.cells


def test_a_figure_becomes_a_directive_with_its_twin_and_data(toy_root: Path) -> None:
    prose = text(toy_root, "markdown")
    assert "```{figure} 01-wave.files/wave.light.png\n:name: wave\n" in prose
    assert ':alt: "A \\"sine\\": 100 % of #1 [five] periods"\n:width: 720px\n\nA wave of height $h$.\n' in prose
    assert "{download}`Data (CSV, one row in 2) <01-wave.files/wave.csv>`" in prose
    files = toy_root / "book/_build/site/toy/01-wave.files"
    for name in ("wave.light.png", "wave.dark.png", "wave.csv", "wave.js"):
        assert (files / name).read_bytes() == (toy_root / RUN / "figures" / name).read_bytes()


def test_a_table_becomes_a_directive_and_its_bars_are_escaped(toy_root: Path) -> None:
    prose = text(toy_root, "markdown")
    assert "```{table} Two methods.\n:name: rms\n\n| method | rms / m |\n| :--- | ---: |\n" in prose
    assert "| EKF | 0.8 \\| 9.0\u00a0×\u00a010⁻¹ |" in prose
    assert "{download}`Data (CSV) <01-wave.files/rms.csv>`" in prose


def test_the_reason_of_a_verdict_stands_below_the_claim(toy_root: Path) -> None:
    prose = text(toy_root, "markdown")
    assert ":name: verdicts-toy-01-wave\n\n| The paper says | Printed | Ours | Verdict |\n" in prose
    row = next(line for line in prose.splitlines() if "claim-wave-rms" in line)
    assert row.startswith('| <span id="claim-wave-rms"></span>Table 1: the rms of the wave<br><small>Source: Table 1, ')
    assert row.endswith(" | reproduced |") and "sounds good" not in prose  # which no notebook decides


def test_an_echoed_value_is_not_shown(toy_root: Path) -> None:
    echo = nbformat.v4.new_output("execute_result", data={"text/plain": "1.2345"}, execution_count=1)
    rerecord(toy_root, lambda notebook: notebook.cells[3].outputs.append(echo))
    assert "1.2345" not in json.dumps(staged(toy_root))


def test_a_figure_without_data_offers_none(toy_root: Path) -> None:
    def without(notebook) -> None:
        record = next(
            o.data[toybook.FIGURE_TYPE]
            for c in notebook.cells
            for o in c.get("outputs", [])
            if toybook.FIGURE_TYPE in o.get("data", {})
        )
        del record["files"]["csv"]

    rerecord(toy_root, without)
    assert "files/wave.csv" not in text(toy_root, "markdown")


def test_each_notebook_has_a_label_of_its_own_for_its_verdicts() -> None:
    assert stage.label("toy/01-wave", "verdicts-01-wave") == "verdicts-toy-01-wave"
    assert stage.label("boat/01-wave", "verdicts-01-wave") == "verdicts-boat-01-wave"
    assert stage.label("toy/01-wave", "wave") == "wave"


def test_a_name_of_a_figure_stands_once_in_the_book(toy_root: Path) -> None:
    other = "toy/02-again"
    shutil.copyfile(toy_root / f"book/{toybook.PAGE}.md", toy_root / f"book/{other}.md")
    shutil.copytree(toy_root / RUN, toy_root / "book/_build/runs" / other)
    toc = toy_root / "book/_toc.yml"
    line = f"    - file: {toybook.PAGE}\n"
    toc.write_text(toc.read_text().replace(line, f"{line}    - file: {other}\n"))
    stage.stage(toy_root)
    with pytest.raises(Fault, match=f"(?s){other}.*duplicate label wave, other instance in .*{toybook.PAGE}"):
        html.build(toy_root)


def test_code_is_folded_joined_and_without_machinery(toy_root: Path) -> None:
    code = [cell for cell in staged(toy_root).cells if cell.cell_type == "code"]
    sources = "\n".join(cell.source for cell in code)
    assert "quick" not in sources
    assert "nb.finish()" not in sources
    assert all("hide-input" in cell.metadata.tags for cell in code)
    assert (
        code[0].source.startswith("frequency = 2.0") and "Notebook(" in code[0].source and "nb.figure" in code[0].source
    )
    assert code[0].metadata.mystnb.code_prompt_show == "Parameters: show"
    assert [o.text for cell in code for o in cell.outputs] == ["x" * 200 + "\n", "the end\n"]


def test_an_author_may_show_a_cell(toy_root: Path) -> None:
    rerecord(toy_root, lambda notebook: notebook.cells[4].metadata.update(tags=["show-input"]))
    shown = [
        cell for cell in staged(toy_root).cells if cell.cell_type == "code" and "hide-input" not in cell.metadata.tags
    ]
    assert [cell.source for cell in shown] == ["nb.figure('wave', draw)"]


def test_an_author_may_hide_a_cell_that_is_folded_anyway(toy_root: Path) -> None:
    rerecord(toy_root, lambda notebook: notebook.cells[4].metadata.update(tags=["hide-input"]))
    assert all(
        cell.metadata.tags.count("hide-input") == 1 for cell in staged(toy_root).cells if cell.cell_type == "code"
    )


def test_the_foot_reruns_and_offers(toy_root: Path) -> None:
    prose = text(toy_root, "markdown")
    assert "geokalman run toy/01-wave frequency=1\n" in prose
    assert "| `frequency` | `2.0` | Hz | `(0, 10]` | of the wave |" in prose
    assert "{download}`01-wave.ipynb <01-wave.files/01-wave.ipynb>`" in prose
    assert "commit `0000000000` with uncommitted changes" in prose
    offered = toy_root / "book/_build/site/toy/01-wave.files/01-wave.ipynb"
    assert offered.read_bytes() == (toy_root / RUN / "notebook.ipynb").read_bytes()


def test_verdicts_are_filled_in(toy_root: Path) -> None:
    site = stage.stage(toy_root)
    assert "| reproduced |" in (site / "toy/index.md").read_text()
    assert "[The toy paper](toy/index.md)" in (site / "index.md").read_text()


def test_a_block_is_called_rightly_or_refused(toy_root: Path) -> None:
    assert blocks.fill("<!-- an ordinary comment -->", toy_root) == "<!-- an ordinary comment -->"
    with pytest.raises(Fault, match=r"<!-- verdicts --> is no block; write <!-- verdicts: PAPER -->"):
        blocks.fill("<!-- verdicts -->", toy_root)
    with pytest.raises(Fault, match=r"write <!-- run-times -->"):
        blocks.fill("<!-- run-times: toy -->", toy_root)


def test_claims_near_their_threshold_are_listed(toy_root: Path) -> None:
    path = toy_root / "book/toy/claims.yml"
    given = path.read_text()
    path.write_text(given.replace("rel: 0.01", "rel: 0.05"))
    assert "Table 1: the rms" not in blocks.fill("<!-- near-claims -->", toy_root)
    path.write_text(given.replace("printed: 0.7071", "printed: 0.7"))
    listed = blocks.fill("<!-- near-claims -->", toy_root)
    assert "| Table 1: the rms of the wave" in listed and "| not reproduced | 0.016 % |" in listed
    assert listed.startswith("\n```{table} Claims within 2 % of the threshold that decides them, or with a share ")


def test_kinds_of_guards_are_counted(toy_root: Path) -> None:
    path = reference.path_of(toy_root, "toy/01-wave", "quick")
    path.parent.mkdir(parents=True)
    np.savez(path.with_suffix(".npz"), x=np.ones(3))
    rounding = {"value": 1e-16, "unit": "m", "spread": 1e-16, "largest": 2e-16}
    array = {"shape": [3], "stride": 1, "unit": "m", "spread": 1e-8}
    path.write_text(
        json.dumps({"a": {"value": 1.0, "unit": "m", "spread": 0.0}, "b": rounding, "c": rounding, "x": array})
    )
    (path.parent / "guards.yml").write_text("- {notebook: toy/01-wave, key: c, none: true, why: an argument}\n")
    lines = blocks.fill("<!-- guards -->", toy_root).strip().splitlines()[2:]
    assert lines == [
        "| a relative difference of 1e-06 | 0 | 1 |",
        "| a relative difference of 1e-09 | 0 | 1 |",
        "| a size (rounding) | 0 | 1 |",
        "| nothing, as declared | 0 | 1 |",
    ]


def test_run_times(toy_root: Path) -> None:
    assert "| {doc}`/toy/01-wave` | 1.5 |\n| all of {doc}`/toy/index` | 1.5 |\n| the whole book | 1.5 |" in blocks.fill(
        "<!-- run-times -->", toy_root
    )


def test_the_modules_of_a_package_are_documented_with_their_source(toy_root: Path) -> None:
    package = toy_root / "src/toys"
    package.mkdir(parents=True)
    for name in ("__init__", "part"):
        (package / f"{name}.py").touch()
    listed = blocks.fill("<!-- api: toys -->", toy_root)
    assert [line for line in listed.splitlines() if "automodule" in line] == [
        ".. automodule:: toys", ".. automodule:: toys.part",
    ]  # fmt: skip
    assert "{download}`part.py </../../../src/toys/part.py>`" in listed


def test_what_is_missing_is_named(toy_root: Path) -> None:
    figure = toy_root / RUN / "figures/wave.dark.png"
    kept = figure.read_bytes()
    figure.unlink()
    with pytest.raises(Fault, match=r"wave\.dark\.png is missing, though the notebook recorded it"):
        stage.stage(toy_root)
    figure.write_bytes(kept)
    shutil.rmtree(toy_root / RUN)
    with pytest.raises(Fault, match=r"not executed yet: toy/01-wave"):
        stage.stage(toy_root)
    (toy_root / "book/practice/rerun.md").unlink()
    with pytest.raises(Fault, match=r"lists pages that do not exist: book/practice/rerun\.md"):
        stage.stage(toy_root)


def test_a_notebook_outside_the_contents_is_named(toy_root: Path) -> None:
    shutil.copyfile(toy_root / f"book/{toybook.PAGE}.md", toy_root / "book/toy/02-tiny.md")
    with pytest.raises(Fault, match=r"^book/toy/02-tiny\.md is not in book/_toc\.yml; add it there\.$"):
        stage.stage(toy_root)


def test_the_site_is_whole_or_the_last_one(toy_root: Path) -> None:
    site = stage.stage(toy_root)
    before = tree(site)
    (toy_root / RUN / "tables/rms.csv").unlink()
    with pytest.raises(Fault, match=r"rms\.csv is missing"):
        stage.stage(toy_root)
    assert tree(site) == before
    assert [p.name for p in site.parent.iterdir() if p.name.startswith(".site")] == []


def test_pages_that_left_the_book_leave_the_site(toy_root: Path) -> None:
    extra = toy_root / "book/practice/extra.md"
    extra.write_text("# Extra\n")
    toc = toy_root / "book/_toc.yml"
    kept = toc.read_text()
    toc.write_text(kept + "  - file: practice/extra\n")
    assert (stage.stage(toy_root) / "practice/extra.md").exists()
    toc.write_text(kept)
    assert not (stage.stage(toy_root) / "practice/extra.md").exists()


def tree(folder: Path) -> dict[str, str]:
    """Path -> SHA-256 of all files below a folder."""
    return {
        p.relative_to(folder).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }


def remote(page: str) -> list[str]:
    """Tags of a page that load something from another host."""
    return re.findall(r"""<(?:script|link|img|iframe)\b[^>]*\b(?:src|href)=["'](?:https?:)?//[^>]*>""", page)


def test_a_remote_resource_is_seen() -> None:
    planted = ['<script defer src="https://a.org/a.js">', '<link rel="stylesheet" href="//a.org/b.css">']
    assert remote("\n".join([*planted, '<a href="https://a.org">there</a>', '<script src="c.js">'])) == planted


def test_the_page_of_a_notebook_in_html(toy_root: Path) -> None:
    stage.stage(toy_root)
    page = (html.build(toy_root) / f"{toybook.PAGE}.html").read_text()
    assert page.count('class="dark-light twin-light explore"') == page.count('class="dark-light twin-dark"') == 1
    assert page.count("<figcaption>") == page.count("</figcaption>") == 1
    assert '<span class="verdict verdict-reproduced">reproduced</span>' in page
    assert "Figure 1 " in page and "Table 2 " in page  # the first table is that of the paper's claims
    assert 'rel="preload" as="font"' not in page
    assert not remote(page)


def test_an_unchanged_book_is_left_alone_and_a_failing_one_leaves_the_last(toy_root: Path) -> None:
    stage.stage(toy_root)
    book = html.build(toy_root)
    index = book / "index.html"
    inode, before = index.stat().st_ino, tree(book)
    stage.stage(toy_root)
    html.build(toy_root)
    assert index.stat().st_ino == inode
    (toy_root / "book/index.md").write_text("# A toy book\n\n{numref}`nowhere`\n")
    stage.stage(toy_root)
    with pytest.raises(Fault, match=r"(?s)the last good one stays.*WARNING.*nowhere"):
        html.build(toy_root)
    assert tree(book) == before
    assert "nowhere" in (book.parent / "html.log").read_text()


def test_a_damaged_and_a_deleted_page_are_made_anew(toy_root: Path) -> None:
    stage.stage(toy_root)
    book = html.build(toy_root)
    before = tree(book)
    page = book / f"{toybook.PAGE}.html"
    page.write_text(page.read_text().replace("A wave", "A wane"))
    (book / "index.html").unlink()
    assert tree(html.build(toy_root)) == before


def test_without_a_staged_book_there_is_nothing_to_build(toy_root: Path) -> None:
    with pytest.raises(Fault, match=r"holds no staged book"):
        html.build(toy_root)


def test_two_builds_in_two_places_are_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever letters are in the path of the clone, and whatever modules stand where the user does."""
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "html.py").write_text("raise SystemExit('not this one')")
    monkeypatch.chdir(tmp_path / "here")
    trees = []
    for name in ("one", "an{o}ther [2]*? 'é\" %s #$HOME"):
        root = toybook.make(tmp_path / name)
        stage.stage(root)
        trees.append(tree(html.build(root)))
    assert trees[0] == trees[1]


def test_a_full_disk_leaves_the_last_site(toy_root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    site = stage.stage(toy_root)
    before = tree(site)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(nbformat, "write", full)
    with pytest.raises(Fault, match=r"site: the disk is full; free some space"):
        stage.stage(toy_root)
    assert tree(site) == before


def test_provenance_without_a_commit(toy_root: Path) -> None:
    path = toy_root / RUN / "provenance.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"commit": None}))
    assert "from sources outside git (python 3.11.7" in text(toy_root, "markdown")
