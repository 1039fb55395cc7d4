"""Figures 1 to 6 of the paper and what explains them: plain arrays in, a matplotlib Figure out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from geokalman.attitude.model import AXES, Array
from geokalman.attitude.pointing import asd
from geokalman.style import METHODS, MethodStyle, ink

MOST_POINTS = 4000
ROW = 100.0
"""Widths of characters that a row of a legend holds."""

NAMES: dict[str, str] = {
    "akf7": "additive filter",
    "akf7_iso": "additive filter, isotropic R",
    "mekf": "multiplicative filter",
    "rts": "smoother",
    "jpl_like": "official product (stand-in)",
    "imu": "gyros",
    "sca1": "camera 1",
    "sca2": "camera 2",
    "sca3": "camera 3",
    "sca12": "cameras 1 and 2",
    "sca13": "cameras 1 and 3",
    "sca23": "cameras 2 and 3",
    "sca123": "all three cameras",
}
"""What readers call a filter or a choice of cameras, in tables, legends and captions alike."""


def _look(name: str) -> MethodStyle:
    """How a filter or a camera is drawn and called; the smoother here is that of the multiplicative filter."""
    look = METHODS["mekf_rts" if name == "rts" else name]
    return look._replace(label=NAMES.get(name, look.label))


def _columns(labels: Sequence[str]) -> int:
    """Columns of a legend above a figure, as many as its width holds."""
    for n in range(min(len(labels), 4), 1, -1):
        columns = np.array_split([len(label) + 9 for label in labels], n)
        if sum(column.max() for column in columns) <= ROW:
            return n
    return 1


def _thin(n: int) -> int:
    return max(1, n // MOST_POINTS)


def series_and_spectra(
    t: Array, series: Mapping[str, Array], dt: float, unit: str, scale: float, rows: Sequence[str] = AXES,
    show_s: float = 0.0,
    band: tuple[float, float] | None = None, labels: Mapping[str, str] | None = None, segment_s: float = 2048.0,
) -> Figure:  # fmt: skip
    """One row per component: series against time on the left, its amplitude spectral density on the right.

    series : method -> (n, k) with k = len(rows), in SI; scale : factor to `unit`; show_s : span of the left panels [s],
    0 for all; band : frequencies shaded on the right; labels : of methods that are not to be called by their own;
    segment_s : of the spectrum [s], which starts at its inverse. Gaps (NaN) are bridged for the spectrum only.
    """
    figure, axes = plt.subplots(len(rows), 2, figsize=(7.2, 1.6 + 1.65 * len(rows)), sharex="col", squeeze=False)
    shown = (t - t[0] <= show_s) if show_s else np.ones(len(t), bool)
    for name, values in series.items():
        method = _look(name)
        values = values.reshape(len(t), len(rows))
        label = (labels or {}).get(name, method.label)
        f, density = asd(_bridged(values), dt, segment_s)
        k = _thin(int(shown.sum()))
        for row in range(len(rows)):
            axes[row, 0].plot(
                t[shown][::k] / 3600, scale * values[shown, row][::k], color=method.colour, linewidth=0.6,
                rasterized=True,
            )  # fmt: skip
            axes[row, 1].loglog(f, scale * density[:, row], color=method.colour, linewidth=0.9, label=label)
    for row, word in enumerate(rows):
        axes[row, 0].set_ylabel(f"{word} [{unit}]")
        axes[row, 1].set_ylabel(f"ASD [{unit}/√Hz]")
        if band:
            axes[row, 1].axvspan(*band, color=METHODS["neutral"].colour, alpha=0.15, linewidth=0)
    axes[-1, 0].set_xlabel("time [h]")
    axes[-1, 1].set_xlabel("frequency [Hz]")
    handles, shown_labels = axes[0, 1].get_legend_handles_labels()
    legend = figure.legend(handles, shown_labels, loc="outside upper center", ncols=_columns(shown_labels))
    for line in legend.get_lines():
        line.set_linewidth(2)
    return figure


def _bridged(values: Array) -> Array:
    out = np.array(values)
    k = np.arange(len(out))
    for column in out.T:
        gap = np.isnan(column)
        if gap.any() and not gap.all():
            column[gap] = np.interp(k[gap], k[~gap], column[~gap])
    return out


def bars(
    groups: Mapping[str, Sequence[float]], errors: Mapping[str, Sequence[float]], ylabel: str,
    printed: Mapping[str, Sequence[float]] | None = None, names: Sequence[str] = AXES,
) -> Figure:  # fmt: skip
    """Bars per axis for several methods with their spread over runs; the paper's numbers as dashes beside them.

    groups, errors, printed : method -> (len(names),) in the unit of the label.
    """
    figure, axes = plt.subplots(figsize=(7.2, 3.6))
    width = 0.8 / len(groups)
    for k, (name, values) in enumerate(groups.items()):
        method = _look(name)
        x = np.arange(len(names)) + (k - 0.5 * (len(groups) - 1)) * width
        axes.bar(
            x, values, width * 0.9, yerr=errors.get(name), color=method.colour, label=method.label, ecolor=ink(),
            capsize=2,
        )  # fmt: skip
        if printed and name in printed:
            axes.hlines(
                printed[name], x - 0.45 * width, x + 0.45 * width, color=ink(), linestyle="--", linewidth=1.4,
                label="printed" if "printed" not in axes.get_legend_handles_labels()[1] else None,
            )  # fmt: skip
    handles, labels = axes.get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda k: labels[k] == "printed")
    axes.set_axisbelow(True)
    axes.set_xticks(range(len(names)), names)
    axes.set_ylabel(ylabel)
    labels = [labels[k] for k in order]
    figure.legend([handles[k] for k in order], labels, loc="outside upper center", ncols=_columns(labels))
    return figure


def closeness_and_accuracy(points: Mapping[str, Sequence[tuple[str, float, float, float]]]) -> Figure:
    """Error of the attitude [rad] against closeness to the gyro [rad/s], one marker per filter, a panel per preset.

    points : preset -> (method, std of rate minus gyro rate, rms of the attitude error against the truth, its spread
    over runs).
    """
    figure, axes = plt.subplots(1, len(points), figsize=(7.2, 3.6), sharey=True, squeeze=False)
    words = "rate minus gyro rate, std [10⁻⁷ rad/s]" if len(points) < 3 else "difference [10⁻⁷ rad/s]"
    for axis, (preset, group) in zip(axes[0], points.items(), strict=True):
        for name, closeness, accuracy, spread in group:
            method = _look(name)
            axis.errorbar(
                1e7 * closeness, 1e6 * accuracy, 1e6 * spread, fmt=method.marker, color=method.colour, markersize=8,
                capsize=3, label=method.label,
            )  # fmt: skip
        widest = max(closeness for _, closeness, _, _ in group)
        axis.set(xlabel=words, title=preset, xlim=(0, 1.1e7 * widest))
    axes[0, 0].set_ylabel("attitude error, rms [µrad]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=_columns(labels))
    return figure


def consistency(
    t: Array, nis: Mapping[str, Array], nees: Mapping[str, Array], window: int, bounds: tuple[float, float]
) -> Figure:
    """Running means of NIS/3 and NEES/3 over `window` epochs; bounds : 95 % of independent means."""
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7.2, 4.4))
    for axis, group, label in ((axes[0], nis, "NIS / 3"), (axes[1], nees, "NEES / 3")):
        for name, values in group.items():
            method = _look(name)
            good = np.isfinite(values)
            weight = np.convolve(good, np.ones(window), "valid")
            mean = np.convolve(np.where(good, values, 0.0), np.ones(window), "valid") / np.maximum(weight, 1) / 3
            k = _thin(len(mean))
            axis.plot(
                t[window // 2 : window // 2 + len(mean)][::k] / 3600, mean[::k], color=method.colour,
                linestyle=method.line, label=method.label,
            )  # fmt: skip
        axis.axhspan(*bounds, color=METHODS["neutral"].colour, alpha=0.25, linewidth=0, label="95 % if independent")
        axis.set_ylabel(label)
    axes[1].set_xlabel("time [h]")
    handles, labels = axes[0].get_legend_handles_labels()
    extra = [pair for pair in zip(*axes[1].get_legend_handles_labels(), strict=True) if pair[1] not in labels]
    labels += [text for _, text in extra]
    figure.legend(handles + [h for h, _ in extra], labels, loc="outside upper center", ncols=_columns(labels))
    return figure


def weights(ks: Sequence[float], errors: Array, true_k: float) -> Figure:
    """Error of the three-camera combination (m, 3) [rad] against the assumed anisotropy k (m,)."""
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    for i, (word, method) in enumerate(zip(AXES, ("sca1", "sca2", "sca3"), strict=True)):
        axes.loglog(ks, 1e6 * errors[:, i], color=METHODS[method].colour, marker=METHODS[method].marker, label=word)
    axes.axvline(true_k, color=ink(), linestyle=":", linewidth=0.9)
    axes.annotate("simulated", (true_k, 1e6 * errors.max()), textcoords="offset points", xytext=(4, -8), fontsize=9)
    axes.set(
        xlabel="assumed ratio k of the noise about the boresight to that across it",
        ylabel="rms error of all three [µrad]",
    )
    axes.set_xticks(list(ks), [f"{k:g}" for k in ks])
    axes.minorticks_off()
    axes.set_yticks([15, 20, 30, 50, 80], ["15", "20", "30", "50", "80"])
    axes.legend()
    return figure


def gyro_chain(
    t: Array, wrapped: Array, unwrapped: Array, t_parity: Array, parity: Array, limit: float, around_s: float = 600.0
) -> Figure:
    """Filtered angle [deg] as it comes and unwrapped, and its parity residual (m,) [rad].

    limit : size that the residual of a sound axis does not exceed for 1 s; around_s : span shown around the first wrap.
    """
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(7.2, 4.8))
    jumps = np.flatnonzero(np.abs(np.diff(wrapped)) > 5000.0)
    middle = t[jumps[0]] if len(jumps) else t[0] + around_s
    near = np.abs(t - middle) <= around_s
    k = _thin(int(near.sum()))
    upper.plot(
        t[near][::k] / 60, wrapped[near][::k], ".", markersize=2, color=METHODS["sca2"].colour, label="as it comes"
    )
    upper.plot(t[near][::k] / 60, unwrapped[near][::k], color=METHODS["sca1"].colour, label="unwrapped")
    upper.set(xlabel="time [min]", ylabel="filtered angle [deg]")
    k = _thin(len(t_parity))
    lower.plot(t_parity[::k] / 3600, 1e9 * parity[::k], color=METHODS["neutral"].colour, linewidth=0.4, rasterized=True)
    for sign in (-1, 1):
        lower.axhline(
            sign * 1e9 * limit, color=ink(), linestyle="--", linewidth=0.9,
            label="fault, if beyond for 1 s" if sign > 0 else None,
        )  # fmt: skip
    lower.set(xlabel="time [h]", ylabel="parity residual [nrad]")
    pairs = [pair for axis in (upper, lower) for pair in zip(*axis.get_legend_handles_labels(), strict=True)]
    legend = figure.legend(*map(list, zip(*pairs, strict=True)), loc="outside upper center", ncols=3)
    for handle in legend.legend_handles:
        handle.set_markersize(6)
    return figure


def gap(t: Array, error: Mapping[str, Array], sigma: Mapping[str, Array], start: float, length: float) -> Figure:
    """Attitude error (n, 3) [rad] of filter and smoother around a gap of all cameras, with 2-sigma bands (n, 3)."""
    figure, axes = plt.subplots(3, 1, sharex=True, figsize=(7.2, 5.2))
    for i, axis in enumerate(axes):
        for name in error:
            method = _look(name)
            axis.plot(t - start, 1e6 * error[name][:, i], color=method.colour, linewidth=0.9, label=method.label)
            axis.fill_between(
                t - start, -2e6 * sigma[name][:, i], 2e6 * sigma[name][:, i], color=method.colour, alpha=0.18,
                linewidth=0,
            )  # fmt: skip
        axis.axvspan(0, length, color=METHODS["neutral"].colour, alpha=0.12, linewidth=0)
        axis.set_ylabel(f"{AXES[i]} error [µrad]")
    axes[-1].set_xlabel("time after the last camera [s]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def settling(t: Array, angle: Mapping[str, Array]) -> Figure:
    """Angle of the attitude error [rad] after a wrong start, per starting angle."""
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    looks = (("mekf", "-"), ("akf7", "-"), ("mekf", "--"), ("akf7", "--"), ("neutral", ":"), ("neutral", "-."))
    for (word, values), (method, line) in zip(angle.items(), looks, strict=False):
        axes.semilogy(t, values, color=METHODS[method].colour, linestyle=line, label=word)
    axes.set(xlabel="time after the start [s]", ylabel="attitude error [rad]")
    axes.legend()
    return figure


def mean_changes(groups: Mapping[str, Sequence[float]], expected: Mapping[str, float], printed: float) -> Figure:
    """Change of the mean attitude [rad] per axis, that expected in pitch, and the size printed."""
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    for k, (satellite, values) in enumerate(groups.items()):
        method = METHODS[("sca1", "sca2")[k]]
        axes.bar(
            np.arange(3) + (k - 0.5) * 0.35, 1e3 * np.asarray(values), 0.32, color=method.colour,
            label=f"GRACE-{satellite}",
        )  # fmt: skip
        axes.hlines(
            1e3 * expected[satellite], 1 + (k - 0.5) * 0.35 - 0.16, 1 + (k - 0.5) * 0.35 + 0.16, color=ink(),
            linestyle="--", label="shift × orbit rate" if k == 0 else None,
        )  # fmt: skip
    for sign in (-1, 1):
        axes.hlines(
            sign * 1e3 * printed, 0.6, 1.4, color=METHODS["neutral"].colour, linestyle=":",
            label="printed, no sign given" if sign > 0 else None,
        )  # fmt: skip
    axes.axhline(0, color=ink(), linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_xticks(range(3), AXES)
    axes.set_ylabel("change of the mean [mrad]")
    axes.legend()
    return figure
