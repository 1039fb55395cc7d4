"""The correlator against the specification's table, against raw samples, and against itself."""

import numpy as np
import pytest

from geokalman import memory
from geokalman.radioastron import assess, experiment
from geokalman.radioastron.correlator import (
    RawSamples,
    Setup,
    coherence,
    find,
    plane,
    polynomial,
    raw_check,
    scan_snr,
    search,
    visibilities,
    within_window,
)

GRID = {"L16": ("L", 16e6, 256), "L32": ("L", 32e6, 512), "C16": ("C", 16e6, 256), "C32": ("C", 32e6, 512)}
TABLE = [
    (2e-11, 0.0, (0.959, 0.971, 0.952, 0.970)), (1.8e-10, 0.0, (0.635, 0.301, 0.467, 0.223)),
    (0.0, 1e-15, (0.990, 0.990, 0.919, 0.919)),
    (0.0, 3e-15, (0.913, 0.912, 0.525, 0.525)), (0.0, 5e-15, (0.772, 0.770, 0.418, 0.417)),
    (1.8e-10, 3e-15, (0.601, 0.327, 0.333, 0.267)),
]  # fmt: skip
SMALL = Setup(n_channels=64, duration=30.0, padding=2)


@pytest.mark.parametrize(("rate", "acceleration", "wanted"), TABLE)
def test_coherence(rate, acceleration, wanted):
    ours = [coherence(Setup(band, width, channels), rate, acceleration) for band, width, channels in GRID.values()]
    assert ours == pytest.approx(wanted, abs=0.01)


def test_nothing_is_lost_without_residuals_nor_by_a_constant_delay():
    assert coherence(SMALL, 0.0, 0.0) == pytest.approx(1.0, abs=1e-9)
    lag = (
        SMALL.sample * 2
    )  # one lag of the padded grid at 64 channels: on a grid cell, only the segment's overlap is lost
    cells = visibilities(SMALL, *polynomial(SMALL, lag, 0.0, 0.0), snr0=1.0)
    peak = find(SMALL, cells)
    assert peak.delay == pytest.approx(lag) and peak.snr == pytest.approx(1.0 - 1.0 / 64, abs=1e-9)


