"""Two runs, or a run and the book: numbers with differences, figures over each other."""

from __future__ import annotations

import html
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from execbook import atomic, claims, display, graph, notebooks, overlay, parameters, reference, runfolder
from execbook.errors import Fault, Misuse, shown

HEADER = ("name", "left", "right", "left − right", "relative", "unit")
_ALIGN = ("left", *["right"] * 4, "left")
_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Two runs compared</title><style>
body {{ font: 15px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem }}
td, th {{ padding: .15rem .8rem .15rem 0 }} img {{ max-width: 100% }}
</style></head><body><main>
<h1>Two runs compared</h1>
{note}<p>left: <code>{left}</code><br>right: <code>{right}</code></p>
<h2>Parameters that differ (left | right)</h2><ul>{changed}</ul>
<h2>Numbers</h2>
{numbers}
<h2>Figures</h2>
<p>Blue and solid is left, orange and dashed is right.</p>
{figures}
</main></body></html>
"""


class Row(NamedTuple):
    """A number in both runs, or the rms of an array with the largest difference of its items."""

    key: str
    unit: str
    left: float | None
    right: float | None
    difference: float | None
    relative: float | None


class Comparison(NamedTuple):
    """Both sides' names, parameters that differ, numbers, and the figures that both have.

    scales : of the left and the right side: paper, quick or custom.
    """

    left: str
    right: str
    parameters: list[tuple[str, Any, Any]]
    rows: list[Row]
    figures: list[str]
    scales: tuple[str, str] = ("paper", "paper")

    @property
    def note(self) -> str:
        """One sentence where both sides were not computed with the same parameters, else nothing."""
        if not self.parameters:
            return ""
        names, (left, right) = ", ".join(name for name, _, _ in self.parameters), self.scales
        sides = f"left is at {left} scale and right is at {right} scale"
        return f"The numbers are expected to differ, because the parameters do ({names}; {sides})."


def resolve(root: Path, text: str, base: Path) -> Path:
    """Give the run folder that a path or a name means: a folder, or the book's run of a notebook."""
    try:
        folder = (base / text).resolve()
        if (folder / "provenance.json").is_file():
            return folder
    except (OSError, RuntimeError, ValueError):  # longer than a path may be, or a loop of links
        pass
    text = notebooks.name_of(root, text)
    if text in notebooks.names(root):
        folder = graph.run_folder(root, text)
        if (folder / "provenance.json").is_file():
            return folder
        raise Misuse(f"{text} has no run in the book yet; make one with the command build.")
    raise Misuse(f"{shown(text)} is no folder of a run and no notebook; the command run prints the folder last.")


def compare(root: Path, left: Path, right: Path | None) -> Comparison:
    """Compare two run folders; the second is by default the book's, else the stored reference."""
    told, metrics, arrays = runfolder.read(left)
    name, quick = told["notebook"], told["mode"] == "quick"
    if right is None:
        notebooks.source_path(root, name)  # a word of the record must not lead anywhere else
        books = graph.run_folder(root, name)
        if quick or not (books / "provenance.json").is_file():
            mode = "quick" if quick else "paper"
            stored = {k: e for k, e in reference.load(root, name, mode)[0].items() if "value" in e}
            specification = parameters.load(root, name)
            theirs = specification.defaults | (specification.quick if quick else {})
            changed, scales = _changed(told["parameters"], theirs), (told["mode"], mode)
            return Comparison(str(left), f"reference ({mode})", changed, _rows(metrics, stored), [], scales)
        right = books
    other_told, others, other_arrays = runfolder.read(right)
    if other_told["notebook"] != name:
        other = other_told["notebook"]
        raise Misuse(f"{left} is a run of {name}, {right} one of {other}; two runs of one notebook compare.")
    changed, scales = _changed(told["parameters"], other_told["parameters"]), (told["mode"], other_told["mode"])
    rows = _rows(metrics, others)
    for key in sorted(arrays.keys() & other_arrays.keys()):
        a, b = (side[key].astype(complex if side[key].dtype.kind == "c" else float) for side in (arrays, other_arrays))
        if a.shape == b.shape and a.size:
            worst, largest = reference.largest(a - b), reference.largest(b)
            what = f"{key} (array: rms, largest difference)"
            rows.append(Row(what, told["arrays"][key]["unit"], _rms(a), _rms(b), worst, _ratio(worst, largest)))
    figures = [{p.stem for p in run.glob("figures/*.csv")} for run in (left, right)]
    return Comparison(str(left), str(right), changed, rows, sorted(figures[0] & figures[1]), scales)


