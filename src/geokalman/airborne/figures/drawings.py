"""Figures 1 and 4 of the paper as drawings: the system in three blocks, and the chain of processing."""

from __future__ import annotations

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

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
