"""Two runs side by side."""

import io
import json
import shutil

import matplotlib.image
import numpy as np
import pytest

from geokalman.reproduce import compare, graph
from geokalman.reproduce.errors import Fault, Misuse


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
    assert page == str(mine / "compare" / "compare.html")
    text = (mine / "compare" / "compare.html").read_text()
    assert text.count("<img ") == 1 and "http" not in text and "slope: 2.2 | 2.0" in text
    assert (mine / "compare" / "line.png").is_file()


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


def test_a_map_is_shown_by_its_difference():
    lon, lat = (g.ravel() for g in np.meshgrid(np.arange(0.0, 360, 30), np.arange(-80.0, 81, 20)))
    left = {"lon_deg": lon, "lat_deg": lat, "geoid_m": np.sin(np.radians(lon))}
    image = compare.overlay(left, left | {"geoid_m": np.zeros(lon.size)}, "map")
    assert matplotlib.image.imread(io.BytesIO(image)).ndim == 3
    assert image == compare.overlay(left, left | {"geoid_m": np.zeros(lon.size)}, "map")


def test_figures_without_columns_in_common():
    with pytest.raises(Fault, match="figure f has fewer than two columns that both runs have"):
        compare.overlay({"a": np.ones(2)}, {"a": np.ones(2), "b": np.ones(2)}, "f")


def test_page_lists_every_number(pair):
    root, mine = pair
    numbers = json.loads((mine / "metrics.json").read_text())
    page = compare.write_page(compare.compare(root, mine, None), root / "other").read_text()
    assert all(f"<td>{key}</td>" in page for key in numbers)
