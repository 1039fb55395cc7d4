"""Pulsar ephemerides in .par files: aliases, ecliptic positions, proper motion, time units, and damaged files."""

import random
import warnings

import numpy as np
import pytest

from geokalman.data import data_path
from geokalman.pulsar.par import ParError, ParWarning, par_direction, par_frequency, read_par
from geokalman.reading import InputError

GOOD = "PSR J1513-5908\nRAJ 15:13:55.52\nDECJ -59:08:09.0\nF0 6.5957\nF1 -6.6E-11\nPEPOCH 55576.6\n"
POSITION = (228.48133333333334, -59.13583333333333)


@pytest.fixture
def par_file(tmp_path):
    def write(text):
        path = tmp_path / "given.par"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def degrees(n):
    return np.degrees(np.arctan2(n[1], n[0])) % 360.0, np.degrees(np.arcsin(n[2]))


def changed(*pairs):
    text = GOOD
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.mark.parametrize(
    "text",
    [
        GOOD, GOOD.lower(), b"\xef\xbb\xbf" + GOOD[15:].encode(), GOOD.encode("utf-16"), GOOD.rstrip(),
        GOOD.replace("\n", "\r\n"),
        GOOD.encode() + "# r\xeaf".encode("latin-1"), GOOD.replace(" ", "\t"), GOOD.replace("\n", "  1  0.001\n"),
        changed(("E-11", "D-11")),
        changed(("E-11", "d-11"), ("6.5957", "6.5957D0"), ("55576.6", "0.555766D+05")), changed(("RAJ", "RA"),
        ("DECJ", "DEC")),
        changed(("15:13:55.52", "15h13m55.52s"),
        ("-59:08:09.0", "-59d08m09.0s")), GOOD + "C RAJ 1:2:3\n# RAJ 1:2:3\nc F0 9\n\n",
        changed(("55576.6", "55576.6 # days")), GOOD + "RAJ 15:13:55.52\n",
        GOOD + "JUMP -f a 1\nJUMP -f b 2\nT2EFAC -f a 1\nT2EFAC -f b 3\n",
        GOOD + "INFO\nWAVE1 1 2\nUNITS TDB\nCLK TT(TAI)\nEPHEM DE405\n",
        changed(("RAJ 15:13:55.52", "RAJ +15:13:55.52")),
        changed(("F0 6.5957", f"P0 {1 / 6.5957!r}"),
        ("F1 -6.6E-11", f"P1 {6.6e-11 / 6.5957**2!r}")), GOOD + f"P {1 / 6.5957!r}\n",
        changed(("PSR", "ECL IERS2010\nPSR")), GOOD + "ELONG 243.8910\nELAT -39.4025\n",
    ],
)  # fmt: skip
def test_the_same_pulsar_in_other_words(par_file, text):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        par = read_par(par_file(text))
        assert degrees(par_direction(par)) == pytest.approx(POSITION, abs=1e-10)
        assert par_frequency(par, 1e6, 2455577.1) == pytest.approx(6.5957 - 6.6e-5, abs=1e-14)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        (changed(("15:13", "15:74")), "line 2: RAJ = 15:74:55.52 has minutes or seconds of 60"),
        (changed(("08:09", "08:60")), "line 3: DECJ = -59:08:60.0 has"),
        (changed(("15:13", "24:13")), "line 2: RAJ = 24:13:55.52 is not between 0 and 24"),
        (changed(("15:13", "-1:13")), "line 2: RAJ = -1:13"),
        (changed(("-59:08", "-91:08")), "DECJ = -91:08:09.0 is not between -90 and 90"),
        (changed(("-59:08:09", "90:00:00.1")), "DECJ = 90:00:00.1.0"),
        (changed(("15:13:55.52", "228.48")), "line 2: RAJ = 228.48 is not written as 12:34:56.7; hours, minutes and seconds are needed, and if "
         "these are degrees, RAJ 15:13:55.20 is right."),
        (changed(("-59:08:09.0", "-59.13583")), "line 3: DECJ = -59.13583 .*; degrees, minutes and seconds are needed, .*, DECJ -59:08:08.99 is"),
        (changed(("15:13:55.52", "15 13 55")), "RAJ = 15 is not"),
        (changed(("-59:08:09.0", "-59:08:09:0")), "DECJ = -59:08:09:0 is not written"),
        (changed(("-59:08:09.0", "-59")), "DECJ = -59 is not written"),
        (changed(("-59:08:09.0", "-59:08.5:09")), "DECJ = -59:08.5:09 is not written"),
        (changed(("-59", "\u221259")), "is not written as 12:34:56.7"),
        (changed(("RAJ 15:13:55.52", "RAJ")), "line 2: RAJ has no value"),
        (changed(("DECJ -59:08:09.0\n", "")), "given.par: the parameter DECJ is missing .degrees, .* as in DECJ "),
        (GOOD + "F0 6.6\n", "line 7: F0 = 6.6 contradicts 6.5957 on line 4"),
        (GOOD + "RA 15:13:56\n", "line 7: RA = 15:13:56 contradicts 15:13:55.52 on line 2"),
        (GOOD + "P0 6.5957\n", "line 7: P0 = 6.5957 contradicts F0 = 6.5957"),
        (GOOD + "ELONG 244.9\nELAT -39.4\n", "line 7: ELONG and ELAT contradict RAJ and DECJ on line 2"),
        (GOOD + "ELONG 243.8\n", "the parameter ELAT is missing"),
        (GOOD + "ECL IERS1066\n", "line 7: ECL IERS1066 is unknown; it must be one of IERS2010"),
        (changed(("F0 6.5957", "F0 6,5957")), "line 4: F0 '6,5957' is not a number; the decimal mark"),
        (changed(("F0 6.5957", "F0 nan")), "line 4: F0 'nan' is not finite"),
        (changed(("F0 6.5957", "F0 0")), "F0 = 0 is not between 1e-05 and 2000"),
        (changed(("F0 6.5957", "F0 -6.6")), "F0 = -6.6 is not"),
        (changed(("F0 6.5957", "F0 6595.7")), "F0 = 6595.7 is not"),
        (changed(("F0 6.5957", "P0 151.6e3")), "line 4: P0 = 151.6e3 is not between 0.0005"),
        (changed(("F0 6.5957", "P0 -1")), "P0 = -1 is not"),
        (changed(("E-11", "E+11")), "line 5: F1 = -6.6E.11 is not between -1e-07 and 1e-07"),
        (changed(("55576.6", "2455577.1")), "line 6: PEPOCH = 2455577.1 is not between 36934 and 88069"),
        (changed(("PEPOCH 55576.6\n", "")), "parameter PEPOCH is missing"),
        (changed(("55576.6", "2011-01-15")), "PEPOCH '2011-01-15' is not a number"),
        (GOOD + "UNITS TT\n", "line 7: UNITS TT is unknown"),
        ("", "no line gives a position or a spin"), ("some text\nof no use\n", "this is no .par file"),
        ("# RAJ 15:13:55\n", "this is no .par file"),
        (b"PSR\0\1\2", "line 1: it has a zero byte"), (b"<!DOCTYPE html><p>log in", "this is a web page"),
        (b"PK\3\4", "a zip archive"),
    ],
)  # fmt: skip
def test_what_cannot_be_right_is_refused_by_line(par_file, text, match):
    path = par_file(text)
    with pytest.raises(ParError, match=match) as caught:
        read_par(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_what_a_use_needs_is_asked_for_by_the_use(par_file):
    with pytest.raises(ParError, match="position is missing: RAJ and DECJ, or ELONG and ELAT"):
        par_direction(read_par(par_file("F0 6.5957\n")))
    said = "the parameter F0 is missing .the frequency in Hz, as in F0 6.5957, or P0, .*the file has PSR, RAJ, DECJ.$"
    with pytest.raises(ParError, match=said):
        par_frequency(read_par(par_file(GOOD.partition("F0")[0])), 0.0, 2455577.1)
    assert par_frequency(read_par(par_file("F0 6.5957\n")), 0.0, 2455577.1) == 6.5957  # no F1: no PEPOCH
    with pytest.raises(FileNotFoundError, match="No pulsar's .par file at"):
        read_par("nothing.par")


@pytest.mark.parametrize(
    ("dec", "wanted"),
    [("-00:12:30.0", -0.20833333333333334), ("00:12:30", 0.20833333333333334),
     ("-59:08", -59.13333333333333), ("+59:08.25", 59.1375),
     ("-59:08:09.", -59.135833333333334), ("-59:8:9", -59.135833333333334), ("90:00:00", 90.0)],
)  # fmt: skip
def test_declinations(par_file, dec, wanted):
    par = read_par(par_file(changed(("-59:08:09.0", dec))))
    assert degrees(par_direction(par))[1] == pytest.approx(wanted, abs=1e-6 if wanted == 90.0 else 1e-12)


def test_ecliptic_positions(par_file):
    """The vendored B1937+21 against its catalogue place; each obliquity turns about the vernal equinox."""
    par = read_par(data_path("photons/b1937.par"))
    assert degrees(par_direction(par)) == pytest.approx((294.910672, 21.583090), abs=5e-7)
    assert par_frequency(par, 0.0, 2455321.5) == 641.9282333345536244
    ecliptic = "ELONG 301.9732445337270\nELAT 42.2967523367957\nF0 1\n"
    for name, shift in (("ECL IERS2003", -1e-4), ("ECL IERS1992", 6e-3), ("ECL IAU1976", 42e-3), ("", 0.0)):
        other = par_direction(read_par(par_file(ecliptic + name)))
        turned = np.arctan2(other[2], other[1]) - np.arctan2(par_direction(par)[2], par_direction(par)[1])
        assert np.degrees(turned) * 3600.0 == pytest.approx(shift, abs=1e-8)
    text = ecliptic.replace("301.9732445337270", "301:58:23.68").replace("42.2967523367957", "42:17:48.308")
    assert par_direction(read_par(par_file(text))) == pytest.approx(par_direction(par), abs=1e-7)
    for bad, match in (
        (("301.97", "391.97"), "ELONG = 391.97.* is not between -180 and 360"),
        (("42.29", "92.29"), "ELAT = 92.29"),
    ):
        with pytest.raises(ParError, match=match):
            read_par(par_file(ecliptic.replace(*bad)))


@pytest.mark.parametrize("epoch", ["POSEPOCH 50000\n", ""])
def test_proper_motion_is_that_of_its_own_axes(par_file, epoch):
    """At the node of both systems, east of one is not east of the other: they differ by the obliquity."""
    head = f"RAJ 00:00:00\nDECJ 00:00:00\nF0 1\nPEPOCH 50000\n{epoch}"
    for names, tilt in (
        (("PMRA", "PMDEC"), 0.0),
        (("PMELONG", "PMELAT"), 23.4392794),
        (("PMLAMBDA", "PMBETA"), 23.4392794),
    ):
        par = read_par(par_file(head + f"{names[0]} 36000\n{names[1]} 0\n"))
        moved = par_direction(par, 50000.0 + 100 * 365.25)  # 36 arcsec a year for a century: 1 degree
        angle = np.arctan(np.radians(1.0))
        wanted = np.array(
            [np.cos(angle), np.sin(angle) * np.cos(np.radians(tilt)), np.sin(angle) * np.sin(np.radians(tilt))]
        )
        assert moved == pytest.approx(wanted, abs=1e-9)
        assert par_direction(par).tolist() == [1.0, 0.0, 0.0]
    with pytest.raises(ParError, match="PMRA '12x' is not a number"):
        par_direction(read_par(par_file(head + "PMRA 12x\n")), 51000.0)


@pytest.mark.parametrize("units", ["TCB", "SI", "tcb"])
def test_barycentric_coordinate_time_is_converted_with_a_warning(par_file, units):
    with pytest.warns(ParWarning, match=f"line 7: UNITS {units.upper()}: F0, F1 and PEPOCH are turned from TCB"):
        par = read_par(par_file(GOOD + f"UNITS {units}\n"))
    ratio = par_frequency(par, 0.0, 2455577.1) / par_frequency(read_par(par_file(GOOD)), 0.0, 2455577.1)
    assert ratio - 1.0 == pytest.approx(1.550519792e-8, abs=3e-15 + 6.6e-11 * 20 / 6.6)  # PEPOCH moves by 17 s


@pytest.mark.parametrize("line", ["BINARY ELL1", "GLEP_1 55000"])
def test_what_is_left_out_of_a_frequency_is_told(par_file, line):
    par = read_par(par_file(f"{GOOD}{line}\n"))
    with pytest.warns(ParWarning, match=f"{line.split()[0]}: the pulsar's own orbit and glitches are left out"):
        assert par_frequency(par, 0.0, 2455577.1) == pytest.approx(6.5957, abs=1e-14)


@pytest.mark.parametrize("share", [0.5e-6, -2e-6])
def test_a_second_derivative_is_left_out_with_a_word_where_it_matters(par_file, share):
    """F2 t^2 / 2 is the share of the frequency after a hundred days."""
    since = 100 * 86400.0
    par = read_par(par_file(f"{GOOD}F2 {2 * share * 6.5957 / since**2!r}\n"))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assert par_frequency(par, since, 2455577.1) == pytest.approx(6.5957 - 6.6e-11 * since, abs=1e-14)
    told = [str(one.message) for one in said]
    assert told == [] if abs(share) < 1e-6 else "line 7: F2 = " in told[0] and "it would be -1.3e-05 Hz" in told[0]


def test_the_second_derivative_of_the_vendored_pulsar_is_as_small_as_is_said():
    """5.3e-7 Hz, a twelfth of f sigma sqrt(12 / n) / T of n = 7 times of arrival in T = 3500 s."""
    par = read_par(data_path("photons/b1509.par"))
    left = 0.5 * float(par["F2"]) * ((55576.6 - float(par["PEPOCH"])) * 86400.0) ** 2
    assert left == pytest.approx(5.3e-7, rel=0.02)
    sigma = 6.5957 * 2.643e-3 * np.sqrt(12 / 7) / 3500.0
    assert (sigma, sigma / left) == (pytest.approx(6.5e-6, rel=0.01), pytest.approx(12, abs=0.5))


@pytest.mark.filterwarnings("ignore::geokalman.pulsar.par.ParWarning")
def test_damaged_files_give_a_pulsar_or_one_sentence(par_file):
    rng = random.Random(0)
    refused = 0
    for _ in range(500):
        damaged = bytearray(GOOD.encode())
        damaged[rng.randrange(len(damaged))] = rng.choice(b"0123456789:.-+ED# \n\0\xff\xc3")
        try:
            par_frequency(par := read_par(par_file(bytes(damaged))), 0.0, 2455577.1)
            assert np.linalg.norm(par_direction(par)) == pytest.approx(1.0)
        except InputError as error:
            refused += 1
            assert "\n" not in str(error)
    assert 50 < refused < 450


@pytest.mark.parametrize("line", ["EPHVER 5", "EPHVER TEMPO2"])
def test_tempo2_without_units_counts_in_tcb(par_file, line):
    with pytest.warns(ParWarning, match=f"line 7: {line}: .* turned from TCB"):
        par = read_par(par_file(GOOD + line + "\n"))
    with pytest.warns(ParWarning, match="UNITS TCB"):
        wanted = read_par(par_file(GOOD + "UNITS TCB\n"))
    assert par_frequency(par, 0.0, 2455000.5) == par_frequency(wanted, 0.0, 2455000.5)


@pytest.mark.parametrize("more", ["EPHVER 2\n", "EPHVER 5\nUNITS TDB\n", "F0 6.59570\n", "EQUINOX J2000\n"])
def test_what_changes_no_value_is_read_without_a_word(par_file, more):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        par = read_par(par_file(GOOD + more))
    assert par_frequency(par, 0.0, 2455577.1) == pytest.approx(6.5957, abs=1e-9)


def test_another_equinox_is_refused(par_file):
    with pytest.raises(ParError, match="line 7: EQUINOX B1950: a position of J2000 is needed"):
        read_par(par_file(GOOD + "EQUINOX B1950\n"))


def test_no_proper_motion_needs_no_epoch(par_file):
    par = read_par(par_file("RAJ 15:13:55.52\nDECJ -59:08:09.0\nF0 6.5957\nPMRA 0\nPMDEC 0.0\n"))
    assert degrees(par_direction(par, 55000.0)) == pytest.approx(POSITION)
