"""Every figure of the part: the data in its artists, labels with units, in both themes."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from artists import line
from matplotlib.colors import same_color
from matplotlib.figure import Figure

from geokalman.radioastron import experiment, figures
from geokalman.radioastron.correlator import Plane
from geokalman.radioastron.model import SESSIONS
from geokalman.style import METHODS

RNG = np.random.default_rng(1)
pytestmark = pytest.mark.usefixtures("theme")


def dressed(figure: Figure, theme: dict[str, str], *units: str) -> None:
    """Paper and ink are the theme's, every unit stands on an axis, and the figure can be drawn."""
    assert same_color(figure.get_facecolor(), theme["paper"])
    labels = " ".join(axes.get_xlabel() + " " + axes.get_ylabel() for axes in figure.axes)
    for unit in units:
        assert unit in labels, (unit, labels)
    for axes in figure.axes:
        assert same_color(axes.xaxis.label.get_color(), theme["ink"])
    figure.canvas.draw()


def test_orbit_view(theme):
    u = np.linspace(0, 2 * np.pi, 200)
    orbit = 1e8 * np.column_stack([np.cos(u) - 0.5, 0.8 * np.sin(u), 0.1 * np.sin(u)])
    figure = figures.orbit_view(orbit, {"tracking": orbit[5:9], "observation": orbit[12:15]}, np.array([0.0, 0.6, 0.8]))
    dressed(figure, theme, "[1000 km]")
    x, y = line(figure.axes[0], "tracking").get_data()
    np.testing.assert_allclose(np.hypot(x, y), np.linalg.norm(orbit[5:9], axis=1) / 1e6)
    assert np.hypot(*(a[1] for a in line(figure.axes[0], "to the source").get_data())) <= 150.0 + 1e-9


def test_the_schematic_names_what_it_draws(theme):
    figure = figures.schematic()
    dressed(figure, theme)
    [axes] = figure.axes
    words = {text.get_text() for text in axes.texts}
    assert {"Earth", "Spektr-R", "tracking\nstation", "radio\ntelescope", "error before tracking"} <= words
    ellipse = axes.patches[-1]
    assert ellipse.get_width() < 0.1 * ellipse.get_height()  # thin along the line of sight
    assert all(np.isfinite(text.get_position()).all() for text in axes.texts)


def test_ground_track_is_cut_at_the_date_line(theme):
    figure = figures.ground_track(
        np.array([170.0, 178.0, -174.0]), np.array([10.0, 12.0, 14.0]), {"here": (30.0, 50.0), "there": (40.0, 60.0)}
    )
    dressed(figure, theme, "longitude [deg]", "latitude [deg]")
    assert np.isnan(line(figure.axes[0], "spacecraft").get_xdata()[2])
    assert {t.get_text() for t in figure.axes[0].texts} == {"here", "there"}


def test_elevation(theme):
    t = np.array([36000.0, 39600.0])
    figure = figures.elevation(
        t,
        {"Bear Lakes": np.array([20.0, 30.0]), "Evpatoria": np.array([15.0, 16.0])},
        [(36100.0, 36200.0)],
        (39000.0, 39500.0),
    )
    dressed(figure, theme, "UTC [h]", "elevation [deg]")
    np.testing.assert_array_equal(line(figure.axes[0], "Bear Lakes").get_xdata(), [10.0, 11.0])


def test_sizes_are_hollow_where_negative(theme):
    figure = figures.sizes({"a_term": -1e-3, "other": 2e-6}, "m/s", 1e-3, "noise")
    dressed(figure, theme, "[m/s]")
    axes = figure.axes[0]
    assert axes.get_xscale() == "log" and [t.get_text() for t in axes.get_yticklabels()] == ["other", "a_term"]
    first, second = axes.get_lines()[:2]
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["noise", "positive", "negative"]
    assert first.get_xdata()[0] == 2e-6 and second.get_xdata()[0] == 1e-3 and second.get_markerfacecolor() == "none"


def test_bars(theme):
    rows = {"one": {"before": 8.0, "after": 2.0}, "two": {"before": 8.0}}
    dots = figures.bars(rows, "sigma [µs]")
    dressed(dots, theme, "[µs]")
    assert dots.axes[0].get_xscale() == "log" and not dots.axes[0].containers
    np.testing.assert_array_equal(line(dots.axes[0], "before").get_xdata(), [8.0, 8.0])
    figure = figures.bars(
        rows, "sigma [µs]", log=False, errors={"one": {"before": 0.5, "after": 0.25}, "two": {"before": 1.0}}
    )
    dressed(figure, theme, "[µs]")
    whiskers = [c.get_segments() for c in figure.axes[0].collections]
    assert [round(float(s[:, 0].max()), 3) for s in whiskers[0]] == [8.5, 9.0]
    widths = {
        container.get_label(): [bar.get_width() for bar in container]
        for container in figure.axes[0].containers
        if hasattr(container, "patches")
    }
    assert widths == {"before": [8.0, 8.0], "after": [2.0]}


