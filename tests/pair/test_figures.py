"""Figures that the chapters share: the data in the lines and bands, the labels with their units, in both themes."""

from __future__ import annotations

import numpy as np
import pytest
from artists import assert_dressed
from matplotlib.colors import same_color
from matplotlib.patches import Ellipse

from geokalman.pair import figures
from geokalman.style import METHODS

T = 30.0 * np.arange(50)
WAVE = np.sin(T / 300)
SIGMA = 0.5 + T / 3000


def test_filtered(theme):
    figure = figures.filtered(T, WAVE, WAVE + 0.1, WAVE - 0.2, SIGMA, ["separation [m]", "error [m]"])
    assert_dressed(figure, theme)
    upper, lower = figure.axes
    truth, seen, mean = upper.get_lines()
    for drawn, values in ((truth, WAVE), (seen, WAVE + 0.1), (mean, WAVE - 0.2)):
        np.testing.assert_allclose(drawn.get_xdata(), T / 60)
        np.testing.assert_allclose(drawn.get_ydata(), values)
    np.testing.assert_allclose(lower.get_lines()[0].get_ydata(), 0.1, atol=1e-12)
    np.testing.assert_allclose(lower.get_lines()[1].get_ydata(), -0.2, atol=1e-12)
    assert (upper.get_ylabel(), lower.get_ylabel(), lower.get_xlabel()) == ("separation [m]", "error [m]", "time [min]")


def test_errors(theme):
    figure = figures.errors(T, {"A": (WAVE, SIGMA), "B": (2 * WAVE, SIGMA)}, "error [m]", {"B": 3.0})
    assert_dressed(figure, theme)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["A", "B"]
    for k, axes in enumerate(figure.axes):
        [line] = axes.get_lines()
        np.testing.assert_allclose(line.get_ydata(), (k + 1) * WAVE)
        [band] = axes.collections
        assert band.get_paths()[0].vertices[:, 1].max() == pytest.approx(2 * SIGMA.max())
        assert axes.get_ylabel() == "error [m]"
    assert figure.axes[1].get_ylim() == (-3.0, 3.0)
    assert figure.axes[1].get_xlabel() == "time [min]"


def test_cloud(theme):
    figure = figures.cloud(T, np.array([WAVE, 2 * WAVE]), SIGMA, "separation [m]")
    assert_dressed(figure, theme)
    [axes] = figure.axes
    first, second, low, high = axes.get_lines()
    np.testing.assert_allclose(second.get_ydata(), 2 * first.get_ydata())
    np.testing.assert_allclose(high.get_ydata(), 2 * SIGMA)
    np.testing.assert_allclose(low.get_ydata(), -2 * SIGMA)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [min]", "separation [m]")


def test_curves(theme):
    figure = figures.curves(T + 1, {"A": SIGMA, "B": 2 * SIGMA}, "step [s]", "sigma [m]", log="xy", level=1.0)
    assert_dressed(figure, theme)
    [axes] = figure.axes
    first, second, level = axes.get_lines()
    np.testing.assert_allclose(second.get_ydata(), 2 * first.get_ydata())
    assert set(level.get_ydata()) == {1.0}
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("step [s]", "sigma [m]")


def test_densities(theme):
    x = np.linspace(-40, 40, 4001)
    figure = figures.densities(x, {"prior": (0.0, 5.0), "posterior": (3.0, 2.0)}, "separation [m]")
    assert_dressed(figure, theme)
    [axes] = figure.axes
    for line, (mean, sigma) in zip(axes.get_lines(), ((0.0, 5.0), (3.0, 2.0)), strict=True):
        density = line.get_ydata() * (x[1] - x[0])
        assert density.sum() == pytest.approx(1.0, abs=1e-6)
        assert (x * density).sum() == pytest.approx(mean, abs=1e-6)
        assert ((x - mean) ** 2 * density).sum() == pytest.approx(sigma**2, rel=1e-6)
    assert axes.get_xlabel() == "separation [m]"


def test_ellipses(theme):
    cov = np.array([[4.0, 1.5], [1.5, 1.0]])
    figure = figures.ellipses({"prior": (np.array([1.0, 2.0]), cov)}, "position [m]", "rate [m/s]")
    assert_dressed(figure, theme)
    [axes] = figure.axes
    [patch] = [p for p in axes.patches if isinstance(p, Ellipse)]
    assert same_color(patch.get_edgecolor(), getattr(METHODS["ekf"], theme["name"]))
    points = patch.get_patch_transform().transform(patch.get_path().vertices[:-1]) - [1.0, 2.0]
    squares = np.einsum("ki,ij,kj->k", points, np.linalg.inv(cov), points)
    assert squares.min() == pytest.approx(4.0, rel=1e-2)  # two sigma; the path is made of Bezier curves
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("position [m]", "rate [m/s]")
