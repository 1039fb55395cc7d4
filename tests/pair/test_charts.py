"""Figures of single chapters: the data in their artists, labels with units, both themes."""

from __future__ import annotations

import numpy as np
import pytest
from artists import assert_dressed, line, texts
from matplotlib.colors import same_color
from matplotlib.patches import Ellipse

from geokalman.pair import charts
from geokalman.style import METHODS


def test_banana(theme):
    x, y = np.linspace(-2, 2, 30), np.linspace(-9, 5, 20)
    density = np.exp(-0.5 * (x[None] ** 2 + (y[:, None] + x[None] ** 2) ** 2))
    points, curve = np.array([[0.0, 1.0], [0.5, -1.0]]), np.array([[0.0, 0.0], [1.0, -1.0], [0.0, 0.0]])
    gaussians = {"EKF": (np.zeros(2), np.eye(2)), "UKF": (np.ones(2), 4 * np.eye(2))}
    figure = charts.banana(x, y, density, gaussians, points, curve)
    assert_dressed(figure, theme)
    [axes] = figure.axes
    colours = [patch.get_edgecolor() for patch in axes.patches if isinstance(patch, Ellipse)]
    assert [
        same_color(c, getattr(METHODS[k], theme["name"])) for c, k in zip(colours, ("ekf", "ukf"), strict=True)
    ] == [True] * 2
    np.testing.assert_allclose(line(axes, "sigma points").get_xydata(), points)
    np.testing.assert_allclose(line(axes, "error state").get_xydata(), curve)
    np.testing.assert_allclose(np.ravel(axes.collections[0].get_array()), density.ravel())
    assert axes.get_xlabel().endswith("[km]") and axes.get_ylabel().endswith("[m]")
    assert texts(axes.get_legend()) == ["EKF", "UKF", "sigma points", "error state"]


def test_banana_without_points(theme):
    [axes] = charts.banana(np.arange(3.0), np.arange(2.0), np.ones((2, 3)), {"UKF": (np.ones(2), np.eye(2))}).axes
    assert texts(axes.get_legend()) == ["UKF"]


def test_matrices(theme):
    band = np.diag(np.ones(4)) - 0.5 * np.diag(np.ones(3), 1) - 0.5 * np.diag(np.ones(3), -1)
    figure = charts.matrices({"normal": band, "inverse": np.linalg.inv(band)}, "size")
    assert_dressed(figure, theme)
    left, right = figure.axes[:2]
    assert (left.get_title(), right.get_title(), figure.axes[2].get_ylabel()) == ("normal", "inverse", "size")
    shown = np.asarray(left.images[0].get_array().filled(np.nan))
    assert np.isnan(shown[0, 2]) and shown[0, 1] == pytest.approx(0.5)  # zeros are left blank
    np.testing.assert_allclose(right.images[0].get_array(), np.linalg.inv(band))


def test_consistency(theme):
    minutes, mean = np.arange(40.0), 3 + np.sin(np.arange(40.0))
    figure = charts.consistency(minutes, {"NEES": (mean, 2.0, 4.1, 3.0), "NIS": (mean - 1, 1.3, 2.9, 2.0)})
    assert_dressed(figure, theme)
    for axes, low, high, expected, values in zip(
        figure.axes, (2.0, 1.3), (4.1, 2.9), (3.0, 2.0), (mean, mean - 1), strict=True
    ):
        [band] = axes.patches
        assert (band.get_y(), band.get_y() + band.get_height()) == pytest.approx((low, high))
        level, drawn = axes.get_lines()
        assert set(level.get_ydata()) == {expected}
        np.testing.assert_allclose(drawn.get_ydata(), values)
    assert figure.axes[1].get_xlabel() == "time [min]"


def test_comparison(theme):
    names = ["Kalman", "gate"]
    worlds = {"as modelled": np.array([1.0, 1.1]), "outliers": np.array([9.0, 1.2])}
    figure = charts.comparison(names, {"rms [m]": worlds, "NEES": worlds}, {"NEES": 1.0})
    assert_dressed(figure, theme)
    left, right = figure.axes
    for axes in (left, right):
        for world, values in worlds.items():
            np.testing.assert_allclose(line(axes, world).get_xdata(), values)
        assert axes.get_xscale() == "log"
    assert len(right.get_lines()) == len(left.get_lines()) + 1
    assert [tick.get_text() for tick in left.get_yticklabels()] == names
    assert left.yaxis_inverted() and texts(figure.legends[0]) == list(worlds)


def test_playground(theme):
    t = 30.0 * np.arange(20)
    wave = np.sin(t / 100)
    seen = wave + 0.1
    seen[3] = np.nan
    cov = np.diag([4.0, 1.0])
    gaussians = {"before": (np.zeros(2), cov), "after": (np.ones(2), 0.25 * cov)}
    figure = charts.playground(t, wave, seen, (wave + 0.2, np.full(20, 0.5)), gaussians, 1.0 + t, (0.05, 7.4))
    assert_dressed(figure, theme)
    above, left, right = figure.axes
    np.testing.assert_allclose(line(above, "truth").get_xydata(), np.column_stack([t / 60, wave]))
    np.testing.assert_allclose(line(above, "GNSS").get_ydata(), seen)
    np.testing.assert_allclose(line(above, "estimate, two sigma").get_ydata(), wave + 0.2)
    edges = above.collections[0].get_paths()[0].vertices[:, 1]
    assert edges.max() == pytest.approx((wave + 1.2).max()) and edges.min() == pytest.approx((wave - 0.8).min())
    assert texts(left.get_legend()) == ["before", "after"]
    [nis] = right.get_lines()
    np.testing.assert_allclose(nis.get_ydata(), 1.0 + t)
    assert right.get_yscale() == "log"
    assert (above.get_ylabel(), right.get_xlabel()) == ("separation [cm]", "time [min]")
