"""Every figure of the paper: the data in the lines, the limits, the labels with their units, in both themes; and smoke
images.

The images (`--mpl`) catch what no artist tells; they are small, and text is removed, since fonts differ between
machines.
"""

from __future__ import annotations

import inspect

import matplotlib.pyplot as plt
import numpy as np
import pytest
from artists import assert_dressed, line, texts
from matplotlib.colors import same_color
from recoveredfield import DEGREE, errors, grids

from geokalman import style
from geokalman.constants import A_EARTH
from geokalman.grace import figures
from geokalman.style import METHODS

T = 30.0 * np.arange(2000)
WAVE = np.sin(2 * np.pi * T / 5600)


def circle(radius: float) -> np.ndarray:
    u = np.linspace(0, 2 * np.pi, 300)
    return radius * np.column_stack([np.cos(u), 0.3 * np.sin(u), np.sin(u)])


# --- figures.py ------------------------------------------------------------------------------------------------------


def test_orbits_3d(theme):
    A, B = circle(6.834e6), circle(6.83e6)
    figure = figures.orbits_3d(A, B)
    assert_dressed(figure, theme)
    assert [a.get_title() for a in figure.axes] == ["(a) satellite A", "(b) satellite B"]
    for axes, position, method in zip(figure.axes, (A, B), ("ekf", "newton"), strict=True):
        [orbit] = axes.get_lines()
        np.testing.assert_allclose(np.array(orbit.get_data_3d()).T, position / 1e6, rtol=2e-15)
        assert same_color(orbit.get_color(), getattr(METHODS[method], theme["name"]))
        assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel()) == (
            "x [1000 km]",
            "y [1000 km]",
            "z [1000 km]",
        )
        [globe] = axes.collections
        assert np.linalg.norm(globe._segments3d[0][0]) == pytest.approx(A_EARTH / 1e6)


def test_range_and_rate(theme):
    rho, rate = 2.2e5 + 600 * WAVE, 0.7 * WAVE
    figure = figures.range_and_rate(T, rho, rate)
    assert_dressed(figure, theme)
    upper, lower = figure.axes
    for axes, series, label in ((upper, rho / 1e3, "range [km]"), (lower, rate, "range-rate [m/s]")):
        [drawn] = axes.get_lines()
        np.testing.assert_allclose(drawn.get_xydata(), np.column_stack([T / 3600, series]), rtol=2e-15)
        assert axes.get_ylabel() == label
    assert lower.get_xlabel() == "time [h]"
    assert upper.get_xlim() == lower.get_xlim()


