"""Curves along lines, spectra, gains and errors.

Every function takes plain arrays and returns a matplotlib Figure, drawn in the theme of `style.theme` that is in force.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from geokalman.airborne.figures.names import NAMES
from geokalman.airborne.model import Array
from geokalman.style import METHODS, ink


class Panel(NamedTuple):
    """One line: title, x (n,), curves by method (n,) [mGal], and the smoother's standard deviation or None."""

    title: str
    x: Array
    curves: Mapping[str, Array]
    sigma: Array | None = None


def six_panels(panels: Sequence[Panel], labels: Mapping[str, str], xlabel: str = "time [s]") -> Figure:
    """Figures 6 to 11: gravity along each line; FB dashed with its 2-sigma band, forward dotted, reference solid."""
    rows = (len(panels) + 1) // 2
    figure, axes = plt.subplots(rows, min(2, len(panels)), figsize=(7.2, 0.9 + 2.1 * rows), squeeze=False)
    for axis in axes.ravel()[len(panels) :]:
        axis.set_visible(False)
    for axis, panel in zip(axes.ravel(), panels, strict=False):
        if panel.sigma is not None:
            centre = panel.curves["fb"]
            axis.fill_between(
                panel.x,
                centre - 2 * panel.sigma,
                centre + 2 * panel.sigma,
                color=METHODS["fb"].colour,
                alpha=0.25,
                linewidth=0,
            )
        for name, values in panel.curves.items():
            axis.plot(panel.x, values, label=labels[name], **_line(name))
        axis.set_title(panel.title, loc="left")
    for axis in axes[:, 0]:
        axis.set_ylabel("gravity [mGal]")
    for axis in axes.ravel()[max(0, len(panels) - 2) : len(panels)]:
        axis.set_xlabel(xlabel)
    handles, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=len(handles))
    return figure


def gauss_markov(
    lag: Array, covariance: Array, wavelength: Array, density: Array, t: Array, paths: Array, unit_lag: float
) -> Figure:
    """Third-order Gauss-Markov gravity: autocovariance, power density, sample paths; unit_lag is L/V [s]."""
    figure = plt.figure(figsize=(7.2, 5.2))
    grid = figure.add_gridspec(2, 2)
    left, right, below = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, :])
    left.plot(lag, covariance / covariance[0], **_line("fb"))
    left.axvline(unit_lag, linestyle=":", color=METHODS["neutral"].colour)
    left.axhline(np.exp(-1), linestyle=":", color=METHODS["neutral"].colour)
    left.annotate("L/V, 1/e", (unit_lag, np.exp(-1)), xytext=(5, 5), textcoords="offset points", fontsize=9)
    left.set(xlabel="lag [s]", ylabel="correlation", title="(a) autocorrelation")
    right.loglog(wavelength / 1e3, density, **_line("fb"))
    right.invert_xaxis()
    right.set(xlabel="wavelength [km]", ylabel="density [mGal²/Hz]", title="(b) power density")
    for k, path in enumerate(paths):
        below.plot(t, path, color=METHODS[("fb", "forward", "contractor")[k % 3]].colour, linewidth=1)
    below.set(xlabel="time [s]", ylabel="gravity [mGal]", title="(c) three sample paths")
    return figure


