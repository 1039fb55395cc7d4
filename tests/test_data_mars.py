"""The scripts that made the data of the pulsar part: the same bytes every time, verified as they are read."""

import gzip
import importlib.util
import io

import numpy as np
import pytest

from execbook import project
from geokalman import data
from geokalman.physics.ephemeris import load_ephemeris
from geokalman.physics.harmonics import load_field
from geokalman.physics.spk import Segment

DATA = project.root() / "data"


@pytest.fixture
def script(monkeypatch):
    """Load a script of data/scripts by its name."""
    monkeypatch.syspath_prepend(str(DATA / "scripts"))

    def load(name):
        spec = importlib.util.spec_from_file_location(f"{name}_of_mars", DATA / "scripts" / f"{name}.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load


def test_the_field_is_read_from_the_lines_of_its_file(script):
    make, field = script("make_gmm2b"), load_field("GMM2B")
    lines = [f"{field.radius!r}, {field.gm!r}, 7.4e-05, 80, 80, 1, 0.0, 0.0"]
    for n in range(2, field.n_max + 1):
        for m in range(n + 1):
            lines.append(
                f"{n}, {m}, "
                + ", ".join(repr(float(a[n, m])) for a in (field.C, field.S, field.sigma_C, field.sigma_S))
            )
    lines.append("80, 80, 1.0, 1.0, 1.0, 1.0")  # beyond the degree that is kept
    assert make.read("\n".join(lines)).digest() == field.digest()


def test_the_ephemeris_is_packed_from_its_segments(script, monkeypatch, tmp_path):
    make = script("make_de421")
    segments = list(load_ephemeris().segments)
    others = [Segment(199, 1, segments[0].start, segments[0].length, segments[0].coefficients)]
    monkeypatch.setattr(make, "read_spk", lambda path: segments + others)
    packed = make.pack(tmp_path / "any.bsp")
    assert packed == make.pack(tmp_path / "any.bsp")
    with np.load(io.BytesIO(packed)) as again, np.load(DATA / "de421.npz") as vendored:
        assert set(again) == set(vendored)
        for key in vendored:
            np.testing.assert_allclose(again[key], vendored[key], rtol=2e-15, atol=1e-300)


def test_photons_are_kept_as_they_are(script):
    make = script("make_photons")
    content = gzip.decompress((DATA / "photons" / "rxte_orbit.fits.gz").read_bytes())
    packed = make.convert("rxte_orbit.fits.gz", content)
    assert gzip.decompress(packed) == content and packed == make.convert("rxte_orbit.fits.gz", content)
    assert make.convert("b1509.par", b"F0 1") == b"F0 1"
    assert {f"photons/{name}" for name in make.FILES} == {n for n in data.registry() if n.startswith("photons/")}


def test_another_archive_is_refused(script, tmp_path):
    (tmp_path / "wrong.tar.gz").write_bytes(b"no archive")
    with pytest.raises(SystemExit, match="is not the pint-pulsar 1.1.8"):
        script("make_photons").archive(str(tmp_path / "wrong.tar.gz"))
