"""Figures 1 to 3 of the primary paper and what explains them: orbits, range-rate residuals, differentiators, filter
weights.

Every function takes plain arrays and returns a matplotlib Figure, drawn in the theme of `style.theme` that is in force.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from geokalman.constants import A_EARTH
from geokalman.grace.model import DAY, Array
from geokalman.style import METHODS, ink


def orbits_3d(A: Array, B: Array) -> Figure:
    """Figure 1: orbits of A and B in the inertial frame; A, B are (n, 3) positions [m]."""
    figure = plt.figure(figsize=(7.2, 4.0), layout="none")  # constrained layout does not know the extent of 3-D labels
    figure.subplots_adjust(left=0.0, right=0.94, bottom=0.05, top=0.95, wspace=0.08)
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 37), np.linspace(-np.pi / 2, np.pi / 2, 19))
    globe = A_EARTH / 1e6 * np.array([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)])
    for k, (name, position, method) in enumerate((("A", A, "ekf"), ("B", B, "newton"))):
        axes = figure.add_subplot(1, 2, k + 1, projection="3d")
        axes.plot_wireframe(*globe, color=METHODS["exact"].colour, linewidth=0.3, rstride=2, cstride=2, alpha=0.7)
        axes.plot(*(position.T / 1e6), color=METHODS[method].colour, linewidth=0.9)
        axes.set(
            xlabel="x [1000 km]", ylabel="y [1000 km]", zlabel="z [1000 km]", title=f"({'ab'[k]}) satellite {name}"
        )
        axes.set_box_aspect((1, 1, 1), zoom=0.95)
        for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
            axis.set_major_locator(MaxNLocator(4, integer=True))
            axis.set_pane_color((0, 0, 0, 0))
    return figure


def range_and_rate(t: Array, rho: Array, rate: Array) -> Figure:
    """Range [m] and range-rate [m/s] of the pair against time [s]."""
    figure, (upper, lower) = plt.subplots(2, 1, sharex=True)
    upper.plot(t / 3600, rho / 1e3, color=METHODS["truth"].colour)
    upper.set_ylabel("range [km]")
    lower.plot(t / 3600, rate, color=METHODS["truth"].colour)
    lower.set(xlabel="time [h]", ylabel="range-rate [m/s]")
    return figure


def node_gaps(days: Sequence[float], gaps: Sequence[float], n_max: int) -> Figure:
    """Largest gap between ascending nodes on the Earth [deg] after a number of days, and 180 deg / n_max."""
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    axes.semilogy(days, gaps, color=METHODS["truth"].colour, drawstyle="steps-post")
    axes.set(xlabel="length of the simulation [d]", ylabel="largest gap between nodes [deg]")
    ticks = [x for x in (0.5, 1, 2, 5, 10, 20, 50, 100, 200) if 0.5 * min(*gaps, 180 / n_max) <= x <= 2 * max(gaps)]
    axes.set_yticks(ticks, [f"{x:g}" for x in ticks])
    axes.minorticks_off()
    axes.axhline(
        180 / n_max, color=METHODS["neutral"].colour, linestyle=":", label=f"half a wavelength at degree {n_max}"
    )
    axes.legend()
    return figure


def residuals(t: Array, series: Mapping[str, Array], panels: Sequence[Sequence[str]]) -> Figure:
    """Figures 2 and 3: range-rate residuals against time, one panel for each group of methods.

    series: method -> (n,) residual [m/s]; t: (n,) [s]; panels: the methods drawn together, the first one at the back.
    """
    figure, axes = plt.subplots(
        len(panels), 1, sharex=True, sharey=True, squeeze=False, figsize=(7.2, 1.2 + 1.9 * len(panels))
    )
    for k, (axis, group) in enumerate(zip(axes[:, 0], panels, strict=True)):
        for name in group:
            method = METHODS[name]
            axis.plot(
                t / DAY, 1e6 * series[name], color=method.colour, linewidth=0.5, label=method.label, rasterized=True
            )
        axis.set_ylabel("residual [µm/s]")
        letter = f"({'abcdef'[k]}) " if len(panels) > 1 else ""
        axis.set_title(letter + " and ".join(METHODS[name].label for name in group), loc="left")
        legend = axis.legend(loc="upper right", ncols=len(group), bbox_to_anchor=(1, 1.18))
        for line in legend.get_lines():
            line.set_linewidth(2)
    axes[-1, 0].set_xlabel("time [d]")
    return figure


def transfer_functions(degree: Array, gains: Mapping[int, Array], dt: float) -> Figure:
    """Gain of central first derivatives at degree cycles per revolution; gains: points of the stencil -> (n,)."""
    figure, axes = plt.subplots(figsize=(7.2, 3.6))
    looks = itertools.cycle(METHODS[name] for name in ("neutral", "spline", "newton", "ekf", "ukf", "truth"))
    for look, (points, gain) in zip(looks, sorted(gains.items()), strict=False):
        axes.plot(degree, gain, color=look.colour, linestyle=look.line, label=f"{points} points")
    axes.axhline(1, color=ink(), linewidth=0.6)
    axes.set(
        xlabel="cycles per revolution", ylabel="gain", title=f"central first derivative at {dt:g} s", ylim=(0, 1.05)
    )
    axes.legend()
    return figure


def error_against_step(dts: Array, curves: Mapping[str, tuple[str, Array]]) -> Figure:
    """Error of derivatives against the sampling interval [s]; curves: label -> (unit group, (n,) standard
    deviation)."""
    groups = list(dict.fromkeys(unit for unit, _ in curves.values()))
    figure, axes = plt.subplots(1, len(groups), figsize=(7.2, 3.4), squeeze=False)
    styles = [METHODS[name] for name in ("newton", "ekf", "ukf", "spline")]
    for axis, unit in zip(axes[0], groups, strict=True):
        for k, (label, (_, values)) in enumerate(item for item in curves.items() if item[1][0] == unit):
            axis.loglog(
                dts, values, color=styles[k].colour, linestyle=styles[k].line, marker=styles[k].marker, label=label
            )
        axis.set(xlabel="sampling interval [s]", ylabel=f"standard deviation [{unit}]")
        axis.set_xticks(dts, [f"{x:g}" for x in dts])
        axis.minorticks_off()
        axis.legend()
    return figure


def weight_curve(lambdas: Array, rate_std: Array, los_std: Array, chosen: float, printed: float) -> Figure:
    """Range-rate [m/s] and line-of-sight acceleration [m/s^2] errors against lambda_q; `printed` is the paper's
    range-rate std."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.4))
    method = METHODS["ekf"]
    for axis, values, unit, scale in (
        (left, rate_std, "range-rate error [µm/s]", 1e6),
        (right, los_std, "acceleration error [nm/s²]", 1e9),
    ):
        axis.semilogx(lambdas, scale * values, color=method.colour, marker=method.marker, label="EKF, smoothed")
        axis.axvline(chosen, color=METHODS["neutral"].colour, linestyle=":", label=f"default, {chosen:g}")
        axis.set(xlabel=r"$\lambda_q = q h^5 / \sigma_r^2$", ylabel=f"std of {unit}")
    left.axhline(1e6 * printed, color=ink(), linewidth=0.8, linestyle="--", label="printed in Table 1")
    left.legend()
    right.legend()
    return figure


