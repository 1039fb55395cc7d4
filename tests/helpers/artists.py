"""What the artists of a figure tell."""

from __future__ import annotations

from matplotlib.colors import same_color
from matplotlib.figure import Figure


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
