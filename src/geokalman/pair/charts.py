"""Figures of single chapters: what a distance tells, matrices of a smoother, filters side by side.

Every function takes plain arrays and returns a matplotlib Figure, drawn in the theme of `style.theme` that is in force.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LinearSegmentedColormap, to_rgba
from matplotlib.figure import Figure

from geokalman.pair.figures import LOOKS, ellipse, looks
from geokalman.pair.model import Array
from geokalman.style import METHODS, SEQUENTIAL, ink, paper

_LOOK = {"EKF": "ekf", "iterated EKF": "newton", "UKF": "ukf"}


def banana(
    x: Array, y: Array, density: Array, series: Mapping[str, tuple[Array, Array]],
    points: Array | None = None, curve: Array | None = None,
) -> Figure:  # fmt: skip
    """A density in the plane, and Gaussians by their ellipses of two sigma.

    x (n,) radial [km]; y (m,) along-track less the measured range [m]; density (m, n); series : label -> (mean (2,),
    covariance (2, 2)) in these units; points (k, 2), curve (k, 2) : sigma points, and a closed curve of two sigma.
    """
    figure, axes = plt.subplots(figsize=(7.2, 4.2))
    shade = LinearSegmentedColormap.from_list("density", [to_rgba(paper()), to_rgba(METHODS["exact"].colour)])
    axes.pcolormesh(x, y, density, cmap=shade, shading="auto", rasterized=True)
    for name, (mean, cov) in series.items():
        ellipse(axes, mean, cov, METHODS[_LOOK.get(name, "neutral")], name)
    if points is not None:
        axes.plot(*points.T, "o", markersize=5, color=METHODS["ukf"].colour, label="sigma points")
    if curve is not None:
        axes.plot(*curve.T, color=METHODS["newton"].colour, linewidth=1.6, label="error state")
    axes.set(
        xlabel="radial position [km]", ylabel="along-track position\nless the range [m]",
        xlim=(x[0], x[-1]), ylim=(y[0], y[-1]),
    )  # fmt: skip
    axes.grid(False)
    axes.legend(ncols=4, loc="lower left", bbox_to_anchor=(0, 1))
    return figure


def matrices(series: Mapping[str, Array], label: str) -> Figure:
    """Square matrices (n, n) side by side, the size of their elements in shades; label : of the scale."""
    figure, axes = plt.subplots(1, len(series), squeeze=False, figsize=(7.2, 3.6))
    for axis, (title, matrix) in zip(axes[0], series.items(), strict=True):
        size = np.abs(matrix)
        shown = axis.imshow(np.where(size > 0, size, np.nan), cmap=SEQUENTIAL, vmin=0.0, vmax=1.0)
        axis.set(title=title, xlabel="unknown", ylabel="unknown")
        axis.grid(False)
    figure.colorbar(shown, ax=axes[0], label=label, shrink=0.8)
    return figure


def consistency(minutes: Array, series: Mapping[str, tuple[Array, float, float, float]]) -> Figure:
    """Mean normalised squares against time [min], a panel for each, with the band of a consistent filter.

    series : title -> (mean (n,), lower bound, upper bound, expectation).
    """
    figure, axes = plt.subplots(len(series), 1, sharex=True, squeeze=False, figsize=(7.2, 0.8 + 1.7 * len(series)))
    for axis, look, (title, (mean, low, high, expected)) in zip(axes[:, 0], looks(), series.items(), strict=False):
        axis.axhspan(low, high, color=look.colour, alpha=0.18, linewidth=0)
        axis.axhline(expected, color=ink(), linewidth=0.9, linestyle=":")
        axis.plot(minutes, mean, color=look.colour, linewidth=0.9)
        axis.set_title(title, loc="left")
        axis.set(ylabel="mean", ylim=(0, None))
    axes[-1, 0].set_xlabel("time [min]")
    return figure


def comparison(names: Sequence[str], series: Mapping[str, Mapping[str, Array]], levels: Mapping[str, float]) -> Figure:
    """Methods side by side: a row for each, a panel for each quantity, a marker for each world.

    names (n,) : methods; series : quantity with its unit -> world -> (n,); levels : quantity -> what is ideal there.
    """
    figure, axes = plt.subplots(
        1, len(series), squeeze=False, sharey=True, figsize=(7.2, 1.5 + 0.3 * len(names)), layout="constrained"
    )
    place = np.arange(len(names))
    for axis, (quantity, worlds) in zip(axes[0], series.items(), strict=True):
        for k, (world, values) in enumerate(worlds.items()):
            look = METHODS[LOOKS[k]]
            axis.plot(
                values, place + 0.18 * (k - 1), look.marker, color=look.colour, markersize=5.5, label=world,
                markerfacecolor="none" if k == 0 else look.colour,
            )  # fmt: skip
        if quantity in levels:
            axis.axvline(levels[quantity], color=ink(), linewidth=0.9, linestyle=":")
        axis.set(xscale="log", xlabel=quantity)
    axes[0, 0].set_yticks(place, names)
    axes[0, 0].invert_yaxis()
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, ncols=len(labels), loc="outside upper center")
    return figure


def playground(
    t: Array, truth: Array, seen: Array, course: tuple[Array, Array], gaussians: Mapping[str, tuple[Array, Array]],
    nis: Array, bounds: tuple[float, float],
) -> Figure:  # fmt: skip
    """A filter at a glance: its estimate above; below, one epoch before and after the update, and the innovations.

    t (n,) [s]; truth, seen (n,) [cm]; course : mean and sigma, (n,) each [cm]; gaussians : label -> (mean (2,),
    covariance (2, 2)) in cm and um/s; nis (n,), with the bounds of the values of a consistent filter.
    """
    figure, axes = plt.subplot_mosaic([["course", "course"], ["ellipse", "nis"]], figsize=(7.2, 5.6))
    (mean, sigma), look = course, METHODS["ekf"]
    above, left, right = axes["course"], axes["ellipse"], axes["nis"]
    above.fill_between(t / 60, mean - 2 * sigma, mean + 2 * sigma, color=look.colour, alpha=0.25, linewidth=0)
    above.plot(t / 60, truth, color=METHODS["truth"].colour, label="truth")
    above.plot(t / 60, seen, ".", color=METHODS["newton"].colour, label="GNSS")
    above.plot(t / 60, mean, color=look.colour, linestyle="--", label="estimate, two sigma")
    spread = np.concatenate([truth, seen[np.isfinite(seen)]])
    pad = 0.15 * np.ptp(spread)
    above.set(xlabel="time [min]", ylabel="separation [cm]", ylim=(spread.min() - pad, spread.max() + pad))
    above.legend(ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    for (label, (centre, cov)), name in zip(gaussians.items(), ("neutral", "ekf"), strict=True):
        ellipse(left, centre, cov, METHODS[name], label)
    left.set(xlabel="separation less\nthe predicted one [cm]", ylabel="rate less the\npredicted one [µm/s]")
    left.autoscale_view()
    left.legend(ncols=2, loc="lower left", bbox_to_anchor=(0, 1))
    right.axhspan(*bounds, color=look.colour, alpha=0.2, linewidth=0)
    right.semilogy(t / 60, nis, ".", color=look.colour)
    right.set(xlabel="time [min]", ylabel="NIS", ylim=(min(1e-2, nis.min()), max(1e2, nis.max())))
    return figure
