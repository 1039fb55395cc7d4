"""DE421: against jplephem on the whole file, its own derivatives, distances that everybody knows, and what it
refuses."""

import struct

import numpy as np
import pytest

from geokalman.physics import ephemeris
from geokalman.physics.ephemeris import OutsideEphemeris, load_ephemeris
from geokalman.physics.spk import Segment, SpkError, read_spk

# Positions [m] by jplephem 2.24 from the whole de421.bsp at JD 2456658.5.
JPLEPHEM = {
    "mars": (-226109983615.99432, 92255241379.67479, 48416111603.76542),
    "sun": (147634380.56047082, -307094713.6359819, -148317672.29561153),
    "earth": (-26120416424.107727, 132494764415.9485, 57423117387.50029),
    "moon": (-26098102378.97526, 132157488768.80566, 57306110829.05666),
    "jupiter": (-198936876786.0572, 687998227588.5897, 299725487781.88007),
}


@pytest.mark.parametrize("body", JPLEPHEM)
def test_positions_are_those_of_jplephem(body):
    np.testing.assert_allclose(load_ephemeris().position(body, 2456658.5), JPLEPHEM[body], rtol=0, atol=1e-3)


@pytest.mark.parametrize("body", [b for b in ephemeris.BODIES if b != "ssb"])
def test_velocity_is_the_derivative_of_position(body):
    e, jd = load_ephemeris(), np.array([2455700.3, 2457000.123, 2458800.9])
    numeric = (e.position(body, jd, 30.0) - e.position(body, jd, -30.0)) / 60.0
    np.testing.assert_allclose(e.velocity(body, jd), numeric, atol=2e-3)


def test_distances():
    e, jd = load_ephemeris(), np.linspace(e0 := 2455600.0, e0 + 3000.0, 400)
    moon = np.linalg.norm(e.position("moon", jd, centre="earth"), axis=1)
    assert 3.56e8 < moon.min() < moon.max() < 4.07e8
    mars = np.linalg.norm(e.position("mars", jd, centre="sun"), axis=1) / 1.495978707e11
    assert 1.381 < mars.min() < mars.max() < 1.667
    np.testing.assert_allclose(e.position("sun", jd, centre="mars"), -e.position("mars", jd, centre="sun"))
    np.testing.assert_array_equal(e.position("ssb", jd), 0.0)


def test_the_records_join_smoothly():
    e = load_ephemeris()
    segment = next(s for s in e.segments if s.target == 301)
    seam = 2451545.0 + (segment.start + 50 * segment.length) / 86400.0
    both = e.position("moon", seam, np.array([-1e-3, 1e-3]), centre="earth")
    assert np.linalg.norm(both[1] - both[0]) < 10.0  # 2 ms at 1 km/s


def test_seconds_keep_their_digits():
    e = load_ephemeris()
    moved = e.position("earth", 2456658.5, 1e-3) - e.position("earth", 2456658.5)
    np.testing.assert_allclose(moved, 1e-3 * e.velocity("earth", 2456658.5), atol=1e-3)


@pytest.mark.parametrize("jd", [2455000.0, 2462502.5, 2400000.0, np.nan])
def test_a_time_outside_is_refused(jd):
    with pytest.raises(OutsideEphemeris, match="covers JD 24555"):
        load_ephemeris().position("mars", jd)


def test_an_unknown_body_is_refused():
    with pytest.raises(KeyError, match="vulcan"):
        load_ephemeris().position("vulcan", 2456658.5)
    with pytest.raises(KeyError, match="no segment"):
        ephemeris.Ephemeris("short", load_ephemeris().segments[:1]).position("moon", 2456658.5)


def write_spk(path, segments, kind=2, cut=None):
    """A minimal SPK file: file record, one summary record, one name record, the segments."""
    words, summaries, place = [], [], 3 * 128 + 1
    for s in segments:
        n, _, k = s.coefficients.shape
        mid = s.start + s.length * (np.arange(n) + 0.5)
        rows = np.column_stack([mid, np.full(n, s.length / 2), (s.coefficients / 1e3).reshape(n, 3 * k)])
        body = np.concatenate([rows.ravel(), [s.start, s.length, 3 * k + 2, n]])
        summaries.append(
            struct.pack("<2d6i", s.start, s.end, s.target, s.centre, 1, kind, place, place + len(body) - 1)
        )
        words.append(body)
        place += len(body)
    head = (
        b"DAF/SPK ".ljust(8) + struct.pack("<2i", 2, 6) + b" " * 60 + struct.pack("<3i", 2, 2, place) + b"LTL-IEEE"
    ).ljust(1024, b"\0")
    page = (struct.pack("<3d", 0, 0, len(segments)) + b"".join(summaries)).ljust(1024, b"\0")
    data = head + page + b" " * 1024 + np.concatenate(words).astype("<f8").tobytes()
    path.write_bytes(data[:cut])
    return path


def test_an_spk_file_is_read_back(tmp_path):
    kept = [s for s in load_ephemeris().segments if s.target in (4, 10)]
    path = write_spk(tmp_path / "two.bsp", kept)
    e = load_ephemeris(path)
    np.testing.assert_allclose(
        e.position("mars", 2456658.5, centre="sun"),
        load_ephemeris().position("mars", 2456658.5, centre="sun"),
        atol=1e-3,
    )
    assert e.name == "two.bsp"


def test_files_that_cannot_be_read_are_named(tmp_path):
    segment = [s for s in load_ephemeris().segments if s.target == 10]
    with pytest.raises(FileNotFoundError, match="no.bsp"):
        read_spk(tmp_path / "no.bsp")
    (tmp_path / "text.bsp").write_text("no ephemeris")
    with pytest.raises(SpkError, match="DAF/SPK"):
        read_spk(tmp_path / "text.bsp")
    with pytest.raises(SpkError, match="type 3"):
        read_spk(write_spk(tmp_path / "type3.bsp", segment, kind=3))
    with pytest.raises(SpkError, match="truncated"):
        read_spk(write_spk(tmp_path / "cut.bsp", segment, cut=9000))
    path = write_spk(tmp_path / "odd.bsp", segment)
    path.write_bytes(path.read_bytes().replace(b"LTL-IEEE", b"VAX-GFLT"))
    with pytest.raises(SpkError, match="VAX-GFLT"):
        read_spk(path)


def test_an_excerpt_stays_inside():
    segment = Segment(4, 0, 0.0, 10.0, np.zeros((5, 3, 4)))
    assert len(segment.excerpt(12.0, 31.0).coefficients) == 3
    with pytest.raises(ValueError, match="not inside"):
        segment.excerpt(-1.0, 20.0)