def steady(t: Array, forward: Array, smoother: Array, printed: tuple[float, float] | None = None) -> Figure:
    """Standard deviation of gravity [mGal] along a line: the filter settles, the smoother is better between the
    ends.
    """
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    axes.plot(t, forward, label=NAMES["forward"], **_line("forward"))
    axes.plot(t, smoother, label=NAMES["fb"], **_line("fb"))
    for value in printed or ():
        axes.axhline(value, color=ink(), linewidth=0.7, linestyle=(0, (1, 3)))
    axes.set(xlabel="time [s]", ylabel="standard deviation [mGal]", ylim=(0, 2.2 * forward[len(forward) // 2]))
    axes.legend()
    return figure


def table_one(means: Mapping[str, Array], printed: Mapping[str, float]) -> Figure:
    """Six-line means of D_raw of each run (runs,) by method, with the paper's printed means as dashed lines."""
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    for name, values in means.items():
        style = METHODS[name]
        axes.plot(
            np.arange(len(values)), values, color=style.colour, marker=style.marker, linestyle="", label=style.label
        )
        axes.axhline(values.mean(), color=style.colour, linewidth=1)
        axes.axhline(printed[name], color=style.colour, linewidth=1.2, linestyle="--")
        axes.annotate(
            f"printed\n{printed[name]}",
            (1.01, printed[name]),
            xycoords=("axes fraction", "data"),
            va="center",
            fontsize=8,
            annotation_clip=False,
        )
    axes.set(xlabel="simulated survey (seed)", ylabel="mean of six RMS [mGal]", ylim=(0, None))
    axes.set_xticks(np.arange(len(next(iter(means.values())))))
    axes.legend(loc="lower left")
    return figure


def starts(t: Array, errors: Mapping[str, Array], ratios: Mapping[str, Array]) -> Figure:
    """What the start of the backward pass does: difference to RTS [mGal] (log scale), and reported over true standard
    deviation.
    """
    figure, (upper, lower) = plt.subplots(2, 1, sharex=True, figsize=(7.2, 5.4))
    looks = dict(zip(errors, _looks(), strict=False))
    for name, values in errors.items():
        upper.semilogy(t, np.maximum(np.abs(values), 1e-13), label=name, linewidth=1, **looks[name])
    for name, values in ratios.items():
        lower.plot(t, values, label=name, linewidth=1, **looks[name])
    upper.set_ylabel("|difference| [mGal]")
    lower.set(xlabel="time [s]", ylabel="reported / right sigma", ylim=(0, 1.1))
    figure.legend(*upper.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def consistency(nis: Array, nees: Mapping[str, Array], bounds: Mapping[str, tuple[float, float]]) -> Figure:
    """Mean NIS and NEES of each line, with the band in which the mean over all lines lies with 95 %."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.2))
    number = np.arange(1, len(nis) + 1)
    left.axhspan(*bounds["nis"], color=METHODS["exact"].colour, alpha=0.3, linewidth=0)
    left.plot(number, nis, linestyle="", marker="o", color=METHODS["fb"].colour)
    left.axhline(1, color=ink(), linewidth=0.7)
    left.set(xlabel="line", ylabel="mean NIS", title="(a) innovations")
    for name, values in nees.items():
        style = METHODS[name]
        right.plot(number, values, linestyle="", marker=style.marker, color=style.colour, label=style.label)
    right.axhline(1, color=ink(), linewidth=0.7)
    right.set(xlabel="line", ylabel="mean NEES of gravity", title="(b) errors", yscale="log")
    figure.legend(*right.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def gains(
    wavelength: Mapping[str, Array], curves: Mapping[str, Mapping[str, Array]], delay: tuple[Array, Array]
) -> Figure:
    """Gain of smoothers and low-pass filters against wavelength [m], one panel a set; last the forward filter's delay
    [s].
    """
    figure, axes = plt.subplots(1, len(curves) + 1, figsize=(7.2, 3.4))
    looks = _looks()
    for axis, (title, group) in zip(axes, curves.items(), strict=False):
        for k, (name, gain) in enumerate(group.items()):
            axis.semilogx(wavelength[title] / 1e3, gain, label=name, linewidth=1.1, **looks[k % len(looks)])
        axis.set(xlabel="wavelength [km]", ylabel="gain", title=title)
        _plain_ticks(axis)
        axis.legend(fontsize=7)
    axes[-1].semilogx(delay[0] / 1e3, delay[1], **_line("forward"))
    axes[-1].set(xlabel="wavelength [km]", ylabel="delay [s]", title="delay, forward filter")
    _plain_ticks(axes[-1])
    return figure


def fir_scan(
    cutoffs: Array,
    scans: Mapping[str, Array],
    levels: Mapping[str, Mapping[str, float]],
    clean: Mapping[str, Array] | None = None,
) -> Figure:
    """Error of the FIR against its cutoff [s], one panel a preset, with the level of the filters as lines.

    clean : the same with ends that are cut instead of repeated.
    """
    figure, axes = plt.subplots(1, len(scans), figsize=(7.2, 3.4), squeeze=False)
    looks = _looks()
    for axis, (title, values) in zip(axes[0], scans.items(), strict=True):
        axis.plot(cutoffs, values, marker="o", color=METHODS["neutral"].colour, label="FIR low-pass, ends repeated")
        if clean is not None:
            axis.plot(cutoffs, clean[title], marker="s", linestyle="", color=ink(), label="FIR low-pass, clean ends")
        for k, (name, level) in enumerate(levels[title].items()):
            axis.axhline(level, label=name, **looks[k % len(looks)])
        axis.set(xlabel="cutoff of the FIR [s]", ylabel="sd against truth [mGal]", title=title, ylim=(0, None))
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def spectra(frequency: Array, densities: Mapping[str, Array]) -> Figure:
    """One-sided power densities [mGal^2/Hz] against frequency [Hz]."""
    figure, axes = plt.subplots(figsize=(7.2, 3.4))
    for (name, values), look in zip(densities.items(), _looks(), strict=False):
        axes.loglog(frequency[1:], values[1:], label=name, **look)
    axes.set(xlabel="frequency [Hz]", ylabel="power density [mGal²/Hz]")
    axes.legend()
    return figure


def per_line(
    names: Sequence[str], values: Mapping[str, Array], ylabel: str = "sd against ground gravity [mGal]"
) -> Figure:
    """One number a line for several methods."""
    figure, axes = plt.subplots(figsize=(7.2, 3.4))
    x = np.arange(len(names))
    for name, v in values.items():
        style = METHODS[name]
        axes.plot(
            x,
            v,
            color=style.colour,
            marker=style.marker,
            linestyle="-",
            linewidth=0.6,
            label=f"{style.label}, mean {np.mean(v):.3f}",
        )
    every = max(1, len(names) // 10)
    axes.set_xticks(x[::every], list(names)[::every], rotation=45, ha="right")
    axes.set(xlabel="line", ylabel=ylabel, ylim=(0, None))
    figure.legend(loc="outside upper center", ncols=2)
    return figure


def repeats(axis_m: Array, passes: Mapping[str, Array]) -> Figure:
    """Repeated passes over one line, (passes, points) [mGal] by product, and their standard deviation along it."""
    figure, axes = plt.subplots(len(passes) + 1, 1, sharex=True, figsize=(7.2, 1.5 + 1.8 * len(passes)))
    x = (axis_m - axis_m[0]) / 1e3
    for panel, (name, values) in zip(axes, passes.items(), strict=False):
        panel.plot(x, values.T, color=METHODS[name].colour, linewidth=0.6)
        panel.plot(x, values.mean(axis=0), color=ink(), linewidth=1.2)
        panel.set_ylabel("gravity [mGal]")
        panel.set_title(METHODS[name].label, loc="left")
        axes[-1].plot(x, values.std(axis=0, ddof=1), label=METHODS[name].label, **_line(name))
    axes[-1].set(xlabel="along the line [km]", ylabel="sd of passes [mGal]", ylim=(0, None))
    axes[-1].legend(ncols=2)
    return figure


def downward(wavelength_km: Array, factors: Mapping[str, Array]) -> Figure:
    """Factor by which downward continuation multiplies noise, against wavelength [km], for heights."""
    figure, axes = plt.subplots(figsize=(7.2, 3.0))
    for (name, values), look in zip(factors.items(), _looks(), strict=False):
        axes.loglog(wavelength_km, values, label=name, **look)
    axes.set(xlabel="wavelength [km]", ylabel="factor of the noise", ylim=(1, 100))
    _plain_ticks(axes)
    axes.legend()
    return figure


def timings(rates: Sequence[float], per_epoch: Mapping[str, Sequence[float]]) -> Figure:
    """Microseconds an epoch at several rates of the filter."""
    figure, axes = plt.subplots(figsize=(7.2, 3.0))
    for (name, values), look in zip(per_epoch.items(), _looks(), strict=False):
        axes.plot(rates, values, marker="o", label=name, **look)
    axes.set(xlabel="rate of the filter [Hz]", ylabel="time per epoch [µs]", xscale="log", ylim=(0, None))
    axes.set_xticks(list(rates), [f"{r:g}" for r in rates])
    axes.minorticks_off()
    figure.legend(loc="outside upper center", ncols=3)
    return figure


def _line(name: str) -> dict:
    style = METHODS[name]
    return {"color": style.colour, "linestyle": style.line, "linewidth": 1.2}


def _looks() -> list[dict]:
    names = ("fb", "forward", "contractor", "joint", "neutral", "exact")
    return [{"color": METHODS[n].colour, "linestyle": METHODS[n].line} for n in names]


def _plain_ticks(axis: Axes) -> None:
    ticks = [x for x in (3, 5, 10, 20, 40) if axis.get_xlim()[0] <= x <= axis.get_xlim()[1]]
    axis.set_xticks(ticks, [str(x) for x in ticks])
    axis.minorticks_off()
