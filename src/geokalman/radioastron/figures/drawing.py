"""What the figures of the part share: how a method is drawn, bands of runs, plain ticks on a logarithmic axis."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter

from geokalman.radioastron.figures.names import NAMES, ORBITS
from geokalman.radioastron.model import Array
from geokalman.style import METHODS


def method(name: str, *parts: str, **changes: Any) -> dict[str, Any]:
    """Keywords of `plot` for a method of `style.METHODS`: its colour and `parts` of linestyle, marker and label."""
    m = METHODS[name]
    all_parts = {
        "color": m.colour,
        "linestyle": m.line,
        "marker": m.marker,
        "label": (NAMES | ORBITS).get(name, m.label),
    }
    return {part: all_parts[part] for part in ("color", *parts)} | changes


def band(axes: Axes, x: Array, low: Array, high: Array, name: str, **changes: Any) -> None:
    """The band of a method between two curves."""
    axes.fill_between(x, low, high, **{"color": METHODS[name].colour, "alpha": 0.25, "linewidth": 0} | changes)


def plain_logarithm(axis: Axis) -> None:
    """Write the ticks of a logarithmic axis as plain numbers, and more of them where it spans less than two decades."""
    low, high = axis.get_view_interval()
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(
        FuncFormatter(lambda x, _: f"{x:g}" if high < 100.0 * low and f"{x:e}"[0] in "235" else "")
    )


def two_thirds(runs: Array) -> Array:
    """The 16 and 84 % points over the runs (runs, ...), between which two thirds of them lie: (2, ...)."""
    return np.quantile(runs, [0.16, 0.84], axis=0)
