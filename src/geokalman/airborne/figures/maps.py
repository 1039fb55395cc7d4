"""Maps of a survey in kilometres of easting and northing; plain matplotlib, nothing to fetch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from geokalman.airborne.model import Array
from geokalman.style import DIVERGING, METHODS, SEQUENTIAL


def tracks(lines: Sequence[tuple[str, Array, Array]], proper: Sequence[slice]) -> Figure:
    """Figure 5: plan of the lines, numbered; name, east, north [m], and the epochs without the lead-ins."""
    figure, axes = plt.subplots(figsize=(4.6, 5.4))
    for k, ((name, east, north), keep) in enumerate(zip(lines, proper, strict=True)):
        axes.plot(
            east / 1e3,
            north / 1e3,
            color=METHODS["exact"].colour,
            linewidth=0.8,
            linestyle=":",
            label="lead-in" if k == 0 else None,
        )
        axes.plot(
            east[keep] / 1e3,
            north[keep] / 1e3,
            color=METHODS["fb"].colour,
            linewidth=1.5,
            label="line" if k == 0 else None,
        )
        ahead = np.sign(north[-1] - north[0])
        axes.annotate(
            "",
            (east[keep][-1] / 1e3, north[keep][-1] / 1e3),
            (east[keep][-1] / 1e3, north[keep][-1] / 1e3 - 4 * ahead),
            arrowprops={"arrowstyle": "->", "color": METHODS["fb"].colour},
        )  # fmt: skip
        axes.annotate(
            name,
            (east[0] / 1e3, max(north.max(), -north.min()) / 1e3),
            xytext=(0, 3),
            textcoords="offset points",
            ha="center",
        )
    axes.set(xlabel="east [km]", ylabel="north [km]")
    axes.margins(x=0.1)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.05), ncols=2)
    return figure


def along_lines(
    tracks: Sequence[tuple[Array, Array]],
    panels: Mapping[str, Sequence[Array]],
    symmetric: Mapping[str, bool],
    unit: str = "mGal",
) -> Figure:
    """Values along the tracks (east, north [m]) in colour, one panel a quantity; symmetric ones about zero."""
    figure, axes = plt.subplots(1, len(panels), figsize=(7.2, 4.4), sharex=True, sharey=True, squeeze=False)
    east, north = (np.concatenate([track[k] for track in tracks]) / 1e3 for k in (0, 1))
    east, north = east - east.min(), north - north.min()
    for axis, (title, values) in zip(axes[0], panels.items(), strict=True):
        flat = np.concatenate(values)
        limit = np.nanpercentile(np.abs(flat), 99)
        span = (
            {"vmin": -limit, "vmax": limit}
            if symmetric[title]
            else dict(zip(("vmin", "vmax"), np.nanpercentile(flat, [1, 99]), strict=True))
        )
        points = axis.scatter(
            east[::4],
            north[::4],
            c=flat[::4],
            s=1.5,
            linewidths=0,
            cmap=DIVERGING if symmetric[title] else SEQUENTIAL,
            rasterized=True,
            **span,
        )
        axis.set(xlabel="east [km]", title=title, aspect="equal")
        if np.ptp(east) < 2.0:  # a single line
            axis.set_xlim(np.mean(east) - 2.0, np.mean(east) + 2.0)
        figure.colorbar(points, ax=axis, orientation="horizontal", label=unit, shrink=0.9)
    axes[0, 0].set_ylabel("north [km]")
    return figure


def grids(
    east_km: Array,
    north_km: Array,
    panels: Mapping[str, Array],
    symmetric: Mapping[str, bool],
    lines: Sequence[tuple[Array, Array]] = (),
) -> Figure:
    """Gridded quantities (north, east) [mGal]; symmetric ones about zero; flight lines in black on white."""
    figure, axes = plt.subplots(1, len(panels), figsize=(7.2, 5.0), sharex=True, sharey=True, squeeze=False)
    for axis, (title, values) in zip(axes[0], panels.items(), strict=True):
        limit = np.nanmax(np.abs(values))
        span = {"vmin": -limit, "vmax": limit} if symmetric[title] else {}
        image = axis.pcolormesh(
            east_km,
            north_km,
            values,
            cmap=DIVERGING if symmetric[title] else SEQUENTIAL,
            shading="nearest",
            rasterized=True,
            **span,
        )
        for east, north in lines:
            axis.plot(east, north, color="white", linewidth=1.1, alpha=0.6)
            axis.plot(east, north, color="black", linewidth=0.5)
        axis.set(xlabel="east [km]", title=title, aspect="equal")
        axis.grid(False)
        figure.colorbar(image, ax=axis, orientation="horizontal", label="mGal", shrink=0.9)
    axes[0, 0].set_ylabel("north [km]")
    return figure
