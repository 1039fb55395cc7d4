"""Drawings without data: what is measured on a flight line, and Figures 1 and 4 of the paper (system, chain)."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, FancyBboxPatch

from geokalman.style import METHODS, ink, paper

BLOCKS = {
    "in the aircraft": (
        "strapdown gravimeter",
        "rover GPS and antenna",
        "display, control, recording",
        "power management",
    ),
    "on the ground": ("base GPS antenna", "base GPS receiver"),
    "afterwards": ("workstation with the\nprocessing software",),
}
"""Figure 1: the three blocks and what is in them."""
STEPS = (
    ("gyro and accelerometer pulses", "error compensation", "angular rate,\nspecific force"),
    ("strapdown navigation", "integration of the rates", "position, velocity,\nattitude"),
    ("raw GPS, rover and base", "differential processing", "precise position\nand velocity"),
    ("INS and DGPS", "correct the attitude", "$f_1', f_2', f_3'$\neast, north, up"),
    ("gravity model and $f'$", "Kalman, forward\nand backward", "gravity"),
)
"""Figure 4: what goes in, what is done, what comes out; the book starts at step 4."""


def schematic() -> Figure:
    """Draw what is measured on a flight line, and how two passes of a filter make gravity of it.

    Left the geometry: specific force in the aircraft, height by GNSS, gravity of a dense body below. Right the
    estimate: the twice integrated force less the height, filtered forward and backward, then combined.
    """
    figure, axes = plt.subplots(figsize=(7.2, 4.5))
    fb, forward, other = (METHODS[name].colour for name in ("fb", "forward", "contractor"))
    _flight(axes, forward, other)
    for y, height, text, colour in (
        (5.45, 0.8, r"$h' = \iint (f_3' - g_0 + g_E)\,\mathrm{d}t^2$", forward),
        (4.2, 0.8, r"$\Delta h' = h' - h''$", ink()),
        (0.25, 0.9, "gravity disturbance $\\delta g$\nwith its standard deviation", fb),
    ):
        _box(axes, 7.0, y, 3.6, height, text, colour)
    _box(axes, 5.95, 2.1, 2.5, 1.15, "forward filter\nuses the past", forward)
    _box(axes, 9.15, 2.1, 2.5, 1.15, "backward filter\nuses the future", other)
    for start, end in (
        ((8.8, 5.39), (8.8, 5.06)), ((8.4, 4.14), (7.2, 3.32)), ((9.2, 4.14), (10.4, 3.32)),
        ((7.2, 2.04), (8.3, 1.22)), ((10.4, 2.04), (9.3, 1.22)),
    ):  # fmt: skip
        _arrow(axes, start, end)
    axes.text(8.8, 1.62, "combined", ha="center", va="center", fontsize=8)
    axes.text(8.8, 3.45, "every 0.5 s", ha="center", va="center", fontsize=8)
    axes.annotate("", (6.9, 4.6), (4.0, 4.15), arrowprops={"arrowstyle": "->", "color": other, "linestyle": "--"})
    axes.text(5.75, 4.62, "$h''$", ha="center", va="bottom", fontsize=9, color=other)
    axes.annotate("", (6.9, 5.85), (3.35, 4.05), arrowprops={"arrowstyle": "->", "color": forward, "linestyle": "--"})
    axes.text(5.6, 5.4, "$f_3'$", ha="center", va="bottom", fontsize=9, color=forward)
    return _bare(figure, axes, (0, 11.8), (-0.1, 6.5))


def _flight(axes: Axes, force: str, height: str) -> None:
    """Draw the left half: aircraft, satellite, base station, ellipsoid and a dense body below the ground."""
    line = ink()
    axes.plot([0.2, 5.5], [3.9, 3.9], color=METHODS["exact"].colour, linestyle=":", linewidth=1)
    axes.text(0.2, 3.97, "flight line", fontsize=8, va="bottom")
    body = np.array([(2.3, 3.8), (3.6, 3.8), (3.9, 3.9), (3.6, 4.0), (2.55, 4.0), (2.3, 4.3), (2.2, 4.3), (2.3, 3.8)])
    axes.fill(*body.T, facecolor=paper(), edgecolor=line, linewidth=1.2, zorder=3)
    axes.fill(*np.array([(2.8, 3.9), (3.2, 3.9), (2.75, 3.5)]).T, facecolor=paper(), edgecolor=line, zorder=4)
    axes.annotate("", (3.1, 5.1), (3.1, 4.05), arrowprops={"arrowstyle": "->", "color": force, "linewidth": 1.6})
    axes.text(3.1, 5.15, "specific force", ha="center", va="bottom", fontsize=8, color=force)
    for x in (0.75, 1.55):
        axes.add_patch(plt.Rectangle((x, 5.8), 0.45, 0.28, facecolor=paper(), edgecolor=height, linewidth=1.1))
    axes.add_patch(plt.Rectangle((1.2, 5.74), 0.35, 0.4, facecolor=paper(), edgecolor=height, linewidth=1.1))
    axes.text(2.1, 5.95, "GNSS", fontsize=8, color=height, va="center")
    for x, y in ((2.6, 4.1), (0.72, 1.95)):
        axes.plot([1.38, x], [5.7, y], color=height, linestyle=(0, (1, 2)), linewidth=1)
    x = np.linspace(0.1, 5.6, 120)
    ground = 1.55 + 0.12 * np.sin(1.7 * x) + 0.05 * np.sin(4.0 * x)
    axes.plot(x, ground, color=line, linewidth=1.2)
    axes.plot(x, np.full_like(x, 0.95), color=METHODS["exact"].colour, linestyle="--", linewidth=1)
    axes.text(5.6, 0.86, "ellipsoid, normal gravity $g_0$", ha="right", va="top", fontsize=8)
    axes.plot([0.58, 0.72, 0.86], [1.62, 1.95, 1.62], color=height, linewidth=1.2)
    axes.text(0.95, 1.9, "base station", fontsize=8, color=height, va="center")
    axes.add_patch(Ellipse((3.6, 1.22), 1.3, 0.34, facecolor=METHODS["fb"].colour, alpha=0.35, linewidth=0))
    axes.text(3.6, 1.22, "dense body", fontsize=7, ha="center", va="center")
    axes.annotate("", (3.6, 1.75), (3.6, 3.0), arrowprops={"arrowstyle": "->", "color": METHODS["fb"].colour})
    axes.text(3.7, 2.4, r"$\delta g$", fontsize=9, color=METHODS["fb"].colour, va="center")
    axes.annotate("", (5.3, 0.97), (5.3, 3.88), arrowprops={"arrowstyle": "<->", "color": line, "linewidth": 0.8})
    axes.text(5.22, 3.2, "$h$", fontsize=9, va="center", ha="right")


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": ink()})


def system() -> Figure:
    """Figure 1: airborne, ground and offline blocks."""
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    for k, (title, parts) in enumerate(BLOCKS.items()):
        x = 0.2 + 3.4 * k
        _box(axes, x, 0.2, 3.0, 3.0, "", METHODS["exact"].colour, 0.0)
        axes.text(x + 1.5, 3.0, title, ha="center", va="top", weight="bold")
        for j, part in enumerate(parts):
            _box(axes, x + 0.2, 2.05 - 0.58 * j, 2.6, 0.46, part, METHODS["fb"].colour)
    axes.annotate("", (7.0, 1.5), (6.62, 1.5), arrowprops={"arrowstyle": "->", "color": ink()})
    axes.plot([1.7, 1.7, 8.5], [0.16, -0.15, -0.15], color=ink(), linewidth=1)
    axes.annotate("", (8.5, 0.17), (8.5, -0.17), arrowprops={"arrowstyle": "->", "color": ink()})
    axes.text(5.1, -0.2, "records of both are joined after the flight", ha="center", va="top", fontsize=8)
    return _bare(figure, axes, (0, 10.4), (-0.6, 3.4))


def chain() -> Figure:
    """Figure 4: the chain of processing; the part that this book simulates or reads begins at the fourth row."""
    figure, axes = plt.subplots(figsize=(7.2, 5.6))
    for k, row in enumerate(STEPS):
        y = 5.0 - 1.15 * k
        colour = METHODS["fb" if k > 2 else "exact"].colour
        for j, text in enumerate(row):
            _box(axes, 0.5 + 3.3 * j, y, 2.8, 0.8, text, colour)
            if j < 2:
                axes.annotate(
                    "",
                    (0.5 + 3.3 * (j + 1), y + 0.4),
                    (3.3 + 3.3 * j, y + 0.4),
                    arrowprops={"arrowstyle": "->", "color": ink()},
                )
        axes.text(0.12, y + 0.4, str(k + 1), va="center", weight="bold")
    for start in (0, 2, 3):  # what comes out of a row goes into the next one, through the gap between them
        gap = 4.82 - 1.15 * start
        _path(axes, [(8.5, 4.96 - 1.15 * start), (8.5, gap), (1.9, gap), (1.9, 4.69 - 1.15 * start)])
    _path(axes, [(9.95, 4.25), (10.2, 4.25), (10.2, 2.52), (8.5, 2.52)], head=False)  # past the row of GPS
    axes.plot([10.2, 10.2], [0.4, 2.3], color=METHODS["fb"].colour, linewidth=1.2)
    axes.text(10.28, 1.35, "the book begins here", fontsize=8, color=METHODS["fb"].colour, rotation=90, va="center")
    return _bare(figure, axes, (0, 10.6), (0.2, 6.0))


def _path(axes: Axes, corners: list[tuple[float, float]], head: bool = True) -> None:
    x, y = zip(*corners, strict=True)
    axes.plot(x, y, color=ink(), linestyle="--", linewidth=1)
    if head:
        axes.annotate("", corners[-1], (x[-1], y[-1] + 0.02), arrowprops={"arrowstyle": "->", "color": ink()})


def _box(
    axes: Axes, x: float, y: float, width: float, height: float, text: str, colour: str, face: float = 1.0
) -> None:
    axes.add_patch(
        FancyBboxPatch(
            (x, y),
            width,
            height,
            boxstyle="round,pad=0.04",
            edgecolor=colour,
            facecolor=paper() if face else "none",
            linewidth=1.2,
        )
    )
    axes.text(x + width / 2, y + height / 2, text, ha="center", va="center", fontsize=8.5)


def _bare(figure: Figure, axes: Axes, xlim: tuple[float, float], ylim: tuple[float, float]) -> Figure:
    axes.set(xlim=xlim, ylim=ylim)
    axes.axis("off")
    return figure
