"""Figures 4 to 7 of the primary paper: degree variances, their differences, and geoid maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from geokalman.data import natural_earth_dir
from geokalman.grace.figures.names import NAMES
from geokalman.grace.model import Array
from geokalman.style import DIVERGING, METHODS, ink, paper

LOOK = {
    "X": "exact",
    "N1": "newton",
    "N2": "newton",
    "E0": "ekf",
    "E1": "ekf",
    "E2": "ekf",
    "U1": "ukf",
    "U2": "ukf",
    "K0": "exact",
    "B11": "spline",
    "P2": "neutral",
}
"""Which method's colour an observable is drawn in."""
_LINES = {
    "N2": ":",
    "E0": ":",
    "E2": "-",
    "U1": "--",
    "K0": "--",
}  # beside the paper's three, which keep their method's line


def _line(name: str) -> dict:
    method = METHODS[LOOK[name]]
    return {
        "color": method.colour,
        "linestyle": _LINES.get(name, method.line),
        "marker": "+" if name == "K0" else method.marker,
        "markevery": 5,
    }


def degree_variances(degree: Array, reference: Array, recovered: Mapping[str, Array]) -> Figure:
    """Figure 4: degree variances of the input field and of each recovered one, a panel a method.

    degree: (k,) degrees shown; reference, recovered[id]: (k,) dimensionless.
    """
    figure, axes = plt.subplots(1, len(recovered), sharey=True, figsize=(7.2, 3.2), squeeze=False)
    for k, (axis, (name, values)) in enumerate(zip(axes[0], recovered.items(), strict=True)):
        axis.semilogy(degree, reference, color=METHODS["truth"].colour, linewidth=3, alpha=0.45, label="input field")
        axis.semilogy(degree, values, label=METHODS[LOOK[name]].label, **_line(name))
        axis.set(xlabel="degree n", title=f"({'abcdef'[k]}) {METHODS[LOOK[name]].label}")
        axis.legend(loc="upper right")
    axes[0, 0].set_ylabel("degree variance")
    return figure


