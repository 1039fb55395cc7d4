"""The vendored data: every file registered with source and licence, every checksum right, every script reproducible."""

import importlib.util
import json
import socket
import zipfile

import numpy as np
import pytest

from execbook import project
from geokalman import data as vendored
from geokalman.physics import harmonics
from geokalman.physics.harmonics import load_field

DATA = project.root() / "data"
FIELDS = {"source", "source_sha256", "licence", "citation", "script", "sha256", "bytes"}


def faults(root, name):
    """What is wrong with one registered file: missing words, another size, no exact source, no script."""
    entry = vendored.registry(root)[name]
    found = [field for field in sorted(FIELDS) if not entry.get(field)]
    if entry.get("bytes") != vendored.data_path(name, root).stat().st_size:
        found.append("bytes")
    if "==" not in entry.get("source", ""):
        found.append("source without a version")
    if not (root / entry.get("script", "-")).is_file():
        found.append("no such script")
    return found


def unregistered(root):
    """Files below `data/` that the registry does not know, and entries without a file."""
    own = {"registry.json", "LICENSES.md"}
    data = root / "data"
    found = {str(p.relative_to(data)) for p in data.rglob("*") if p.is_file() and "scripts" not in p.parts}
    return (found - own) ^ set(vendored.registry(root))


def without_licence(root):
    """Registered files whose name, or whose folder's, the page of licences does not give."""
    page = (root / "data" / "LICENSES.md").read_text(encoding="utf-8")
    return [name for name in vendored.registry(root) if f"`{name.partition('/')[0]}" not in page]


@pytest.mark.parametrize("name", sorted(vendored.registry()))
def test_each_vendored_file_is_whole_and_documented(name):
    assert not faults(DATA.parent, name)


def test_every_file_beside_the_registry_is_registered():
    assert not unregistered(DATA.parent) and not without_licence(DATA.parent)


@pytest.fixture
def planted(tmp_path):
    """A clone with one file and its sound entry, and a function that changes the entry."""
    (tmp_path / "data" / "scripts").mkdir(parents=True)
    (tmp_path / "data" / "scripts" / "make_toy.py").touch()
    (tmp_path / "data" / "toy.txt").write_text("toy")
    sound = dict.fromkeys(FIELDS, "x") | {
        "sha256": vendored.sha256(tmp_path / "data" / "toy.txt"), "bytes": 3, "source": "toy==1.0",
        "script": "data/scripts/make_toy.py",
    }  # fmt: skip

    def change(**entry):
        (tmp_path / "data" / "registry.json").write_text(json.dumps({"toy.txt": sound | entry}))
        return tmp_path

    return change


@pytest.mark.parametrize(
    ("entry", "found"),
    [
        ({}, []),
        ({"licence": ""}, ["licence"]),
        ({"bytes": 4}, ["bytes"]),
        ({"source": "toy, of late"}, ["source without a version"]),
        ({"script": "data/scripts/lost.py"}, ["no such script"]),
    ],
)
def test_a_fault_of_an_entry_is_seen(planted, entry, found):
    assert faults(planted(**entry), "toy.txt") == found


def test_strays_on_either_side_are_seen(planted):
    root = planted()
    assert not unregistered(root)
    (root / "data" / "stray.csv").touch()
    assert unregistered(root) == {"stray.csv"}
    (root / "data" / "toy.txt").unlink()
    assert unregistered(root) == {"stray.csv", "toy.txt"}


def test_a_file_without_a_licence_in_words_is_seen(planted):
    root = planted()
    for page, found in (("`toys.txt` is free", ["toy.txt"]), ("`toy.txt` is free", [])):
        (root / "data" / "LICENSES.md").write_text(page)
        assert without_licence(root) == found


def test_the_gravity_field_stays_small():
    assert (DATA / "egm96.npz").stat().st_size <= 1.1e6


