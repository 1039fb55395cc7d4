"""The schematic of the part: where a range along the line to a pulsar comes from, and what the filter does with it."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch

from geokalman.style import METHODS, ink, paper

STEPS = (
    "photons of\nseven pulsars",
    "arrival times,\ntiming model",
    "ranges\n$z=\\mathbf{n}\\cdot\\mathbf{r}+v$",
    "update, weights\nand factor $\\alpha$",
    "position and\nvelocity",
)
"""From photons to the state, in the order of the chain."""
_OBSERVED = "$\\mathbf{n}\\cdot\\mathbf{r}$, observed:\n$c$ times how much earlier\nthe pulse comes than at Mars"
_TOWARDS = np.array(
    [np.cos(np.radians(105.0)), np.sin(np.radians(105.0))]
)  # to the pulsar, in the plane of the drawing
_MARS = np.array([5.9, 2.2])
_ORBITER = _MARS + 1.35 * np.array([np.cos(np.radians(150.0)), np.sin(np.radians(150.0))])


def schematic() -> Figure:
    """Draw the geometry of one range, and below it the chain from photons to the estimated state."""
    figure, axes = plt.subplots(figsize=(7.2, 4.5))
    axes.set(xlim=(0.0, 10.4), ylim=(-1.45, 5.0), aspect="equal")
    axes.axis("off")
    _geometry(axes)
    colours = [METHODS[key].colour for key in ("exact", "exact", "ekf", "aekf1", "ekf")]
    for k, (text, colour) in enumerate(zip(STEPS, colours, strict=True)):
        _box(axes, 0.12 + 2.08 * k, -0.5, text, colour)
        if k:
            _arrow(axes, (2.08 * k - 0.08, -0.08), (2.08 * k + 0.09, -0.08), ink())
    predicted = METHODS["ukf"].colour
    axes.plot([9.3, 9.3, 7.25], [-0.56, -1.1, -1.1], color=predicted, linewidth=1.2)
    _arrow(axes, (7.25, -1.12), (7.25, -0.54), predicted)
    axes.text(
        8.28, -1.17, "prediction: point mass and $J_2$, process noise $Q$", ha="center", va="top", fontsize=8.5,
        color=predicted,
    )  # fmt: skip
    return figure


def _geometry(axes: Axes) -> None:
    """Draw barycentre, Mars, orbiter and the fronts of a pulse, with the projection that is observed."""
    sun, across = np.array([1.0, 1.25]), np.array([-_TOWARDS[1], _TOWARDS[0]])
    axes.add_patch(Circle(sun, 0.16, color=METHODS["raekf"].colour))
    axes.text(sun[0], sun[1] - 0.28, "barycentre of the\nsolar system", ha="center", va="top", fontsize=8.5)
    axes.add_patch(Circle(_MARS, 0.8, color=METHODS["aekf1"].colour, alpha=0.3, linewidth=0))
    axes.text(_MARS[0] + 0.1, _MARS[1] - 0.4, "Mars", ha="center", va="center", fontsize=8.5)
    radius = np.hypot(*(_ORBITER - _MARS))
    axes.add_patch(Circle(_MARS, radius, fill=False, edgecolor=ink(), linestyle=":"))
    axes.plot(*_ORBITER, marker="s", markersize=7, color=ink())
    axes.text(_ORBITER[0] - 0.25, _ORBITER[1], "orbiter", ha="right", va="center", fontsize=8.5)
    _arrow(axes, sun, _MARS, METHODS["exact"].colour)
    axes.text(*(0.5 * (sun + _MARS) + [-1.3, -0.28]), "$\\mathbf{R}_M$, from the ephemeris", va="top", fontsize=9)
    _arrow(axes, _MARS, _ORBITER, METHODS["ekf"].colour)
    axes.text(*(0.5 * (_MARS + _ORBITER) + [0.05, 0.22]), "$\\mathbf{r}$, estimated", fontsize=9)
    foot = _MARS + ((_ORBITER - _MARS) @ _TOWARDS) * _TOWARDS
    line = METHODS["aekf2"].colour
    beside = -1.6 * across  # the line to the pulsar is drawn beside Mars, so that it can be read
    axes.plot(*np.array([_MARS, _MARS + beside]).T, color=line, linewidth=0.8, linestyle="--")
    axes.plot(*np.array([_ORBITER, foot + beside]).T, color=line, linewidth=0.8, linestyle="--")
    axes.annotate(
        "", foot + beside, _MARS + beside, arrowprops={"arrowstyle": "<->", "color": line, "shrinkA": 0, "shrinkB": 0}
    )
    axes.text(
        *(0.5 * (foot + _MARS) + beside + [0.15, 0.1]),
        _OBSERVED, va="center", fontsize=8.5, color=line,
    )  # fmt: skip
    for k in range(3):
        middle = _ORBITER + (0.6 + 0.4 * k) * _TOWARDS
        axes.plot(*np.array([middle - 0.75 * across, middle + 0.75 * across]).T, color=line, linewidth=1.4, alpha=0.8)
    _arrow(axes, _ORBITER + 0.25 * _TOWARDS, _ORBITER + 1.95 * _TOWARDS, line)
    axes.text(
        *(_ORBITER + 1.95 * _TOWARDS + [-0.15, -0.1]),
        "$\\mathbf{n}$, to the pulsar",
        ha="right",
        fontsize=9,
        color=line,
    )
    axes.text(*(_ORBITER + 1.0 * _TOWARDS - 0.9 * across), "fronts of\na pulse", va="center", fontsize=8.5, color=line)


def _arrow(axes: Axes, start, end, colour: str) -> None:
    axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": colour, "shrinkA": 0, "shrinkB": 0})


def _box(axes: Axes, x: float, y: float, text: str, colour: str) -> None:
    style = {"boxstyle": "round,pad=0.04", "edgecolor": colour, "facecolor": paper(), "linewidth": 1.2}
    axes.add_patch(FancyBboxPatch((x, y), 1.84, 0.85, **style))
    axes.text(x + 0.92, y + 0.42, text, ha="center", va="center", fontsize=8.5)
