"""DE421: against jplephem on the whole file, its own derivatives, distances that everybody knows, and what it
refuses."""

import gzip
import struct
from dataclasses import replace

import numpy as np
import pytest
from spkfiles import write_spk

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
    with pytest.raises(ValueError, match="body 'vulcan' is unknown"):
        load_ephemeris().position("vulcan", 2456658.5)
    with pytest.raises(SpkError, match="short has no segment of moon"):
        ephemeris.Ephemeris("short", load_ephemeris().segments[:1]).position("moon", 2456658.5)


def vendored(*targets):
    return [s for s in load_ephemeris().segments if s.target in targets]


JD = 2456658.5
SECONDS = (JD - 2451545.0) * 86400.0
SUN = vendored(10)[0]


def test_an_spk_file_is_read_back(tmp_path):
    e = load_ephemeris(write_spk(tmp_path / "two.bsp", vendored(4, 10)))
    wanted = load_ephemeris().position("mars", JD, centre="sun")
    np.testing.assert_allclose(e.position("mars", JD, centre="sun"), wanted, atol=1e-3)
    assert e.name == "two.bsp"


@pytest.mark.parametrize(
    "changes", [{"order": ">"}, {"stamp": b"NAIF/DAF"}, {"form": b"\0" * 8}, {"form": b"\0" * 8, "order": ">"}]
)
def test_byte_orders_and_old_files(tmp_path, changes):
    e = load_ephemeris(write_spk(tmp_path / "a.bsp", vendored(10), **changes))
    np.testing.assert_allclose(e.position("sun", JD), load_ephemeris().position("sun", JD), rtol=1e-14)


def test_a_packed_file(tmp_path):
    path = write_spk(tmp_path / "a.bsp", vendored(10))
    path.write_bytes(gzip.compress(path.read_bytes()))
    assert len(read_spk(path)) == 1


def test_type_3_has_velocities_of_its_own(tmp_path):
    """Against jplephem, with velocities that are not the derivative of the positions."""
    jplephem_spk = pytest.importorskip("jplephem.spk")
    part = SUN.excerpt(SECONDS - 5e6, SECONDS + 5e6)
    moving = replace(part, velocities=1e-6 * part.coefficients + 3.0)
    path = write_spk(tmp_path / "a.bsp", [moving], kind=3)
    e = load_ephemeris(path)
    with jplephem_spk.SPK.open(path) as kernel:
        state = 1e3 * kernel[0, 10].compute(JD)
    np.testing.assert_allclose(e.position("sun", JD), state[:3], rtol=1e-12)
    np.testing.assert_allclose(e.velocity("sun", JD), state[3:], rtol=1e-12)


def pieces(segment, *cuts):
    """The segment in pieces that end and begin at cuts [s]."""
    edges = [segment.start, *cuts, segment.end]
    return [replace(segment.excerpt(*pair), valid=pair) for pair in zip(edges, edges[1:], strict=False)]


def test_of_several_segments_the_one_that_covers_the_time(tmp_path):
    """DE441 has two segments for each body."""
    whole = load_ephemeris()
    halves = [half for s in vendored(3, 301, 399) for half in pieces(s, SECONDS - 3.3e6, SECONDS + 1.1e6)]
    e, jd = load_ephemeris(write_spk(tmp_path / "many.bsp", halves)), JD + np.linspace(-80.0, 80.0, 50)
    for body in ("earth", "moon"):
        np.testing.assert_allclose(e.position(body, jd), whole.position(body, jd), rtol=1e-14)
        np.testing.assert_allclose(
            e.velocity(body, jd, centre="emb"), whole.velocity(body, jd, centre="emb"), rtol=1e-9
        )


def test_of_several_segments_that_cover_a_time_the_last(tmp_path):
    later = replace(
        SUN.excerpt(SECONDS - 1e6, SECONDS + 1e6),
        coefficients=np.full((3, 3, 2), 1e6),
        start=SECONDS - 1.2e6,
        length=1e6,
    )
    e = load_ephemeris(write_spk(tmp_path / "a.bsp", [SUN, later]))
    np.testing.assert_allclose(e.position("sun", JD), 1e6 * (1 + 2 * (0.2 - 0.5)), rtol=1e-9)
    np.testing.assert_allclose(e.position("sun", JD + 100), load_ephemeris().position("sun", JD + 100), rtol=1e-14)


