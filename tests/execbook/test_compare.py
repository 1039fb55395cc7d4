"""Two runs side by side."""

import io
import json
import re
import shutil

import matplotlib.image
import numpy as np
import pytest

from execbook import compare, graph, overlay
from execbook.errors import Fault, Misuse


@pytest.fixture(scope="module")
def pair(built, tmp_path_factory, geokalman):
    """A built clone and a run of it with another slope."""
    root = shutil.copytree(built, tmp_path_factory.mktemp("pair") / "clone")
    done = geokalman(root, "run", "toy/01-line", "slope=2.2", "--out", "mine")
    assert done.returncode == 0, done.stderr
    return root, root / "mine"


def test_a_run_against_the_book(pair, geokalman):
    root, mine = pair
    done = geokalman(root, "compare", "mine")
    assert done.returncode == 0, done.stderr
    assert "slope: 2.2 | 2.0" in done.stdout and "+1.00e-01" in done.stdout and "53.90000" in done.stdout
    page = done.stdout.splitlines()[-1]
    assert page == str(mine / "compare.html")
    text = (mine / "compare.html").read_text()
    assert text.count("<img ") == 1 and "http" not in text and "slope: 2.2 | 2.0" in text


@pytest.mark.parametrize("rel, code", [("1e-9", 1), ("0.2", 0)])
def test_strict(pair, geokalman, rel, code):
    root, _ = pair
    done = geokalman(root, "compare", "mine", "toy/01-line", "--strict", "--rel", rel, "--out", "page")
    assert done.returncode == code and f"{2 if code else 0} of 2 differ by more than" in done.stderr


def test_rows(pair):
    root, mine = pair
    found = compare.compare(root, mine, graph.run_folder(root, "toy/01-line"))
    number, array = found.rows
    assert (number.key, number.left, number.right, number.unit) == ("line.mean", pytest.approx(53.9), 49.0, "m")
    assert number.difference == pytest.approx(4.9) and number.relative == pytest.approx(0.1)
    assert array.difference == pytest.approx(0.2 * 49) and array.relative == pytest.approx(0.1)
    assert compare.moved(found, 0.11) == [] and compare.moved(found, 0.09) == [number, array]


def test_against_the_stored_reference_where_there_is_no_book(pair, tmp_path, geokalman):
    root = shutil.copytree(pair[0], tmp_path / "clone")
    assert geokalman(root, "reference", "--reason", "x", "--no-quick").returncode == 0
    shutil.rmtree(root / "book" / "_build")
    done = geokalman(root, "compare", "mine")
    assert done.returncode == 0 and "right: reference (paper)" in done.stdout and "53.90000" in done.stdout
    assert "slope: 2.2 | 2.0" in done.stdout


def test_other_parameters_are_told_at_the_top_of_output_and_page(pair, tmp_path, geokalman):
    root = shutil.copytree(pair[0], tmp_path / "clone")
    assert geokalman(root, "run", "toy/01-line", "--quick", "--out", "quick").returncode == 0
    told = {
        "mine": "The numbers are expected to differ, because the parameters do "
        "(slope; left is at custom scale and right is at paper scale).",
        "quick": "The numbers are expected to differ, because the parameters do "
        "(n; left is at quick scale and right is at paper scale).",
    }
    for run, sentence in told.items():
        done = geokalman(root, "compare", run, "toy/01-line")
        assert done.stdout.splitlines()[0] == sentence
        assert f"<h1>Two runs compared</h1>\n<p><strong>{sentence}" in (root / run / "compare.html").read_text()
    same = geokalman(root, "compare", "toy/01-line", "toy/01-line", "--out", "same")
    assert same.stdout.startswith("left:") and "<strong>" not in (root / "same" / "compare.html").read_text()
    assert geokalman(root, "reference", "--reason", "x", "--no-quick").returncode == 0
    shutil.rmtree(root / "book" / "_build")
    assert geokalman(root, "compare", "mine").stdout.splitlines()[0] == told["mine"]


def test_what_cannot_be_compared(pair, tmp_path):
    root, mine = pair
    with pytest.raises(
        Misuse, match="mine is a run of toy/01-line, .* one of toy/02-constant; two runs of one notebook"
    ):
        compare.compare(root, mine, graph.run_folder(root, "toy/02-constant"))
    with pytest.raises(Misuse, match="nowhere is no folder of a run and no notebook"):
        compare.resolve(root, "nowhere", root)
    assert compare.resolve(root, "toy/02-constant", root) == graph.run_folder(root, "toy/02-constant")


