"""The set-up of the chapter as a drawing: how a satellite points, and how its sensors become an attitude."""

from __future__ import annotations

from math import cos, radians, sin

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, FancyBboxPatch, Polygon

from geokalman.style import METHODS, ink, paper

BODY = np.array([(-8.5, -3.2), (8.5, -3.2), (6.0, 3.2), (-6.0, 3.2)])
TILT = {"x": 90.0, "z": 180.0, "camera 1": 30.5, "cameras 2 and 3": -45.0}
"""Directions in the plane of x and z [deg from the zenith toward x]; cameras 2 and 3 also look out to either side."""
SMALL = 8.0


def chain() -> Figure:
    """Both satellites with their axes, boresights and antennas, above the way from sensors to the gravity field."""
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(7.2, 6.6), height_ratios=(1.0, 1.05))
    for axes, height in ((upper, 44.0), (lower, 46.0)):
        axes.set(xlim=(0, 100), ylim=(0, height), aspect="equal")
        axes.axis("off")
    _geometry(upper)
    _flow(lower)
    return figure


def _geometry(axes: Axes) -> None:
    """Both satellites from the side; the trailing one is turned in pitch, far more than in flight."""
    axes.plot([20, 80], [20, 20], color=ink(), linestyle=":", linewidth=1.2)
    axes.text(50, 21.2, "line of sight, 220 km", ha="center", fontsize=9)
    axes.text(50, 15.0, "range and range-rate\nbetween the antennas", ha="center", va="center", fontsize=SMALL)
    _satellite(axes, 20.0, 1.0, 9.0, "GRACE-D")
    _satellite(axes, 80.0, -1.0, 0.0, "GRACE-C")
    axes.add_patch(Arc((20, 20), 36, 36, theta1=0, theta2=9, color=METHODS["sca2"].colour, linewidth=1.5))
    axes.text(39.5, 25.4, "pitch θ (exaggerated)", color=METHODS["sca2"].colour, fontsize=SMALL, va="center")
    axes.annotate(
        "", (64, 41), (36, 41), arrowprops={"arrowstyle": "-|>", "color": ink(), "linewidth": 1.2, "shrinkA": 0}
    )
    axes.text(50, 37.6, "both fly this way; GRACE-C leads", ha="center", fontsize=SMALL)
    axes.text(
        50, 7.6, "rotation about a boresight is measured\n9 times worse than rotation across it", ha="center",
        va="center", fontsize=SMALL, color=METHODS["sca1"].colour,
    )  # fmt: skip
    axes.text(0, 42.5, "(a)", fontweight="bold")


def _satellite(axes: Axes, centre: float, ahead: float, pitch: float, name: str) -> None:
    """A body with its axes; ahead : 1 where x points to the right, -1 to the left; pitch [deg]: nose up."""
    turn = radians(pitch) * ahead
    R = np.array([[cos(turn), -sin(turn)], [sin(turn), cos(turn)]])
    origin = np.array([centre, 20.0])

    def at(tilt: float, length: float) -> np.ndarray:
        return origin + R @ np.array([ahead * length * sin(radians(tilt)), length * cos(radians(tilt))])

    axes.add_patch(Polygon(BODY @ R.T + origin, facecolor=paper(), edgecolor=ink(), linewidth=1.3, zorder=2))
    looks = {
        "x": (ink(), 16.0, "x"),
        "z": (ink(), 12.0, "z, to the Earth"),
        "camera 1": (METHODS["sca1"].colour, 15.0, "camera 1"),
        "cameras 2 and 3": (METHODS["sca3"].colour, 12.5, "cameras 2, 3"),
    }
    for key, (colour, length, label) in looks.items():
        arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", at(TILT[key], length), origin, arrowprops=arrow, zorder=3)
        place = at(TILT[key], length + (1.6 if key == "x" else 2.0))
        axes.text(*place, label, color=colour, fontsize=SMALL, ha="center", va="center")
    axes.plot(*at(90.0, 10.5), "o", color=METHODS["jpl_like"].colour, markersize=6, zorder=4)
    antenna = at(90.0, 10.5) + np.array([4.6 * ahead, -2.6])
    axes.text(*antenna, "antenna", color=METHODS["jpl_like"].colour, fontsize=SMALL, ha="center", va="center")
    axes.text(centre - 8.0 * ahead, 12.6, f"{name}\nfour gyros inside", fontsize=SMALL, ha="center", va="center")


def _flow(axes: Axes) -> None:
    """Sensors, filter, products and gravity from left to right, with the pages that treat them."""
    axes.text(0, 44.2, "(b)", fontweight="bold")
    camera, gyro, product = METHODS["sca1"].colour, METHODS["sca2"].colour, METHODS["jpl_like"].colour
    boxes = {
        "cameras": (1, 29, 17, "three cameras\n2 Hz quaternions\npage 1", camera),
        "gyros": (1, 7, 17, "four gyros\n8 Hz angles\npage 3", gyro),
        "combine": (23, 29, 16, "combine\nby weights\npages 2, 12", camera),
        "reduce": (23, 7, 16, "unwrap, sum,\nfour axes to three\npage 3", gyro),
        "update": (45, 29, 16, "update\n1 Hz", ink()),
        "predict": (45, 7, 16, "predict\n8 Hz", ink()),
        "rates": (68, 33, 14, "rates against\nthe gyro\npage 5", product),
        "antenna": (68, 18, 14, "antenna\ncorrection\npage 8", product),
        "turned": (68, 3, 14, "accelerations\nturned\npage 7", product),
        "field": (87, 10.5, 12.5, "monthly\ngravity field\npage 9", product),
    }
    axes.add_patch(
        FancyBboxPatch((43.5, 3), 19, 39, boxstyle="round,pad=0.4", facecolor="none", edgecolor=ink(), linestyle="--")
    )
    axes.text(
        53, 23, "Kalman filter\nattitude and\ngyro bias\npages 4, 6, 11", ha="center", va="center", fontsize=SMALL
    )
    for left, low, width, label, colour in boxes.values():
        axes.add_patch(
            FancyBboxPatch(
                (left, low), width, 10, boxstyle="round,pad=0.3", facecolor=paper(), edgecolor=colour, linewidth=1.4,
                zorder=2,
            )
        )  # fmt: skip
        axes.text(left + width / 2, low + 5, label, ha="center", va="center", fontsize=SMALL, zorder=3)
    for start, end in (
        ((18.4, 34), (22.6, 34)), ((18.4, 12), (22.6, 12)), ((39.4, 34), (44.6, 34)), ((39.4, 12), (44.6, 12)),
        ((46, 17.4), (46, 28.6)), ((60, 28.6), (60, 17.4)), ((63, 38), (67.6, 38)), ((63, 23), (67.6, 23)),
        ((63, 8), (67.6, 8)), ((82.4, 21.5), (86.6, 18)), ((82.4, 9.5), (86.6, 13)),
    ):  # fmt: skip
        axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": ink(), "linewidth": 1.2, "shrinkA": 0,
                                                  "shrinkB": 0})  # fmt: skip
