"""Figures that several chapters share: series with their bands, densities and ellipses.

Every function takes plain arrays and returns a matplotlib Figure, drawn in the theme of `style.theme` that is in force.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from geokalman.pair.model import Array
from geokalman.style import METHODS, MethodStyle, ink

LOOKS = ("ekf", "newton", "ukf", "spline", "neutral", "rts")
"""Methods of `style.METHODS` whose colours and lines the series of a figure take in turn."""


def looks() -> Iterator[MethodStyle]:
    """Give the looks in turn, for ever."""
    return itertools.cycle(METHODS[name] for name in LOOKS)


def filtered(
    t: Array, truth: Array, seen: Array, mean: Array, sigma: Array, labels: Sequence[str],
    names: Sequence[str] = ("observed", "filter"),
) -> Figure:  # fmt: skip
    """A quantity above, its observations and its estimate; below, the error of both with the band of two sigma.

    t (n,) [s]; truth, seen (NaN where missing), mean, sigma (n,); labels : of the upper and of the lower axis;
    names : of what is seen and of the estimate.
    """
    figure, (upper, lower) = plt.subplots(2, 1, sharex=True, figsize=(7.2, 4.8))
    look = METHODS["ekf"]
    upper.plot(t / 60, truth, color=METHODS["truth"].colour, label="truth")
    upper.plot(t / 60, seen, ".", color=METHODS["newton"].colour, label=names[0])
    upper.plot(t / 60, mean, color=look.colour, linestyle="--", label=names[1])
    upper.set_ylabel(labels[0])
    upper.legend(ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    lower.plot(t / 60, seen - truth, ".", color=METHODS["newton"].colour, label=names[0])
    band(lower, t, mean - truth, sigma, look, names[1])
    lower.set(xlabel="time [min]", ylabel=labels[1])
    lower.legend(ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    return figure


def band(axes: Axes, t: Array, error: Array, sigma: Array, look: MethodStyle, label: str) -> None:
    """Draw an error (n,) over the band of plus and minus two sigma (n,) against time [s]."""
    axes.fill_between(t / 60, -2 * sigma, 2 * sigma, color=look.colour, alpha=0.22, linewidth=0, label="two sigma")
    axes.plot(t / 60, error, color=look.colour, linewidth=1.1, label=label)


def errors(
    t: Array, series: Mapping[str, tuple[Array, Array]], ylabel: str, limits: Mapping[str, float] | None = None
) -> Figure:
    """One panel for each estimator: its error and its band of two sigma.

    t (n,) [s]; series : title -> (error, sigma), each (n,); ylabel : with the unit; limits : title -> half height of
    its panel (the others have that of their data).
    """
    figure, axes = plt.subplots(len(series), 1, sharex=True, squeeze=False, figsize=(7.2, 0.9 + 1.75 * len(series)))
    for axis, look, (title, (error, sigma)) in zip(axes[:, 0], looks(), series.items(), strict=False):
        band(axis, t, error, sigma, look, title)
        axis.set_title(title, loc="left")
        axis.set_ylabel(ylabel)
        if limits and title in limits:
            axis.set_ylim(-limits[title], limits[title])
    axes[-1, 0].set_xlabel("time [min]")
    return figure


def cloud(t: Array, series: Array, sigma: Array, ylabel: str) -> Figure:
    """Many realisations (k, n) against time [s] (n,), over plus and minus two of their predicted sigma (n,)."""
    figure, axes = plt.subplots(figsize=(7.2, 3.6))
    look = METHODS["ekf"]
    axes.plot(t / 60, series.T, color=look.colour, linewidth=0.5, alpha=0.5)
    for sign in (-2.0, 2.0):
        axes.plot(t / 60, sign * sigma, color=ink(), linewidth=1.6, label="two sigma, predicted" if sign > 0 else None)
    axes.set(xlabel="time [min]", ylabel=ylabel)
    axes.legend()
    return figure


def curves(
    x: Array, series: Mapping[str, Array], xlabel: str, ylabel: str, log: str = "", level: float | None = None
) -> Figure:
    """Curves against a common x (n,); log : the axes that are logarithmic, of x and y; level : a line across."""
    figure, axes = plt.subplots(figsize=(7.2, 3.4))
    for look, (name, y) in zip(looks(), series.items(), strict=False):
        axes.plot(x, y, color=look.colour, linestyle=look.line, label=name)
    if level is not None:
        axes.axhline(level, color=ink(), linewidth=0.8, linestyle=":")
    axes.set(xlabel=xlabel, ylabel=ylabel)
    if "x" in log:
        axes.set_xscale("log")
    if "y" in log:
        axes.set_yscale("log")
        low, high = axes.get_ylim()
        if high < 100 * low:  # too few powers of ten to read from
            ticks = [m * 10.0**k for k in range(-30, 30) for m in (1, 2, 5) if low <= m * 10.0**k <= high]
            axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
            axes.minorticks_off()
    axes.legend()
    return figure


def densities(x: Array, series: Mapping[str, tuple[float, float]], xlabel: str) -> Figure:
    """Normal densities at x (n,); series : label -> (mean, standard deviation), in the unit of x."""
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    for look, (name, (mean, sigma)) in zip(looks(), series.items(), strict=False):
        y = np.exp(-0.5 * ((x - mean) / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))
        axes.plot(x, y, color=look.colour, linestyle=look.line, label=name)
        axes.fill_between(x, y, color=look.colour, alpha=0.12, linewidth=0)
    axes.set(xlabel=xlabel, ylabel="probability density", ylim=(0, None))
    axes.legend()
    return figure


def ellipse(axes: Axes, mean: Array, cov: Array, look: MethodStyle, label: str = "", scale: float = 2.0) -> None:
    """Draw the ellipse of `scale` standard deviations of a Gaussian in two dimensions; mean (2,), cov (2, 2)."""
    values, vectors = np.linalg.eigh(cov)
    angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
    minor, major = 2.0 * scale * np.sqrt(np.maximum(values, 0.0))
    patch = Ellipse(
        (float(mean[0]), float(mean[1])), float(major), float(minor), angle=float(angle), fill=False, linewidth=1.6,
        edgecolor=look.colour, linestyle=look.line, label=label or None,
    )  # fmt: skip
    axes.add_patch(patch)
    axes.plot(*mean, "+", color=look.colour)


def ellipses(series: Mapping[str, tuple[Array, Array]], xlabel: str, ylabel: str) -> Figure:
    """Ellipses of two sigma; series : label -> (mean (2,), covariance (2, 2)), in the units of the labels."""
    figure, axes = plt.subplots(figsize=(7.2, 4.0))
    for look, (name, (mean, cov)) in zip(looks(), series.items(), strict=False):
        ellipse(axes, mean, cov, look, name)
    axes.set(xlabel=xlabel, ylabel=ylabel)
    axes.autoscale_view()
    axes.legend()
    return figure