def script(name, monkeypatch):
    monkeypatch.syspath_prepend(str(DATA / "scripts"))
    spec = importlib.util.spec_from_file_location(f"{name}_under_test", DATA / "scripts" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["egm96.npz", "jgm3.npz"])
def test_packing_a_field_gives_the_vendored_coefficients(name, monkeypatch, tmp_path):
    make = script("make_egm96", monkeypatch)
    field = load_field(name[:-4])
    packed = make.pack(field, make.FIELDS[name]["errors"])
    assert packed == make.pack(field, make.FIELDS[name]["errors"])
    (tmp_path / name).write_bytes(packed)
    with np.load(tmp_path / name) as again, np.load(DATA / name) as vendored:
        assert set(again) == set(vendored)
        for key in vendored:
            np.testing.assert_array_equal(again[key], vendored[key])


def test_scripts_refuse_a_wheel_that_is_not_the_pinned_one(monkeypatch, tmp_path):
    vendoring = script("vendoring", monkeypatch)
    monkeypatch.setattr(vendoring, "DATA", tmp_path)
    with zipfile.ZipFile(tmp_path / "wrong.whl", "w") as archive:
        archive.writestr("inner.txt", "words")
    with pytest.raises(SystemExit, match="wrong.whl has SHA-256 .*, not 00: not the toy 1.0 we vendored from"):
        vendoring.wheel("toy", "1.0", "00", str(tmp_path / "wrong.whl"))
    right = vendoring.wheel("toy", "1.0", vendored.sha256(tmp_path / "wrong.whl"), str(tmp_path / "wrong.whl"))
    with pytest.raises(SystemExit, match="inner.txt has SHA-256"):
        vendoring.extract(right, "inner.txt", "00")


def test_registering_a_file(monkeypatch, tmp_path, capsys):
    vendoring = script("vendoring", monkeypatch)
    monkeypatch.setattr(vendoring, "DATA", tmp_path)
    (tmp_path / "b.txt").write_text("b")
    vendoring.register("b.txt", licence="public domain")
    assert json.loads((tmp_path / "registry.json").read_text()) == {
        "b.txt": {"sha256": vendored.sha256(tmp_path / "b.txt"), "bytes": 1, "licence": "public domain"}
    }
    assert capsys.readouterr().out == "data/b.txt: 1 bytes\n"


def test_a_damaged_field_is_told_from_a_good_one(tmp_path, monkeypatch):
    (tmp_path / "egm96.npz").write_bytes((DATA / "egm96.npz").read_bytes()[:5000])
    monkeypatch.setattr(harmonics, "data_path", lambda name: tmp_path / name)
    with pytest.raises(vendored.CorruptedData, match="is no field made by data/scripts/make_egm96.py"):
        harmonics.load_field()


@pytest.fixture
def no_network(monkeypatch):
    """Cartopy without a network and without files of its own: what it is asked for is in the folder that is given."""
    cartopy = pytest.importorskip("cartopy")

    def refuse(*_, **__):
        raise OSError("a map wants the network")

    monkeypatch.setattr(socket, "getaddrinfo", refuse)
    monkeypatch.setitem(cartopy.config, "data_dir", "/nonexistent")
    return lambda folder: monkeypatch.setitem(cartopy.config, "pre_existing_data_dir", folder)


def test_maps_find_their_coastline_without_a_network(no_network, tmp_path):
    from cartopy.io import shapereader

    no_network(vendored.natural_earth_dir())
    for name, kind in (("coastline", "LineString"), ("land", "Polygon")):
        path = shapereader.natural_earth("110m", "physical", name)
        assert str(path).startswith(str(vendored.natural_earth_dir()))
        shapes = list(shapereader.Reader(path).geometries())
        assert len(shapes) > 100 and kind in shapes[0].geom_type
    no_network(tmp_path)
    with pytest.raises(OSError, match="wants the network"), pytest.warns(match="Downloading"):
        shapereader.natural_earth("110m", "physical", "land")