def _changed(mine: dict[str, Any], theirs: dict[str, Any]) -> list[tuple[str, Any, Any]]:
    return [(k, mine.get(k), theirs.get(k)) for k in {**mine, **theirs} if mine.get(k) != theirs.get(k)]


def _rms(a: np.ndarray) -> float:
    known = np.abs(a[~np.isnan(a)])
    return float(np.sqrt(np.mean(known**2))) if known.size else math.nan


def _ratio(difference: float, scale: float) -> float:
    return difference / abs(scale) if scale else 0.0 if difference == 0 else math.inf


def _rows(metrics: claims.Metrics, others: claims.Metrics) -> list[Row]:
    rows = []
    for key in sorted({*metrics, *others}):
        left, right = metrics.get(key, {}).get("value"), others.get(key, {}).get("value")
        difference = None if left is None or right is None else left - right
        relative = None if difference is None else _ratio(difference, right)
        rows.append(Row(key, (metrics.get(key) or others[key])["unit"], left, right, difference, relative))
    return rows


def moved(comparison: Comparison, rel: float) -> list[Row]:
    """List the rows whose relative difference is above `rel`, or that one side lacks."""
    return [r for r in comparison.rows if (r.left != r.right if r.relative is None else abs(r.relative) > rel)]


def cells(row: Row) -> list[str]:
    """Give the texts of a row under `HEADER`."""
    values = ["–" if v is None else display.number(v, 7) for v in (row.left, row.right)]
    difference = "" if row.difference is None else display.number(row.difference, 3)
    return [row.key, *values, difference, "" if row.relative is None else f"{row.relative:+.2e}", row.unit]


def table(comparison: Comparison, form: str = "simple") -> str:
    """Give the numbers as a table, in text or as `html`."""
    return display.table(HEADER, [cells(row) for row in comparison.rows], _ALIGN, form)


def write_page(comparison: Comparison, folder: Path) -> Path:
    """Write `compare.html` into `folder` and return it; it names figures that cannot be drawn."""
    changed = "".join(f"<li>{html.escape(f'{k}: {a!r} | {b!r}')}</li>" for k, a, b in comparison.parameters)
    figures = "\n".join(_figure(comparison, name) for name in comparison.figures)
    page = folder / runfolder.PAGE
    text = _PAGE.format(
        note=f"<p><strong>{html.escape(comparison.note)}</strong></p>\n" if comparison.note else "",
        left=html.escape(comparison.left),
        right=html.escape(comparison.right),
        changed=changed or "<li>none</li>",
        numbers=table(comparison, "html"),
        figures=figures or "<p>None that both have.</p>",
    )
    atomic.write_text(page, text)
    return page


def _figure(comparison: Comparison, name: str) -> str:
    heading = f"<h3>{html.escape(name)}</h3>\n"
    try:
        runs = (Path(run) / "figures" / f"{name}.csv" for run in (comparison.left, comparison.right))
        image = overlay.overlay(*map(overlay.read_columns, runs), name)
    except Fault as error:
        return f"{heading}<p>Not drawn: {html.escape(str(error))}</p>"
    alt = f"The data of figure {html.escape(name)} from the left and the right run"
    return f'{heading}<figure><img alt="{alt}" src="{display.inlined(image)}"></figure>'
