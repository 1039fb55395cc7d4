"""Figures of the orbit: from two sides, over the ground, above the horizon."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from geokalman.constants import A_EARTH
from geokalman.data import natural_earth_dir
from geokalman.radioastron.figures.drawing import method
from geokalman.radioastron.model import Array
from geokalman.style import METHODS, ink, paper


def orbit_view(orbit: Array, arcs: Mapping[str, Array], source: Array) -> Figure:
    """The orbit (n, 3) [m] in its own plane and seen edge-on, with arcs: name -> (k, 3) parts of it.

    source (3,): unit vector to the source.
    """
    normal = np.cross(orbit[0], orbit[len(orbit) // 8])
    normal /= np.linalg.norm(normal)
    perigee = orbit[np.argmin(np.linalg.norm(orbit, axis=1))]
    x = perigee / np.linalg.norm(perigee)
    axes = np.array([x, np.cross(normal, x), normal])
    names = "towards perigee", "along the motion", "out of the plane"
    figure, panels = plt.subplots(1, 2, figsize=(7.2, 3.6))
    for panel, pair in zip(panels, ([0, 1], [0, 2]), strict=True):
        panel.plot(*axes[pair] @ orbit.T / 1e6, **method("exact"), linewidth=0.9)
        for name, (label, arc) in zip(("ekf", "batch", "prior"), arcs.items(), strict=False):
            panel.plot(*axes[pair] @ arc.T / 1e6, **method(name, label=label), linewidth=4, solid_capstyle="round")
        if pair[1] == 1:
            panel.add_patch(plt.Circle((0, 0), A_EARTH / 1e6, color=METHODS["exact"].colour, linewidth=0))
        else:
            panel.plot(0.0, 0.0, **method("exact", marker="o", linestyle="none"), markersize=4)
        ray = np.outer(axes[pair] @ source, [0.0, 150.0])
        panel.plot(*ray, **method("neutral", linestyle=":", label="to the source"))
        across, up = (f"{names[k]} [1000 km]" for k in pair)
        panel.set(xlabel=across, ylabel=up, aspect="equal")
    panels[0].set_title("in its plane", loc="left")
    panels[1].set_title("edge-on, the same scale", loc="left")
    panels[1].set(ylim=(-80.0, 80.0))
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def ground_track(longitude: Array, latitude: Array, stations: Mapping[str, tuple[float, float]]) -> Figure:
    """Ground track [deg], and stations: name -> (longitude, latitude) [deg]."""
    import cartopy
    import cartopy.crs as ccrs

    cartopy.config["pre_existing_data_dir"] = str(natural_earth_dir())
    plain = ccrs.PlateCarree()
    figure, axes = plt.subplots(figsize=(7.2, 3.9), subplot_kw={"projection": plain})
    axes.set_global()
    axes.coastlines(resolution="110m", linewidth=0.5, color=METHODS["exact"].colour)
    jump = np.flatnonzero(np.abs(np.diff(longitude)) > 180) + 1
    track = (np.insert(values, jump, np.nan) for values in (longitude, latitude))
    axes.plot(*track, **method("ekf", label="spacecraft"))
    axes.plot(longitude[:1], latitude[:1], **method("ekf", marker="o", linestyle="none", label="where it begins"))
    for k, (name, (x, y)) in enumerate(stations.items()):
        label = None if k else "station"
        axes.plot(x, y, **method("prior", marker="^", linestyle="none", label=label), markersize=6)
        # neighbours, as Bear Lakes and Evpatoria are, would write over each other on one side
        side = {"xytext": (7, -4)} if k % 2 == 0 else {"xytext": (-7, -4), "ha": "right"}
        axes.annotate(name, (x, y), textcoords="offset points", fontsize=9, **side)
    axes.set(xlabel="longitude [deg]", ylabel="latitude [deg]")
    axes.set_xticks(range(-180, 181, 60), crs=plain)
    axes.set_yticks(range(-90, 91, 30), crs=plain)
    axes.set_facecolor(paper())
    axes.spines["geo"].set_edgecolor(ink())
    figure.legend(loc="outside upper center", ncols=3)
    return figure


def elevation(
    t: Array, heights: Mapping[str, Array], passes: Sequence[tuple[float, float]], observation: tuple[float, float]
) -> Figure:
    """Elevation (n,) [deg] at stations against time [s]; tracking passes and the observation are shaded."""
    figure, axes = plt.subplots(figsize=(7.2, 3.4))
    for name, style in zip(heights, ("ekf", "prior", "batch"), strict=False):
        axes.plot(t / 3600, heights[name], **method(style, "linestyle", label=name))
    spans = [(span, "neutral", 0.4, None if k else "tracking") for k, span in enumerate(passes)]
    for (begin, end), style, alpha, label in [*spans, (observation, "exact", 0.3, "observation")]:
        axes.axvspan(begin / 3600, end / 3600, **method(style, label=label), alpha=alpha, linewidth=0)
    axes.axhline(5, color=ink(), linewidth=0.8, linestyle=":")
    axes.set(xlabel="UTC [h]", ylabel="elevation [deg]", ylim=(0, 90))
    figure.legend(loc="outside upper center", ncols=5)
    return figure


def around(angles: Array, curves: Mapping[str, Array], label: str, printed: float) -> Figure:
    """A share (k,) of each session against the position angle (k,) [deg] of its source; printed: a level to compare."""
    figure, axes = plt.subplots(figsize=(7.2, 3.4))
    for name, (session, values) in zip(("ekf", "prior", "batch", "naive"), curves.items(), strict=False):
        axes.plot(angles, values, **method(name, "linestyle", "marker", label=session))
    axes.axhline(printed, color=ink(), linestyle=":", linewidth=1.6, label=f"{printed:g}")
    axes.set(xlabel="position angle of the source [deg]", ylabel=label, ylim=(0, 1), xlim=(0, 360))
    axes.set_xticks(range(0, 361, 60))
    axes.legend()
    return figure
