"""The data of a figure from two runs in one image: curves, tracks, or maps."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from execbook.display import as_png
from execbook.errors import Fault

Columns = Mapping[str, np.ndarray]
_LEFT, _RIGHT = "#0072b2", "#d55e00"  # Okabe & Ito's blue and vermilion
_DECADES = 3.0  # positive values that span more are shown on a logarithmic axis


def read_columns(path: Path) -> dict[str, np.ndarray]:
    """Read the numeric columns of a figure's data (CSV); raises Fault for a damaged file."""
    try:
        with open(path, encoding="utf-8", newline="") as stream:
            header, *rows = csv.reader(stream)
        found = list(zip(header, zip(*rows, strict=True), strict=bool(rows)))
    except (OSError, ValueError, csv.Error) as error:
        raise Fault(f"{path} is damaged: it is no table of columns of one length.") from error
    columns = {}
    for name, values in found:
        try:
            columns[name] = np.array(values, dtype=float)
        except ValueError:  # a column of words
            continue
    return columns


def overlay(left: Columns, right: Columns, title: str) -> bytes:
    """Draw the columns that both runs have, as PNG; raises Fault where they cannot be drawn.

    Longitude and latitude alone are a track; with other columns they are a map, shown left, right and as difference.
    All other columns are curves over the first one.
    """
    shared = [c for c in left if c in right]
    places = [next((c for c in shared if c.startswith(word)), "") for word in ("lon", "lat")]
    if len(shared) < 2:
        raise Fault(f"Figure {title} has fewer than two columns that both runs have ({', '.join(shared) or 'none'}).")
    with plt.style.context("default"), plt.rc_context({"figure.constrained_layout.use": True}):
        try:
            if not all(places):
                figure = _curves(left, right, shared)
            elif len(shared) == 2:
                figure = _track(left, right, places)
            else:
                figure = _maps(left, right, places, [c for c in shared if c not in places])
            figure.suptitle(title)
            return as_png(figure, 110)
        except (ValueError, MemoryError) as error:  # thousands of columns, an unpaired $ in a name, infinite places
            raise Fault(f"The columns of figure {title} cannot be drawn ({' '.join(str(error).split())}).") from error


def _curves(left: Columns, right: Columns, shared: Sequence[str]) -> Figure:
    over, *columns = shared
    figure, axes = plt.subplots(len(columns), 1, figsize=(8, 2.6 * len(columns)), squeeze=False)
    for axis, column in zip(axes[:, 0], columns, strict=True):
        axis.plot(left[over], left[column], color=_LEFT, lw=1.6, label="left")
        axis.plot(right[over], right[column], color=_RIGHT, lw=1.0, ls="--", label="right")
        axis.set(xlabel=over, ylabel=column)
        axis.set(xscale=_scale(left[over], right[over]), yscale=_scale(left[column], right[column]))
        axis.legend(loc="upper right")
    return figure


def _scale(left: np.ndarray, right: np.ndarray) -> str:
    """`log` for positive values that span more than three decades, else `linear`."""
    values = np.concatenate([left, right])
    values = values[np.isfinite(values)]
    wide = values.size and values.min() > 0 and np.log10(values.max() / values.min()) > _DECADES
    return "log" if wide else "linear"


def _track(left: Columns, right: Columns, places: Sequence[str]) -> Figure:
    figure, axis = plt.subplots(figsize=(8, 4.2))
    for columns, colour, name in ((left, _LEFT, "left"), (right, _RIGHT, "right")):
        axis.plot(columns[places[0]], columns[places[1]], ".", ms=2, color=colour, label=name)
    axis.set(xlabel=places[0], ylabel=places[1])
    axis.legend(loc="upper right", markerscale=4)
    return figure


def _maps(left: Columns, right: Columns, places: Sequence[str], columns: Sequence[str]) -> Figure:
    """Draw one row of maps per column; no difference where the runs have other places."""
    same = all(left[p].shape == right[p].shape and np.allclose(left[p], right[p]) for p in places)
    panels = 3 if same else 2
    figure, axes = plt.subplots(len(columns), panels, figsize=(4.6 * panels, 2.8 * len(columns)), squeeze=False)
    for row, column in zip(axes, columns, strict=True):
        largest = max(_largest(left[column]), _largest(right[column]))
        for axis, side, name in ((row[0], left, "left"), (row[1], right, "right")):
            _map(axis, side, places, side[column], largest, f"{column}: {name}")
        if same:
            difference = left[column] - right[column]
            name = f"{column}: left − right"
            _map(row[2], left, places, difference, _largest(difference), name)
    return figure


def _largest(values: np.ndarray) -> float:
    return float(np.nanmax(np.abs(values), initial=0.0)) or 1.0


def _map(axis: Axes, at: Columns, places: Sequence[str], values: np.ndarray, largest: float, label: str) -> None:
    """Draw a complete grid as cells, else points; the colour scale is symmetric about zero."""
    longitude, latitude = (at[p] for p in places)
    (east, i), (north, k) = (np.unique(x, return_inverse=True) for x in (longitude, latitude))
    look = {"cmap": "RdBu_r", "vmin": -largest, "vmax": largest, "rasterized": True}
    if east.size * north.size == values.size and min(east.size, north.size) > 1:
        grid = np.full((north.size, east.size), np.nan)
        grid[k, i] = values
        drawn = axis.pcolormesh(east, north, grid, shading="nearest", **look)
    else:
        drawn = axis.scatter(longitude, latitude, c=values, s=4, **look)
    axis.figure.colorbar(drawn, ax=axis, orientation="horizontal", label=label)
    axis.set(xlabel=places[0], ylabel=places[1])
