"""One figure style for the whole book: the same colour and marker for the same method everywhere, light and dark.

Colours are from Okabe & Ito's palette, safe for colour-blind readers; a few are lightened for dark pages. Line style
and marker differ as well, so that a figure survives a grey print. Imports matplotlib only.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import matplotlib as mpl
import matplotlib.pyplot as plt


class MethodStyle(NamedTuple):
    """How one method is drawn everywhere: its colour in each theme, line style, marker and label."""

    light: str
    dark: str
    line: str
    marker: str
    label: str

    @property
    def colour(self) -> str:
        """The colour of the theme in force."""
        return self.dark if _theme == "dark" else self.light


METHODS: dict[str, MethodStyle] = {
    "truth": MethodStyle("#000000", "#f2f2f2", "-", "", "truth"),
    "newton": MethodStyle("#b34700", "#ff9b52", "--", "s", "Newton"),
    "ekf": MethodStyle("#0072b2", "#62b8ee", "-.", "^", "EKF"),
    "ukf": MethodStyle("#00795a", "#2fcf9f", "-", "o", "UKF"),
    "exact": MethodStyle("#6b6b6b", "#b5b5b5", ":", "x", "exact"),
    "spline": MethodStyle("#9b4f80", "#e29bc7", (0, (5, 1, 1, 1)), "D", "spline"),
    "akf7": MethodStyle("#b34700", "#ff9b52", "--", "s", "AKF7 (paper)"),
    "mekf": MethodStyle("#0072b2", "#62b8ee", "-.", "^", "MEKF"),
    "mekf_rts": MethodStyle("#00795a", "#2fcf9f", "-", "o", "MEKF + RTS"),
    "jpl_like": MethodStyle("#9b4f80", "#e29bc7", (0, (5, 1, 1, 1)), "D", "JPL-like stand-in"),
    "imu": MethodStyle("#6b6b6b", "#b5b5b5", ":", "x", "gyros (IMU1B-like)"),
    "sca1": MethodStyle("#0072b2", "#62b8ee", "-", "^", "SCA1"),
    "sca2": MethodStyle("#b34700", "#ff9b52", "-", "s", "SCA2"),
    "sca3": MethodStyle("#00795a", "#2fcf9f", "-", "o", "SCA3"),
    "sca12": MethodStyle("#0072b2", "#62b8ee", "--", "^", "SCA12"),
    "sca13": MethodStyle("#b34700", "#ff9b52", "--", "s", "SCA13"),
    "sca23": MethodStyle("#9b4f80", "#e29bc7", "--", "D", "SCA23"),
    "sca123": MethodStyle("#00795a", "#2fcf9f", "-", "o", "SCA123"),
    "prior": MethodStyle("#b34700", "#ff9b52", "--", "s", "a-priori orbit"),
    "batch": MethodStyle("#00795a", "#2fcf9f", "-", "o", "batch"),
    "naive": MethodStyle("#9b4f80", "#e29bc7", (0, (5, 1, 1, 1)), "D", "naive EKF"),
    "aekf1": MethodStyle("#b34700", "#ff9b52", "-", "o", "AEKF1"),
    "aekf2": MethodStyle("#9b4f80", "#e29bc7", "--", "s", "AEKF2"),
    "raekf": MethodStyle("#7a6a00", "#e6d84a", (0, (5, 1, 1, 1)), "D", "RAEKF"),
    "rts": MethodStyle("#4b4bab", "#aeaeff", "-", "v", "EKF + RTS"),
    "forward": MethodStyle("#b34700", "#ff9b52", ":", "s", "forward filter"),
    "fb": MethodStyle("#0072b2", "#62b8ee", "--", "o", "forward-backward smoother"),
    "reference": MethodStyle("#000000", "#f2f2f2", "-", "", "reference"),
    "contractor": MethodStyle("#00795a", "#2fcf9f", "-.", "^", "contractor's line product"),
    "grid": MethodStyle("#7a6a00", "#e6d84a", (0, (1, 1)), "v", "contractor's gridded product"),
    "joint": MethodStyle("#9b4f80", "#e29bc7", (0, (5, 1, 1, 1)), "D", "joint estimate"),
    "neutral": MethodStyle("#7a6a00", "#e6d84a", (0, (1, 1)), "v", "other"),
}

_COMMON = {
    "figure.figsize": (7.2, 4.0),
    "figure.dpi": 100,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 180,
    "font.size": 10,
    "font.family": "DejaVu Sans",
    "axes.titlesize": 10,
    "axes.labelsize": 10,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.use_mathtext": True,
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.4,
    "lines.markersize": 4,
    "image.cmap": "cividis",
    "svg.hashsalt": "geokalman",  # the same figure gives the same bytes
}
_THEMES = {
    "light": {"ink": "#1a1a1a", "paper": "#ffffff", "grid": "#d9d9d9"},
    "dark": {"ink": "#e6e6e6", "paper": "#14181e", "grid": "#3a414b"},
}
_theme = "light"

DIVERGING = "RdBu_r"
"""Colour map for signed maps; white is zero in both themes, and it is safe for colour-blind readers."""
SEQUENTIAL = "cividis"
"""Colour map for magnitudes."""


@contextmanager
def theme(name: str = "light") -> Iterator[dict[str, str]]:
    """Draw in the theme `light` or `dark`; yields its ink, paper and grid colours. Raises ValueError for another
    name."""
    global _theme
    if name not in _THEMES:
        raise ValueError(f"theme {name!r} is unknown; the themes are {', '.join(_THEMES)}.")
    colours, before = _THEMES[name], _theme
    ink, paper, grid = colours["ink"], colours["paper"], colours["grid"]
    rc = _COMMON | {
        "figure.facecolor": paper, "axes.facecolor": paper, "savefig.facecolor": paper,
        "text.color": ink, "axes.labelcolor": ink, "axes.edgecolor": ink, "axes.titlecolor": ink,
        "xtick.color": ink, "ytick.color": ink, "grid.color": grid,
    }  # fmt: skip
    _theme = name
    try:
        with mpl.rc_context(rc):
            yield colours
    finally:
        _theme = before


def ink() -> str:
    """The text colour of the theme in force."""
    return _THEMES[_theme]["ink"]


def paper() -> str:
    """The background colour of the theme in force."""
    return _THEMES[_theme]["paper"]


def close(figure: mpl.figure.Figure) -> None:
    """Release a figure; a book draws hundreds."""
    plt.close(figure)
