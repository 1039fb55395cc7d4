"""A drawing of the part's subject: the pair of satellites, and the way from its observations to a gravity field."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from geokalman.style import METHODS, ink, paper

BOXES = {
    "positions": (0.0, 2.6, "GNSS positions\nof both satellites", "truth"),
    "range-rate": (0.0, 0.6, "K-band\nrange-rate", "truth"),
    "newton": (2.55, 3.2, "Newton:\nnine-point derivative", "newton"),
    "ekf": (2.55, 1.9, "EKF:\npositions alone", "ekf"),
    "ukf": (2.55, 0.6, "UKF: positions\nand range-rate", "ukf"),
    "rate": (5.1, 2.6, "range-rate\n(Table 1)", "truth"),
    "acceleration": (5.1, 1.2, "gravity along the\nline of sight", "truth"),
    "field": (7.65, 1.2, "gravity field and\ngeoid (Figs 4 to 7)", "truth"),
}
"""Box -> left, bottom, text, and whose colour it has."""
FLOWS = (
    ("positions", "newton"),
    ("positions", "ekf"),
    ("positions", "ukf"),
    ("range-rate", "ukf"),
    ("newton", "rate"),
    ("ekf", "rate"),
    ("ukf", "rate"),
    ("ekf", "acceleration"),
    ("ukf", "acceleration"),
)
"""Arrows from the right side of a box to the left side of another."""
_WIDTH, _HEIGHT = 2.0, 0.8


def pair() -> Figure:
    """Draw the geometry of the pair (a) and the three ways from its observations to the gravity field (b)."""
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(7.2, 6.6), height_ratios=(1.1, 1.0))
    _geometry(upper)
    _ways(lower)
    for axes, title in (
        (upper, "(a) two satellites on one orbit"),
        (lower, "(b) three ways from the same pair to a gravity field"),
    ):
        axes.set_title(title, loc="left")
        axes.axis("off")
    return figure


def _geometry(axes: Axes) -> None:
    angle = np.radians(np.linspace(62, 118, 200))
    for radius, width in ((10.0, 2.0), (12.0, 0.8)):
        line = "-" if width > 1 else ":"
        axes.plot(radius * np.cos(angle), radius * np.sin(angle), color=METHODS["exact"].colour, lw=width, ls=line)
    axes.text(0, 9.72, "Earth, turning", ha="center", va="top", fontsize=9, color=METHODS["exact"].colour)
    A, B = (12.0 * np.array([np.cos(a), np.sin(a)]) for a in np.radians([78, 102]))
    look = METHODS["ukf"].colour
    axes.annotate("", A, B, arrowprops={"arrowstyle": "<->", "color": look, "lw": 1.6, "shrinkA": 8, "shrinkB": 8})
    text = r"K-band ranging: range $\rho$ and range-rate $\dot\rho$"
    behind = {"facecolor": paper(), "edgecolor": "none", "pad": 1}
    axes.text(0, A[1] + 0.42, text, ha="center", va="bottom", fontsize=9, color=look, bbox=behind)
    axes.annotate("", B + [2.0, -0.25], B + [0.5, -0.25], arrowprops={"arrowstyle": "-|>", "color": ink()})
    axes.text(*(B + [1.25, -0.33]), "$e$, line of sight", ha="center", va="top", fontsize=9)
    for name, place, side in (("A", A, 1), ("B", B, -1)):
        axes.plot(*place, "s", color=ink(), markersize=9)
        role = "leading" if name == "A" else "trailing"
        outward = "left" if side > 0 else "right"
        axes.text(place[0] + 0.25 * side, place[1] + 0.08, f"{name}, {role}", ha=outward, fontsize=9)
        down = -place / np.linalg.norm(place)
        axes.annotate(
            "", place + 1.35 * down, place + 0.15 * down,
            arrowprops={"arrowstyle": "-|>", "color": METHODS["newton"].colour, "lw": 1.4},
        )  # fmt: skip
        foot = place + 1.3 * down + [0.15 * side, 0.0]
        axes.text(*foot, f"$g_{name}$", ha=outward, va="center", color=METHODS["newton"].colour)
        for shift in (-1.6, 1.6):
            above = place + [shift, 1.75]
            axes.plot(*zip(above, place, strict=True), color=METHODS["ekf"].colour, lw=0.8, ls="--")
            axes.plot(*above, "D", color=METHODS["ekf"].colour, markersize=5)
    text = "GNSS satellites: positions of A and B"
    axes.text(0, A[1] + 2.0, text, ha="center", fontsize=9, color=METHODS["ekf"].colour)
    axes.set(xlim=(-6.2, 6.2), ylim=(9.0, 14.1), aspect="equal")


def _ways(axes: Axes) -> None:
    for left, bottom, text, method in BOXES.values():
        colour = METHODS[method].colour
        axes.add_patch(
            FancyBboxPatch(
                (left, bottom), _WIDTH, _HEIGHT, boxstyle="round,pad=0.04", edgecolor=colour, facecolor=paper(), lw=1.3
            )
        )
        axes.text(left + _WIDTH / 2, bottom + _HEIGHT / 2, text, ha="center", va="center", fontsize=9)
    for start, end in FLOWS:
        _arrow(axes, _side(start, 1), _side(end, 0), METHODS[BOXES[start][3]].colour)
    x, y = BOXES["rate"][0] + _WIDTH / 2, BOXES["rate"][1]
    _arrow(axes, (x, y - 0.05), (x, BOXES["acceleration"][1] + _HEIGHT + 0.05), ink(), "--")
    axes.text(x + 0.1, y - 0.3, "differentiated\nonce more", fontsize=8, va="center")
    _arrow(axes, _side("acceleration", 1), _side("field", 0), ink())
    axes.text(BOXES["field"][0] + _WIDTH / 2, 2.15, "least squares", ha="center", fontsize=8)
    axes.set(xlim=(-0.1, 9.75), ylim=(0.35, 4.15))


def _side(name: str, right: int) -> tuple[float, float]:
    left, bottom, _, _ = BOXES[name]
    return (left + _WIDTH + 0.05 if right else left - 0.05), bottom + _HEIGHT / 2


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], colour: str, line: str = "-") -> None:
    axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": colour, "linestyle": line, "lw": 1.1})
