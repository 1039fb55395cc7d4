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
        if k < 2:
            axes.annotate("", (x + 3.38, 1.5), (x + 3.02, 1.5), arrowprops={"arrowstyle": "->", "color": ink()})
    return _bare(figure, axes, (0, 10.4), (0, 3.4))


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
    for start, end, bend in ((0, 1, 0), (1, 3, -0.3), (2, 3, -0.12), (3, 4, 0)):
        axes.annotate(
            "", (8.6, 5.8 - 1.15 * end), (8.6 if bend == 0 else 9.9, 5.0 - 1.15 * start + (0 if bend == 0 else 0.4)),
            arrowprops={"arrowstyle": "->", "color": ink(), "connectionstyle": f"arc3,rad={bend}", "linestyle": "--"},
        )  # fmt: skip
    axes.axhline(2.52, color=METHODS["neutral"].colour, linestyle=":")
    axes.text(0.5, 2.54, "the book begins here", fontsize=8, color=METHODS["neutral"].colour, va="bottom")
    return _bare(figure, axes, (0, 10.6), (0.2, 6.0))


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
