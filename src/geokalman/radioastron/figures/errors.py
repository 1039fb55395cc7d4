"""Figures of the observables, the covariances and the errors of many runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from geokalman.radioastron.figures.drawing import band, method, plain_logarithm, two_thirds
from geokalman.radioastron.model import Array
from geokalman.style import METHODS, ink


def sizes(values: Mapping[str, float], unit: str, threshold: float | None = None, threshold_label: str = "") -> Figure:
    """Absolute sizes by name on a logarithmic scale, negative ones hollow; a line at what matters."""
    figure, axes = plt.subplots(figsize=(7.2, 0.9 + 0.3 * len(values)))
    dot = method("ekf", marker="o", linestyle="none")
    for k, value in enumerate(list(values.values())[::-1]):
        axes.plot(abs(value), k, **dot, markersize=7, markerfacecolor=dot["color"] if value >= 0 else "none")
    if threshold is not None:
        axes.axvline(threshold, color=METHODS["prior"].colour, linestyle="--", label=threshold_label)
    if min(values.values()) < 0:
        axes.plot([], [], **dot, label="positive")
        axes.plot([], [], **dot, markerfacecolor="none", label="negative")
    axes.set_yticks(range(len(values)), list(values)[::-1])
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
    width, height = 0.8 / len(series), 0.24 if len(groups) < 12 else 0.15
    figure, axes = plt.subplots(figsize=(7.2, 1.1 + height * len(groups) * max(1.4, len(series))))
    for k, name in enumerate(series):
        rows = [(i, row) for i, row in enumerate(groups) if name in groups[row]]
        place = [i + (k - 0.5 * (len(series) - 1)) * width for i, _ in rows]
        values = [groups[row][name] for _, row in rows]
        look = method(styles[k % len(styles)], "marker", linestyle="none", label=name)
        if log:
            axes.plot(values, place, **look)
        else:
            axes.barh(
                place, values, 0.9 * width, xerr=errors and [errors[row][name] for _, row in rows],
                color=look["color"], ecolor=ink(), capsize=2, label=name, error_kw={"linewidth": 0.9},
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
    units = "delay sigma [µs]", "delay-rate sigma [s/s]"
    for panel, values, unit in zip(panels, (1e6 * delay, rate), units, strict=True):
        for column, name, word in zip(values.T, ("prior", "ekf"), ("before", "after tracking"), strict=True):
            panel.loglog(scale, column, **method(name, "linestyle", "marker", label=word))
        panel.set(xlabel=label, ylabel=unit)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def ellipses(covariances: Mapping[str, Array], source: Array) -> Figure:
    """One-sigma ellipses of the position in the plane of the sky, and seen from the side.

    covariances: `prior` or `ekf`, before and after tracking -> (3, 3) [m^2] in radial, east and north;
    source (3,): unit vector in the same axes.
    """
    figure, panels = plt.subplots(1, 2, figsize=(7.2, 3.9))
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    labels = {"prior": "before tracking", "ekf": "after tracking"}
    size = 1e-3 * np.sqrt(max(np.trace(cov) for cov in covariances.values()) / 3.0)
    for panel, pair, title in zip(panels, ((1, 2), (1, 0)), ("plane of the sky", "from the side"), strict=True):
        for name, cov in covariances.items():
            # the root by eigenvectors: the ellipse may be a thousand times as long as it is wide
            values, vectors = np.linalg.eigh(cov[np.ix_(pair, pair)])
            x, y = 1e-3 * (vectors * np.sqrt(np.maximum(values, 0.0))) @ np.array([np.cos(angle), np.sin(angle)])
            panel.plot(x, y, **method(name, "linestyle", label=labels[name]))
        ray = np.outer([0.0, size], source[list(pair)] / np.linalg.norm(source[list(pair)]))
        panel.plot(ray[:, 0], ray[:, 1], **method("neutral", linestyle=":", label="to the source"))
        across, up = (f"{('radial', 'east', 'north')[axis]} [km]" for axis in pair)
        panel.set(xlabel=across, ylabel=up, aspect="equal")
        panel.set_title(title, loc="left")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def scans(
    delay: Mapping[str, Array],
    rate: Mapping[str, Array],
    printed: tuple[tuple[float, float], tuple[float, float]] | None = None,
    labels: Mapping[str, str] | None = None,
) -> Figure:
    """Size of delay [s] and rate [s/s] at the scans, (runs, scans): medians and bands of 16 to 84 %.

    printed: (delay, rate) of both orbits.
    """
    figure, panels = plt.subplots(1, 2, figsize=(7.2, 3.5))
    for panel, data, factor, unit, values in zip(
        panels, (delay, rate), (1e6, 1e10), ("|residual delay| [µs]", "|delay rate| [1e-10 s/s]"),
        printed or ((np.nan, np.nan),) * 2, strict=True,
    ):  # fmt: skip
        for name, runs in data.items():
            x, size = np.arange(1, runs.shape[1] + 1), factor * np.abs(runs)
            band(panel, x, *two_thirds(size), name)
            look = method(name, "linestyle", "marker", "label")
            panel.plot(x, np.median(size, axis=0), **look | {"label": (labels or {}).get(name, look["label"])})
        if np.isfinite(values).all():
            for value, word in zip(values, ("before", "after"), strict=True):
                panel.axhline(factor * value, color=ink(), linewidth=1.6, linestyle=":", zorder=3)
                text = f"printed, {word}" if values[0] != values[1] else "printed"
                panel.annotate(text, (1, factor * value), textcoords="offset points", xytext=(2, 2), fontsize=8)
        panel.set(xlabel="scan", ylabel=unit, yscale="log")
        panel.set_xticks(x)
        plain_logarithm(panel.yaxis)
    figure.legend(*panels[1].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def innovations(t: Array, whitened: Array) -> Figure:
    """Whitened innovations (n, 2) of range and range-rate against time [s], the passes cut apart."""
    cut = int(np.argmax(np.diff(t))) + 1
    figure, panels = plt.subplots(1, 2, figsize=(7.2, 3.2), sharey=True, width_ratios=(1, 1))
    for k, (panel, part) in enumerate(zip(panels, (slice(0, cut), slice(cut, None)), strict=True)):
        for values, name, kind in zip(whitened[part].T, ("ekf", "prior"), ("range", "range-rate"), strict=True):
            panel.plot(t[part] / 3600, values, **method(name, "marker", linestyle="none", label=kind), markersize=3)
        panel.axhspan(-3, 3, color=METHODS["exact"].colour, alpha=0.2, linewidth=0)
        panel.set(xlabel="UTC [h]", title=f"pass {k + 1}")
        panel.locator_params(axis="x", nbins=5)
    panels[0].set_ylabel("innovation / sigma")
    panels[0].legend(loc="upper right")
    return figure


def covariance_history(t: Array, sigmas: Array) -> Figure:
    """Sigmas (n, 3) [m] of the position, smallest to largest principal axis, against the number of the measurement."""
    figure, axes = plt.subplots(figsize=(7.2, 3.3))
    labels = {"ekf": "radial (smallest axis)", "batch": "middle axis", "prior": "largest axis"}
    for values, (name, label) in zip(sigmas.T, labels.items(), strict=True):
        axes.plot(np.arange(1, len(t) + 1), values, **method(name, "linestyle", label=label))
    gap = int(np.argmax(np.diff(t))) + 1.5
    axes.axvline(gap, **method("neutral", linestyle=":", label="between the passes"))
    axes.set(xlabel="measurement", ylabel="sigma of the position [m]", yscale="log")
    axes.legend(loc="center right")
    return figure


def histogram(
    gains: Mapping[str, Array], printed: float, label: str, labels: Mapping[str, str] | None = None
) -> Figure:
    """Share of runs whose gain exceeds a value, for several estimators with their labels; printed: the paper's gain."""
    figure, axes = plt.subplots(figsize=(7.2, 3.5))
    for name, values in gains.items():
        look = method(name, "linestyle", "label")
        share = 1.0 - np.arange(len(values)) / len(values)
        axes.plot(np.sort(values), share, **look | {"label": (labels or {}).get(name, look["label"])})
    axes.axvline(printed, color=ink(), linestyle="--", linewidth=0.8, label="printed")
    axes.set(xscale="log", xlabel=label, ylabel="share of runs that gain more", ylim=(0, 1), xlim=(0.1, 1000))
    axes.legend()
    return figure


def divergence(t: Array, position: Array, velocity: Array) -> Figure:
    """Distance of the literal prediction from the integrated orbit [m] and its velocity [m/s] against time [s]."""
    figure, panels = plt.subplots(1, 2, figsize=(7.2, 3.2))
    panels[0].plot(t, position, **method("prior"))
    panels[1].plot(t, velocity, **method("ekf"))
    panels[0].set(xlabel="time [s]", ylabel="position error [m]")
    panels[1].set(xlabel="time [s]", ylabel="velocity error [m/s]")
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
        band(panel, t / 3600, *two_thirds(values), "ekf", label="16 to 84 % of runs")
        panel.plot(t / 3600, values[middle], **method("ekf", label="one run"))
        if name in printed:
            low, high = printed[name]
            panel.axhspan(low / 1e3, high / 1e3, **method("prior", label="printed"), alpha=0.5, linewidth=0)
        panel.set_ylabel(f"{name} [km]")
    for panel in panels[1]:
        panel.set_xlabel("UTC [h]")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure
