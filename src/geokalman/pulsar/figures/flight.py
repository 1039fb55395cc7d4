"""Figures of the flight and of its filters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator, ScalarFormatter

from geokalman.pulsar.model import Array
from geokalman.style import METHODS, MethodStyle, ink

STYLES = {
    "ekf": "ekf", "aekf1_prw": "aekf1", "aekf1_pr3": "aekf1", "aekf1_pr2": "aekf1", "aekf2": "aekf2", "raekf": "raekf",
    "ukf": "ukf", "rts": "rts", "ekf_tuned": "ekf", "igg": "exact",
}  # fmt: skip
"""Name of a filter -> name of its style."""
LABELS = {
    "ekf": "EKF", "aekf1_prw": "AEKF1, ratio", "aekf1_pr3": "AEKF1, three-part", "aekf1_pr2": "AEKF1, two-part",
    "aekf2": "AEKF2", "raekf": "RAEKF", "ukf": "UKF", "rts": "EKF, smoothed", "ekf_tuned": "EKF, tuned noise",
}  # fmt: skip
"""Name of a filter -> how it is called in figures, tables and prose; AEKF1 by the form of its factor."""
SETUPS = {
    "A": "over-confident start", "truthful": "truthful start", "B": "matched dynamics", "C": "untuned noise",
    "D": "tuned noise", "E": "accurate ranges",
}  # fmt: skip
"""Name of a preset -> how its set-up is called in figures, tables and prose."""
AXES = "XYZ"
COLOURS = ("ekf", "aekf1", "ukf", "aekf2", "raekf", "rts", "exact")
"""Styles of the seven pulsars, in their order."""
_EPOCH = "epoch k, 500 s apart"
_WORDS = (
    ("RAEKF", "raekf"), ("AEKF2", "aekf2"), ("AEKF1", "aekf1"), ("RTS", "rts"), ("smoothed", "rts"), ("UKF", "ukf"),
    ("IGG", "exact"), ("Huber", "exact"), ("EKF", "ekf"),
)  # fmt: skip


def _style(name: str) -> MethodStyle:
    """Give the style of a filter by its name, or of a label by the filter that it names."""
    named = STYLES.get(name) or next((style for word, style in _WORDS if word in name), "neutral")
    return METHODS[named]


def _round_ticks(axis: Axis, low: float, high: float, room: int = 7) -> None:
    """Put at most `room` ticks in plain digits on a logarithmic axis, all of 1 to 9 or fewer."""
    for steps in (range(1, 10), (1, 2, 5), (1, 3), (1,)):
        ticks = [f * 10.0**k for k in range(-3, 8) for f in steps if low <= f * 10.0**k <= high]
        if len(ticks) <= room:
            break
    axis.set_minor_locator(NullLocator())
    if len(ticks) > 1:
        axis.set_ticks(ticks, [f"{t:g}" for t in ticks])
    else:  # a range too narrow for round numbers
        axis.set_major_locator(MaxNLocator(4))
        axis.set_major_formatter(ScalarFormatter())


def orbit_view(states: Array, radius: float, axes: tuple[str, str, str] = ("x", "y", "z")) -> Figure:
    """Draw states (n, 6) [m] over the disc of Mars, radius [m], in three projections."""
    figure, panels = plt.subplots(1, 3, figsize=(7.2, 2.8))
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    disc = radius / 1e3 * np.cos(angle), radius / 1e3 * np.sin(angle)
    for panel, (i, j) in zip(panels, ((0, 1), (0, 2), (1, 2)), strict=True):
        panel.fill(*disc, color=METHODS["aekf1"].colour, alpha=0.3, linewidth=0, label="Mars")
        panel.plot(states[:, i] / 1e3, states[:, j] / 1e3, color=METHODS["truth"].colour, linewidth=0.7, label="orbit")
        panel.set(xlabel=f"{axes[i]} [km]", ylabel=f"{axes[j]} [km]", aspect="equal")
        panel.set(xticks=[-3000, 0, 3000], yticks=[-3000, 0, 3000])
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def ranges(t: Array, z: Array, names: Sequence[str]) -> Figure:
    """Draw ranges z (n, m) [m] along the lines to pulsars over t (n,) [s]."""
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    for name, values, key in zip(names, z.T, COLOURS, strict=False):
        look = {"color": METHODS[key].colour, "linestyle": METHODS[key].line}
        axes.plot(t / 3600, values / 1e3, **look, linewidth=0.7, marker=".", label=name)
    axes.set(xlabel="time [h]", ylabel="range along the line [km]")
    figure.legend(loc="outside upper center", ncols=4)
    return figure


def axis_errors(
    epoch: Array, error: Array, sigma: Array, quantity: str, unit: str, names: Sequence[str] = AXES, zoom: float = 0.0,
    notes: Sequence[str] = ("", "", ""), mark: float | None = None,
) -> Figure:  # fmt: skip
    """Draw Figures 1 and 2: error (n, 3) on three axes with the filter's 3-sigma band.

    zoom > 0 limits the axis to +- zoom; notes stand above the panels on the right; mark: an epoch to draw a line at.
    """
    figure, panels = plt.subplots(3, 1, sharex=True, figsize=(7.2, 5.4))
    colour, label = METHODS["aekf1"].colour, "±3 sigma of the filter"
    for panel, e, s, name, note in zip(panels, error.T, 3 * sigma.T, names, notes, strict=True):
        panel.fill_between(epoch, -s, s, color=colour, alpha=0.22, linewidth=0, label=label)
        panel.plot(epoch, e, color=colour, linewidth=0.8, label="estimate minus truth")
        panel.axhline(0.0, color=ink(), linewidth=0.6)
        panel.set_ylabel(f"{name} [{unit}]")
        panel.set_title(note, loc="right", fontsize=9)
        if mark is not None:
            panel.axvline(mark, color=ink(), linewidth=0.9, linestyle=":")
        if zoom:
            panel.set_ylim(-zoom, zoom)
    panels[-1].set_xlabel(_EPOCH)
    panels[0].set_title(f"error of {quantity}", loc="left")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def consistency(epoch: Array, nees6: Mapping[str, Array], bounds: tuple[float, float]) -> Figure:
    """Draw NEES/6 against epoch, a line per filter, with the 95 % bounds of a single epoch."""
    figure, axes = plt.subplots(figsize=(7.2, 3.4))
    for name, values in nees6.items():
        axes.semilogy(epoch, values, color=_style(name).colour, linewidth=0.8, label=LABELS.get(name, name))
    axes.axhspan(*bounds, color=METHODS["ukf"].colour, alpha=0.25, linewidth=0, label="95 % of a consistent filter")
    axes.set(xlabel=_EPOCH, ylabel="NEES / 6")
    figure.legend(loc="outside upper center", ncols=3)
    return figure


def against_paper(scores: Mapping[str, Array], spreads: Mapping[str, Array], printed: Sequence[float]) -> Figure:
    """Draw Table 3: RMS on X, Y, Z [m] with its spread over seeds, and the paper's AEKF1."""
    figure, panels = plt.subplots(1, 3, figsize=(7.2, 3.4), sharey=True)
    rows = {"yticks": range(len(scores)), "yticklabels": [LABELS.get(name, name) for name in scores]}
    for j, panel in enumerate(panels):
        for k, (name, values) in enumerate(scores.items()):
            look = {"color": _style(name).colour, "marker": _style(name).marker or "o"}
            panel.errorbar(values[j], k, xerr=spreads[name][j], **look, markersize=6, capsize=3)
        panel.axvline(printed[j], color=ink(), linewidth=0.9, linestyle="--", label=f"paper, AEKF1: {printed[j]:g} m")
        panel.set(xlabel=f"RMS error in {AXES[j]} [m]", xscale="log", **rows)
        panel.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0))
        _round_ticks(panel.xaxis, *panel.get_xlim(), room=4)
    panels[0].invert_yaxis()
    return figure


