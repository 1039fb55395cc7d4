"""Figures of the recovered field: degrees, maps, ground track; what is drawn, in both themes."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from artists import assert_dressed, line, texts
from matplotlib.colors import same_color
from matplotlib.figure import Figure
from recoveredfield import DEGREE, IDS, errors, grids

from geokalman import style
from geokalman.grace import figures, observables, readings
from geokalman.grace.figures import field
from geokalman.style import METHODS


def test_degree_variances(theme):
    reference = 1e-10 / DEGREE**3.0
    recovered = {name: reference * (1 + 0.1 * k) for k, name in enumerate(("N1", "E1", "U2"))}
    figure = figures.degree_variances(DEGREE, reference, recovered)
    assert_dressed(figure, theme)
    assert [a.get_title() for a in figure.axes] == ["(a) Newton", "(b) EKF", "(c) UKF"]
    for axes, (name, values), label in zip(figure.axes, recovered.items(), ("Newton", "EKF", "UKF"), strict=True):
        np.testing.assert_array_equal(line(axes, "input field").get_xydata(), np.column_stack([DEGREE, reference]))
        np.testing.assert_array_equal(line(axes, label).get_xydata(), np.column_stack([DEGREE, values]))
        assert same_color(line(axes, label).get_color(), getattr(METHODS[figures.LOOK[name]], theme["name"]))
        assert axes.get_yscale() == "log" and axes.get_xlabel() == "degree n"
        assert texts(axes.get_legend()) == ["input field", label]
    assert figure.axes[0].get_ylabel() == "degree variance"
    assert len({a.get_ylim() for a in figure.axes}) == 1


def test_degree_differences(theme):
    variances, amplitudes = errors(("N1", "E1", "U2")), errors(("N1", "E1", "U2"))
    figure = figures.degree_differences(DEGREE, {k: 1e-12 * v for k, v in variances.items()}, amplitudes)
    assert_dressed(figure, theme)
    left, right = figure.axes
    labels = {name: figures.NAMES[name] for name in variances}
    for name, label in labels.items():
        np.testing.assert_allclose(line(left, label).get_xydata(), np.column_stack([DEGREE, 1e-12 * variances[name]]))
        np.testing.assert_allclose(line(right, label).get_xydata(), np.column_stack([DEGREE, amplitudes[name]]))
    assert left.get_ylabel() == "|difference of degree variances|"
    assert right.get_ylabel() == "error per degree in geoid height [m]"
    assert texts(figure.legends[0]) == list(labels.values())
    for axes in (left, right):
        assert axes.get_yscale() == "log" and axes.get_xlabel() == "degree n"


def test_amplitudes(theme):
    signal = 1.0 / DEGREE
    formal = {"U2": 1e-3 * np.exp(DEGREE / 25)}
    figure = figures.amplitudes(DEGREE, signal, errors(), formal)
    assert_dressed(figure, theme)
    [axes] = figure.axes
    [band] = axes.collections
    corners = band.get_paths()[0].vertices
    last = corners[corners[:, 0] == 70.0, 1]
    assert (last.min(), last.max()) == (pytest.approx(0.5 * formal["U2"][-1]), pytest.approx(2 * formal["U2"][-1]))
    assert same_color(band.get_facecolor()[0][:3], line(axes, figures.NAMES["U2"]).get_color())
    np.testing.assert_array_equal(line(axes, "signal").get_xydata(), np.column_stack([DEGREE, signal]))
    for name, values in errors().items():
        np.testing.assert_array_equal(line(axes, figures.NAMES[name]).get_xydata(), np.column_stack([DEGREE, values]))
    named = [figures.NAMES[name] for name in IDS]
    assert texts(figure.legends[0]) == ["UKF, acceleration state, if white", "signal", *named]
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_yscale()) == (
        "degree n",
        "amplitude per degree in geoid height [m]",
        "log",
    )


def test_every_observable_has_a_look_and_no_two_the_same(theme):
    assert set(figures.LOOK) == set(observables.IDS) == set(IDS)
    looks = [str(sorted(field._line(name).items())) for name in IDS]
    assert len(set(looks)) == len(IDS)


def images(figure: Figure) -> list:
    return [axes.images[0] for axes in figure.axes if axes.images]


def test_geoid_maps_share_one_symmetric_scale(theme):
    figure = figures.geoid_maps(grids())
    drawn, maps = images(figure), [axes for axes in figure.axes if axes.images]
    assert len(drawn) == 3
    limit = 1e3 * np.quantile(np.abs(grids()["(a) Newton"]), 0.995)
    for image, peak in zip(drawn, (5.0, 4.0, 1.0), strict=True):
        assert image.get_clim() == (pytest.approx(-limit), pytest.approx(limit))
        assert image.get_cmap().name == style.DIVERGING
        # The pattern is largest at longitude 0, which stands in the middle of the map, and smallest at its rims.
        values = np.ma.filled(image.get_array().astype(float), np.nan)
        row = values[values.shape[0] // 2]
        assert np.nanmax(values) == pytest.approx(peak * np.cos(np.radians(5)) ** 2, rel=1e-6)
        assert np.nanmin(values) == pytest.approx(-np.nanmax(values), rel=1e-6)
        assert row[row.size // 2] == pytest.approx(np.nanmax(values), rel=1e-6)
        inside = row[np.isfinite(row)]
        assert inside[0] < 0 and inside[-1] < 0
        assert np.nanmax(values[: values.shape[0] // 4]) < np.nanmax(values)  # towards a pole
    assert [axes.get_title(loc="left") for axes in maps] == list(grids())
    assert all(same_color(axes.get_facecolor(), theme["paper"]) for axes in maps)
    assert all(same_color(axes.spines["geo"].get_edgecolor(), theme["ink"]) for axes in maps)
    [bar] = [axes for axes in figure.axes if not axes.images]
    assert bar.get_xlabel() == "geoid-height difference [mm]"
    assert same_color(bar.xaxis.label.get_color(), theme["ink"])


def test_geoid_maps_are_not_upside_down():
    """South comes first in the grid and stands below in the map."""
    lat = np.radians(np.arange(-85.0, 90.0, 10.0))[:, None]
    with style.theme("light"):
        [image] = images(figures.geoid_maps({"north": np.sin(lat) * np.ones((1, 36))}, "m"))
    values = np.ma.filled(image.get_array().astype(float), np.nan)
    lower, upper = np.nanmean(values[: values.shape[0] // 4]), np.nanmean(values[-values.shape[0] // 4 :])
    assert (lower < -0.5 < 0.5 < upper) if image.origin == "lower" else (upper < -0.5 < 0.5 < lower)
    plt.close("all")


@pytest.mark.parametrize(("unit", "scale"), [("m", 1.0), ("µm", 1e6)])
def test_geoid_maps_with_scales_of_their_own(unit, scale):
    two = dict(list(grids().items())[:2])
    with style.theme("light"):
        figure = figures.geoid_maps(two, unit, shared=False)
    for image, grid in zip(images(figure), two.values(), strict=True):
        limit = scale * np.quantile(np.abs(grid), 0.995)
        assert image.get_clim() == (pytest.approx(-limit), pytest.approx(limit))
    labels = [axes.get_xlabel() for axes in figure.axes if not axes.images]
    assert labels == [f"geoid-height difference [{unit}]"] * 2
    plt.close("all")


def test_geoid_against_radius(theme):
    radii, rms = [0.0, 300.0, 500.0], {"N1": [0.139, 1.02e-2, 5.3e-3], "U2": [9.9e-3, 1.3e-3, 6.4e-4]}
    figure = figures.geoid_against_radius(radii, rms)
    assert_dressed(figure, theme)
    [axes] = figure.axes
    for name, values in rms.items():
        curve = line(axes, figures.NAMES[name])
        np.testing.assert_array_equal(curve.get_xydata(), np.column_stack([radii, values]))
        assert curve.get_markevery() == 1
    assert texts(axes.get_legend()) == [figures.NAMES["N1"], figures.NAMES["U2"]]
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_yscale()) == (
        "Gaussian radius [km]",
        "rms of geoid-height error [m]",
        "log",
    )


def test_geoid_by_method(theme):
    groups = {"alike": {"N1": 5.3e-3, "U1": 3.5e-3}, "own": {"U2": 6.4e-4, "Q2": 2.5e-4}}
    figure = figures.geoid_by_method(groups, 1.2e-2)
    assert_dressed(figure, theme)
    [axes] = figure.axes
    *points, omission = axes.get_lines()
    values = {name: value for group in groups.values() for name, value in group.items()}
    assert [p.get_label() for p in points] == [figures.NAMES[name] for name in values]
    np.testing.assert_allclose([p.get_xdata()[0] for p in points], [1e3 * value for value in values.values()])
    for point, method in zip(points, ("newton", "ukf", "ukf", "ukf"), strict=True):
        assert same_color(point.get_color(), getattr(METHODS[method], theme["name"]))
    assert omission.get_xdata()[0] == pytest.approx(12.0)
    shown = {text.get_text() for text in axes.texts}
    assert shown == {"alike", "own", "5.3", "3.5", "0.64", "0.25", "degrees left out"}
    places = dict(zip(axes.get_yticks(), (t.get_text() for t in axes.get_yticklabels()), strict=True))
    assert places == {p.get_ydata()[0]: p.get_label() for p in points}  # each name stands at its point
    assert (axes.get_xlabel(), axes.get_xscale()) == ("rms of geoid-height error [mm]", "log")
    assert axes.yaxis_inverted()  # the first group on top


def test_every_route_has_a_name_of_its_own():
    assert set(figures.NAMES) == {*observables.IDS, "Q2"} and len(set(figures.NAMES.values())) == len(figures.NAMES)
    for reading, route in readings.ROUTES.items():
        assert figures.ROUTE_NAMES[reading].endswith(f"({', '.join(route.values())})")


def test_ground_track(theme):
    lon, lat = np.linspace(-170, 170, 50), 80 * np.sin(np.linspace(0, 6, 50))
    figure = figures.ground_track(lon, lat)
    assert_dressed(figure, theme)
    [axes] = figure.axes
    [track] = axes.get_lines()
    np.testing.assert_array_equal(track.get_xydata(), np.column_stack([lon, lat]))
    assert track.get_linestyle() == "None" and track.get_rasterized()
    assert axes.get_extent() == pytest.approx(axes.projection.x_limits + axes.projection.y_limits)  # the whole globe
