"""The schematic of the part: what the station measures, and what the interferometer sees. It holds no data."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse

from geokalman.radioastron.figures.drawing import method
from geokalman.style import METHODS, ink

_CRAFT, _SOURCE_ANGLE = np.array([7.6, 2.5]), 34.0
_STATION_ANGLE, _TELESCOPE_ANGLE = -8.0, 98.0


def schematic() -> Figure:
    """Earth, tracking station, telescope and spacecraft; two-way range, baseline, delay, and the error ellipses."""
    figure, axes = plt.subplots(figsize=(7.2, 4.3))
    station, telescope, toward = (_unit(a) for a in (_STATION_ANGLE, _TELESCOPE_ANGLE, _SOURCE_ANGLE))
    axes.add_patch(Circle((0, 0), 1.0, color=METHODS["exact"].colour, alpha=0.35, linewidth=0))
    axes.text(-0.05, -0.15, "Earth", ha="center", va="center")
    orbit = np.radians(np.linspace(-4.0, 44.0, 60))
    axes.plot(8.25 * np.cos(orbit) - 0.25, 7.2 * np.sin(orbit) - 0.38, **method("exact"), linewidth=0.9)
    axes.text(7.8, -0.75, "orbit", color=METHODS["exact"].colour, ha="right")
    _tracking(axes, station)
    _interferometer(axes, telescope, toward)
    _errors(axes, station)
    axes.plot(*_CRAFT, **method("truth", linestyle="none"), marker="o", markersize=7)
    axes.annotate("Spektr-R", _CRAFT, textcoords="offset points", xytext=(9, -11), fontsize=8)
    for place, words, offset in ((station, "tracking\nstation", (3, -27)), (telescope, "radio\ntelescope", (-52, 2))):
        axes.plot(*place, **method("truth", linestyle="none"), marker="^", markersize=8)
        axes.annotate(words, place, textcoords="offset points", xytext=offset)
    axes.set(aspect="equal", xlim=(-1.6, 11.3), ylim=(-1.35, 6.3))
    axes.axis("off")
    return figure


def _unit(angle: float) -> np.ndarray:
    return np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])


def _arrow(axes: Axes, start: np.ndarray, end: np.ndarray, name: str, style: str = "->", **changes) -> None:
    look = {"arrowstyle": style, "color": METHODS[name].colour, "linewidth": 1.5} | changes
    axes.annotate("", end, start, arrowprops=look)


def _tracking(axes: Axes, station: np.ndarray) -> None:
    """The two-way range and its rate."""
    _arrow(axes, station, _CRAFT, "ekf", "<->")
    axes.text(
        4.5, 0.62, r"two-way range $\rho$ and its rate $\dot\rho$", color=METHODS["ekf"].colour, rotation=21,
        rotation_mode="anchor", ha="center",
    )  # fmt: skip


def _interferometer(axes: Axes, telescope: np.ndarray, toward: np.ndarray) -> None:
    """Wave front, baseline, its projection, and the way that the wave still has to go."""
    front = np.array([-toward[1], toward[0]])
    foot = telescope + ((_CRAFT - telescope) @ toward) * toward
    _arrow(axes, telescope, _CRAFT, "truth")
    axes.text(4.1, 1.98, r"baseline $b$", rotation=10, ha="center")
    axes.plot(*np.array([foot + 0.5 * front, _CRAFT - 0.9 * front]).T, **method("neutral"), linestyle="--")
    axes.text(*(foot + 0.62 * front), "wave front", color=METHODS["neutral"].colour, ha="right", va="bottom")
    _arrow(axes, foot, telescope, "neutral")
    axes.text(
        2.55, 2.95, r"delay $\tau = b\cdot s/c$", color=METHODS["neutral"].colour, rotation=_SOURCE_ANGLE, ha="center"
    )
    axes.text(*(0.5 * (foot + _CRAFT) + [0.14, 0.06]), r"$B_\perp$", color=METHODS["neutral"].colour)
    for begin in (foot, _CRAFT):
        axes.plot(*np.array([begin, begin + 2.3 * toward]).T, **method("neutral"), linestyle=":")
    _arrow(axes, _CRAFT + 1.5 * toward, _CRAFT + 2.4 * toward, "neutral")
    axes.text(
        *(_CRAFT + 2.35 * toward + [-0.1, 0.2]), "to the source, $s$", color=METHODS["neutral"].colour, ha="right"
    )


def _errors(axes: Axes, station: np.ndarray) -> None:
    """One-sigma errors of the position before and after tracking."""
    sight = _CRAFT - station
    angle = np.degrees(np.arctan2(sight[1], sight[0]))
    before, after = METHODS["prior"].colour, METHODS["ekf"].colour
    axes.add_patch(Circle(_CRAFT, 1.2, fill=False, color=before, linestyle="--", linewidth=1.4))
    axes.add_patch(Ellipse(_CRAFT, 0.16, 1.9, angle=angle, facecolor=after, edgecolor=after, alpha=0.55))
    axes.text(*(_CRAFT + [1.3, 0.25]), "error before tracking", color=before)
    axes.annotate(
        "error after tracking:\nthin along the line of sight,\nwide across it", _CRAFT - 0.9 * _unit(angle + 90.0),
        xytext=(8.45, 0.2), color=after, va="center",
        arrowprops={"arrowstyle": "-", "color": ink(), "linewidth": 0.6, "relpos": (0.0, 0.8)},
    )  # fmt: skip
