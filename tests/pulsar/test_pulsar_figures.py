"""Every figure of the part: the data in its artists, its labels with units, in both themes."""

from __future__ import annotations

import artists
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import same_color

from geokalman.pulsar import figures
from geokalman.pulsar.model import PRESETS
from geokalman.style import METHODS

N = 60
EPOCH = np.arange(1, N + 1)
NAMES = ["B0531+21", "B1821-24", "B1937+21"]
RNG = np.random.default_rng(0)
pytestmark = pytest.mark.usefixtures("theme")


def data_of(axes, label):
    """x, y of the one line with this label."""
    return artists.line(axes, label).get_data()


def labelled(figure):
    """Every axes of the figure says what it shows, and every figure can be drawn."""
    figure.canvas.draw()
    assert all(axes.get_xlabel() or axes.get_ylabel() for axes in figure.axes)
    return figure


def test_schematic_names_what_is_observed_and_what_is_done_with_it():
    figure = figures.schematic()
    figure.canvas.draw()
    [axes] = figure.axes
    told = " ".join(text.get_text() for text in axes.texts)
    for word in (
        "barycentre",
        "Mars",
        "orbiter",
        "pulsar",
        "pulse",
        "$\\mathbf{n}\\cdot\\mathbf{r}$",
        *figures.drawings.STEPS,
    ):
        assert word in told, word
    assert not axes.axison


def test_every_set_up_has_its_name():
    assert set(figures.SETUPS) == {*PRESETS, "truthful"}
    assert len(set(figures.SETUPS.values())) == len(figures.SETUPS)


def test_orbit_view():
    states = np.column_stack([1e6 * np.cos(EPOCH), 1e6 * np.sin(EPOCH), 1e5 * EPOCH, *np.zeros((3, N))])
    figure = labelled(figures.orbit_view(states, 3.397e6))
    x, z = data_of(figure.axes[1], "orbit")
    np.testing.assert_allclose(x, states[:, 0] / 1e3)
    np.testing.assert_allclose(z, states[:, 2] / 1e3)
    assert [a.get_xlabel() for a in figure.axes] == ["x [km]", "x [km]", "y [km]"]
    assert figure.axes[0].patches[0].get_xy().max() == pytest.approx(3397.0)


def test_ranges():
    z = RNG.standard_normal((N, 3)) * 1e6
    figure = labelled(figures.ranges(500.0 * EPOCH, z, NAMES))
    t, y = data_of(figure.axes[0], "B1937+21")
    np.testing.assert_allclose(t, 500.0 * EPOCH / 3600)
    np.testing.assert_allclose(y, z[:, 2] / 1e3)
    assert "[km]" in figure.axes[0].get_ylabel() and "[h]" in figure.axes[0].get_xlabel()


@pytest.mark.parametrize("zoom", [0.0, 500.0])
def test_axis_errors_with_their_band(zoom):
    error, sigma = RNG.standard_normal((N, 3)) * 100, np.full((N, 3), 90.0)
    notes = ["one", "two", "three"]
    figure = labelled(figures.axis_errors(EPOCH, error, sigma, "position", "m", zoom=zoom, notes=notes, mark=17))
    for j, panel in enumerate(figure.axes):
        np.testing.assert_array_equal(data_of(panel, "estimate minus truth")[1], error[:, j])
        assert panel.get_title(loc="right") == notes[j]
        assert any(list(line.get_xdata()) == [17, 17] for line in panel.get_lines())
        [band] = panel.collections
        assert band.get_paths()[0].get_extents().ymax == pytest.approx(270.0)
        assert panel.get_ylabel() == f"{'XYZ'[j]} [m]"
        if zoom:
            assert panel.get_ylim() == (-zoom, zoom)
    assert "epoch" in figure.axes[-1].get_xlabel()


def test_consistency():
    series = {"ekf": np.full(N, 4e3), "aekf1_pr3": np.full(N, 0.7)}
    [axes] = labelled(figures.consistency(EPOCH, series, (0.2, 2.4))).axes
    np.testing.assert_array_equal(data_of(axes, "EKF")[1], 4e3)
    assert axes.get_yscale() == "log" and axes.get_ylabel() == "NEES / 6"


def test_against_paper():
    scores = {"ekf": np.array([1620.0, 200.0, 941.0]), "aekf1_prw": np.array([92.0, 20.0, 65.0])}
    figure = labelled(figures.against_paper(scores, {k: 0.02 * v for k, v in scores.items()}, (94.1, 19.5, 22.3)))
    for j, axes in enumerate(figure.axes):
        lines = [line for line in axes.get_lines() if line.get_label().startswith("paper")]
        assert lines[0].get_xdata()[0] == (94.1, 19.5, 22.3)[j]
        assert sorted(
            float(line.get_xdata()[0]) for line in axes.get_lines() if line.get_marker() in ("^", "o")
        ) == sorted(v[j] for v in scores.values())
        assert axes.get_xlabel() == f"RMS error in {'XYZ'[j]} [m]"
    assert [t.get_text() for t in figure.axes[0].get_yticklabels()] == ["EKF", "AEKF1, ratio"]


