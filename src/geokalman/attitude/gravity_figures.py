"""Figures 7 and 8: degree variances and maps of equivalent water height."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from geokalman.attitude.model import Array
from geokalman.data import natural_earth_dir
from geokalman.style import DIVERGING, METHODS, ink, paper

LOOK = {"signal": "truth", "noise": "imu", "none": "mekf", "offset": "jpl_like"}


def degree_variances(degree: Array, curves: Mapping[str, tuple[str, Array]]) -> Figure:
    """Degree variances (k,) of fields and differences; curves : key of `LOOK` -> (label, values)."""
    figure, axes = plt.subplots(figsize=(7.2, 4.0))
    for key, (label, values) in curves.items():
        method = METHODS[LOOK[key]]
        axes.semilogy(
            degree, values, color=method.colour, linestyle=method.line, marker=method.marker, markevery=5, label=label
        )
    axes.set(xlabel="degree n", ylabel="degree variance [dimensionless]")
    axes.legend(loc="upper left", bbox_to_anchor=(0, -0.16), ncols=2)
    return figure


def water_maps(grids: Mapping[str, tuple[Array, str, float]]) -> Figure:
    """Maps of equivalent water height, each on its own scale.

    grids : title -> (grid (n_lat, n_lon) [m], unit, metres per unit), south to north, longitude from 0 to 360; the
    colour scale ends at the 99.5 % quantile and says so by its arrows.
    """
    import cartopy
    import cartopy.crs as ccrs

    cartopy.config["pre_existing_data_dir"] = str(natural_earth_dir())
    figure, axes = plt.subplots(
        len(grids), 1, figsize=(6.4, 3.3 * len(grids)), squeeze=False, subplot_kw={"projection": ccrs.Robinson()}
    )
    for axis, (title, (grid, unit, size)) in zip(axes[:, 0], grids.items(), strict=True):
        shown = np.roll(grid / size, grid.shape[1] // 2, axis=1)
        limit = float(np.quantile(np.abs(shown), 0.995))
        image = axis.imshow(
            shown, origin="lower", extent=(-180, 180, -90, 90), transform=ccrs.PlateCarree(), regrid_shape=600,
            cmap=DIVERGING,
            vmin=-limit, vmax=limit, interpolation="nearest",
        )  # fmt: skip
        axis.coastlines(resolution="110m", linewidth=0.5, color="#303030")
        axis.set_global()
        axis.set_facecolor(paper())
        axis.spines["geo"].set_edgecolor(ink())
        axis.set_title(title, loc="left")
        bar = figure.colorbar(image, ax=axis, orientation="horizontal", shrink=0.7, aspect=40, pad=0.03, extend="both")
        bar.set_label(f"equivalent water height [{unit}]")
    return figure