def test_numbers_that_one_side_lacks():
    rows = compare._rows({"a": {"value": 1.0, "unit": "m"}}, {"b": {"value": 0.0, "unit": "s"}})
    found = compare.Comparison("", "", [], rows, [])
    assert [r.difference for r in rows] == [None, None] and compare.moved(found, 1.0) == rows
    assert compare._rows({"a": {"value": 1.0, "unit": ""}}, {"a": {"value": 0.0, "unit": ""}})[0].relative == np.inf


def grid():
    lon, lat = (g.ravel() for g in np.meshgrid(np.arange(0.0, 360, 30), np.arange(-80.0, 81, 20)))
    return {"longitude_deg": lon, "latitude_deg": lat, "geoid_m": np.sin(np.radians(lon))}


def axes_of(monkeypatch, left, right):
    """The axes that an overlay draws, colour bars left out."""
    seen = []
    monkeypatch.setattr("matplotlib.pyplot.close", seen.append)
    image = overlay.overlay(left, right, "name")
    assert matplotlib.image.imread(io.BytesIO(image)).ndim == 3
    assert seen[0].get_suptitle() == "name"
    return [a for a in seen[0].axes if a.get_xlabel() in left]


def test_a_map_is_shown_from_both_sides_and_by_its_difference(monkeypatch):
    left = grid()
    right = left | {"geoid_m": left["geoid_m"] - 0.1}
    drawn = [a.collections[0].get_array() for a in axes_of(monkeypatch, left, right)]
    assert [d.shape for d in drawn] == [(9, 12)] * 3
    np.testing.assert_allclose(drawn[1], np.tile(right["geoid_m"][:12], (9, 1)))
    np.testing.assert_allclose(drawn[2], 0.1)


def test_maps_of_other_places_have_no_difference_and_points_no_cells(monkeypatch):
    left = grid()
    right = {name: values[:-1] for name, values in left.items()}
    one, other = axes_of(monkeypatch, left, right)
    assert one.collections[0].get_array().shape == (9, 12)
    assert other.collections[0].get_offsets().shape == (107, 2)


def test_two_places_alone_are_a_track(monkeypatch):
    left = {name: values for name, values in grid().items() if name != "geoid_m"}
    [axis] = axes_of(monkeypatch, left, left)
    assert [line.get_xdata().size for line in axis.lines] == [108, 108]
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("longitude_deg", "latitude_deg")


def test_wide_positive_values_have_a_logarithmic_axis(monkeypatch):
    left = {"step_s": np.logspace(0, 4, 5), "rms_m": np.logspace(-9, -3, 5), "mean_m": np.linspace(-1, 1, 5)}
    scales = [(a.get_xscale(), a.get_yscale()) for a in axes_of(monkeypatch, left, left)]
    assert scales == [("log", "log"), ("log", "linear")]


def test_figures_without_columns_in_common():
    with pytest.raises(Fault, match="Figure f has fewer than two columns that both runs have"):
        overlay.overlay({"a": np.ones(2)}, {"a": np.ones(2), "b": np.ones(2)}, "f")


def test_columns_of_words_and_empty_tables_are_left_out(tmp_path):
    path = tmp_path / "f.csv"
    path.write_text("method,x\nUKF,1\nEKF,2\n")
    assert {k: v.tolist() for k, v in overlay.read_columns(path).items()} == {"x": [1.0, 2.0]}
    path.write_text("method,x\n")
    assert overlay.read_columns(path) == {}


def test_a_figure_that_cannot_be_drawn_is_named_with_the_reason(pair, tmp_path):
    root, mine = pair
    run = shutil.copytree(mine, tmp_path / "run")
    (run / "figures" / "line.csv").write_text("y_m\n1\n")
    found = compare.compare(root, run, graph.run_folder(root, "toy/01-line"))
    page = compare.write_page(found, tmp_path / "page").read_text()
    assert "<h3>line</h3>\n<p>Not drawn: Figure line has fewer than two columns" in page and "<img" not in page
    assert f"left: <code>{run}</code>" in page


def test_page_lists_every_number(pair):
    root, mine = pair
    numbers = json.loads((mine / "metrics.json").read_text())
    page = compare.write_page(compare.compare(root, mine, None), root / "other").read_text()
    assert all(re.search(rf"<td[^>]*>{re.escape(key)}\s*</td>", page) for key in numbers)
