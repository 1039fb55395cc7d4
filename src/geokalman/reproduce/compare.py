"""Two runs, or a run and the book, side by side: numbers with their differences, figures laid over each other."""

from __future__ import annotations

import base64
import html
import math
import shutil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from geokalman.reproduce import atomic, children, claims, display, graph, notebooks, overlay, reference, runfolder
from geokalman.reproduce.errors import Fault, Misuse, shown


class Row(NamedTuple):
    """One number in both runs, or the rms of an array in both with the largest difference of its items."""

    key: str
    unit: str
    left: float | None
    right: float | None
    difference: float | None
    relative: float | None


class Comparison(NamedTuple):
    """Names of both sides, parameters that differ (name, left, right), the numbers, and the figures that both have."""

    left: str
    right: str
    parameters: list[tuple[str, Any, Any]]
    rows: list[Row]
    figures: list[str]


def resolve(root: Path, word: str, base: Path) -> Path:
    """Run folder that a word of the command line means: a folder, or the book's run of a notebook."""
    try:
        folder = (base / word).resolve()
        if (folder / "provenance.json").is_file():
            return folder
    except (OSError, RuntimeError, ValueError):  # longer than a path may be, or a loop of links
        pass
    if word in notebooks.names(root):
        folder = graph.run_folder(root, word)
        if (folder / "provenance.json").is_file():
            return folder
        raise Misuse(f"{word} has no run in the book yet; make book executes it, or name the folder of a run.")
    raise Misuse(f"{shown(word)} is no folder of a run and no notebook; geokalman run prints the name of one last.")


def compare(root: Path, left: Path, right: Path | None) -> Comparison:
    """Compare two run folders; without a second one, the book's run of the same notebook, else the stored reference."""
    told, metrics, arrays = reference.read_run(left)
    name = told["notebook"]
    if right is None:
        notebooks.source_path(root, name)  # a word of the record must not lead anywhere else
    if right is None and (graph.run_folder(root, name) / "provenance.json").is_file() and told["mode"] != "quick":
        right = graph.run_folder(root, name)
    if right is None:
        mode = "quick" if told["mode"] == "quick" else "paper"
        entries, _ = reference.load(root, name, mode)
        others = {k: e for k, e in entries.items() if "value" in e}
        return Comparison(str(left), f"reference ({mode})", [], _rows(metrics, others), [])
    other_told, others, other_arrays = reference.read_run(right)
    if other_told["notebook"] != name:
        raise Misuse(
            f"{left} is a run of {name}, {right} one of {other_told['notebook']}; two runs of one notebook compare."
        )
    mine, theirs = told["parameters"], other_told["parameters"]
    changed = [(k, mine.get(k), theirs.get(k)) for k in {**mine, **theirs} if mine.get(k) != theirs.get(k)]
    rows = _rows(metrics, others)
    for key in sorted(arrays.keys() & other_arrays.keys()):
        a, b = (side[key].astype(complex if side[key].dtype.kind == "c" else float) for side in (arrays, other_arrays))
        if a.shape == b.shape and a.size:
            worst, largest = (float(np.nanmax(np.abs(x), initial=0.0)) for x in (a - b, b))
            unit = told["arrays"][key]["unit"]
            rows.append(
                Row(f"{key} (array: rms, largest difference)", unit, _rms(a), _rms(b), worst, _ratio(worst, largest))
            )
    figures = sorted(
        {p.name[:-4] for p in left.glob("figures/*.csv")} & {p.name[:-4] for p in right.glob("figures/*.csv")}
    )
    return Comparison(str(left), str(right), changed, rows, figures)


def _rms(a: np.ndarray) -> float:
    known = np.abs(a[~np.isnan(a)])
    return float(np.sqrt(np.mean(known**2))) if known.size else math.nan


def _ratio(difference: float, scale: float) -> float:
    return difference / abs(scale) if scale else 0.0 if difference == 0 else math.inf