@pytest.mark.parametrize("gaps", [[26.0, 20.0, 7.3, 3.9, 1.12], [300.0]])
def test_node_gaps(theme, gaps):
    days = list(range(1, len(gaps) + 1))
    figure = figures.node_gaps(days, gaps, 60)
    assert_dressed(figure, theme)
    [axes] = figure.axes
    drawn, limit = axes.get_lines()
    np.testing.assert_array_equal(drawn.get_xydata(), np.column_stack([days, gaps]))
    assert drawn.get_drawstyle() == "steps-post" and axes.get_yscale() == "log"
    assert limit.get_ydata()[0] == pytest.approx(180 / 60)
    assert texts(axes.get_legend()) == ["half a wavelength at degree 60"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("length of the simulation [d]", "largest gap between nodes [deg]")
    shown = axes.get_yticks()
    assert len(shown) >= 1 and min(shown) >= 0.5 * min(*gaps, 3.0) and max(shown) <= 2 * max(gaps)


def test_residuals(theme):
    series = {"newton": 2e-6 * WAVE, "ekf": 7e-7 * WAVE, "ukf": 5e-7 * WAVE}
    figure = figures.residuals(T, series, [["newton", "ukf"], ["ekf", "ukf"]])
    assert_dressed(figure, theme)
    upper, lower = figure.axes
    for axes, group, letter in (
        (upper, ("newton", "ukf"), "(a) Newton and UKF"),
        (lower, ("ekf", "ukf"), "(b) EKF and UKF"),
    ):
        assert axes.get_title(loc="left") == letter
        assert axes.get_ylabel() == "residual [µm/s]"
        assert texts(axes.get_legend()) == [METHODS[name].label for name in group]
        assert [a.get_label() for a in axes.get_lines()] == [
            METHODS[name].label for name in group
        ]  # the first at the back
        for name in group:
            drawn = line(axes, METHODS[name].label)
            np.testing.assert_allclose(drawn.get_xydata(), np.column_stack([T / 86400, 1e6 * series[name]]), rtol=2e-15)
            assert same_color(drawn.get_color(), getattr(METHODS[name], theme["name"]))
            assert drawn.get_rasterized()
    assert lower.get_xlabel() == "time [d]"
    assert upper.get_ylim() == lower.get_ylim()  # one scale, so that they can be compared
    assert upper.get_ylim()[0] <= -2.0 and upper.get_ylim()[1] >= 2.0


def test_one_panel_of_residuals_has_no_letter(theme):
    figure = figures.residuals(T, {"newton": WAVE}, [["newton"]])
    assert figure.axes[0].get_title(loc="left") == "Newton"


def test_transfer_functions(theme):
    gains = {n: np.exp(-((DEGREE / (10.0 * n)) ** 4)) for n in (9, 5, 7)}
    figure = figures.transfer_functions(DEGREE, gains, 30.0)
    assert_dressed(figure, theme)
    [axes] = figure.axes
    assert texts(axes.get_legend()) == ["5 points", "7 points", "9 points"]
    for n, gain in gains.items():
        np.testing.assert_array_equal(line(axes, f"{n} points").get_xydata(), np.column_stack([DEGREE, gain]))
    assert axes.get_ylim() == (0, 1.05)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("cycles per revolution", "gain")
    assert axes.get_title() == "central first derivative at 30 s"
    styles = {(a.get_color(), a.get_linestyle()) for a in axes.get_lines()}
    assert len(styles) == 4  # three curves and the line at 1: told apart without colour too


def test_error_against_step(theme):
    dts = np.array([5.0, 10.0, 30.0])
    curves = {
        "D9 of range": ("m/s", 1e-10 * dts**4),
        "D9 of range-rate": ("m/s²", 1e-13 * dts**4),
        "D9 D9 of range": ("m/s²", 1e-12 * dts**4),
    }
    figure = figures.error_against_step(dts, curves)
    assert_dressed(figure, theme)
    left, right = figure.axes
    assert (left.get_ylabel(), right.get_ylabel()) == ("standard deviation [m/s]", "standard deviation [m/s²]")
    for axes, labels in ((left, ["D9 of range"]), (right, ["D9 of range-rate", "D9 D9 of range"])):
        assert texts(axes.get_legend()) == labels
        assert axes.get_xlabel() == "sampling interval [s]"
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
        assert [t.get_text() for t in axes.get_xticklabels()] == ["5", "10", "30"]
        for label in labels:
            np.testing.assert_array_equal(line(axes, label).get_xydata(), np.column_stack([dts, curves[label][1]]))


def test_weight_curve(theme):
    lambdas, rate, los = (
        np.array([1500.0, 4250.0, 1e5]),
        np.array([11e-7, 7.5e-7, 5.4e-7]),
        np.array([0.9e-8, 3e-8, 4.5e-8]),
    )
    figure = figures.weight_curve(lambdas, rate, los, 4250.0, 7.46e-7)
    assert_dressed(figure, theme)
    left, right = figure.axes
    np.testing.assert_allclose(line(left, "EKF, smoothed").get_xydata(), np.column_stack([lambdas, 1e6 * rate]))
    np.testing.assert_allclose(line(right, "EKF, smoothed").get_xydata(), np.column_stack([lambdas, 1e9 * los]))
    assert (
        left.get_ylabel() == "std of range-rate error [µm/s]"
        and right.get_ylabel() == "std of acceleration error [nm/s²]"
    )
    for axes in (left, right):
        assert axes.get_xscale() == "log" and "lambda_q" in axes.get_xlabel()
        assert line(axes, "default, 4250").get_xdata()[0] == 4250.0
    assert line(left, "printed in Table 1").get_ydata()[0] == pytest.approx(0.746)
    assert texts(left.get_legend()) == ["EKF, smoothed", "default, 4250", "printed in Table 1"]
    assert texts(right.get_legend()) == ["EKF, smoothed", "default, 4250"]


def test_literal_filter(theme):
    sigma = np.full(T.size, 3e-4)
    figure = figures.literal_filter(T, 6e-4 + 1e-3 * WAVE, sigma)
    assert_dressed(figure, theme)
    [axes] = figure.axes
    np.testing.assert_allclose(
        line(axes, "residual, no smoother").get_xydata(), np.column_stack([T / 3600, 0.6 + WAVE])
    )
    [band] = axes.collections
    extent = band.get_paths()[0].get_extents()
    assert (extent.y0, extent.y1) == (pytest.approx(-0.9), pytest.approx(0.9))
    assert band.get_label() == "±3 sigma of the filter"
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [h]", "range-rate residual [mm/s]")
    assert texts(figure.legends[0]) == ["±3 sigma of the filter", "residual, no smoother"]


def test_dial(theme):
    sigmas, rate, los = (
        np.array([1e-5, 1e-4, 3e-4]),
        np.array([2e-9, 1.7e-7, 5.2e-7]),
        np.array([1.1e-8, 0.7e-8, 2.1e-8]),
    )
    figure = figures.dial(sigmas, rate, los, 3e-4, 5.26e-7)
    assert_dressed(figure, theme)
    axes, twin = figure.axes
    np.testing.assert_array_equal(line(axes, "range-rate residual [m/s]").get_xydata(), np.column_stack([sigmas, rate]))
    np.testing.assert_allclose(
        line(twin, "line-of-sight acceleration error [nm/s²]").get_xydata(), np.column_stack([sigmas, 1e9 * los])
    )
    assert (axes.get_xscale(), axes.get_yscale(), twin.get_yscale()) == ("log", "log", "linear")
    assert twin.get_ylim()[0] == 0.0 and twin.get_ylim()[1] >= 21.0
    assert axes.get_xlabel() == "assumed standard deviation of the range-rate [m/s]"
    assert (axes.get_ylabel(), twin.get_ylabel()) == ("std of range-rate [m/s]", "std of acceleration [nm/s²]")
    assert {a.get_text() for a in axes.texts} == {"printed in Table 1 (mended)", "default"}
    levels = [a for a in axes.get_lines() if a.get_label().startswith("_")]
    assert levels[0].get_ydata()[0] == 5.26e-7 and levels[1].get_xdata()[0] == 3e-4
    assert texts(figure.legends[0]) == ["range-rate residual [m/s]", "line-of-sight acceleration error [nm/s²]"]
    assert not same_color(
        line(axes, "range-rate residual [m/s]").get_color(),
        line(twin, "line-of-sight acceleration error [nm/s²]").get_color(),
    )


def test_integrator_effect(theme):
    rtols, std, mean = np.array([1e-6, 1e-9, 1e-12]), np.array([1e-4, 1.4e-6, 1.2e-6]), np.array([3e-6, -2.9e-8, 1e-10])
    figure = figures.integrator_effect(rtols, std, mean, 1.19e-6, -1.8e-8)
    assert_dressed(figure, theme)
    [axes] = figure.axes
    np.testing.assert_array_equal(line(axes, "standard deviation").get_xydata(), np.column_stack([rtols, std]))
    np.testing.assert_array_equal(line(axes, "|mean|").get_xydata(), np.column_stack([rtols, np.abs(mean)]))
    assert line(axes, "standard deviation, precise orbit").get_ydata()[0] == 1.19e-6
    assert line(axes, "|mean| printed in Table 1").get_ydata()[0] == 1.8e-8
    assert axes.xaxis_inverted() and (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("relative tolerance of Runge-Kutta 4(5)", "residual [m/s]")
    assert len(texts(axes.get_legend())) == 4


def test_pair(theme):
    figure = figures.pair()
    assert_dressed(figure, theme)
    upper, lower = figure.axes
    assert [a.get_title(loc="left")[:3] for a in (upper, lower)] == ["(a)", "(b)"]
    said = {text.get_text() for text in upper.texts}
    assert {"A, leading", "B, trailing", "$g_A$", "$g_B$", "$e$, line of sight", "Earth, turning"} <= said
    written = {text.get_text() for text in lower.texts}
    assert {text for *_, text, _ in figures.BOXES.values()} <= written
    assert not upper.axison and not lower.axison


def test_the_ways_of_the_drawing_begin_and_end_at_boxes():
    assert {name for flow in figures.drawings.FLOWS for name in flow} <= set(figures.BOXES)


def test_another_ink_is_seen(theme):
    figure, axes = plt.subplots()
    assert_dressed(figure, theme)
    axes.set_xlabel("time [s]", color="red")
    with pytest.raises(AssertionError):
        assert_dressed(figure, theme)


def test_every_figure_function_has_a_smoke_image():
    public = {
        name
        for module in (figures.drawings, figures.series, figures.field)
        for name, item in inspect.getmembers(module, inspect.isfunction)
        if item.__module__ == module.__name__ and not name.startswith("_")
    }
    assert public == set(SMOKE)


# --- smoke images ----------------------------------------------------------------------------------------------------

SMOKE = {
    "pair": lambda: figures.pair(),
    "orbits_3d": lambda: figures.orbits_3d(circle(6.834e6), circle(6.83e6)),
    "range_and_rate": lambda: figures.range_and_rate(T, 2.2e5 + 600 * WAVE, 0.7 * WAVE),
    "node_gaps": lambda: figures.node_gaps([1, 2, 5, 10, 30], [26.0, 20.0, 7.3, 3.9, 1.12], 70),
    "residuals": lambda: figures.residuals(T, {"newton": 2e-6 * WAVE, "ukf": 5e-7 * WAVE}, [["newton", "ukf"]]),
    "transfer_functions": lambda: figures.transfer_functions(DEGREE, {n: np.exp(-((DEGREE / (10.0 * n)) ** 4)) for n in (5, 7, 9)}, 30.0),
    "error_against_step": lambda: figures.error_against_step(np.array([5.0, 10, 30]), {"a": ("m/s", np.array([1e-9, 1e-8, 1e-6])), "b": ("m/s²", np.array([1e-12, 1e-10, 1e-8]))}),
    "weight_curve": lambda: figures.weight_curve(np.array([1500.0, 4250, 1e5]), np.array([11e-7, 7.5e-7, 5.4e-7]), np.array([0.9e-8, 3e-8, 4.5e-8]), 4250.0, 7.46e-7),
    "literal_filter": lambda: figures.literal_filter(T, 6e-4 + 1e-3 * WAVE, np.full(T.size, 3e-4)),
    "dial": lambda: figures.dial(np.array([1e-5, 1e-4, 3e-4]), np.array([2e-9, 1.7e-7, 5.2e-7]), np.array([1.1e-8, 0.7e-8, 2.1e-8]), 3e-4, 5.26e-7),
    "integrator_effect": lambda: figures.integrator_effect(np.array([1e-6, 1e-9, 1e-12]), np.array([1e-4, 1.4e-6, 1.2e-6]), np.array([3e-6, -2.9e-8, 1e-10]), 1.19e-6, 1.8e-8),
    "degree_variances": lambda: figures.degree_variances(DEGREE, 1e-10 / DEGREE**3.0, dict.fromkeys(("N1", "E1", "U2"), 1.1e-10 / DEGREE ** 3.0)),
    "degree_differences": lambda: figures.degree_differences(DEGREE, errors(("N1", "E1", "U2")), errors(("N1", "E1", "U2"))),
    "amplitudes": lambda: figures.amplitudes(DEGREE, 1.0 / DEGREE, errors(), {"U2": 1e-3 * np.exp(DEGREE / 25)}),
    "geoid_by_method": lambda: figures.geoid_by_method({"alike": {"N1": 5.3e-3, "E1": 3.8e-3}, "own": {"U2": 6.4e-4}}, 1.2e-2),
    "geoid_maps": lambda: figures.geoid_maps({"(a) Newton": grids()["(a) Newton"]}),
    "geoid_against_radius": lambda: figures.geoid_against_radius([0.0, 300.0, 500.0], {"N1": [0.139, 1.02e-2, 5.3e-3]}),
    "ground_track": lambda: figures.ground_track(np.linspace(-170, 170, 50), 80 * np.sin(np.linspace(0, 6, 50))),
}  # fmt: skip

compare = pytest.mark.mpl_image_compare(
    baseline_dir="baseline", remove_text=True, tolerance=10, style="default",
    savefig_kwargs={"dpi": 60, "facecolor": "auto", "metadata": {"Software": None}},
)  # fmt: skip


@compare
@pytest.mark.parametrize("name", sorted(SMOKE))
def test_smoke(name):
    with style.theme("light"):
        return SMOKE[name]()


@compare
@pytest.mark.parametrize("name", ["geoid_maps", "residuals"])
def test_smoke_dark(name):
    with style.theme("dark"):
        return SMOKE[name]()
