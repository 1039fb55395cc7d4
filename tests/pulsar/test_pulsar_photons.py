"""Real photons: numbers of the specification; synthetic ones with a known answer; FITS files that are damaged."""

import gzip

import numpy as np
import pytest

from geokalman import files
from geokalman.constants import C_LIGHT
from geokalman.pulsar import photons
from geokalman.pulsar.fits import FitsError, parse_fits, read_fits

NEAR = 6.5957


def vendored(name):
    return files.data_path(f"photons/{name}")


@pytest.fixture(scope="module")
def rxte():
    events, orbit = (
        photons.read_events(vendored("b1509_rxte.fits.gz")),
        photons.read_orbit(vendored("rxte_orbit.fits.gz")),
    )
    return events, orbit, photons.par_direction(photons.read_par(vendored("b1509.par")))


def test_arrival_times_of_the_specification(rxte):
    events, orbit, n = rxte
    raw = photons.arrival_times(events.t, NEAR)
    earth = photons.arrival_times(photons.barycentred(events, n, None), NEAR)
    both = photons.arrival_times(photons.barycentred(events, n, orbit), NEAR)
    assert (len(events.t), events.local) == (25828, True)
    assert raw.rms == pytest.approx(8.07e-3, abs=1.5e-4) and raw.z2 == pytest.approx(585.1, abs=0.2)
    assert earth.rms == pytest.approx(8.08e-3, abs=1.5e-4)
    assert both.rms == pytest.approx(2.11e-3, abs=1.5e-4) and both.z2 == pytest.approx(637.9, abs=0.2)
    assert raw.sigma.mean() == pytest.approx(2.57e-3, abs=5e-6)
    assert raw.formal == pytest.approx(np.sqrt((raw.sigma**2).mean()))
    assert both.frequency == pytest.approx(6.595710, abs=2e-6)
    assert np.ptp(orbit.position(events.t, events.jd) @ n) / C_LIGHT == pytest.approx(22.3e-3, abs=5e-5)


def test_photons_that_carry_phases():
    nicer = photons.read_events(vendored("j0218_nicer.fits.gz"))
    assert (len(nicer.t), nicer.local) == (3361, False)
    assert nicer.exposure == pytest.approx(6724, abs=1)
    assert photons.h_test(nicer.phase) == pytest.approx(48.7, abs=0.05)
    with np.load(vendored("j0030_fermi.npz")) as fermi:
        assert len(fermi["phase"]) == 6973
        assert photons.z_squared(fermi["phase"], 2)[1] == pytest.approx(2167, abs=1)
    assert len(photons.read_events(vendored("ngc300_nicer.fits.gz")).t) == 2408


def test_photons_at_the_barycentre_are_not_corrected_twice(rxte):
    _, orbit, n = rxte
    with pytest.raises(ValueError, match="barycentre already"):
        photons.barycentred(photons.read_events(vendored("j0218_nicer.fits.gz")), n, orbit)


def test_an_orbit_of_another_day_is_refused(rxte):
    events, orbit, n = rxte
    other = photons.SatelliteOrbit(orbit.t + 86400.0 * 3, orbit.jd, orbit.r, orbit.v)
    with pytest.raises(ValueError, match="orbit file of their day"):
        photons.barycentred(events, n, other)


def test_positions_between_the_minutes_of_an_orbit(rxte):
    _, orbit, _ = rxte
    middle = photons.SatelliteOrbit(orbit.t[::2], orbit.jd, orbit.r[::2], orbit.v[::2]).position(
        orbit.t[1:-1:2], orbit.jd
    )
    assert np.abs(middle - orbit.r[1:-1:2]).max() < 100.0  # even over two minutes: 0.3 microseconds


def simulated(frequency, shift, n=40000, seconds=1000.0):
    rng = np.random.default_rng(0)
    t = np.sort(rng.uniform(0, seconds, 3 * n))
    return t[rng.uniform(0, 2, t.size) < 1 + np.cos(2 * np.pi * frequency * (t - shift(t)))]


def test_frequency_and_arrival_times_of_simulated_photons():
    t = simulated(7.0, lambda t: 0.0 * t)
    frequency, power = photons.best_frequency(t, 7.0005)
    assert frequency == pytest.approx(7.0, abs=2e-6)
    assert power == pytest.approx(len(t) / 2, rel=0.03)  # Z^2 = 2 N (1/2)^2 for full modulation
    timing = photons.arrival_times(simulated(7.0, lambda t: 0.01 * np.sin(np.pi * t / 1000) ** 2), 7.0, 100.0, 10)
    bend = 0.01 * np.sin(np.pi * timing.t / 1000) ** 2
    expected = bend - np.polyval(np.polyfit(timing.t, bend, 1), timing.t)
    assert np.abs(timing.residual - expected).max() < 5 * timing.formal
    assert timing.formal < 2e-3


def test_statistics_of_phases():
    assert photons.z_squared(np.zeros(50), 3).tolist() == pytest.approx([100.0, 200.0, 300.0])
    rng = np.random.default_rng(2)
    z = [photons.z_squared(rng.random(300))[0] for _ in range(400)]
    assert np.mean(z) == pytest.approx(2.0, abs=0.3)  # chi-square with two degrees of freedom
    assert photons.h_test(np.zeros(50)) == pytest.approx(20 * 100 - 4 * 19)


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda t: photons.arrival_times(t, NEAR, 500.0, 2), "from three pieces on"),
        (lambda t: photons.arrival_times(t, NEAR, 500.0, 9), "piece 9 of 500 s has no photon"),
        (lambda t: photons.best_frequency(t, 6.59722, 1e-3), "end of the interval"),
        (lambda t: photons.arrival_times(t, 100.0), "no pulsation within .* of 100 Hz: the largest Z.2, 6.* by chance"),
        (lambda t: photons.arrival_times(t, 5.0), "no pulsation within 0.002 Hz of 5 Hz"),
    ],
)
def test_what_cannot_be_timed(rxte, call, match):
    with pytest.raises(ValueError, match=match):
        call(rxte[0].t)


