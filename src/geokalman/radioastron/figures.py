"""Figures of the observables, the covariances and the Monte Carlo; those of the orbit stand in `orbit_figures`, those
of the correlator in `plane_figures`.

Every function takes plain arrays and returns a matplotlib Figure, drawn in the theme of `style.theme` that is in force.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from geokalman.radioastron.model import Array
from geokalman.style import METHODS, ink

US, RATE = 1e6, 1e10
"""Factors to microseconds, and to units of 1e-10 s/s."""


def sizes(values: Mapping[str, float], unit: str, threshold: float | None = None, threshold_label: str = "") -> Figure:
    """Absolute sizes by name on a logarithmic scale, negative ones hollow; a line at what matters."""
    figure, axes = plt.subplots(figsize=(7.2, 0.9 + 0.3 * len(values)))
    names = list(values)[::-1]
    colour = METHODS["ekf"].colour
    for k, name in enumerate(names):
        value = values[name]
        axes.plot(
            abs(value),
            k,
            marker="o",
            markersize=7,
            linestyle="none",
            color=colour,
            markerfacecolor=colour if value >= 0 else "none",
        )
    if threshold is not None:
        axes.axvline(threshold, color=METHODS["prior"].colour, linestyle="--", label=threshold_label)
    if min(values.values()) < 0:
        axes.plot([], [], marker="o", linestyle="none", color=colour, label="positive")
        axes.plot([], [], marker="o", linestyle="none", color=colour, markerfacecolor="none", label="negative")
    axes.set_yticks(range(len(names)), names)
    axes.set(xscale="log", xlabel=f"size [{unit}]")
    axes.grid(axis="y", alpha=0.4)
    if axes.get_legend_handles_labels()[0]:
        figure.legend(loc="outside upper center", ncols=3)
    return figure


def bars(
    groups: Mapping[str, Mapping[str, float]],
    label: str,
    log: bool = True,
    styles: Sequence[str] = ("prior", "ekf", "batch", "naive"),
    errors: Mapping[str, Mapping[str, float]] | None = None,
) -> Figure:
    """Values side by side: row label -> (series -> value); label of the axis with its unit; errors likewise, one sigma.

    Bars from zero; on a logarithmic axis, where a bar has no beginning, dots.
    """
    series = list(dict.fromkeys(name for group in groups.values() for name in group))
    width = 0.8 / len(series)
    figure, axes = plt.subplots(
        figsize=(7.2, 1.1 + (0.24 if len(groups) < 12 else 0.15) * len(groups) * max(1.4, len(series)))
    )
    for k, name in enumerate(series):
        place = [i + (k - 0.5 * (len(series) - 1)) * width for i, group in enumerate(groups.values()) if name in group]
        values = [group[name] for group in groups.values() if name in group]
        method = METHODS[styles[k % len(styles)]]
        if log:
            axes.plot(values, place, color=method.colour, marker=method.marker, linestyle="none", label=name)
        else:
            spread = None if errors is None else [errors[row][name] for row, group in groups.items() if name in group]
            axes.barh(
                place, values, 0.9 * width, xerr=spread, color=method.colour, ecolor=ink(), capsize=2, label=name,
                error_kw={"linewidth": 0.9},
            )  # fmt: skip
    axes.set_axisbelow(True)
    axes.set_yticks(range(len(groups)), list(groups))
    axes.invert_yaxis()
    if log:
        axes.set_xscale("log")
        plain_logarithm(axes.xaxis)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(label)
    if len(series) > 1:
        figure.legend(loc="outside upper center", ncols=len(series))
    return figure


def sweep(scale: Array, delay: Array, rate: Array, label: str) -> Figure:
    """Formal sigmas of delay [s] and rate [s/s] before and after, (n, 2) each, against what is swept."""
    figure, panels = plt.subplots(1, 2, figsize=(7.2, 3.4))
    for panel, values, factor, unit in (
        (panels[0], delay, US, "delay sigma [µs]"),
        (panels[1], rate, 1.0, "delay-rate sigma [s/s]"),
    ):
        for k, name in enumerate(("prior", "ekf")):
            method = METHODS[name]
            panel.loglog(
                scale,
                factor * values[:, k],
                color=method.colour,
                linestyle=method.line,
                marker=method.marker,
                label=("before", "after tracking")[k],
            )
        panel.set(xlabel=label, ylabel=unit)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def ellipses(covariances: Mapping[str, Array], source: Array) -> Figure:
    """One-sigma ellipses of the position in the plane of the sky, and seen from the side.

    covariances: method of `style.METHODS` -> (3, 3) [m^2] in radial, east and north; source (3,): unit vector in the
    same axes.
    """
    figure, panels = plt.subplots(1, 2, figsize=(7.2, 3.9))
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    for panel, pair, labels in (
        (panels[0], (1, 2), ("east [km]", "north [km]")),
        (panels[1], (1, 0), ("east [km]", "radial [km]")),
    ):
        for name, cov in covariances.items():
            # the root by eigenvectors: the ellipse may be a thousand times as long as it is wide
            values, vectors = np.linalg.eigh(cov[np.ix_(pair, pair)])
            x, y = 1e-3 * (vectors * np.sqrt(np.maximum(values, 0.0))) @ np.array([np.cos(angle), np.sin(angle)])
            method = METHODS[name]
            panel.plot(x, y, color=method.colour, linestyle=method.line, label=method.label)
        size = 1e-3 * np.sqrt(max(np.trace(cov) for cov in covariances.values()) / 3.0)
        ray = np.outer([0.0, size], source[list(pair)] / np.linalg.norm(source[list(pair)]))
        panel.plot(ray[:, 0], ray[:, 1], color=METHODS["neutral"].colour, linestyle=":", label="to the source")
        panel.set(xlabel=labels[0], ylabel=labels[1], aspect="equal")
    panels[0].set_title("plane of the sky", loc="left")
    panels[1].set_title("from the side", loc="left")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def plain_logarithm(axis: Axis) -> None:
    """Write the ticks of a logarithmic axis as plain numbers, and more of them where it spans less than two decades."""
    low, high = axis.get_view_interval()
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(
        FuncFormatter(lambda x, _: f"{x:g}" if high < 100.0 * low and f"{x:e}"[0] in "235" else "")
    )


def _band(axes, x: Array, runs: Array, name: str, factor: float, label: str) -> None:
    low, middle, high = factor * np.quantile(runs, [0.16, 0.5, 0.84], axis=0)
    method = METHODS[name]
    axes.fill_between(x, low, high, color=method.colour, alpha=0.25, linewidth=0)
    axes.plot(x, middle, color=method.colour, linestyle=method.line, marker=method.marker, label=label)


def scans(
    delay: Mapping[str, Array],
    rate: Mapping[str, Array],
    printed: tuple[tuple[float, float], tuple[float, float]] | None = None,
    labels: Mapping[str, str] | None = None,
) -> Figure:
    """Size of delay [s] and rate [s/s] at the scans, (runs, scans): medians and bands of 16 to 84 %; printed: (delay,
    rate) of both orbits.
    """
    figure, panels = plt.subplots(1, 2, figsize=(7.2, 3.5))
    for panel, data, factor, unit, k in (
        (panels[0], delay, US, "|residual delay| [µs]", 0),
        (panels[1], rate, RATE, "|delay rate| [1e-10 s/s]", 1),
    ):
        for name, runs in data.items():
            x = np.arange(1, runs.shape[1] + 1)
            _band(panel, x, np.abs(runs), name, factor, (labels or {}).get(name, METHODS[name].label))
        if printed is not None and np.isfinite(printed[k]).all():
            for value, word in zip(printed[k], ("before", "after"), strict=True):
                panel.axhline(factor * value, color=ink(), linewidth=1.6, linestyle=":", zorder=3)
                panel.annotate(
                    f"printed, {word}" if printed[k][0] != printed[k][1] else "printed",
                    (x[0], factor * value),
                    textcoords="offset points",
                    xytext=(2, 2),
                    fontsize=8,
                )
        panel.set(xlabel="scan", ylabel=unit, yscale="log")
        panel.set_xticks(x)
        plain_logarithm(panel.yaxis)
    figure.legend(*panels[1].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def innovations(t: Array, whitened: Array) -> Figure:
    """Whitened innovations (n, 2) of range and range-rate against time [s], the passes cut apart."""
    cut = int(np.argmax(np.diff(t))) + 1
    figure, panels = plt.subplots(1, 2, figsize=(7.2, 3.2), sharey=True, width_ratios=(1, 1))
    for k, part in enumerate((slice(0, cut), slice(cut, None))):
        for j, name in enumerate(("ekf", "prior")):
            method = METHODS[name]
            panels[k].plot(
                t[part] / 3600,
                whitened[part, j],
                color=method.colour,
                marker=method.marker,
                linestyle="none",
                markersize=3,
                label=("range", "range-rate")[j],
            )
        panels[k].axhspan(-3, 3, color=METHODS["exact"].colour, alpha=0.2, linewidth=0)
        panels[k].set(xlabel="UTC [h]", title=f"pass {k + 1}")
        panels[k].locator_params(axis="x", nbins=5)
    panels[0].set_ylabel("innovation / sigma")
    panels[0].legend(loc="upper right")
    return figure


def covariance_history(t: Array, sigmas: Array) -> Figure:
    """Sigmas (n, 3) [m] of the position, smallest to largest principal axis, against the number of the measurement."""
    figure, axes = plt.subplots(figsize=(7.2, 3.3))
    number = np.arange(1, len(t) + 1)
    for k, (name, label) in enumerate(
        (("ekf", "radial (smallest axis)"), ("batch", "middle axis"), ("prior", "largest axis"))
    ):
        axes.plot(number, sigmas[:, k], color=METHODS[name].colour, linestyle=METHODS[name].line, label=label)
    axes.axvline(
        int(np.argmax(np.diff(t))) + 1.5, color=METHODS["neutral"].colour, linestyle=":", label="between the passes"
    )
    axes.set(xlabel="measurement", ylabel="sigma of the position [m]", yscale="log")
    axes.legend(loc="center right")
    return figure


def histogram(
    gains: Mapping[str, Array], printed: float, label: str, labels: Mapping[str, str] | None = None
) -> Figure:
    """Share of runs whose gain exceeds a value, for several estimators; printed: the paper's gain; labels of
    estimators.
    """
    figure, axes = plt.subplots(figsize=(7.2, 3.5))
    for name, values in gains.items():
        x = np.sort(values)
        method = METHODS[name]
        axes.plot(
            x,
            1.0 - np.arange(len(x)) / len(x),
            color=method.colour,
            linestyle=method.line,
            label=(labels or {}).get(name, method.label),
        )
    axes.axvline(printed, color=ink(), linestyle="--", linewidth=0.8, label="printed")
    axes.set(xscale="log", xlabel=label, ylabel="share of runs that gain more", ylim=(0, 1), xlim=(0.1, 1000))
    axes.legend()
    return figure


def divergence(t: Array, position: Array, velocity: Array) -> Figure:
    """Distance of the literal prediction from the integrated orbit: position [m] and velocity [m/s] against time
    [s].
    """
    figure, panels = plt.subplots(1, 2, figsize=(7.2, 3.2))
    for panel, values, unit, name in (
        (panels[0], position, "position error [m]", "prior"),
        (panels[1], velocity, "velocity error [m/s]", "ekf"),
    ):
        panel.plot(t, values, color=METHODS[name].colour)
        panel.set(xlabel="time [s]", ylabel=unit)
    return figure


def corrections(
    t: Array, difference: Array, radius: Array, printed: Mapping[str, tuple[float, float]], middle: Array
) -> Figure:
    """Figure 5: correction of the orbit, filter minus a priori, against UTC [s].

    difference (runs, k, 3) and radius (runs, k) [m]; printed: axis -> range of the figure [m]; middle: the run that
    is drawn as a line.
    """
    figure, panels = plt.subplots(2, 2, figsize=(7.2, 5.0), sharex=True)
    for k, (panel, name) in enumerate(zip(panels.ravel(), ("dX", "dY", "dZ", "dR"), strict=True)):
        values = (difference[..., k] if k < 3 else radius) / 1e3
        low, high = np.quantile(values, [0.16, 0.84], axis=0)
        panel.fill_between(
            t / 3600, low, high, color=METHODS["ekf"].colour, alpha=0.25, linewidth=0, label="16 to 84 % of runs"
        )
        panel.plot(t / 3600, values[middle], color=METHODS["ekf"].colour, label="one run")
        if name in printed:
            panel.axhspan(
                *(value / 1e3 for value in printed[name]),
                color=METHODS["prior"].colour,
                alpha=0.5,
                linewidth=0,
                label="printed",
            )
        panel.set_ylabel(f"{name} [km]")
    for panel in panels[1]:
        panel.set_xlabel("UTC [h]")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure
