"""Where the project is found from, and vendored files that are given out only when their checksum holds."""

import json
import shutil

import pytest

from geokalman import files


@pytest.fixture
def clone(tmp_path):
    """A small clone of the project, with one vendored file."""
    (tmp_path / "book").mkdir()
    (tmp_path / "book" / "_config.yml").write_text("title: toy\n")
    (tmp_path / "data" / "natural_earth").mkdir(parents=True)
    (tmp_path / "data" / "toy.txt").write_text("toy")
    (tmp_path / "data" / "natural_earth" / "land.shp").write_text("land")
    entries = {
        name: {"sha256": files.sha256(tmp_path / "data" / name)} for name in ("toy.txt", "natural_earth/land.shp")
    }
    entries["gone.txt"] = {"sha256": "0", "script": "data/scripts/make_gone.py"}
    (tmp_path / "data" / "registry.json").write_text(json.dumps(entries))
    return tmp_path


def test_root_is_found_upward(clone, monkeypatch):
    monkeypatch.delenv("GEOKALMAN_ROOT", raising=False)
    (clone / "a" / "b").mkdir(parents=True)
    assert files.project_root(clone / "a" / "b") == clone
    monkeypatch.chdir(clone / "a")
    assert files.project_root() == clone


def test_root_that_is_told_comes_first_and_must_be_a_clone(clone, monkeypatch, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    monkeypatch.setenv("GEOKALMAN_ROOT", str(clone))
    assert files.project_root(elsewhere) == clone
    monkeypatch.setenv("GEOKALMAN_ROOT", str(elsewhere))
    with pytest.raises(files.ProjectNotFound, match=f"GEOKALMAN_ROOT={elsewhere} is no clone of geokalman"):
        files.project_root(clone)


def test_an_installed_wheel_says_that_it_carries_the_algorithms_alone(monkeypatch, tmp_path):
    monkeypatch.delenv("GEOKALMAN_ROOT", raising=False)
    package = tmp_path / "lib" / "site-packages" / "geokalman"
    package.mkdir(parents=True)
    shutil.copy(files.__file__, package / "files.py")
    monkeypatch.setattr(files, "__file__", str(package / "files.py"))
    with pytest.raises(files.ProjectNotFound, match="the installed package carries the algorithms alone"):
        files.project_root(tmp_path)


def test_a_whole_file_is_given_out(clone):
    assert files.data_path("toy.txt", clone).read_text() == "toy"
    assert files.natural_earth_dir(clone) == clone / "data" / "natural_earth"


def test_a_changed_file_stops_with_both_checksums(clone):
    path = clone / "data" / "toy.txt"
    wanted = files.sha256(path)[:12]
    path.write_text("toy!")
    with pytest.raises(
        files.CorruptedData, match=f"{files.sha256(path)[:12]}.*says {wanted}.*git checkout -- data/toy.txt"
    ):
        files.data_path("toy.txt", clone)


def test_a_changed_map_stops(clone):
    (clone / "data" / "natural_earth" / "land.shp").write_text("sea")
    with pytest.raises(files.CorruptedData, match="land.shp"):
        files.natural_earth_dir(clone)


def test_missing_and_unregistered_files(clone):
    with pytest.raises(FileNotFoundError, match="gone.txt is missing; restore it with: git checkout"):
        files.data_path("gone.txt", clone)
    with pytest.raises(KeyError, match="data/other is not in data/registry.json; registered are gone.txt"):
        files.data_path("other", clone)