def seed_strip(
    values: Mapping[str, Sequence[float]], xlabel: str, log: bool = True, marks: Mapping[str, float] | None = None,
    stopped: Mapping[str, int] | None = None,
) -> Figure:  # fmt: skip
    """Draw a row for each label: a stroke for every seed, and their mean.

    marks : label -> x of a vertical line; stopped : label -> runs without a stroke, told beside the label.
    """
    figure, axes = plt.subplots(figsize=(7.2, 0.9 + 0.34 * len(values)))
    for k, (label, row) in enumerate(values.items()):
        if len(row):
            look = {"color": _style(label).colour, "linestyle": "none"}
            axes.plot(row, np.full(len(row), k), **look, marker="|", markersize=9, alpha=0.8)
            axes.plot(np.mean(row), k, **look, marker="D", markersize=6, markeredgecolor=ink())
    beside = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "xytext": (3, 2), "fontsize": 8}
    for text, x in (marks or {}).items():
        axes.axvline(x, color=ink(), linewidth=0.8, linestyle="--")
        axes.annotate(text, (x, 1.0), **beside)
    told = {label: f" ({count} stopped)" for label, count in (stopped or {}).items() if count}
    names = [LABELS.get(label, label) + told.get(label, "") for label in values]
    axes.set(xlabel=xlabel, yticks=range(len(values)), yticklabels=names, ylim=(len(values) - 0.5, -0.5))
    if log:
        axes.set_xscale("log")
        _round_ticks(axes.xaxis, *axes.get_xlim())
    return figure