def literal_filter(t: Array, residual: Array, sigma: Array) -> Figure:
    """The causal filter's range-rate residual [m/s] with its own 3-sigma band: what Table 1 cannot be."""
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    method = METHODS["ekf"]
    axes.fill_between(
        t / 3600,
        -3e3 * sigma,
        3e3 * sigma,
        color=method.colour,
        alpha=0.25,
        linewidth=0,
        label="±3 sigma of the filter",
    )
    axes.plot(t / 3600, 1e3 * residual, color=method.colour, label="residual, no smoother")
    axes.axhline(0, color=ink(), linewidth=0.6)
    axes.set(xlabel="time [h]", ylabel="range-rate residual [mm/s]")
    figure.legend(loc="outside upper right", ncols=2)
    return figure


def dial(sigmas: Array, rate_std: Array, los_std: Array, chosen: float, printed: float) -> Figure:
    """Residual range-rate [m/s] and acceleration error [m/s^2] of the UKF against the sigma it assumes [m/s]."""
    figure, axes = plt.subplots(figsize=(7.2, 3.4))
    method, other = METHODS["ukf"], METHODS["spline"]
    (rate,) = axes.loglog(
        sigmas, rate_std, color=method.colour, marker=method.marker, label="range-rate residual [m/s]"
    )
    axes.axhline(printed, color=ink(), linewidth=0.8, linestyle="--")
    axes.annotate(
        "printed in Table 1 (mended)", (sigmas[0], printed), textcoords="offset points", xytext=(2, 4), fontsize=9
    )
    axes.axvline(chosen, color=METHODS["neutral"].colour, linestyle=":")
    axes.annotate(
        "default",
        (chosen, rate_std.min()),
        textcoords="offset points",
        xytext=(-4, 0),
        rotation=90,
        ha="right",
        fontsize=9,
    )
    axes.set(xlabel="assumed standard deviation of the range-rate [m/s]", ylabel="std of range-rate [m/s]")
    twin = axes.twinx()
    twin.grid(False)
    twin.spines["right"].set_visible(True)
    (los,) = twin.semilogx(
        sigmas, 1e9 * los_std, color=other.colour, linestyle=other.line, marker=other.marker,
        label="line-of-sight acceleration error [nm/s²]",
    )  # fmt: skip
    twin.set(ylabel="std of acceleration [nm/s²]", ylim=(0, 1.1e9 * los_std.max()))
    axes.set_ylim(top=1.6 * max(printed, rate_std.max()))
    figure.legend(handles=[rate, los], loc="outside upper center", ncols=2)
    return figure


def integrator_effect(rtols: Array, std: Array, mean: Array, reference: float, printed_mean: float) -> Figure:
    """Newton's range-rate residual [m/s] against the relative tolerance of RK45.

    reference: its standard deviation on the precise orbit; printed_mean: the mean in the paper's Table 1.
    """
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    method = METHODS["newton"]
    axes.loglog(rtols, std, color=method.colour, marker=method.marker, label="standard deviation")
    axes.loglog(rtols, np.abs(mean), color=METHODS["neutral"].colour, marker="v", linestyle=":", label="|mean|")
    axes.axhline(reference, color=ink(), linewidth=0.8, linestyle="--", label="standard deviation, precise orbit")
    axes.axhline(abs(printed_mean), color=ink(), linewidth=0.8, linestyle=":", label="|mean| printed in Table 1")
    axes.set(xlabel="relative tolerance of Runge-Kutta 4(5)", ylabel="residual [m/s]")
    axes.invert_xaxis()
    axes.legend()
    return figure