def degree_differences(degree: Array, variances: Mapping[str, Array], amplitudes: Mapping[str, Array]) -> Figure:
    """Figure 5: |difference of degree variances| (left) and the error amplitude per degree in geoid height [m]
    (right)."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 4.2))
    for axis, curves in ((left, variances), (right, amplitudes)):
        for name, values in curves.items():
            axis.semilogy(degree, values, label=NAMES[name], **_line(name))
        axis.set_xlabel("degree n")
    left.set_ylabel("|difference of degree variances|")
    right.set_ylabel("error per degree in geoid height [m]")
    figure.legend(handles=left.get_lines(), loc="outside lower center", ncols=2)
    return figure


def amplitudes(degree: Array, signal: Array, errors: Mapping[str, Array], formal: Mapping[str, Array]) -> Figure:
    """Signal and error amplitude per degree in geoid height [m] for every observable.

    formal: id -> amplitude that white errors of the observable's size would leave, drawn as a band from half to twice
    of it.
    """
    figure, axes = plt.subplots(figsize=(7.2, 5.6))
    for name, values in formal.items():
        axes.fill_between(
            degree,
            0.5 * values,
            2 * values,
            color=_line(name)["color"],
            alpha=0.25,
            linewidth=0,
            label=f"{NAMES[name]}, if white",
        )
    axes.semilogy(degree, signal, color=METHODS["truth"].colour, linewidth=3, alpha=0.45, label="signal")
    for name, values in errors.items():
        axes.semilogy(degree, values, label=NAMES[name], **_line(name))
    axes.set(xlabel="degree n", ylabel="amplitude per degree in geoid height [m]")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def geoid_maps(grids: Mapping[str, Array], unit: str = "mm", shared: bool = True) -> Figure:
    """Figures 6 and 7: geoid-height differences [m] on a cell-centred global grid, a map a method, symmetric colour
    scale.

    grids: title -> (n_lat, n_lon), south to north and from longitude 0 to 360. One colour scale serves all maps where
    `shared`, so that they can be compared; it ends at the 99.5 % quantile, and the map says so by its arrows.
    """
    import cartopy
    import cartopy.crs as ccrs

    cartopy.config["pre_existing_data_dir"] = str(natural_earth_dir())
    scale = {"m": 1.0, "mm": 1e3, "µm": 1e6}[unit]
    limits = {name: float(np.quantile(np.abs(grid), 0.995)) * scale for name, grid in grids.items()}
    if shared:
        limits = dict.fromkeys(limits, max(limits.values()))
    figure, axes = plt.subplots(
        len(grids), 1, figsize=(6.4, 2.9 * len(grids)), squeeze=False, subplot_kw={"projection": ccrs.Robinson()}
    )
    for axis, (name, grid) in zip(axes[:, 0], grids.items(), strict=True):
        half = grid.shape[1] // 2
        centred = np.roll(scale * grid, half, axis=1)  # Greenwich in the middle
        image = axis.imshow(
            centred, origin="lower", extent=(-180, 180, -90, 90), transform=ccrs.PlateCarree(), regrid_shape=700,
            cmap=DIVERGING, vmin=-limits[name], vmax=limits[name], interpolation="nearest",
        )  # fmt: skip
        axis.coastlines(resolution="110m", linewidth=0.5, color="#303030")
        axis.set_global()
        axis.set_facecolor(paper())
        axis.spines["geo"].set_edgecolor(ink())
        axis.set_title(name, loc="left")
        if not shared or axis is axes[-1, 0]:
            bar = figure.colorbar(
                image,
                ax=axes[:, 0] if shared else axis,
                orientation="horizontal",
                shrink=0.7,
                aspect=40,
                pad=0.03,
                extend="both",
            )
            bar.set_label(f"geoid-height difference [{unit}]")
    return figure


def geoid_against_radius(radii_km: Sequence[float], rms: Mapping[str, Sequence[float]]) -> Figure:
    """Rms of the geoid-height error [m] against the radius of the Gaussian low-pass [km]."""
    figure, axes = plt.subplots(figsize=(7.2, 3.4))
    for name, values in rms.items():
        axes.semilogy(radii_km, values, label=NAMES[name], **(_line(name) | {"markevery": 1}))
    axes.set(xlabel="Gaussian radius [km]", ylabel="rms of geoid-height error [m]")
    axes.legend()
    return figure


def geoid_by_method(groups: Mapping[str, Mapping[str, float]], omission: float) -> Figure:
    """Rms of the geoid-height error by observable, on a logarithmic axis in mm, in groups of observables formed alike.

    groups: heading -> id -> rms [m]; omission: rms [m] that the degrees left out of the simulation would leave.
    """
    count = sum(len(group) + 1 for group in groups.values())
    figure, axes = plt.subplots(figsize=(7.2, 0.7 + 0.3 * count))
    place, ticks = 0, {}
    for heading, group in groups.items():
        axes.text(0.01, place, heading, transform=axes.get_yaxis_transform(), va="center", weight="bold", fontsize=9)
        for name, value in group.items():
            place += 1
            method = METHODS["ukf" if name == "Q2" else LOOK[name]]
            axes.plot(1e3 * value, place, method.marker, color=method.colour, markersize=7, label=NAMES[name])
            axes.annotate(f"{1e3 * value:.2g}", (1e3 * value, place), (8, 0), textcoords="offset points", va="center")
            ticks[place] = NAMES[name]
        place += 1
    axes.axvline(1e3 * omission, color=METHODS["neutral"].colour, linestyle="--", linewidth=1.2)
    axes.annotate(
        "degrees left out", (1e3 * omission, place - 0.7), (-4, 0), textcoords="offset points", ha="right",
        va="bottom", fontsize=9, color=METHODS["neutral"].colour,
    )  # fmt: skip
    axes.set(xscale="log", xlabel="rms of geoid-height error [mm]", ylim=(place - 0.3, -0.7))
    axes.set_yticks(list(ticks), list(ticks.values()))
    axes.grid(False, axis="y")
    return figure


def ground_track(lon_deg: Array, lat_deg: Array) -> Figure:
    """Ground track of the trailing satellite on a world map; lon, lat (n,) [deg]."""
    import cartopy
    import cartopy.crs as ccrs

    cartopy.config["pre_existing_data_dir"] = str(natural_earth_dir())
    figure, axes = plt.subplots(figsize=(7.2, 3.8), subplot_kw={"projection": ccrs.Robinson()})
    axes.set_facecolor(paper())
    axes.coastlines(resolution="110m", linewidth=0.6, color=ink())
    axes.plot(
        lon_deg,
        lat_deg,
        ".",
        markersize=1.5,
        color=METHODS["ekf"].colour,
        transform=ccrs.PlateCarree(),
        rasterized=True,
    )
    axes.spines["geo"].set_edgecolor(ink())
    axes.set_global()
    return figure