def test_seed_strip_takes_the_colour_of_the_filter_that_is_named():
    values = {
        "A, RAEKF 1.5/2.5": [3.0, 5.0],
        "EKF, cycle 123": [1.0],
        "EKF, IGG-III 3/8 on innovations": [2.0],
        "UKF": [],
        "the same + RTS smoother": [4.0],
    }
    stopped = {"UKF": 2, "EKF, cycle 123": 0}
    figure = figures.seed_strip(values, "3-D RMS error of a run [m]", marks={"paper": 2.5}, stopped=stopped)
    [axes] = labelled(figure).axes
    assert [t.get_text() for t in axes.get_yticklabels()] == [*list(values)[:3], "UKF (2 stopped)", *list(values)[4:]]
    means = [line for line in axes.get_lines() if line.get_marker() == "D"]
    assert [float(line.get_xdata()[0]) for line in means] == [4.0, 1.0, 2.0, 4.0]
    for line, key in zip(means, ("raekf", "ekf", "exact", "rts"), strict=True):
        assert same_color(line.get_color(), METHODS[key].colour)
    assert axes.get_xscale() == "log" and axes.get_ylim()[0] > axes.get_ylim()[1]


@pytest.mark.parametrize("logx", [True, False])
def test_curves(logx):
    x = np.array([2.0, 4.0, 20.0])
    [axes] = labelled(figures.curves(x, {"ekf": x**2, "aekf2": x}, "degree", "3-D RMS error [m]", logx=logx)).axes
    np.testing.assert_array_equal(data_of(axes, "EKF")[1], x**2)
    assert (axes.get_xscale() == "log") == logx and axes.get_yscale() == "log"


def test_noise_curve():
    q, d3, nis = np.array([1.0, 70.0, 150.0]), np.array([3235.0, 1206.0, 989.0]), np.array([58.0, 1.03, 0.88])
    left, right = labelled(figures.noise_curve(q, d3, nis)).axes
    np.testing.assert_array_equal(left.get_lines()[0].get_ydata(), d3)
    np.testing.assert_array_equal(right.get_lines()[0].get_ydata(), nis)
    assert "989 m, at 150 m" in left.get_title(loc="left")
    for axes in (left, right):
        assert data_of(axes, "least error")[0][0] == 150.0


def test_smoothing():
    [axes] = labelled(figures.smoothing(EPOCH, np.full(N, 9.0), np.full(N, 6.0), "3-D position error [m]")).axes
    assert data_of(axes, "EKF, smoothed")[1][0] == 6.0


def test_timing_terms():
    terms = {"Roemer": RNG.standard_normal((N, 3)), "differences": np.exp(RNG.standard_normal((N, 3)))}
    figure = labelled(figures.timing_terms(EPOCH, terms, NAMES, ["[s]", "[m]"]))
    assert [a.get_yscale() for a in figure.axes] == ["linear", "log"]
    np.testing.assert_array_equal(data_of(figure.axes[1], "B1821-24")[1], terms["differences"][:, 1])


def test_transition_errors():
    steps = np.array([10.0, 100.0, 500.0])
    blocks = {name: steps**2 * f for name, f in zip(("rr", "rv", "vr", "vv"), (1, 2, 3, 4), strict=True)}
    [axes] = labelled(figures.transition_errors(steps, blocks, steps**4)).axes
    np.testing.assert_array_equal(data_of(axes, "Markley, rv [s]")[1], 2 * steps**2)
    np.testing.assert_array_equal(data_of(axes, "integrated, rv [s]")[1], steps**4)


def test_sky_map():
    ra, dec, sigma = np.array([83.6, 276.1, 34.5]), np.array([22.0, -24.9, 42.5]), np.array([109.0, 326.0, 13718.0])
    [axes] = labelled(figures.sky_map(ra, dec, sigma, NAMES)).axes
    [dots] = axes.collections
    np.testing.assert_allclose(np.degrees(dots.get_offsets()), np.column_stack([[83.6, -83.9, 34.5], dec]))
    assert (np.diff(dots.get_sizes()) < 0).all()  # the better, the larger
    assert [t.get_text() for t in axes.texts] == ["B0531+21, 109 m", "B1821-24, 326 m", "B1937+21, 13718 m"]


def test_accuracy():
    t = np.geomspace(100, 1e5, 5)
    [axes] = labelled(figures.accuracy(t, np.outer([1.0, 3.0, 9.0], 1e4 / np.sqrt(t)), NAMES)).axes
    np.testing.assert_allclose(data_of(axes, "B1821-24")[1], 3e4 / np.sqrt(t))
    assert any(np.allclose(line.get_ydata(), 94.1) for line in axes.get_lines())


def test_arrival_residuals_in_milliseconds():
    t = 500.0 * np.arange(7)
    [axes] = labelled(
        figures.arrival_residuals(t, {"raw": np.full(7, 8e-3), "corrected": np.full(7, 2e-3)}, np.full(7, 1e-3))
    ).axes
    heights = [c.lines[0].get_ydata()[0] for c in axes.containers]
    assert heights == pytest.approx([8.0, 2.0]) and "[ms]" in axes.get_ylabel()


def test_orbit_scale():
    s = np.linspace(0, 2, 41)
    [axes] = labelled(figures.orbit_scale(s, 600 - 20 * (s - 1.2) ** 2, (0.98, 1.42))).axes
    shaded = axes.patches[0].get_extents().transformed(axes.transData.inverted())
    assert (shaded.x0, shaded.x1) == pytest.approx((0.98, 1.42))
    np.testing.assert_array_equal(axes.get_lines()[0].get_ydata(), 600 - 20 * (s - 1.2) ** 2)


def test_profiles_count_every_photon_twice():
    phase = RNG.random(1000)
    figure = labelled(figures.profiles({"one": phase, "two": phase - 7.0}))
    for axes in figure.axes:
        [stairs] = list(axes.patches)
        assert stairs.get_data().values.sum() == 2000
    assert "cycles" in figure.axes[-1].get_xlabel()


def test_axes_that_say_nothing_are_seen():
    figure, axes = plt.subplots(2)
    axes[0].set_xlabel("time [s]")
    with pytest.raises(AssertionError):
        labelled(figure)
    axes[1].set_ylabel("error [m]")
    labelled(figure)