def test_figure_1():
    wide = Setup("L", 16e6, 1024, padding=1)
    for (delay, rate), (f, d, snr) in (
        ((20.3e-6, 1.8e-10), (0.3017, 20.375e-6, 23.4)),
        ((19.3e-6, 2e-11), (0.0333, 19.3125e-6, 40.4)),
    ):
        peak = search(
            plane(wide, visibilities(wide, *polynomial(wide, delay, rate, 0.0), rng=np.random.default_rng(42)))
        )
        assert peak.rate == pytest.approx(f, abs=1 / 600 + 1e-4) and peak.delay == pytest.approx(d, abs=62.6e-9)
        assert peak.snr == pytest.approx(snr, abs=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_the_quick_search_finds_the_peak_of_the_plane(seed):
    rng = np.random.default_rng(seed)
    cells = visibilities(SMALL, *polynomial(SMALL, rng.uniform(-1e-6, 1e-6), rng.uniform(-1e-10, 1e-10), 0.0), rng=rng)
    assert find(SMALL, cells) == pytest.approx(search(plane(SMALL, cells)), rel=1e-12)


def test_signs_of_delay_and_rate():
    for delay, rate in ((1e-6, 1e-10), (-1e-6, 1e-10), (1e-6, -1e-10)):
        peak = find(SMALL, visibilities(SMALL, *polynomial(SMALL, delay, rate, 0.0)))
        assert peak.delay == pytest.approx(delay, abs=4e-8) and peak.rate == pytest.approx(rate * 1.676e9, abs=0.02)


def test_a_rate_beyond_nyquist_is_aliased_by_two_hertz():
    setup = Setup("C", 16e6, 64, 30.0, padding=2)
    peak = find(setup, visibilities(setup, *polynomial(setup, 0.0, 2.2e-10, 0.0)))
    assert peak.rate == pytest.approx(2.2e-10 * (4.836e9 + 8e6) - 2.0, abs=0.02)


def test_noise_alone_peaks_where_an_exponential_does():
    """The largest of m |FFT|^2 cells ~ Exp(1) is about ln m; padding adds some."""
    rng = np.random.default_rng(3)
    cells = (rng.standard_normal((120, 64)) + 1j * rng.standard_normal((120, 64))) / np.sqrt(2.0)
    assert (
        np.sqrt(np.log(7680)) - 0.7
        < find(Setup(n_channels=64, duration=60.0, padding=1), cells).snr
        < np.sqrt(np.log(7680)) + 1.2
    )


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(("delay", "rate"), [(3.2e-6, 0.30), (1.1e-6, 0.03)])
def test_raw_samples(delay, rate, seed):
    raw = RawSamples()
    peak = raw_check(raw, delay, rate, np.random.default_rng(seed))
    assert peak.delay == pytest.approx(delay, abs=0.07e-6) and peak.rate == pytest.approx(rate, abs=0.04)
    assert peak.amplitude == pytest.approx(raw.rho * (1 - delay * raw.bandwidth / raw.n_channels), rel=0.08)
    assert peak.snr == pytest.approx(peak.amplitude * np.sqrt(8e6), rel=1e-3)


def test_condition_2():
    setup = Setup()
    assert setup.sample == pytest.approx(31.25e-9)
    assert (
        within_window(setup, 2e-11, 0.0)
        and not within_window(setup, 1.8e-10, 0.0)
        and within_window(setup, 1.8e-10, 0.0, steps=4)
    )


def test_a_lost_peak_is_the_peak_of_the_noise():
    """A residual outside the window does not stop a Monte Carlo; it is a scan without fringe."""
    none = np.empty(0)
    runs = assess.Runs(np.array([1e-3, 0.0]), np.zeros(2), np.zeros(2), none, none, none, none, none)
    lost, found = experiment.signal_to_noise(SMALL, runs, 1)
    assert lost < 6.0 and found > 50.0
    assert scan_snr(SMALL, 1e-3, 0.0, 0.0) == 0.0
    assert scan_snr(SMALL, 0.0, 0.0, 0.0) == pytest.approx(60.0, rel=0.02)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: Setup("X"), "band 'X' is unknown"),
    (lambda: Setup(bandwidth=0.0), "bandwidth = 0 must be positive"),
    (lambda: Setup(padding=0), "padding = 0 must be positive"),
    (lambda: Setup(duration=float("nan")), "duration = nan"),
    (lambda: Setup(period=700.0), "longer than the scan"),
    (lambda: visibilities(SMALL, np.full(60, 1e-3), np.zeros(60)), "outside the lag window"),
    (lambda: raw_check(RawSamples(), 40e-6, 0.0, np.random.default_rng(1)), "longer than a segment"),
])  # fmt: skip
def test_what_is_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_more_cells_than_memory_holds_are_refused(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 8e9)
    sentence = (
        "^A scan of 3600 s in periods of 1e-06 s and 65536 channels, padded 16 times, needs 1.36e.05 TB of memory, and "
        r"8 GB are available; take longer periods, fewer channels or less padding\.$"
    )
    with pytest.raises(memory.TooLarge, match=sentence):
        Setup(n_channels=65536, duration=3600.0, period=1e-6, padding=16)
    setup = Setup(n_channels=1024, padding=16)  # 707 MB for the search, 12.6 GB for the whole plane
    with pytest.raises(memory.TooLarge, match="^The plane of such a scan needs 12.6 GB of memory"):
        plane(setup, np.zeros((1200, 1024), complex))


def test_channels_that_are_no_power_of_two_are_taken_with_a_warning():
    with pytest.warns(UserWarning, match="no power of two"):
        Setup(n_channels=100)
