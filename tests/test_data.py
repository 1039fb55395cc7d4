"""Where the clone is found from, and vendored files that are given out only when their checksum holds."""

import json
from pathlib import Path

import pytest

from geokalman import data


@pytest.fixture
def clone(tmp_path):
    """A small clone of the project, with one vendored file."""
    (tmp_path / "book").mkdir()
    (tmp_path / "book" / "_config.yml").write_text("title: toy\n")
    (tmp_path / "data" / "natural_earth").mkdir(parents=True)
    (tmp_path / "data" / "toy.txt").write_text("toy")
    (tmp_path / "data" / "natural_earth" / "land.shp").write_text("land")
    entries = {
        name: {"sha256": data.sha256(tmp_path / "data" / name)} for name in ("toy.txt", "natural_earth/land.shp")
    }
    entries["gone.txt"] = {"sha256": "0", "script": "data/scripts/make_gone.py"}
    (tmp_path / "data" / "registry.json").write_text(json.dumps(entries))
    return tmp_path


def test_the_clone_is_found_upward_else_where_the_package_stands(clone, monkeypatch, tmp_path_factory):
    (clone / "a" / "b").mkdir(parents=True)
    monkeypatch.chdir(clone / "a" / "b")
    assert data.data_path("toy.txt") == clone / "data" / "toy.txt"
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    assert data.data_path("egm96.npz") == Path(data.__file__).resolve().parents[2] / "data" / "egm96.npz"


def test_an_installed_wheel_says_that_it_carries_the_algorithms_alone(clone, monkeypatch, tmp_path):
    monkeypatch.setattr(data, "__file__", str(tmp_path / "lib" / "site-packages" / "geokalman" / "data.py"))
    monkeypatch.chdir(tmp_path / "book")
    (tmp_path / "data" / "registry.json").unlink()
    with pytest.raises(FileNotFoundError, match="the installed package carries the algorithms alone"):
        data.data_path("egm96.npz")


def test_a_whole_file_is_given_out(clone):
    assert data.data_path("toy.txt", clone).read_text() == "toy"
    assert data.natural_earth_dir(clone) == clone / "data" / "natural_earth"


def test_a_changed_file_stops_with_both_checksums(clone):
    path = clone / "data" / "toy.txt"
    wanted = data.sha256(path)[:12]
    path.write_text("toy!")
    with pytest.raises(
        data.CorruptedData, match=f"{data.sha256(path)[:12]}.*says {wanted}.*git checkout -- data/toy.txt"
    ):
        data.data_path("toy.txt", clone)


def test_a_changed_map_stops(clone):
    (clone / "data" / "natural_earth" / "land.shp").write_text("sea")
    with pytest.raises(data.CorruptedData, match="land.shp"):
        data.natural_earth_dir(clone)


def test_missing_and_unregistered_files(clone):
    with pytest.raises(FileNotFoundError, match="gone.txt is missing; restore it with: git checkout"):
        data.data_path("gone.txt", clone)
    with pytest.raises(KeyError, match="data/other is not in data/registry.json; registered are gone.txt"):
        data.data_path("other", clone)


def test_all_files_are_verified_at_once(clone):
    with pytest.raises(FileNotFoundError, match="gone.txt is missing"):
        data.verified(clone)
    (clone / "data" / "registry.json").write_text(
        json.dumps({"toy.txt": {"sha256": data.sha256(clone / "data" / "toy.txt")}})
    )
    assert data.verified(clone) == {"toy.txt": data.sha256(clone / "data" / "toy.txt")}
