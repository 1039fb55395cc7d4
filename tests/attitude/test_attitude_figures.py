"""Artist tests: what the figures show is what they were given, with labels and units, in both themes."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest

from geokalman import style
from geokalman.attitude import figures, gravity_figures, schematic_figures
from geokalman.attitude.estimate import FILTERS
from geokalman.attitude.model import AXES
from geokalman.attitude.pointing import asd


@pytest.fixture(autouse=True, params=["light", "dark"])
def drawn_in(request):
    with style.theme(request.param):
        yield request.param
    plt.close("all")


def labels(figure):
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def test_series_and_spectra():
    t = np.arange(3000.0)
    series = {"mekf": np.random.default_rng(0).standard_normal((3000, 3)) * 1e-6, "jpl_like": np.ones((3000, 3)) * 1e-6}
    series["jpl_like"][100:200] = np.nan
    series["jpl_like"][::7] *= 2
    figure = figures.series_and_spectra(t, series, 1.0, "µrad", 1e6, band=(0.1, 0.2), show_s=1000.0)
    axes = np.array(figure.axes).reshape(3, 2)
    for i, name in enumerate(AXES):
        assert axes[i, 0].get_ylabel() == f"{name} [µrad]" and axes[i, 1].get_ylabel() == "ASD [µrad/√Hz]"
        x, y = axes[i, 0].lines[0].get_data()
        np.testing.assert_allclose(x, t[:1001] / 3600)
        np.testing.assert_allclose(y, 1e6 * series["mekf"][:1001, i])
        _f, density = asd(series["mekf"], 1.0)
        np.testing.assert_allclose(axes[i, 1].lines[0].get_data()[1], 1e6 * density[:, i])
        assert np.isfinite(axes[i, 1].lines[1].get_data()[1]).all()
    assert axes[2, 0].get_xlabel() == "time [h]" and axes[2, 1].get_xlabel() == "frequency [Hz]"
    assert labels(figure) == ["multiplicative filter", "official product (stand-in)"]
    renamed = figures.series_and_spectra(
        t, {"mekf": series["mekf"][:, :1]}, 1.0, "nm/s", 1e9, ("rate",), labels={"mekf": "the rate"}
    )
    assert labels(renamed) == ["the rate"]


def test_bars_stand_beside_what_is_printed():
    figure = figures.bars(
        {"akf7": [1, 2, 3], "jpl_like": [4, 5, 6]}, {"akf7": [0.1] * 3}, "std [10⁻⁷ rad/s]", {"akf7": [1.5, 2.5, 3.5]}
    )
    axes = figure.axes[0]
    assert sorted(bar.get_height() for bar in axes.patches) == [1, 2, 3, 4, 5, 6]
    dashes = [
        s[0][1] for c in axes.collections if len(c.get_segments()) == 3 for s in c.get_segments() if s[0][1] == s[1][1]
    ]
    assert dashes == [1.5, 2.5, 3.5]
    assert axes.get_ylabel() == "std [10⁻⁷ rad/s]" and [x.get_text() for x in axes.get_xticklabels()] == list(AXES)


def test_closeness_and_accuracy():
    figure = figures.closeness_and_accuracy(
        {"default": [("mekf", 1e-7, 2e-6, 1e-7)], "paper-tuned": [("mekf", 2e-7, 3e-6, 0.0), ("rts", 1e-7, 1e-6, 0.0)]}
    )
    left, right = figure.axes
    assert left.lines[0].get_data() == ([pytest.approx(1.0)], [pytest.approx(2.0)])
    assert left.get_title() == "default"
    assert sum(line.get_marker() in "^o" for line in right.lines) == 2
    bar = left.collections[0].get_segments()[0]
    np.testing.assert_allclose(bar, [(1.0, 1.9), (1.0, 2.1)])
    assert "10⁻⁷ rad/s" in left.get_xlabel() and "µrad" in left.get_ylabel()


def test_running_consistency():
    t = np.arange(1000.0)
    figure = figures.consistency(t, {"mekf": np.full(1000, 3.0)}, {"mekf": np.full(1000, 6.0)}, 100, (0.9, 1.1))
    np.testing.assert_allclose(figure.axes[0].lines[0].get_data()[1], 1.0)
    np.testing.assert_allclose(figure.axes[1].lines[0].get_data()[1], 2.0)
    assert figure.axes[0].get_ylabel() == "NIS / 3" and "95 % if independent" in labels(figure)


def test_weights_gyro_and_changes():
    figure = figures.weights([1.0, 9.0], np.array([[60e-6, 80e-6, 79e-6], [16e-6, 18e-6, 18e-6]]), 9.0)
    np.testing.assert_allclose(figure.axes[0].lines[0].get_data()[1], [60, 16])
    assert "µrad" in figure.axes[0].get_ylabel()
    t = np.arange(100.0)
    wrapped = np.where(t < 40, 5700 + t, t - 5700)
    figure = figures.gyro_chain(t, wrapped, t, t, 1e-8 * t, 5e-7, 20.0)
    np.testing.assert_allclose(figure.axes[0].lines[1].get_data(), [t[19:60] / 60, t[19:60]])
    np.testing.assert_allclose(figure.axes[1].lines[0].get_data()[1], 10 * t)
    assert [line.get_ydata()[0] for line in figure.axes[1].lines[1:]] == pytest.approx([-500, 500])
    assert labels(figure) == ["as it comes", "unwrapped", "fault, if beyond for 1 s"]
    assert (
        figure.axes[1].get_ylabel() == "parity residual [nrad]"
        and figure.axes[0].get_ylabel() == "filtered angle [deg]"
    )
    figure = figures.mean_changes({"C": [0, -5e-4, 0], "D": [0, 5e-4, 0]}, {"C": -5.5e-4, "D": 5.5e-4}, 6e-4)
    assert [round(bar.get_height(), 6) for bar in figure.axes[0].patches] == [0, -0.5, 0, 0, 0.5, 0]
    assert figure.axes[0].get_ylabel() == "change of the mean [mrad]"
    assert "printed, no sign given" in figure.axes[0].get_legend_handles_labels()[1]


def test_gap_and_settling():
    t = np.arange(100.0)
    error = {"mekf": np.full((100, 3), 1e-6), "rts": np.zeros((100, 3))}
    figure = figures.gap(t, error, {n: np.full((100, 3), 2e-6) for n in error}, 40.0, 20.0)
    np.testing.assert_allclose(figure.axes[0].lines[0].get_data()[0], t - 40)
    band = figure.axes[0].collections[0].get_paths()[0].vertices[:, 1]
    assert band.min() == pytest.approx(-4.0) and band.max() == pytest.approx(4.0)
    figure = figures.settling(t, {"60 deg": np.exp(-t)})
    np.testing.assert_allclose(figure.axes[0].lines[0].get_data()[1], np.exp(-t))
    assert figure.axes[0].get_ylabel() == "attitude error [rad]"


def test_gravity_figures():
    degree = np.arange(2, 10)
    figure = gravity_figures.degree_variances(
        degree, {"signal": ("season", 1e-20 * degree), "none": ("difference", 1e-28 * degree)}
    )
    np.testing.assert_allclose(figure.axes[0].lines[1].get_data()[1], 1e-28 * degree)
    assert figure.axes[0].get_yscale() == "log" and figure.axes[0].get_xlabel() == "degree n"
    grid = np.outer(np.linspace(-1, 1, 18), np.ones(36)) * 1e-3
    figure = gravity_figures.water_maps({"one": (grid, "mm", 1e-3), "two": (2 * grid, "µm", 1e-6)})
    bars = [a for a in figure.axes if a.get_xlabel()]
    assert [a.get_xlabel() for a in bars] == ["equivalent water height [mm]", "equivalent water height [µm]"]
    assert figure.axes[0].images[0].get_clim() == pytest.approx((-1.0, 1.0), rel=0.02)


def test_the_schematic_names_sensors_axes_and_pages():
    figure = schematic_figures.chain()
    figure.canvas.draw()
    words = " ".join(text.get_text() for axes in figure.axes for text in axes.texts)
    for word in ("line of sight", "pitch θ", "camera 1", "antenna", "four gyros", "Kalman filter", "predict", "update"):
        assert word in words
    assert {f"page {k}" for k in (1, 3, 5, 7, 8, 9)} <= {
        line for t in figure.axes[1].texts for line in t.get_text().split("\n")
    }
    spans = [text.get_window_extent() for text in figure.axes[1].texts]
    assert all(a is b or not a.overlaps(b) for a in spans for b in spans)


def test_every_filter_has_one_name_for_readers():
    assert set(FILTERS) <= set(figures.NAMES) and len(set(figures.NAMES.values())) == len(figures.NAMES)
    figure = figures.bars({name: [1, 2, 3] for name in FILTERS}, {}, "error [µrad]")
    figure.canvas.draw()
    assert labels(figure) == [figures.NAMES[name] for name in FILTERS]
    edge = figure.legends[0].get_window_extent()
    assert edge.x0 >= 0 and edge.x1 <= figure.bbox.x1
