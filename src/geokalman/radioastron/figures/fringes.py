"""Figures of the correlator: fringe-rate and delay planes, SNR of scans, what a drifting delay costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from geokalman.radioastron.correlator import Plane
from geokalman.radioastron.figures.drawing import band, method, plain_logarithm, two_thirds
from geokalman.radioastron.figures.names import ORBITS
from geokalman.radioastron.model import Array
from geokalman.style import METHODS, SEQUENTIAL, ink


def planes(both: Sequence[Plane], titles: Sequence[str], width: tuple[float, float]) -> Figure:
    """Figure 1: amplitude over the fringe-rate [Hz] and delay [s] plane for two orbits.

    Above, the largest amplitude over all delays against fringe rate; below, the plane about each peak, to one scale.
    width: (fringe rate [Hz], delay [s]) of the windows below.
    """
    figure, panels = plt.subplot_mosaic("aa;bc", figsize=(7.2, 5.4), height_ratios=(1, 1.4))
    top = max(p.snr.max() for p in both)
    for p, title, name, place in zip(both, titles, ("prior", "ekf"), "bc", strict=True):
        i, j = np.unravel_index(int(p.snr.argmax()), p.snr.shape)
        rows, columns = np.abs(p.rates - p.rates[i]) <= 0.5 * width[0], np.abs(p.delays - p.delays[j]) <= 0.5 * width[1]
        near, panel = np.abs(p.rates) <= 0.5, panels[place]
        panels["a"].plot(p.rates[near], p.snr.max(axis=1)[near], **method(name, label=title), linewidth=0.8)
        mesh = panel.pcolormesh(
            1e6 * p.delays[columns], p.rates[rows], p.snr[np.ix_(rows, columns)], cmap=SEQUENTIAL, vmin=0, vmax=top,
            shading="nearest", rasterized=True,
        )  # fmt: skip
        peak = f"{p.rates[i]:.2f} Hz, {1e6 * p.delays[j]:.2f} µs, SNR {p.snr[i, j]:.1f}"
        panel.set(xlabel="delay [µs]", ylabel="fringe rate [Hz]", title=f"{title}\n{peak}")
        panel.grid(False)
    panels["a"].set(xlabel="fringe rate [Hz]", ylabel="largest amplitude [SNR]")
    panels["a"].legend()
    figure.colorbar(mesh, ax=[panels["b"], panels["c"]], label="amplitude [SNR]")
    return figure


def scan_snr(
    snr: Mapping[str, Array],
    printed: Mapping[str, tuple[float, float]],
    flagged: Sequence[int] = (),
    labels: Mapping[str, str] | None = None,
) -> Figure:
    """Figures 2(a), 3 and 4(a): SNR of the scans, (scans,) or (runs, scans), with their median.

    printed: name -> range; flagged: scans left out. The band holds 16 to 84 % of the runs, or all where they are
    fewer than ten.
    """
    figure, axes = plt.subplots(figsize=(7.2, 3.4))
    for name, values in snr.items():
        values = np.atleast_2d(values).astype(float)
        values[:, list(flagged)] = np.nan
        x = np.arange(1, values.shape[1] + 1)
        if len(values) > 1:
            ends = two_thirds(values) if len(values) >= 10 else (values.min(axis=0), values.max(axis=0))
            band(axes, x, *ends, name, where=~np.isnan(values).any(axis=0))
        look = method(name, "linestyle", "marker", "label")
        axes.plot(x, np.median(values, axis=0), **look | {"label": (labels or {}).get(name, look["label"])})
    for k, (name, (low, high)) in enumerate(printed.items()):
        label = f"printed, {ORBITS[name]}" if k < 2 else None
        axes.axhspan(low, high, **method(name, label=label), alpha=0.15, linewidth=0, hatch="//")
    for k in flagged:
        axes.annotate(
            "no fringe in print", (k + 1, 0.05), xycoords=("data", "axes fraction"), rotation=90, ha="center",
            va="bottom", fontsize=9,
        )  # fmt: skip
    axes.set(xlabel="scan", ylabel="SNR")
    axes.set_xticks(x)
    figure.legend(loc="outside upper center", ncols=4)
    return figure


def losses(rates: Array, curves: Mapping[str, Array], printed: Sequence[float]) -> Figure:
    """Coherence (n,) against the residual delay rate [s/s] for several bands; printed: the rates of both orbits."""
    figure, axes = plt.subplots(figsize=(7.2, 3.4))
    for name, (label, values) in zip(("ekf", "prior", "batch", "naive"), curves.items(), strict=False):
        axes.plot(1e10 * rates, values, **method(name, "linestyle", "marker", label=label))
    for k, value in enumerate(printed):
        axes.axvline(1e10 * value, color=ink(), linestyle=":", linewidth=1.6, label="printed rates" if k == 0 else None)
    axes.set(xlabel="residual delay rate [1e-10 s/s]", ylabel="SNR / SNR without residual", ylim=(0, 1.05))
    axes.legend()
    return figure


def ratio_histogram(ratios: Array, printed: float, label: str) -> Figure:
    """Ratio of SNR, filter over a-priori orbit, sorted over runs; printed: the paper's."""
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    share = (np.arange(len(ratios)) + 0.5) / len(ratios)
    axes.plot(np.sort(ratios), share, **method("ekf", "marker", linestyle="-", label="simulated runs"))
    axes.axvline(printed, color=ink(), linestyle="--", linewidth=0.8, label="printed")
    axes.axhspan(0.16, 0.84, color=METHODS["exact"].colour, alpha=0.15, linewidth=0, label="16 to 84 %")
    axes.set(xscale="log", xlabel=label, ylabel="share of runs below", ylim=(0, 1))
    plain_logarithm(axes.xaxis)
    axes.legend(loc="lower right")
    return figure
