"""What a reader can explore in the browser: the curves of a figure, read from the figure itself, as a script.

A page on the disk may load a script but not read a file, so the data assign themselves into `window.exploreData`;
`book/_static/explore.js` plots them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from execbook.errors import Fault

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LARGEST = 2000  # points of a curve
_DASHES = {"--": [6, 4], "-.": [7, 3, 2, 3], ":": [2, 3], "None": None, "none": None, "": None, " ": None}


def read(figure: Figure) -> dict[str, Any]:
    """Give the panels of a figure with their curves, bands and lines across, and the colours of the theme in force.

    Raises Fault where there is nothing to explore, or where the abscissa of a curve goes back and forth.
    """
    import matplotlib as mpl
    from matplotlib.colors import to_hex

    panels = [panel for axes in figure.axes if axes.get_visible() for panel in _panel(axes)]
    if not panels:
        raise Fault("the figure has no curves to explore; leave interactive out.")
    for key in ("xlabel", "ylabel"):  # axes that share a label show it once
        shown = [panel[key] for panel in panels if panel[key]]
        for panel in panels:
            panel[key] = panel[key] or (shown[-1] if shown else "")
    look = {"ink": mpl.rcParams["text.color"], "paper": figure.get_facecolor(), "grid": mpl.rcParams["grid.color"]}
    return {"panels": panels, "look": {name: to_hex(colour) for name, colour in look.items()}}


def script(name: str, data: Mapping[str, Any]) -> str:
    """Write the data of a figure as a script; arrays become lists, and what is not a number there null."""
    text = json.dumps(_listed(dict(data)), ensure_ascii=False, allow_nan=False)
    return f"(window.exploreData ??= {{}})[{json.dumps(name)}] = {text};"


def _listed(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _listed(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_listed(item) for item in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return _listed(value.tolist())
    return None if isinstance(value, float) and not np.isfinite(value) else value


def both(light: Any, dark: Any) -> Any:
    """Give what `read` gave in both themes as one; what differs, the colours, stands twice."""
    if isinstance(light, dict):
        return {key: both(value, dark[key]) for key, value in light.items()}
    if isinstance(light, list):
        return [both(*pair) for pair in zip(light, dark, strict=True)]
    return [light, dark] if isinstance(light, str) and light.startswith("#") else light


def _panel(axes: Axes) -> Iterator[dict[str, Any]]:
    """Give the panel of axes that hold curves; `tables` are [x, y, ...] with the columns in the order of `curves`."""
    log = [axes.get_xscale() == "log", axes.get_yscale() == "log"]
    groups: dict[bytes, list[Any]] = {}
    levels, thinned = [], 1
    for look, x, y in _drawn(axes, levels):
        step = -(-len(x) // LARGEST)
        thinned = max(thinned, step)
        x, y = x[::step], y[::step]
        if len(x) > 1 and x[0] > x[-1]:
            x, y = x[::-1], y[::-1]
        if not (np.diff(x) >= 0).all():
            raise Fault(f"{look['label'] or 'a curve'} goes back and forth along its axis, so it cannot be explored.")
        group = groups.setdefault(x.tobytes(), [[], [_numbers(x, 10, log[0])]])
        group[0].append(look)
        group[1].append(_numbers(y, 6, log[1]))
    if groups:
        yield {
            "title": _plain(axes.get_title(loc="left") or axes.get_title()),
            "xlabel": _plain(axes.get_xlabel()),
            "ylabel": _plain(axes.get_ylabel()),
            "log": log,
            "curves": [look for looks, _ in groups.values() for look in looks],
            "tables": [table for _, table in groups.values()],
            "levels": levels,
            "thinned": thinned,
        }


def _drawn(axes: Axes, levels: list[dict[str, Any]]) -> Iterator[tuple[dict[str, Any], np.ndarray, np.ndarray]]:
    """Give look, x and y of each curve, and of both edges of each band; lines across the axes go into `levels`."""
    from matplotlib.collections import FillBetweenPolyCollection
    from matplotlib.colors import to_hex

    for band in axes.collections:
        for path in band.get_paths() if isinstance(band, FillBetweenPolyCollection) else []:
            n = (
                len(path.vertices) - 3
            ) // 2  # a corner, one edge, a corner, the other edge backwards, the first corner
            look = {"label": "", "colour": to_hex(band.get_facecolor()[0], keep_alpha=True)}
            for edge in (path.vertices[1 : n + 1], path.vertices[n + 2 : 2 * n + 2][::-1]):
                yield look, *edge.T
    for line in axes.lines:
        across = line.get_transform().contains_branch_seperately(axes.transData)
        x, y = (np.asarray(values, dtype=float) for values in line.get_data(orig=False))
        colour = to_hex((line.get_color(), 1.0 if line.get_alpha() is None else line.get_alpha()), keep_alpha=True)
        look = {"colour": colour, "dash": _DASHES.get(line.get_linestyle(), []), "width": line.get_linewidth()}
        if across == (True, True) and len(x):
            name = str(line.get_label())
            yield {"label": "" if name.startswith("_") else _plain(name), **look, "curve": True}, x, y
        elif any(across):
            levels.append(look | {"axis": "xy"[across[1]], "at": float((x, y)[across[1]][0])})


def _numbers(values: Sequence[float] | np.ndarray, digits: int, log: bool) -> list[float | None]:
    """Give numbers for JSON, short; None where there is none, or none on a logarithmic axis."""
    return [float(f"{v:.{digits}g}") if np.isfinite(v) and (v > 0 or not log) else None for v in values]


def _plain(text: str) -> str:
    """Take the marks of mathematics out of a label."""
    for mark, word in (
        ("\\sigma", "σ"),
        ("\\lambda", "λ"),
        ("\\mu", "µ"),
        ("\\dot\\rho", "range-rate"),
        ("\\rho", "ρ"),
    ):
        text = text.replace(mark, word)
    return " ".join(text.replace("$", "").replace("{", "").replace("}", "").split())