def _rows(metrics: claims.Metrics, others: claims.Metrics) -> list[Row]:
    rows = []
    for key in sorted({*metrics, *others}):
        left, right = metrics.get(key, {}).get("value"), others.get(key, {}).get("value")
        unit = (metrics.get(key) or others[key])["unit"]
        both = left is not None and right is not None
        rows.append(
            Row(key, unit, left, right, left - right if both else None, _ratio(left - right, right) if both else None)
        )
    return rows


def moved(comparison: Comparison, rel: float) -> list[Row]:
    """Rows whose relative difference is above `rel`, or that one side lacks."""
    return [r for r in comparison.rows if (r.left != r.right if r.relative is None else abs(r.relative) > rel)]


def texts(row: Row) -> list[str]:
    """Cells of a row: key, left, right, difference, relative difference."""
    relative = "" if row.relative is None else f"{row.relative:+.2e}"
    values = ["–" if v is None else display.number(v, 7) for v in (row.left, row.right)]
    return [row.key, *values, "" if row.difference is None else display.number(row.difference, 3), relative, row.unit]


HEADER = ("name", "left", "right", "left − right", "relative", "unit")


def write_page(comparison: Comparison, folder: Path) -> Path:
    """Write `compare.html` (self-contained) and an image per figure into `folder`, whole; returns the page.

    A figure that cannot be drawn is named there with the reason. Raises Misuse where `folder` holds other files.
    """
    left, right = Path(comparison.left), Path(comparison.right)
    figures = {p.stem for p in left.glob("figures/*.csv")}
    runfolder.refuse_others(folder, runfolder.page_files(figures))
    new = atomic.partial_path(folder)
    with atomic.explained(folder), children.busy():
        new.mkdir(parents=True)
        try:
            parts = []
            for name in comparison.figures:
                try:
                    sides = [overlay.read_columns(run / "figures" / f"{name}.csv") for run in (left, right)]
                    image = overlay.overlay(*sides, name)
                except Fault as error:
                    parts.append(f"<h3>{html.escape(name)}</h3>\n<p>Not drawn: {html.escape(str(error))}</p>\n")
                else:
                    (new / f"{name}.png").write_bytes(image)
                    parts.append(_figure_html(name, image))
            (new / runfolder.PAGE).write_text(_page_html(comparison, parts), encoding="utf-8")
            atomic.swap_folder(new, folder)
        finally:
            shutil.rmtree(new, ignore_errors=True)
    return folder / runfolder.PAGE


def _figure_html(name: str, image: bytes) -> str:
    data = base64.b64encode(image).decode()
    alt = f"The data of figure {html.escape(name)} from the left and the right run"
    return f'<h3>{html.escape(name)}</h3>\n<figure><img alt="{alt}" src="data:image/png;base64,{data}"></figure>\n'


def _page_html(c: Comparison, figures: list[str]) -> str:
    changed = "".join(f"<li>{html.escape(f'{k}: {a!r} | {b!r}')}</li>" for k, a, b in c.parameters) or "<li>none</li>"
    head = "".join(f'<th scope="col">{html.escape(h)}</th>' for h in HEADER)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(t)}</td>" for t in texts(row)) + "</tr>\n" for row in c.rows)
    told = f"<p>left: <code>{html.escape(c.left)}</code><br>right: <code>{html.escape(c.right)}</code></p>"
    drawn = f"<p>Blue and solid is left, orange and dashed is right.</p>\n{told}\n{''.join(figures)}" if figures else ""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>Two runs compared</title><style>'
        "body{font:15px/1.5 system-ui,sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem}"
        "td,th{padding:.15rem .8rem .15rem 0;text-align:left}img{max-width:100%}</style></head><body><main>\n"
        f"<h1>Two runs compared</h1>\n{told}\n"
        f"<h2>Parameters that differ (left | right)</h2><ul>{changed}</ul>\n"
        f"<h2>Numbers</h2><table><thead><tr>{head}</tr></thead>"
        f"<tbody>{body}</tbody></table>\n<h2>Figures</h2>{drawn or '<p>None that both have.</p>'}\n"
        "</main></body></html>\n"
    )
