"""Real photons: numbers of the specification; synthetic ones with a known answer."""

from dataclasses import replace

import numpy as np
import pytest

from geokalman.constants import C_LIGHT
from geokalman.data import data_path
from geokalman.physics.ephemeris import Ephemeris, OutsideEphemeris, load_ephemeris
from geokalman.pulsar import photons

NEAR = 6.5957


def vendored(name):
    return data_path(f"photons/{name}")


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
        (lambda t: photons.arrival_times(t, 100.0), "no pulsation within .* of 100 Hz: the largest Z.2, .* by chance"),
        (lambda t: photons.arrival_times(t, 5.0), "no pulsation within 0.002 Hz of 5 Hz"),
    ],
)
def test_what_cannot_be_timed(rxte, call, match):
    with pytest.raises(ValueError, match=match):
        call(rxte[0].t)


def test_searches_that_cannot_end_well_are_refused_before_the_work():
    t = np.array([0.0, 1.0, 5e8])
    with pytest.raises(ValueError, match="300 events over 5.79e.03 d would take 2e.07 frequencies"):
        photons.best_frequency(np.repeat(t, 100), NEAR)
    for same in (np.zeros(5), np.zeros(1)):
        with pytest.raises(ValueError, match="events all have the same time"):
            photons.best_frequency(same, NEAR)
    for phase, match in (([], "there are 0 phases"), ([0.1, np.nan], "2 phases, 1 of them finite")):
        with pytest.raises(ValueError, match=match):
            photons.z_squared(phase)


def test_where_a_parabola_has_fallen_by_one():
    s = np.linspace(0.0, 2.0, 81)
    low, high = photons.within_one(s, 600.0 - 20.0 * (s - 1.2) ** 2)
    assert (low, high) == pytest.approx((1.2 - 20**-0.5, 1.2 + 20**-0.5), abs=2e-3)
    for flat in (s, -s, np.ones(81)):
        with pytest.raises(ValueError, match="does not fall by one on both sides"):
            photons.within_one(s, flat)


def test_the_search_reaches_as_far_as_the_earth_moves():
    """A pulsar of 200 Hz as recorded on the Earth: the frequency is shifted by up to one part in ten thousand."""
    rng, frequency = np.random.default_rng(5), 200.0 * (1.0 + 1e-4)
    turns = np.sort(rng.choice(int(1000 * frequency), 3000, replace=False))
    t = (turns + 0.1 * rng.standard_normal(3000)) / frequency
    found, _ = photons.best_frequency(t, 200.0)
    assert found == pytest.approx(frequency, abs=0.1 / np.ptp(t))


def test_a_date_outside_the_vendored_years_with_an_ephemeris_of_ones_own(rxte):
    """The same Earth and the same photons, both 8000 days later: the same Roemer delays."""
    events, orbit, n = rxte
    later = 8000.0 * 86400.0
    segments = tuple(replace(s, start=s.start + later) for s in load_ephemeris().segments if s.target in (3, 399))
    moved = replace(events, jd=events.jd + 8000.0)
    with pytest.raises(OutsideEphemeris, match="outside DE421 .vendored excerpt."):
        photons.barycentred(moved, n, None)
    own = Ephemeris("own.bsp", segments)
    ours, theirs = photons.barycentred(moved, n, None, ephemeris=own), photons.barycentred(events, n, None)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-7)
    stay = replace(orbit, jd=orbit.jd + 8000.0)
    power = [
        photons.orbit_scale(e, n, o, NEAR, [1.0], eph) for e, o, eph in ((moved, stay, own), (events, orbit, None))
    ]
    assert power[0] == pytest.approx(power[1], rel=1e-6)
