"""Figures of the signal: timing, transition matrix, sky, ranging accuracy, real photons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from geokalman.pulsar.figures.flight import COLOURS
from geokalman.pulsar.model import Array
from geokalman.style import METHODS, ink


def timing_terms(days: Array, terms: Mapping[str, Array], names: Sequence[str], ylabels: Sequence[str]) -> Figure:
    """Draw terms of the timing model over time, a panel each; terms: title -> (n, pulsars)."""
    figure, panels = plt.subplots(len(terms), 1, sharex=True, figsize=(7.2, 1.0 + 1.8 * len(terms)))
    for panel, (title, values), ylabel in zip(np.atleast_1d(panels), terms.items(), ylabels, strict=True):
        for k, name in enumerate(names):
            style = METHODS[COLOURS[k % 7]]
            panel.plot(days, values[:, k], color=style.colour, linestyle=style.line, linewidth=1.1, label=name)
        panel.set_ylabel(ylabel)
        panel.set_title(title, loc="left")
        if (values > 0).all():
            panel.set_yscale("log")
    panel.set_xlabel("days after the epoch")
    figure.legend(*panel.get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def transition_errors(steps: Array, markley: Mapping[str, Array], integrated: Array) -> Figure:
    """Draw errors of transition matrices over 500 s against the substep [s].

    markley : block -> errors; integrated : of the block rv [s].
    """
    figure, axes = plt.subplots(figsize=(7.2, 3.6))
    units = {"rr": "", "rv": " [s]", "vr": " [1/s]", "vv": ""}
    for (name, values), key in zip(markley.items(), ("ekf", "aekf1", "aekf2", "ukf"), strict=True):
        style = METHODS[key]
        look = {"color": style.colour, "linestyle": style.line, "marker": style.marker or "o"}
        axes.loglog(steps, values, **look, label=f"Markley, {name}{units[name]}")
    axes.loglog(steps, integrated, color=METHODS["exact"].colour, linestyle=":", marker="x", label="integrated, rv [s]")
    axes.axvline(100.0, color=ink(), linewidth=0.7, linestyle="--", label="beyond: the code warns")
    axes.set(xlabel="substep [s]", ylabel="largest error (units: legend)")
    figure.legend(loc="outside upper center", ncols=3)
    return figure


def sky_map(ra: Array, dec: Array, sigma: Array, names: Sequence[str]) -> Figure:
    """Draw the pulsars on the sky, ra, dec [deg]; the larger the dot, the better sigma [m]."""
    figure = plt.figure(figsize=(7.2, 3.8))
    axes = figure.add_subplot(projection="mollweide")
    longitude = np.radians((np.asarray(ra) + 180.0) % 360.0 - 180.0)
    axes.scatter(longitude, np.radians(dec), s=900.0 / np.log10(sigma) ** 2.5, color=METHODS["ekf"].colour, alpha=0.85)
    for k, name in enumerate(names):
        axes.annotate(
            f"{name}, {sigma[k]:.0f} m", (longitude[k], np.radians(dec[k])), textcoords="offset points",
            xytext=(0, -16 if k == 4 else 9), fontsize=8, ha="center",
        )  # fmt: skip
    axes.set_xticks(np.radians([-120, -60, 0, 60, 120]), ["240°", "300°", "0°", "60°", "120°"])
    axes.set(xlabel="right ascension", ylabel="declination")
    return figure


def accuracy(durations: Array, sigma: Array, names: Sequence[str]) -> Figure:
    """Draw ranging accuracy [m] against the duration of an observation [s]; sigma (m, n)."""
    figure, axes = plt.subplots(figsize=(7.2, 3.4))
    for k, name in enumerate(names):
        style = METHODS[COLOURS[k % 7]]
        axes.loglog(durations, sigma[k], color=style.colour, linestyle=style.line, label=name)
    axes.axvline(500.0, color=ink(), linewidth=0.7, linestyle="--", label="500 s")
    axes.axhline(94.1, color=ink(), linewidth=0.7, linestyle=":", label="X error of the paper, 94.1 m")
    axes.set(xlabel="duration of an observation with 1 m² [s]", ylabel="accuracy of the range [m]")
    figure.legend(loc="outside upper center", ncols=4)
    return figure


def arrival_residuals(t: Array, residuals: Mapping[str, Array], sigma: Array) -> Figure:
    """Draw residuals of times of arrival [s], with formal errors sigma (n,) [s]."""
    figure, axes = plt.subplots(figsize=(7.2, 3.4))
    for k, ((label, values), key) in enumerate(zip(residuals.items(), ("aekf1", "exact", "ekf"), strict=False)):
        style = METHODS[key]
        axes.errorbar(
            t / 60 + 0.4 * (k - 1), 1e3 * values, yerr=1e3 * sigma, color=style.colour, linestyle=style.line,
            marker=style.marker or "o", capsize=3, label=label,
        )  # fmt: skip
    axes.axhline(0.0, color=ink(), linewidth=0.6)
    axes.set(xlabel="time after the first photon [min]", ylabel="arrival time residual [ms]")
    figure.legend(loc="outside upper center", ncols=3)
    return figure


def orbit_scale(scales: Array, power: Array, within: tuple[float, float]) -> Figure:
    """Draw Z_1^2 against the scale of the orbit, the range `within` one of the maximum shaded."""
    figure, axes = plt.subplots(figsize=(7.2, 3.0))
    axes.plot(scales, power, color=METHODS["ekf"].colour)
    axes.axvspan(*within, color=METHODS["ekf"].colour, alpha=0.2, linewidth=0, label="within 1 of the maximum")
    axes.axvline(1.0, color=ink(), linewidth=0.8, linestyle="--", label="the true orbit")
    axes.set(xlabel="scale of the orbit of RXTE", ylabel="$Z_1^2$ of all photons")
    axes.legend()
    return figure


def profiles(phases: Mapping[str, Array], bins: int = 32) -> Figure:
    """Draw pulse profiles over two turns with Poisson errors; phases: title -> (n,) [cycles]."""
    figure, panels = plt.subplots(len(phases), 1, sharex=True, figsize=(7.2, 0.8 + 1.6 * len(phases)))
    edges = np.arange(2 * bins + 1) / bins
    for panel, (title, phase), key in zip(np.atleast_1d(panels), phases.items(), COLOURS, strict=False):
        counts = np.tile(np.histogram(np.mod(phase, 1.0), bins, (0.0, 1.0))[0], 2)
        band = (np.repeat(counts + sign * np.sqrt(counts), 2) for sign in (-1, 1))
        panel.stairs(counts, edges, baseline=None, color=METHODS[key].colour, linewidth=1.3)
        panel.fill_between(np.repeat(edges, 2)[1:-1], *band, color=METHODS[key].colour, alpha=0.25, linewidth=0)
        panel.set(ylabel="photons", title=title)
        panel.set_ylim(bottom=0.0)
        panel.title.set(ha="left", x=0.0)
    panel.set_xlabel("pulse phase [cycles]")
    return figure
