"""The correlator in the visibility domain: cells over periods and channels, the fringe-rate and delay plane, its peak.

    cell(i, j) = A a_i exp(2 pi i (f_RF + f_j) dtau(t_i)) + complex noise,   f_j = (j + 1/2) B/n,   A = SNR0/sqrt(cells)
    a_i = max(0, 1 - |dtau| B/n) sinc((f_RF + B/2) dtau'(t_i) T_AP)
    SNR = max |FFT2|/sqrt(cells)
f_RF is the lower edge of the band. A constant delay and a constant phase rate cost nothing; a delay that drifts does.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import fft

from geokalman import memory
from geokalman.radioastron.model import BANDS, Array

SNR0 = 60.0
"""SNR of a scan without any residual delay: the level of the paper's Figure 2(a)."""


@dataclass(frozen=True)
class Setup:
    """A scan at the correlator: SI.

    band "L", "C" or "K", bandwidth B [Hz], n_channels, duration T [s], accumulation period T_AP [s], padding of the FFT
    in both directions. The lag window is +-n/(2 B) and the fringe-rate window +-1/(2 T_AP). Raises ValueError for an
    unknown band, sizes that are not positive, T_AP > T; TooLarge for more cells than memory holds; warns where
    n_channels is no power of two (allowed, slower).
    """

    band: str = "L"
    bandwidth: float = 16e6
    n_channels: int = 256
    duration: float = 600.0
    period: float = 0.5
    padding: int = 4

    def __post_init__(self) -> None:
        if self.band not in BANDS:
            raise ValueError(f"band {self.band!r} is unknown; give L (18 cm), C (6.2 cm) or K (1.4 cm).")
        for name in ("bandwidth", "n_channels", "duration", "period", "padding"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} = {value:g} must be positive.")
        if self.period > self.duration:
            raise ValueError(f"the accumulation period {self.period:g} s is longer than the scan, {self.duration:g} s.")
        memory.require(
            f"A scan of {self.duration:g} s in periods of {self.period:g} s and {self.n_channels} channels, padded "
            f"{self.padding} times,", (64.0 + 32.0 * self.padding) * self.cells,
            "take longer periods, fewer channels or less padding",
        )  # fmt: skip
        if self.n_channels & (self.n_channels - 1):
            warnings.warn(f"n_channels = {self.n_channels} is no power of two; the transform is slower", stacklevel=3)

    @property
    def frequency(self) -> float:
        """Lower band edge f_RF [Hz]."""
        return BANDS[self.band]

    @property
    def times(self) -> Array:
        """Middles of the accumulation periods [s from the start of the scan]."""
        return (np.arange(round(self.duration / self.period)) + 0.5) * self.period

    @property
    def cells(self) -> int:
        """Number of cells of a scan."""
        return round(self.duration / self.period) * self.n_channels

    @property
    def window(self) -> float:
        """Half of the lag window [s]."""
        return self.n_channels / (2.0 * self.bandwidth)

    @property
    def sample(self) -> float:
        """Sampling step 1/(2 B) [s], the unit in which the paper bounds the delay error (2)."""
        return 0.5 / self.bandwidth


_BLOCK = 32  # columns transformed at a time: they fit the cache


_BLOCKS, _TRANSFORM = 150, 512
"""Blocks of a scan in `drifting`, and length of their transform."""
_LAG, _MOST = 0.25, 64
"""Step of the lags in `drifting`, in units of 1/B, and how many about the middle of the track are tried."""


class Peak(NamedTuple):
    """The largest grid cell of a plane: fringe rate [Hz] (modulo 1/T_AP), delay [s], SNR."""

    rate: float
    delay: float
    snr: float


class Plane(NamedTuple):
    """|FFT|/sqrt(cells) over fringe rate (rows) [Hz] and delay (columns) [s]."""

    rates: Array
    delays: Array
    snr: Array