def test_ellipses(theme):
    """A sphere of 2 km and one flattened along the radius: circles, then a line as wide as the sphere."""
    sphere = np.eye(3) * 4e6
    figure = figures.ellipses({"prior": sphere, "ekf": np.diag([1.0, 4e6, 1e6])}, np.array([0.9, 0.3, 0.3]))
    dressed(figure, theme, "east [km]", "north [km]", "radial [km]")
    x, y = line(figure.axes[0], "before tracking").get_data()
    np.testing.assert_allclose(np.hypot(x, y), 2.0)
    x, y = line(figure.axes[1], "after tracking").get_data()
    assert np.abs(x).max() == pytest.approx(2.0, rel=1e-3) and np.abs(y).max() == pytest.approx(1e-3, rel=1e-2)
    x, y = (values[1] for values in line(figure.axes[0], "to the source").get_data())
    assert x == pytest.approx(y) and x > 0


def test_sweep(theme):
    x = np.array([1.0, 2.0])
    figure = figures.sweep(x, np.array([[2e-6, 1e-6], [4e-6, 1e-6]]), np.full((2, 2), 1e-10), "prior [km]")
    dressed(figure, theme, "[µs]", "[s/s]", "[km]")
    np.testing.assert_allclose(line(figure.axes[0], "before").get_ydata(), [2.0, 4.0])


def test_scans_show_medians_of_sizes(theme):
    delay = {"prior": RNG.normal(size=(30, 4)) * 5e-6, "ekf": RNG.normal(size=(30, 4)) * 1e-6}
    rate = {name: values * 1e-5 for name, values in delay.items()}
    figure = figures.scans(delay, rate, ((np.nan, np.nan), (1.8e-10, 2e-11)))
    dressed(figure, theme, "[µs]", "[1e-10 s/s]")
    np.testing.assert_allclose(
        line(figure.axes[0], figures.ORBITS["ekf"]).get_ydata(), 1e6 * np.median(np.abs(delay["ekf"]), axis=0)
    )
    levels = [
        artist.get_ydata()[0]
        for artist in figure.axes[1].get_lines()
        if artist.get_linestyle() == ":" and len(artist.get_ydata())
    ]
    np.testing.assert_allclose(sorted(levels), [0.2, 1.8])


def test_innovations_are_cut_at_the_gap(theme):
    t = np.r_[0.0:50.0:10.0, 6000.0:6050.0:10.0]
    figure = figures.innovations(t, np.column_stack([np.arange(10.0), -np.arange(10.0)]))
    dressed(figure, theme, "UTC [h]", "innovation / sigma")
    np.testing.assert_array_equal(line(figure.axes[1], "range").get_ydata(), np.arange(5.0, 10.0))


def test_covariance_history(theme):
    t = np.r_[0.0:50.0:10.0, 6000.0:6050.0:10.0]
    sigmas = np.column_stack([np.linspace(50, 4, 10), np.full(10, 1300.0), np.full(10, 1800.0)])
    figure = figures.covariance_history(t, sigmas)
    dressed(figure, theme, "[m]", "measurement")
    np.testing.assert_array_equal(line(figure.axes[0], "largest axis").get_ydata(), sigmas[:, 2])
    assert line(figure.axes[0], "between the passes").get_xdata()[0] == 5.5


def test_share_of_runs_that_gain_more(theme):
    figure = figures.histogram({"ekf": np.array([4.0, 1.0, 2.0, 20.0])}, 10.0, "gain")
    dressed(figure, theme, "gain", "share of runs")
    np.testing.assert_array_equal(
        line(figure.axes[0], figures.ORBITS["ekf"]).get_data(), [[1.0, 2.0, 4.0, 20.0], [1.0, 0.75, 0.5, 0.25]]
    )
    assert line(figure.axes[0], "printed").get_xdata()[0] == 10.0


def test_divergence(theme):
    figure = figures.divergence(np.arange(3.0), np.arange(3.0) ** 2, np.arange(3.0))
    dressed(figure, theme, "[m]", "[m/s]", "[s]")
    np.testing.assert_array_equal(figure.axes[0].get_lines()[0].get_ydata(), [0.0, 1.0, 4.0])