def test_the_interval_of_the_summary_holds_within_the_records(tmp_path):
    """DE438 and DE442s vouch for less than their records reach; and no claim reaches beyond the records."""
    inner = replace(SUN, valid=(SECONDS - 86400.0, SECONDS + 86400.0))
    e = load_ephemeris(write_spk(tmp_path / "a.bsp", [inner]))
    assert np.isfinite(e.position("sun", JD + 0.99)).all()
    with pytest.raises(
        OutsideEphemeris, match="JD 2456659.600 TDB is outside a.bsp, which covers JD 2456657.5 to 2456659.5 for sun"
    ):
        e.position("sun", JD + 1.1)
    outer = replace(SUN, valid=(SUN.start - 1e9, SUN.end + 1e9))
    with pytest.raises(OutsideEphemeris):
        load_ephemeris(write_spk(tmp_path / "b.bsp", [outer])).position("sun", 2469000.5)


def test_a_time_in_a_gap_is_refused_with_both_sides(tmp_path):
    first, _, last = pieces(SUN, SECONDS - 1e6, SECONDS + 1e6)
    e = load_ephemeris(write_spk(tmp_path / "a.bsp", [first, last]))
    with pytest.raises(OutsideEphemeris, match="covers JD 2455[0-9.]* to 2456646.9, 2456670.1 to 2458864.5 for sun"):
        e.position("sun", JD + np.array([-100.0, 0.0, 100.0]))


def test_a_body_is_not_held_to_the_span_of_another(tmp_path):
    short = pieces(vendored(4)[0], SECONDS - 1e6)[0]
    e = load_ephemeris(write_spk(tmp_path / "a.bsp", [SUN, short]))
    np.testing.assert_allclose(e.position("sun", JD), load_ephemeris().position("sun", JD), rtol=1e-14)


def test_a_chain_need_not_reach_the_barycentre(tmp_path):
    e = load_ephemeris(write_spk(tmp_path / "a.bsp", vendored(301, 399)))
    wanted = load_ephemeris().position("moon", JD, centre="earth")
    np.testing.assert_allclose(e.position("moon", JD, centre="earth"), wanted, rtol=1e-12)
    with pytest.raises(SpkError, match="a.bsp has no segment of emb, which leads from moon to ssb; it has earth, moon"):
        e.position("moon", JD)


def test_a_segment_that_cannot_be_read_matters_only_where_it_is_needed(tmp_path):
    path = write_spk(tmp_path / "a.bsp", vendored(4, 10), at_1076=struct.pack("<i", 21))  # the type of the first
    e = load_ephemeris(path)
    np.testing.assert_allclose(e.position("sun", JD), load_ephemeris().position("sun", JD), rtol=1e-14)
    with pytest.raises(
        SpkError, match="the segment of body 4 relative to 0 has data type 21 in frame 1; types 2 and 3"
    ):
        e.position("mars", JD)


def test_segments_that_refer_to_one_another(tmp_path):
    mars = vendored(4)[0]
    ring = [replace(mars, centre=5), replace(mars, target=5, centre=4), replace(SUN, centre=10)]
    e = load_ephemeris(write_spk(tmp_path / "a.bsp", ring))
    with pytest.raises(SpkError, match="a.bsp: the segments of mars and jupiter refer to one another only"):
        e.position("mars", JD)
    with pytest.raises(SpkError, match="the segments of sun refer"):
        e.position("sun", JD)


