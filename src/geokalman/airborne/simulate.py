"""A simulated survey: parallel lines in one random field, a strapdown gravimeter at its own rate, GNSS at 2 Hz.

Nothing is drawn from the filter's own model unless `truth` is "gm3". Motion is built from spectra, so that
acceleration is
the exact second derivative of the height and neither drifts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import fft, signal
from scipy.interpolate import CubicSpline
from scipy.ndimage import map_coordinates

from geokalman.airborne import corrections
from geokalman.airborne.model import (
    CORRELATION, METRE, Array, Line, double_integral, gravity_covariance, power_density, step_integrals,
)  # fmt: skip
from geokalman.constants import A_EARTH
from geokalman.kalman.discretise import gauss_markov

TURBULENCE = (0.1, 1.0)
SLOW = (1 / 120, 1 / 20)
"""Bands of motion [Hz]: turbulence, and slow motion around the phugoid (29 s at 65 m/s)."""
LATITUDE = math.radians(40.0)
NODES = (512, 64)
SPACING = 500.0
"""Nodes (north, east) of the grid of gravity and their spacing [m]."""


@dataclass(frozen=True)
class Scenario:
    """What is flown and with what instruments; SI where a name carries no unit. Presets: paper_like, rough, matched.

    n_lines lines of length_km, spacing_m apart, at speed V [m/s] and height_m, with lead_s [s] before and after.
    source_km, sigma_mgal : smoothness and size of the field; truth : field or gm3 (then L_km is its correlation
    length).
    white, drift, drift_s : accelerometer [mGal/sqrt(Hz), mGal, s]; k3, k12, tau3 : its error sizes [-, rad, s].
    gnss_white, gnss_colour, gnss_s : height error [m, m, s]; gnss_velocity [m/s] horizontal; gnss_up : white error of
    the vertical velocity [m/s] whose integral is the height, as h'' of (12) is described; 0 for measured heights.
    turbulence : vertical [m/s^2]; reference : error of the GT-like reference [mGal]; rate, imu_rate [Hz].
    integrate_at : rate of the double integration [Hz], the IMU's unless one wants to see what goes wrong.
    """

    n_lines: int = 6
    length_km: float = 60.0
    spacing_m: float = 2000.0
    V: float = 65.0
    height_m: float = 1500.0
    lead_s: float = 150.0
    truth: str = "field"
    source_km: float = 15.0
    sigma_mgal: float = 12.0
    L_km: float = 12.0
    white: float = 1.0
    drift: float = 0.4
    drift_s: float = 1500.0
    k3: float = 2e-7
    k12: float = 5e-5
    tau3: float = 5e-3
    gnss_white: float = 0.003
    gnss_colour: float = 0.004
    gnss_s: float = 80.0
    gnss_velocity: float = 0.01
    gnss_up: float = 0.0
    turbulence: float = 0.3
    reference: float = 0.79
    rate: float = 2.0
    imu_rate: float = 100.0
    integrate_at: float = 0.0

    def __post_init__(self) -> None:
        if self.n_lines < 1 or self.length_km <= 0 or self.V <= 0:
            raise ValueError(
                f"n_lines = {self.n_lines}, length_km = {self.length_km:g}, V = {self.V:g}: all must be positive."
            )
        if self.truth not in ("field", "gm3"):
            raise ValueError(f"truth = {self.truth!r} is unknown; give field or gm3.")
        ratio = self.imu_rate / self.rate
        if ratio < 1 or abs(ratio - round(ratio)) > 1e-9:
            raise ValueError(f"imu_rate = {self.imu_rate:g} Hz must be a whole multiple of rate = {self.rate:g} Hz.")
        north = self.length_km * 1e3 + 2 * self.lead_s * self.V
        if north > 0.9 * NODES[0] * SPACING or (self.n_lines - 1) * self.spacing_m > 0.9 * NODES[1] * SPACING:
            raise ValueError(
                f"Lines of {north / 1e3:.0f} km with their leads, {self.n_lines} of them: more than the field holds."
            )

    @classmethod
    def preset(cls, name: str, **changes: Any) -> Scenario:
        """A preset with changes. Raises ValueError for an unknown name."""
        if name not in SCENARIOS:
            raise ValueError(f"preset {name!r} is unknown; the presets are {', '.join(SCENARIOS)}.")
        return replace(SCENARIOS[name], **changes)

    @property
    def every(self) -> int:
        """Samples of the IMU per epoch of the filter."""
        return round(self.imu_rate / self.rate)


SCENARIOS = {
    "paper_like": Scenario(),
    "rough": Scenario(source_km=6.0, sigma_mgal=20.0, gnss_white=0.005, gnss_colour=0.015, white=2.0, drift=0.8),
    "matched": Scenario(
        truth="gm3", sigma_mgal=20.0, L_km=12.0, gnss_white=0.02, gnss_colour=0.0, white=8.0, drift=0.0, k3=3e-6,
        lead_s=0.0,
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Truth:
    """What the filter must not see: gravity (n,) [mGal], the reference instrument (n,), the track [m], `proper` epochs.

    k : true (tau3, k1, k2, k3); v_up : vertical velocity (n,) [m/s].
    """

    gravity: Array
    reference: Array
    north: Array
    east: Array
    height: Array
    v_up: Array
    v_north: Array
    k: tuple[float, float, float, float]
    proper: slice


def survey(scenario: Scenario, rng: np.random.Generator) -> list[tuple[Truth, Line]]:
    """All lines of one survey, west to east; 1, 3, 5 flown north and 2, 4, 6 south. They share one field."""
    field = random_field(scenario, rng) if scenario.truth == "field" else None
    epochs = math.floor((1e3 * scenario.length_km / scenario.V + 2 * scenario.lead_s) * scenario.rate + 1e-9) + 1
    motion = Motion((epochs - 1) * scenario.every + 1, 1.0 / scenario.imu_rate)
    return [fly(scenario, field, motion, number, rng) for number in range(1, scenario.n_lines + 1)]


def survey_of_seed(scenario: Scenario, seed: int) -> list[tuple[Truth, Line]]:
    """`survey` with default_rng(seed)."""
    return survey(scenario, np.random.default_rng(seed))


def random_field(scenario: Scenario, rng: np.random.Generator) -> Array:
    """Isotropic random gravity on the grid, amplitude exp(-k (source + h)) / (k + 2 pi/60 km), scaled to sigma_mgal."""
    field = fft.ifft2(fft.fft2(rng.standard_normal(NODES)) * _amplitude(scenario)).real
    return field * (scenario.sigma_mgal / field.std())


def _amplitude(scenario: Scenario) -> Array:
    kx, ky = (2 * np.pi * fft.fftfreq(n, SPACING) for n in NODES)
    k = np.hypot(kx[:, None], ky)
    amplitude = np.exp(-k * (scenario.source_km * 1e3 + scenario.height_m)) / (k + 2 * np.pi / 60e3)
    amplitude[0, 0] = 0.0
    return amplitude


def along_track(scenario: Scenario) -> tuple[Array, Array]:
    """Wavelengths along a line [m] and the variance of gravity in each [mGal^2]; they add up to that of the field.

    The random field's variance in each node of its spectrum, summed over the wave numbers across the lines; for
    `truth` gm3 the density of the third-order model at the same wavelengths.
    """
    n = NODES[0] // 2
    wavelength = NODES[0] * SPACING / np.arange(1, n)
    if scenario.truth == "gm3":
        density = power_density(
            2 * np.pi * scenario.V / wavelength, CORRELATION * scenario.V / (1e3 * scenario.L_km), 1.0
        )
        return wavelength, density * scenario.sigma_mgal**2 / density.sum()
    variance = (_amplitude(scenario) ** 2).sum(axis=1)
    return wavelength, variance[1:n] * scenario.sigma_mgal**2 / variance[1:n].sum()


def fly(
    scenario: Scenario, field: Array | None, motion: Motion, number: int, rng: np.random.Generator
) -> tuple[Truth, Line]:
    """One line, number 1 in the west: the true flight, what the instruments make of it, and z at the rate of the
    filter.
    """
    s, dt, every, n = scenario, 1.0 / scenario.imu_rate, scenario.every, motion.n
    epochs = (n - 1) // every + 1
    t = dt * np.arange(n)
    flown = 1.0 if number % 2 else -1.0
    up = motion.band(rng, TURBULENCE, s.turbulence, derivative=2) + motion.band(rng, SLOW, 2.0, steep=True)
    v_east = motion.series(motion.band(rng, SLOW, 1.0))
    v_north = flown * s.V + motion.series(motion.band(rng, SLOW, 0.5))
    f_1, f_2 = (
        motion.series(motion.band(rng, TURBULENCE, 0.15) + motion.band(rng, SLOW, 0.075)) / corrections.MGAL
        for _ in range(2)
    )
    start = -flown * s.V * t[-1] / 2
    north = start + double_integral(v_north, dt)[0]
    east = (number - (s.n_lines + 1) / 2) * s.spacing_m + double_integral(v_east, dt)[0]
    lat = LATITUDE + north / A_EARTH
    height = s.height_m + motion.series(up)
    if field is not None:
        places = np.array([north / SPACING + NODES[0] / 2, east / SPACING + NODES[1] / 2])
        gravity = map_coordinates(field, places, order=3, mode="grid-wrap")
    else:
        gravity = _gauss_markov_gravity(s, epochs, rng)(t)
    k1, k2 = s.k12 * rng.standard_normal(2)
    k3 = s.k3 * rng.standard_normal()
    still = corrections.normal_gravity(lat, height)
    turning = corrections.eotvos(lat, height, v_east, v_north)
    noise = s.white * math.sqrt(s.imu_rate) * rng.standard_normal(n)
    noise += _first_order(rng, n, dt, s.drift_s, s.drift)
    f_3 = (
        motion.series(motion.ahead(up, s.tau3), derivative=2) / corrections.MGAL + still - turning + gravity
    )  # tau3 > 0 of (7): early
    f_3 = (f_3 + k1 * f_1 + k2 * f_2 + noise) / (1.0 - k3)

    slow = slice(None, None, every)
    seen_east, seen_north = (v[slow] + s.gnss_velocity * rng.standard_normal(epochs) for v in (v_east, v_north))
    measured_turning = _zero_phase(corrections.eotvos(lat[slow], height[slow], seen_east, seen_north), s.rate, 0.05, 2)
    a0 = f_3 - still + CubicSpline(t[slow], measured_turning)(t)
    error = s.gnss_white * rng.standard_normal(epochs) + _first_order(rng, epochs, 1 / s.rate, s.gnss_s, s.gnss_colour)
    if s.gnss_up:
        error = np.concatenate([[0.0], np.cumsum(s.gnss_up / s.rate * rng.standard_normal(epochs - 1))])
    v_up = motion.series(up, derivative=1)
    skip = round(s.imu_rate / s.integrate_at) if s.integrate_at else 1
    integrated = double_integral(a0[::skip], skip * dt, METRE * v_up[0])[1][:: every // skip]
    z = integrated - METRE * (height[slow] - height[0] + error - error[0])
    first, second = step_integrals(np.column_stack([f_1, f_2, f_3]), dt, every)
    line = Line(str(number), t[slow], z, f_3[slow], first, second, s.V)
    lead = round(s.lead_s * s.rate)
    truth = Truth(
        gravity[slow], _reference(s, gravity[slow], rng), north[slow], east[slow], height[slow], v_up[slow],
        v_north[slow], (s.tau3, k1, k2, k3), slice(lead, epochs - lead),
    )  # fmt: skip
    return truth, line


class Motion:
    """Band-limited random motion kept as a spectrum, so that its derivatives are exact.  n samples every dt [s]."""

    def __init__(self, n: int, dt: float) -> None:
        self.n, self.size = n, fft.next_fast_len(n + n // 8, real=True)
        self.frequency = fft.rfftfreq(self.size, dt)
        self.gains: dict[tuple[tuple[float, float], bool], Array] = {}

    def band(
        self, rng: np.random.Generator, band: tuple[float, float], rms: float, derivative: int = 0, steep: bool = False
    ) -> Array:
        """Spectrum of white noise behind a Butterworth band-pass of order 2 (steep: twice), `rms` in its
        `derivative`.
        """
        gain = self._gain(band, steep)
        expected = math.sqrt(np.sum(gain**2) * 2 / self.size)  # rms of filtered unit white noise
        spectrum = fft.rfft(rng.standard_normal(self.size)) * (gain * (rms / expected))
        if derivative:
            spectrum[1:] /= (2j * np.pi * self.frequency[1:]) ** derivative
        return spectrum

    def _gain(self, band: tuple[float, float], steep: bool) -> Array:
        if (band, steep) not in self.gains:
            low, high = band
            f = self.frequency
            with np.errstate(divide="ignore"):
                gain = 1.0 / np.sqrt(1.0 + ((f**2 - low * high) / (f * (high - low))) ** 4)
            gain[0] = 0.0
            self.gains[band, steep] = gain**2 if steep else gain
        return self.gains[band, steep]

    def series(self, spectrum: Array, derivative: int = 0) -> Array:
        """Samples of a spectrum or of its derivative."""
        if derivative == 0:
            return fft.irfft(spectrum, self.size)[: self.n]
        return fft.irfft(spectrum * (2j * np.pi * self.frequency) ** derivative, self.size)[: self.n]

    def ahead(self, spectrum: Array, seconds: float) -> Array:
        """The spectrum of x(t + seconds): what a sensor shows that is so much early, f + tau df/dt to first order."""
        return spectrum * np.exp(2j * np.pi * self.frequency * seconds)


def _first_order(rng: np.random.Generator, n: int, dt: float, tau: float, sigma: float) -> Array:
    Phi, Q = gauss_markov(dt, tau, sigma)
    drive = math.sqrt(Q[0, 0]) * rng.standard_normal(n)
    drive[0] = sigma * rng.standard_normal()
    return signal.lfilter([1.0], [1.0, -Phi[0, 0]], drive)


def _gauss_markov_gravity(s: Scenario, epochs: int, rng: np.random.Generator) -> CubicSpline:
    beta = 2.903 * s.V / (1e3 * s.L_km)
    Phi, Q = gauss_markov(1 / s.rate, 1 / beta, s.sigma_mgal, order=3)
    scale = np.array([1.0, beta, beta**2])
    state = scale * (np.linalg.cholesky(gravity_covariance(1.0, s.sigma_mgal)) @ rng.standard_normal(3))
    root = np.linalg.cholesky(Q / scale[:, None] / scale) * scale[:, None]
    states = np.empty((epochs, 3))
    noise = rng.standard_normal((epochs, 3)) @ root.T
    for k in range(epochs):
        states[k] = state
        state = Phi @ state + noise[k]
    return CubicSpline(np.arange(epochs) / s.rate, states[:, 0])


def _reference(s: Scenario, gravity: Array, rng: np.random.Generator) -> Array:
    smooth = _zero_phase(gravity, s.rate, 0.01, 4)
    margin = round(5 * s.rate / 0.01)
    noise = _zero_phase(rng.standard_normal(len(gravity) + 2 * margin), s.rate, 0.01, 4)[margin:-margin]
    return smooth + s.reference * noise / math.sqrt(np.mean(noise**2))


def _zero_phase(x: Array, rate: float, cutoff: float, order: int) -> Array:
    sos = signal.butter(order, cutoff, fs=rate, output="sos")
    return signal.sosfiltfilt(sos, x, padlen=min(len(x) - 1, round(3 * rate / cutoff)))
