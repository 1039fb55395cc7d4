"""Noise of simulated observations: white, and white plus flicker."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def white(rng: np.random.Generator, sigma: float, shape: int | tuple[int, ...]) -> Array:
    """White Gaussian noise, sigma times standard normal numbers drawn in C order.

    Parameters
    ----------
    rng : generator that is advanced
    sigma : standard deviation, not negative; 0 gives zeros but advances the generator all the same
    shape : shape of the result

    Returns
    -------
    float64 array of that shape, the unit of sigma

    Raises
    ------
    ValueError
        For a sigma that is negative or not finite.
    """
    if not (np.isfinite(sigma) and sigma >= 0.0):
        raise ValueError(f"sigma = {sigma} must be finite and not negative.")
    return sigma * rng.standard_normal(shape)


def flicker(series: Array, dt: float, corner_hz: float) -> Array:
    """White noise coloured to white plus flicker: PSD times (1 + f_c/f).

    The FFT of the series is multiplied by sqrt(1 + f_c/f), the zero frequency left as it is.

    Parameters
    ----------
    series : (n, ...) white noise, time on the first axis
    dt : sampling interval [s]
    corner_hz : frequency f_c [Hz] at which flicker and white noise are equal; 0 leaves the series as it is

    Returns
    -------
    (n, ...) float64, the unit of the series

    Raises
    ------
    ValueError
        For an interval that is not positive or a corner that is negative.
    """
    if not (np.isfinite(dt) and dt > 0.0):
        raise ValueError(f"Sampling interval dt = {dt} s must be positive and finite.")
    if not (np.isfinite(corner_hz) and corner_hz >= 0.0):
        raise ValueError(f"Corner frequency {corner_hz} Hz must be finite and not negative.")
    series = np.asarray(series, dtype=float)
    frequency = np.fft.rfftfreq(series.shape[0], dt)
    factor = np.ones(frequency.size)
    factor[1:] = np.sqrt(1.0 + corner_hz / frequency[1:])
    spectrum = np.fft.rfft(series, axis=0) * factor.reshape(-1, *(1,) * (series.ndim - 1))
    return np.fft.irfft(spectrum, n=series.shape[0], axis=0)
