"""What the artists of a figure tell, and fields to draw."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import same_color
from matplotlib.figure import Figure

DEGREE = np.arange(2, 71)
IDS = ("X", "N1", "N2", "E0", "E1", "E2", "U1", "U2", "K0", "B11", "P2")


def line(axes, label: str):
    """The one line of the axes with this label."""
    [found] = [artist for artist in axes.get_lines() if artist.get_label() == label]
    return found


def texts(legend) -> list[str]:
    return [text.get_text() for text in legend.get_texts()]


def assert_dressed(figure: Figure, theme: dict[str, str]) -> None:
    """Paper and ink are the theme's."""
    assert same_color(figure.get_facecolor(), theme["paper"])
    for axes in figure.axes:
        for label in (axes.xaxis.label, axes.yaxis.label, axes.title):
            assert same_color(label.get_color(), theme["ink"])


def errors(names=IDS) -> dict[str, np.ndarray]:
    return {name: 1e-4 * (k + 1) * np.exp(DEGREE / 20) for k, name in enumerate(names)}


def grids() -> dict[str, np.ndarray]:
    lat = np.radians(np.arange(-85.0, 90.0, 10.0))[:, None]
    lon = np.radians(np.arange(5.0, 360.0, 10.0))
    pattern = np.cos(lat) * np.cos(lon)
    return {"(a) Newton": 5e-3 * pattern, "(b) EKF": 4e-3 * pattern, "(c) UKF": 1e-3 * pattern}