def visibilities(
    setup: Setup, delay: Array, rate: Array, snr0: float = SNR0, rng: np.random.Generator | None = None
) -> Array:
    """Cells (periods, channels) of a scan with residual delay (periods,) [s] and its rate (periods,) [s/s].

    rng : None for no noise; else the real part of all cells is drawn first, then the imaginary part, each over sqrt(2).
    Raises ValueError where the delay leaves the lag window.
    """
    largest, segment = np.abs(delay).max(), setup.n_channels / setup.bandwidth
    if largest > setup.window:
        raise ValueError(
            f"residual delay {largest * 1e6:.2f} us is outside the lag window of +-{setup.window * 1e6:.2f} us "
            f"({setup.n_channels} channels in {setup.bandwidth / 1e6:g} MHz); take more channels."
        )
    turns = (setup.frequency + 0.5 * setup.bandwidth) * rate * setup.period
    loss = np.maximum(0.0, 1.0 - np.abs(delay) / segment) * np.sinc(turns)
    amplitude = snr0 / math.sqrt(setup.cells)
    channels = (np.arange(setup.n_channels) + 0.5) * setup.bandwidth / setup.n_channels
    # in two steps, for f_RF dtau is 1e4 turns
    phase = np.outer(delay, channels)
    phase += np.mod(setup.frequency * delay, 1.0)[:, None]
    cells = (amplitude * loss)[:, None] * np.exp(2j * np.pi * phase)
    if rng is not None:
        real = rng.standard_normal(cells.shape)
        cells += (real + 1j * rng.standard_normal(cells.shape)) / math.sqrt(2.0)
    return cells


def plane(setup: Setup, cells: Array) -> Plane:
    """Fringe-rate and delay plane of a scan's cells, padded with zeros and ordered about zero."""
    shape = [setup.padding * n for n in cells.shape]
    # phase grows with +f tau and +t rate: the forward transform puts a delay tau at +tau
    size = 40.0 * setup.padding**2 * setup.cells
    memory.require("The plane of such a scan", size, "take less padding or fewer channels")
    spectrum = np.abs(np.fft.fftshift(np.fft.fft2(cells, shape))) / math.sqrt(cells.size)
    rates = np.fft.fftshift(np.fft.fftfreq(shape[0], setup.period))
    delays = np.fft.fftshift(np.fft.fftfreq(shape[1], setup.bandwidth / setup.n_channels))
    return Plane(rates, delays, spectrum)


def search(p: Plane) -> Peak:
    """The largest cell of a plane, without interpolation."""
    i, j = np.unravel_index(int(np.argmax(p.snr)), p.snr.shape)
    return Peak(float(p.rates[i]), float(p.delays[j]), float(p.snr[i, j]))