def test_where_a_parabola_has_fallen_by_one():
    s = np.linspace(0.0, 2.0, 81)
    low, high = photons.within_one(s, 600.0 - 20.0 * (s - 1.2) ** 2)
    assert (low, high) == pytest.approx((1.2 - 20**-0.5, 1.2 + 20**-0.5), abs=2e-3)
    for flat in (s, -s, np.ones(81)):
        with pytest.raises(ValueError, match="does not fall by one on both sides"):
            photons.within_one(s, flat)


def card(key, value):
    text = f"'{value}'" if isinstance(value, str) else ("T" if value is True else str(value))
    return f"{key:<8}= {text:>20}".ljust(80)


def table(header, columns, rows):
    """Bytes of a FITS file with one binary table; columns: (name, format, big-endian array)."""
    width = sum(c[2].dtype.itemsize for c in columns)
    cards = [
        card("XTENSION", "BINTABLE"),
        card("BITPIX", 8),
        card("NAXIS", 2),
        card("NAXIS1", width),
        card("NAXIS2", rows),
        card("PCOUNT", 0),
        card("TFIELDS", len(columns)),
    ]
    for k, (name, form, _) in enumerate(columns, 1):
        cards += [card(f"TTYPE{k}", name), card(f"TFORM{k}", form)]
    cards += [card(k, v) for k, v in header.items()] + ["END".ljust(80)]
    head = "".join([card("SIMPLE", True), card("BITPIX", 8), card("NAXIS", 0), "END".ljust(80)]).ljust(2880)
    body = "".join(cards)
    body = body.ljust(-(-len(body) // 2880) * 2880)
    data = b"".join(b"".join(c[2][i : i + 1].tobytes() for c in columns) for i in range(rows))
    return (head + body).encode() + data.ljust(-(-len(data) // 2880) * 2880, b"\0")


TIME = ("TIME", "D", np.array([1.0, 2.5], ">f8"))
GOOD = {"MJDREFI": 49353, "MJDREFF": 0.0007, "TIMEZERO": 3.5, "TIMEREF": "LOCAL", "EXTNAME": "EVENTS", "OBJECT": "X"}


def test_a_fits_table(tmp_path):
    extra = [("PHA", "1I", np.array([7, -3], ">i2")), ("FLAG", "B", np.array([1, 2], "u1"))]
    content = table(GOOD | {"TSCAL2": 0.5, "TZERO2": 100}, [TIME, *extra], 2)
    [found] = parse_fits(content, "x")
    assert found.columns["TIME"].tolist() == [1.0, 2.5] and found.columns["PHA"].tolist() == [103.5, 98.5]
    path = tmp_path / "events.fits.gz"
    path.write_bytes(gzip.compress(content))
    events = photons.read_events(path)
    assert events.t.tolist() == [4.5, 6.0] and events.jd == 2400000.5 + 49353.0007 and np.isnan(events.exposure)


@pytest.mark.parametrize(
    ("drop", "match"),
    [
        ("TIMEZERO", "lacks TIMEZERO"),
        ("MJDREFI", "lacks MJDREF"),
        ("MJDREFF", "lacks MJDREF"),
        ("TIMEREF", "TIMEREF = missing"),
    ],
)
def test_event_files_that_do_not_say_what_their_times_mean(tmp_path, drop, match):
    path = tmp_path / "events.fits"
    path.write_bytes(table({k: v for k, v in GOOD.items() if k != drop}, [TIME], 2))
    with pytest.raises(FitsError, match=match):
        photons.read_events(path)


def test_a_single_mjdref_serves_too(tmp_path):
    header = {k: v for k, v in GOOD.items() if not k.startswith("MJDREF")} | {"MJDREF": 50000.25}
    (tmp_path / "e.fits").write_bytes(table(header, [TIME], 2))
    assert photons.read_events(tmp_path / "e.fits").jd == 2450000.75


def test_files_that_are_damaged_or_other(tmp_path):
    content = table(GOOD, [TIME], 2)
    for name, data, match in (
        ("text", b"hello", "no FITS file"), ("cut", content[:5000], "truncated"),
        ("zip", gzip.compress(content)[:-20], "damaged or truncated"),
        ("form", table(GOOD, [("TIME", "Z", TIME[2])], 2), "unknown format"),
    ):  # fmt: skip
        path = tmp_path / name
        path.write_bytes(data)
        with pytest.raises(FitsError, match=match):
            read_fits(path)
    with pytest.raises(FileNotFoundError, match="nothing"):
        read_fits(tmp_path / "nothing")
    (tmp_path / "other").write_bytes(table(GOOD, [("PHA", "D", TIME[2])], 2))
    with pytest.raises(FitsError, match="column TIME"):
        photons.read_events(tmp_path / "other")
    with pytest.raises(FitsError, match="Vx, Vy, Vz"):
        photons.read_orbit(tmp_path / "other")