def curves(x: Array, values: Mapping[str, Array], xlabel: str, ylabel: str, logx: bool = True) -> Figure:
    """Draw curves of several filters against one setting; x (n,), values: filter -> (n,)."""
    figure, axes = plt.subplots(figsize=(7.2, 3.6))
    for name, y in values.items():
        style = _style(name)
        marker, line = {"aekf1_pr3": ("x", ":"), "aekf1_pr2": ("+", "--")}.get(name, (style.marker or "o", style.line))
        axes.plot(x, y, color=style.colour, linestyle=line, marker=marker, markersize=6, label=LABELS.get(name, name))
    axes.set(xlabel=xlabel, ylabel=ylabel, yscale="log")
    _round_ticks(axes.yaxis, *axes.get_ylim())
    if logx:
        axes.set_xscale("log")
    else:
        axes.set_xticks(x[np.diff(x, prepend=-np.inf) > 0.03 * np.ptp(x)])
    if len(values) > 1:
        figure.legend(loc="outside upper center", ncols=3)
    return figure


def noise_curve(q: Array, d3: Array, nis: Array) -> Figure:
    """Draw 3-D RMS [m] and NIS/7 of the EKF against its process noise of position [m]."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.2))
    for axes, values, ylabel in ((left, d3, "3-D RMS error [m]"), (right, nis, "NIS / 7")):
        axes.loglog(q, values, color=METHODS["ekf"].colour, marker=METHODS["ekf"].marker)
        axes.set(xlabel="process noise of position in 500 s [m]", ylabel=ylabel)
    left.set_title(f"least error {d3.min():.0f} m, at {q[d3.argmin()]:g} m", loc="left")
    _round_ticks(left.yaxis, *left.get_ylim())
    right.axhline(1.0, color=ink(), linewidth=0.8, linestyle="--")
    for axes in (left, right):
        axes.axvline(q[d3.argmin()], color=METHODS["neutral"].colour, linestyle=":", label="least error")
    right.legend()
    return figure


def smoothing(epoch: Array, filtered: Array, smoothed: Array, ylabel: str) -> Figure:
    """Draw the 3-D position error [m] of a filter and its smoother against epoch, (n,) each."""
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    for name, values in (("ekf", filtered), ("rts", smoothed)):
        axes.semilogy(epoch, values, color=METHODS[name].colour, linewidth=0.9, label=LABELS[name])
    axes.set(xlabel=_EPOCH, ylabel=ylabel)
    axes.legend(ncols=2)
    return figure
