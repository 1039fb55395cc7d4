"""Gyro noise and gains that meet printed differences to the gyro: what the differences say, and what they leave open.

A filter that assumes `factor` times the gyro's noise has the gain K = factor N / sigma (small gains; sigma of the
camera over a second). From second to second its attitude departs from the gyro's by K times an innovation, factor N in
size and white. Its rates by a central difference of attitudes, minus the gyro's, hold two such steps, 0.71 factor N:
the gyro's own noise cancels where both are means over the same window. Where they are not, its difference between the
two windows is added; a low-pass of the attitudes changes both.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from geokalman.attitude.model import GYRO_HZ, Array, arw_density

APM = (1.89e-7, 1.56e-7, 1.63e-7)
JPL = (6.09e-7, 3.62e-7, 4.01e-7)
"""Standard deviations of the rates minus IMU1B that the paper prints, about x, y and z [rad/s]. Figure 4 paragraph."""
REDUCED = math.sqrt(3.0) / 2.0
"""Noise of a rate reduced from four axes over that of one gyro."""


class Gains(NamedTuple):
    """Angle random walk of one gyro [deg/sqrt(h)], and the factors on it that both filters assume."""

    arw_deg_sqrt_h: float
    apm_factor: float
    kappa: float

    @property
    def closer_is_better(self) -> bool:
        """Whether the product closer to the gyro is the more accurate one: factor times kappa is above one.

        The variance of the attitude goes as factor + 1 / factor, so of two filters that whose factor is nearer to one,
        as a ratio, is the better one.
        """
        return self.apm_factor * self.kappa > 1.0


def level(printed: tuple[float, float, float]) -> float:
    """One level for three axes [rad/s]: their geometric mean, since fits and rules go by ratios."""
    return math.exp(sum(map(math.log, printed)) / 3.0)


def lowpass_kernel(cutoff_hz: float) -> Array:
    """Weights (2 m + 1,) at 1 Hz of a Gaussian low-pass with half power at the cut-off; (1,) for a cut-off of 0."""
    if not cutoff_hz:
        return np.ones(1)
    sigma = math.sqrt(math.log(2.0)) / (2.0 * math.pi * cutoff_hz)  # s: |H|^2 = exp(-(2 pi f sigma)^2)
    reach = math.ceil(4.0 * sigma)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return kernel / kernel.sum()


def _window(name: str) -> Array:
    """Weights of 8 Hz increments [1/s] that give the gyro rate of a window, centred; their sum is 8."""
    if name == "matched":
        return np.full(2 * GYRO_HZ, 0.5)
    if name == "half":
        return np.ones(GYRO_HZ)
    return np.array([-1.0, 7.0, 7.0, -1.0]) * GYRO_HZ / 12.0


def variances(window: str, cutoff_hz: float = 0.0) -> tuple[float, float]:
    """What factor^2 and 1 are multiplied by in the variance of the difference, in N^2: gain, and mismatch.

    window : of `assess.WINDOWS`; cutoff_hz : of the low-pass of the attitudes, 0 for none. Without one the gain is 1/2
    and the mismatch 0 (matched), 1/2 (half) or 5.06 (sampled).
    """
    kernel = lowpass_kernel(cutoff_hz)
    gain = float(np.sum(np.convolve(kernel, [0.5, 0.5]) ** 2))
    spaced = np.zeros((len(kernel) - 1) * GYRO_HZ + 1)
    spaced[::GYRO_HZ] = kernel
    ours = np.convolve(spaced, _window("matched"))
    theirs = np.pad(_window(window), (len(ours) - len(_window(window))) // 2)
    return gain, float(np.sum((ours - theirs) ** 2)) / GYRO_HZ


def difference(N: float, factor: float, window: str = "matched", cutoff_hz: float = 0.0) -> float:
    """Standard deviation [rad/s] of rate minus gyro rate: N sqrt(gain factor^2 + mismatch).

    N : density of the reduced rate's noise [rad/sqrt(s)].
    """
    gain, mismatch = variances(window, cutoff_hz)
    return N * math.sqrt(gain * factor**2 + mismatch)


def fit(apm: float, jpl: float, apm_factor: float = 1.0, window: str = "matched", cutoff_hz: float = 0.0) -> Gains:
    """Gyro noise and kappa with which the two differences have the printed levels, for one factor of the first filter.

    apm, jpl : printed standard deviations [rad/s], jpl the larger; cutoff_hz : low-pass of the second product alone.
    Raises ValueError where no gain gives the second level.
    """
    N = apm / difference(1.0, apm_factor, window)
    gain, mismatch = variances(window, cutoff_hz)
    rest = (jpl / N) ** 2 - mismatch
    if not (0 < apm < jpl and rest > 0):
        raise ValueError(f"levels of {apm:g} and {jpl:g} rad/s: no gain of the second filter gives the second of them.")
    return Gains(N / REDUCED / arw_density(1.0), apm_factor, math.sqrt(rest / gain))


def crossing(apm: float, jpl: float, window: str = "matched") -> float:
    """The gyro noise [deg/sqrt(h)] beyond which the product closer to the gyro is the less accurate one.

    There factor times kappa is one. For matched windows 0.71 N is the geometric mean of the levels.
    """
    low, high = 1e-3, 1e3
    for _ in range(200):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if fit(apm, jpl, middle, window).closer_is_better else (middle, high)
    return fit(apm, jpl, high, window).arw_deg_sqrt_h