def find(setup: Setup, cells: Array) -> Peak:
    """The peak of `plane` without keeping the plane: three times as fast, the same cell."""
    rows, columns = (setup.padding * n for n in cells.shape)
    lags = np.ascontiguousarray(fft.fft(cells, columns, axis=1).T)
    best, at = -1.0, (0, 0)
    for first in range(0, columns, _BLOCK):
        power = fft.fft(lags[first : first + _BLOCK], rows, axis=1)
        power = power.real**2 + power.imag**2
        k = int(np.argmax(power))
        if power.flat[k] > best:
            best, at = float(power.flat[k]), (first + k // rows, k % rows)
    rates, delays = np.fft.fftfreq(rows, setup.period), np.fft.fftfreq(columns, setup.bandwidth / setup.n_channels)
    return Peak(float(rates[at[1]]), float(delays[at[0]]), math.sqrt(best / cells.size))


def polynomial(setup: Setup, delay: float, rate: float, acceleration: float) -> tuple[Array, Array]:
    """Residual delay (periods,) [s] and its rate [s/s]: delay + rate t + acceleration (t - T/2)^2/2.

    That is equation (1) of the paper with t and the rate counted from the start, the acceleration from the middle.
    """
    late = setup.times - 0.5 * setup.duration
    return delay + rate * setup.times + 0.5 * acceleration * late**2, rate + acceleration * late


def coherence(setup: Setup, rate: float, acceleration: float) -> float:
    """SNR / SNR0 of a scan without noise whose residual delay drifts at `rate` [s/s] and `acceleration` [1/s]."""
    cells = visibilities(setup, *polynomial(setup, 0.0, rate, acceleration), snr0=1.0)
    return find(setup, cells).snr


def drifting(setup: Setup, rate: Array, acceleration: Array) -> Array:
    """SNR / SNR0 of scans (...) of residual rate [s/s] and acceleration [1/s], noise-free, without a grid of channels.

    S(tau, nu) = mean over t of sinc((f_RF + B/2) dtau' T_AP) sinc(B (dtau - tau)) exp(2 pi i (f_RF + B/2) dtau)
    exp(-2 pi i nu t), its largest size; that is `coherence` with its sum over the channels in closed form, the times
    in blocks, and a fine grid of nu and tau.
    """
    centre = setup.frequency + 0.5 * setup.bandwidth
    late = ((np.arange(_BLOCKS) + 0.5) / _BLOCKS - 0.5) * setup.duration
    out = np.empty(np.shape(rate))
    for k, (r, q) in enumerate(zip(np.ravel(rate), np.ravel(acceleration), strict=True)):
        bend = 0.5 * q * late**2
        track, speed = r * late + bend, r + q * late
        lags = np.arange(track.min(), track.max() + _LAG / setup.bandwidth, _LAG / setup.bandwidth)
        lags = lags[np.argsort(np.abs(lags - np.median(track)))[:_MOST]]
        cells = np.sinc(centre * speed * setup.period) * np.exp(2j * np.pi * centre * bend)
        cells = cells * np.sinc(setup.bandwidth * (track - lags[:, None]))
        out.flat[k] = np.abs(fft.fft(cells, _TRANSFORM, axis=1)).max() / _BLOCKS
    return out


def scan_snr(
    setup: Setup, delay: float, rate: float, acceleration: float, rng: np.random.Generator | None = None
) -> float:
    """SNR of a scan whose residual delay, rate and acceleration are those of its middle.

    A residual that leaves the lag window leaves the peak of the noise (0 without noise): no fringe.
    """
    track = polynomial(setup, delay - 0.5 * rate * setup.duration, rate, acceleration)
    if np.abs(track[0]).max() <= setup.window:
        return find(setup, visibilities(setup, *track, rng=rng)).snr
    if rng is None:
        return 0.0
    return find(setup, visibilities(setup, 0.0 * track[0], 0.0 * track[1], snr0=0.0, rng=rng)).snr


def within_window(setup: Setup, rate: float, acceleration: float, steps: int = 1) -> bool:
    """Condition (2): |rate T + acceleration T^2/2| below `steps` sampling steps over the scan."""
    T = setup.duration
    return abs(rate * T + 0.5 * acceleration * T * T) < steps * setup.sample


@dataclass(frozen=True)
class RawSamples:
    """A check with raw samples: a common signal of share rho in two stations' noise, complex, at `bandwidth` [Hz]."""

    bandwidth: float = 2e6
    duration: float = 4.0
    rho: float = 0.02
    n_channels: int = 64
    period: float = 0.125
    padding: int = 8


class RawPeak(NamedTuple):
    """Peak of raw samples: fringe rate [Hz], delay [s], correlation coefficient, SNR = amplitude sqrt(samples)."""

    rate: float
    delay: float
    amplitude: float
    snr: float


def raw_check(setup: RawSamples, delay: float, rate: float, rng: np.random.Generator) -> RawPeak:
    """Correlate raw samples as an FX correlator does: delay by a phase ramp, FFT of segments, cross-multiply, search.

    delay [s], rate: fringe rate [Hz] injected. Expected amplitude: rho (1 - delay/segment). Raises ValueError for a
    delay longer than a segment. Source: radioastron-orbit section 4.4.
    """
    n, total = setup.n_channels, round(setup.bandwidth * setup.duration)
    if abs(delay) >= n / setup.bandwidth:
        raise ValueError(f"delay {delay * 1e6:.2f} us is longer than a segment of {n / setup.bandwidth * 1e6:.2f} us.")

    def noise(share: float) -> Array:
        return math.sqrt(share) * ((rng.standard_normal(total) + 1j * rng.standard_normal(total)) / math.sqrt(2.0))

    common = noise(setup.rho)
    one, two = (noise(1.0 - setup.rho) + common for _ in range(2))
    del common
    two = fft.fft(two, overwrite_x=True)
    two *= np.exp(-2j * np.pi * delay * np.fft.fftfreq(total, 1.0 / setup.bandwidth))
    two = fft.ifft(two, overwrite_x=True)
    two *= np.exp(2j * np.pi * rate / setup.bandwidth * np.arange(total))
    segments = int(setup.period * setup.bandwidth) // n
    periods = total // (segments * n)
    spectra = [np.fft.fft(x[: periods * segments * n].reshape(periods, segments, n), axis=2) for x in (one, two)]
    cells = np.mean(spectra[1] * spectra[0].conj(), axis=1) / n
    cells = np.fft.fftshift(cells, axes=1)  # by frequency before padding, or the peak moves by 0.3 us and loses 20 %
    shape = (setup.padding * periods, setup.padding * n)
    transformed = np.abs(np.fft.fft(np.fft.ifft(cells, shape[1], axis=1) * shape[1], shape[0], axis=0)) / cells.size
    rates, delays = (
        np.fft.fftfreq(shape[0], segments * n / setup.bandwidth),
        np.fft.fftfreq(shape[1], setup.bandwidth / n),
    )
    peak = search(Plane(rates, delays, transformed))
    return RawPeak(*peak, peak.snr * math.sqrt(periods * segments * n))