def trailer(offset, value):
    """The bytes of one of the last four words of the only segment: start, length, size, records."""
    return {f"at_{3 * 1024 + 8 * (SUN.coefficients.shape[0] * 35 + offset)}": struct.pack("<d", value)}


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"kind": 13}, "body 10 relative to 0 has data type 13 in frame 1; types 2 and 3 in frame 1"),
        ({"frame": 17}, "has data type 2 in frame 17"),
        ({"cut": 9000}, "has words 385 to 7633, and the file ends at 1125: it is truncated"),
        ({"cut": 1500}, "the file is truncated: its summaries are missing"),
        ({"form": b"VAX-GFLT"}, "number format 'VAX-GFLT' is unknown"),
        ({"stamp": b"DAF/CK  "}, "DAF file of kind CK, not an ephemeris"),
        ({"stamp": b"DAFETF N"}, "SPK in transfer format; make a binary one"),
        ({"stamp": b"no ephem"}, "does not begin with DAF/SPK"),
        ({"at_706": b"\n\r"}, "a transfer as text has damaged the file"),
        ({"at_8": struct.pack("<2i", 3, 6)}, "summaries of 3 doubles and 6 integers"),
        ({"at_76": struct.pack("<i", 0)}, "holds no segment"),
        ({"at_76": struct.pack("<i", 9999)}, "summary record 9999 is none of the records 2 to"),
        ({"at_76": struct.pack("<i", -3)}, "summary record -3 is none of the records"),
        ({"at_1024": struct.pack("<d", 2.0)}, "its summary records lead back to record 2"),
        ({"at_1040": struct.pack("<d", 1e9)}, "record 2 is damaged: it has 1e.09 summaries"),
        ({"at_1024": struct.pack("<d", np.nan)}, "record nan follows"),
        ({"at_1048": struct.pack("<2d", 5.0, 5.0)}, "covers 5 to 5 s since J2000: its end must come after its begin"),
        ({"at_1048": struct.pack("<2d", -2e9, -1e9)}, "claims -2e.09 to -1e.09 s since J2000, where it has no records"),
        ({"at_1080": struct.pack("<i", -7)}, "has words -7 to 7633"),
        (trailer(1, -5.0), "7249 words hold no 207 records of 35 words over -5 s"),
        (trailer(1, np.inf), "over inf s"),
        (trailer(2, 0.0), "207 records of 0 words"),
        (trailer(3, 0.0), "hold no 0 records"),
        (trailer(3, 1e18), "hold no 1e.18 records"),
        (trailer(0, 0.0), "the times of its records do not follow one another"),
        ({"at_3120": struct.pack("<d", np.nan)}, "record 1 has a number that is not below 1e20"),
    ],
)
def test_files_that_cannot_be_read_are_refused_in_one_sentence(tmp_path, changes, says):
    path = write_spk(tmp_path / "a.bsp", [SUN], **changes)
    with pytest.raises(SpkError, match=says) as caught:
        read_spk(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_distances_tell_kilometres(tmp_path):
    mars = vendored(4)[0]
    says = r"2.12e{}. m away, where 3e.10 to 1e.13 m are right; SPK files are in kilometres"
    for factor, power in ((1e3, r"\+1"), (1e-8, r"\+0")):  # metres; astronomical units, nearly
        with pytest.raises(SpkError, match=says.format(power)):
            read_spk(write_spk(tmp_path / "a.bsp", [replace(mars, coefficients=factor * mars.coefficients)]))


def test_no_file(tmp_path):
    with pytest.raises(FileNotFoundError, match="No SPK ephemeris at .*no.bsp"):
        read_spk(tmp_path / "no.bsp")


def test_an_excerpt_stays_inside():
    segment = Segment(4, 0, 0.0, 10.0, np.zeros((5, 3, 4)))
    assert len(segment.excerpt(12.0, 31.0).coefficients) == 3
    with pytest.raises(ValueError, match="not inside"):
        segment.excerpt(-1.0, 20.0)


def test_a_segment_of_no_length_is_passed_over(tmp_path):
    moment = replace(SUN, valid=(SECONDS, SECONDS))
    e = load_ephemeris(write_spk(tmp_path / "a.bsp", [SUN, moment]))
    np.testing.assert_allclose(e.position("sun", JD + 1), load_ephemeris().position("sun", JD + 1), rtol=1e-14)


@pytest.mark.parametrize(("factor", "words"), [(3.0, r"jumps by .* between records [23] and [34]"), (0.0, "record 3")])
def test_a_single_damaged_record_is_found(tmp_path, factor, words):
    mars = next(s for s in load_ephemeris().segments if s.target == 4)
    wrong = mars.coefficients.copy()
    wrong[2] *= factor
    with pytest.raises(SpkError, match=words):
        load_ephemeris(write_spk(tmp_path / "a.bsp", [replace(mars, coefficients=wrong)]))
