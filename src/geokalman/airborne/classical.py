"""Low-pass filters without a model of gravity, and the transfer functions of all methods."""

from __future__ import annotations

import numpy as np
from scipy import signal

from geokalman import memory
from geokalman.airborne.model import METRE, Array, Line, Tuning, build, power_density
from geokalman.kalman.gaussian import Trajectory


def apparent_gravity(line: Line) -> Array:
    """Gravity before any filter (n,) [mGal]: the second difference of z, its ends repeated."""
    d2 = np.diff(line.z, 2) / line.dt**2
    return np.concatenate([d2[:1], d2, d2[-1:]])


def fir_taps(cutoff_s: float, dt: float) -> Array:
    """Hamming windowed sinc with half gain at the cutoff period, twice that period long, of unit sum.

    Raises ValueError for a cutoff below four steps.
    """
    if cutoff_s < 4 * dt:
        raise ValueError(f"cutoff = {cutoff_s:g} s is below four steps of {dt:g} s.")
    half = round(cutoff_s / dt)
    return signal.firwin(2 * half + 1, 1.0 / cutoff_s, window="hamming", fs=1.0 / dt)


def fir(line: Line, cutoff_s: float, cut_ends: bool = False) -> Array:
    """Apparent gravity behind the FIR low-pass with even extension (n,) [mGal].

    cut_ends : extend the second difference itself, not the series with its ends repeated; where the filter reaches
    beyond
    the flight, those two samples out of thousands decide, since one of them is as large as the turbulence.
    Raises ValueError for a line too short.
    """
    taps = fir_taps(cutoff_s, line.dt)
    half, x = len(taps) // 2, apparent_gravity(line)
    if len(x) <= half + 2:
        raise ValueError(f"Line {line.name} lasts {line.t[-1] - line.t[0]:.0f} s, less than the filter's half length.")
    if not cut_ends:
        return signal.fftconvolve(np.pad(x, half, mode="reflect"), taps, mode="valid")
    inner = signal.fftconvolve(np.pad(x[1:-1], half, mode="reflect"), taps, mode="valid")
    return np.concatenate([inner[:1], inner, inner[-1:]])


def butterworth(line: Line, cutoff_s: float, order: int = 3, cut_ends: bool = False) -> Array:
    """Apparent gravity behind a zero-phase Butterworth low-pass with scipy's own padding (n,) [mGal].

    cut_ends : filter the second difference itself, evenly extended over two cutoffs, as `fir` does.
    """
    (b, a), x = signal.butter(order, 1.0 / cutoff_s, fs=1.0 / line.dt), apparent_gravity(line)
    if not cut_ends:
        return signal.filtfilt(b, a, x)
    reach = min(len(x) - 3, round(2 * cutoff_s / line.dt))
    inner = signal.filtfilt(b, a, x[1:-1], padtype="even", padlen=reach)
    return np.concatenate([inner[:1], inner, inner[-1:]])


def fir_gain(cutoff_s: float, dt: float, frequency: Array) -> Array:
    """Gain of the FIR at frequencies [Hz]."""
    size = 2.0 * cutoff_s / dt * 16.0 * (len(frequency) + 2)
    memory.require(f"The gain of a low-pass of {cutoff_s:g} s in steps of {dt:g} s", size, "give a longer dt")
    taps = fir_taps(cutoff_s, dt)
    lag = np.arange(len(taps)) - len(taps) // 2
    return np.cos(2 * np.pi * np.outer(frequency, lag) * dt) @ taps


def butterworth_gain(cutoff_s: float, frequency: Array, order: int = 3) -> Array:
    """Gain of the zero-phase Butterworth at frequencies [Hz]."""
    return 1.0 / (1.0 + (np.asarray(frequency) * cutoff_s) ** (2 * order))


def smoother_gain(tuning: Tuning, V: float, dt: float, wavelength: Array) -> Array:
    """Gain of the smoother far from the ends at wavelengths [m]: signal over signal and noise.

    S_g / (S_g + q_f^2 + R dt w^4), w = 2 pi V / wavelength: white height noise is w^4 in acceleration.
    """
    w = 2 * np.pi * V / np.asarray(wavelength, dtype=float)
    S = power_density(w, tuning.beta(V), tuning.sigma_mgal)
    return S / (S + tuning.q_f**2 + (tuning.R_m * METRE) ** 2 * dt * w**4)


def forward_response(line: Line, tuning: Tuning, course: Trajectory, wavelength: Array) -> Array:
    """Complex response of the settled forward filter to gravity of given wavelengths [m]; |.| is gain, -phase/w delay.

    x_k = A x_(k-1) + K z_k with A = (I - K H) Phi, and z = -g/w^2 for gravity g at frequency w.
    line, tuning : a line without parameter states (sd_tau3 = sd_k12 = sd_k3 = 0); course : its filter run.
    """
    model = build(line, tuning)
    n = len(model.names)
    P = course.predicted_cov[-1]
    K = P @ model.H[0] / (model.H[0] @ P @ model.H[0] + model.R[0, 0])
    A = (np.eye(n) - np.outer(K, model.H[0])) @ model.Phi[-1]
    pick = model.names.index("dg")
    out = np.empty(len(wavelength), complex)
    for i, w in enumerate(2 * np.pi * line.V / np.asarray(wavelength, dtype=float)):
        x = np.linalg.solve(np.eye(n) - A * np.exp(-1j * w * line.dt), K.astype(complex))
        out[i] = model.scale[pick] * x[pick] * -1.0 / w**2
    return out


def signal_lost(gain: Array, variance: Array) -> float:
    """Root mean square of the gravity that a filter takes away [mGal], sqrt(sum (1 - gain)^2 variance).

    gain, variance : (n,) at the same wavelengths, the latter [mGal^2] as `simulate.along_track` gives it.
    """
    return float(np.sqrt(np.sum((1.0 - np.asarray(gain)) ** 2 * variance)))