def test_corrections(theme):
    t = np.linspace(58000.0, 64000.0, 5)
    d = RNG.normal(size=(12, 5, 3)) * 2e3
    figure = figures.corrections(t, d, d[..., 0], {"dX": (2.5e3, 3.0e3)}, 3)
    dressed(figure, theme, "UTC [h]", "dX [km]", "dR [km]")
    np.testing.assert_allclose(line(figure.axes[1], "one run").get_ydata(), d[3, :, 1] / 1e3)


def test_planes(theme):
    rates, delays = np.linspace(-1, 1, 201), np.linspace(-30e-6, 30e-6, 301)
    both = []
    for k, top in ((130, 20.0), (103, 40.0)):
        snr = np.ones((201, 301))
        snr[k, 250] = top
        both.append(Plane(rates, delays, snr))
    figure = figures.planes(both, ("(a) one", "(b) two"), (0.2, 2e-6))
    dressed(figure, theme, "fringe rate [Hz]", "delay [µs]", "[SNR]")
    above = figure.axes[0]
    assert line(above, "(a) one").get_ydata().max() == 20.0 and line(above, "(b) two").get_ydata().max() == 40.0
    assert "0.30 Hz, 20.00 µs, SNR 20.0" in figure.axes[1].get_title()
    meshes = [axes.collections[0] for axes in figure.axes[1:3]]
    assert meshes[0].get_clim() == meshes[1].get_clim() == (0, 40.0)


def test_scan_snr_leaves_flagged_scans_out(theme):
    snr = {"prior": np.tile([30.0, 31.0, 32.0], (4, 1)), "ekf": np.tile([50.0, 51.0, 52.0], (4, 1))}
    figure = figures.scan_snr(snr, {"prior": (25, 30)}, (1,))
    dressed(figure, theme, "scan", "SNR")
    y = line(figure.axes[0], figures.ORBITS["ekf"]).get_ydata()
    assert np.isnan(y[1]) and y[0] == 50.0 and y[2] == 52.0
    band = figure.axes[0].collections[0].get_paths()[0].vertices  # of four runs, hence the range
    assert band[:, 1].min() == 30.0
    one = figures.scan_snr({"ekf": np.array([1.0, 2.0])}, {}, (), {"ekf": "filter"})
    np.testing.assert_array_equal(line(one.axes[0], "filter").get_ydata(), [1.0, 2.0])


def test_losses(theme):
    figure = figures.losses(np.array([0.0, 1e-10]), {"L 16 MHz": np.array([1.0, 0.8])}, (2e-11, 1.8e-10))
    dressed(figure, theme, "[1e-10 s/s]")
    np.testing.assert_allclose(line(figure.axes[0], "L 16 MHz").get_xdata(), [0.0, 1.0])


def test_around(theme):
    figure = figures.around(np.array([0.0, 90.0]), {"ST": np.array([0.2, 0.3])}, "share of draws", 0.1)
    dressed(figure, theme, "[deg]", "share of draws")
    np.testing.assert_array_equal(line(figure.axes[0], "ST").get_data(), [[0.0, 90.0], [0.2, 0.3]])


def test_ratio_histogram(theme):
    figure = figures.ratio_histogram(np.array([2.0, 1.0]), 2.0, "SNR ratio")
    dressed(figure, theme, "SNR ratio", "share of runs below")
    np.testing.assert_array_equal(line(figure.axes[0], "simulated runs").get_data(), [[1.0, 2.0], [0.25, 0.75]])


@pytest.mark.parametrize(("unit", "colour"), [("[km]", None), ("[s]", "red")])
def test_a_lost_unit_and_another_ink_are_seen(theme, unit, colour):
    figure, axes = plt.subplots()
    axes.set_xlabel("time [s]")
    dressed(figure, theme, "[s]")
    if colour:
        axes.xaxis.label.set_color(colour)
    with pytest.raises(AssertionError):
        dressed(figure, theme, unit)


def test_methods_keep_their_colours():
    assert {"prior", "ekf", "batch", "naive"} <= set(METHODS)


def test_everything_that_is_compared_has_a_name():
    assert set(figures.NAMES) == set(experiment.ALL) and len(set(figures.NAMES.values())) == len(figures.NAMES)
    assert set(figures.SESSION_NAMES) == set(SESSIONS)
    assert figures.case_name("ST range only") == "May 2013: range only"
    assert figures.case_name("OE two stations biases") == "March 2013: two stations, biases estimated"
    assert figures.case_name("OE") == "March 2013"
