"""The pair as the chapters model it: scenario, observations, what a filter assumes, and the continuous dynamics.

On the line between the satellites the state is x = [s, v, a]: the separation less its mean [m], its rate [m/s] and the
acceleration by the field [m/s^2]. In the plane it is [x, y, vx, vy]: radial and along-track position of the leading
satellite as seen from the trailing one, and their rates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from geokalman.kalman.gaussian import Gaussian

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scenario:
    """What is simulated: the motion of the pair and its instruments. SI units.

    duration, step, gnss_step : length, interval of the epochs and of the GNSS positions; period : of a revolution;
    separation : mean distance; amplitude, phase : of its breathing; sigma_a, tau : the acceleration by the field, a
    Gauss-Markov process; sigma_gnss, sigma_rate, sigma_range : white noise of each instrument; range_bias, rate_bias :
    constant errors of the microwave instrument; outliers : share of the GNSS positions with a standard deviation
    twenty times larger.
    Raises ValueError for a value that is not finite or out of range, and where epochs do not divide the GNSS interval.
    """

    duration: float = 10800.0
    step: float = 30.0
    gnss_step: float = 30.0
    period: float = 5640.0
    separation: float = 220e3
    amplitude: float = 400.0
    phase: float = 0.7
    sigma_a: float = 1e-6
    tau: float = 600.0
    sigma_gnss: float = 0.02
    sigma_rate: float = 1e-6
    sigma_range: float = 1e-4
    range_bias: float = 0.0
    rate_bias: float = 0.0
    outliers: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            if not math.isfinite(getattr(self, item.name)):
                raise ValueError(f"{item.name} = {getattr(self, item.name)} is not finite.")
        for name in ("step", "gnss_step", "period", "separation", "tau", "sigma_gnss", "sigma_rate", "sigma_range"):
            if getattr(self, name) <= 0:
                raise ValueError(f"{name} = {getattr(self, name):g}: it must be positive.")
        if self.amplitude < 0 or self.sigma_a < 0 or not 0 <= self.outliers <= 1:
            raise ValueError(
                f"amplitude = {self.amplitude:g}, sigma_a = {self.sigma_a:g}, outliers = {self.outliers:g}: the first"
                " two are not negative, the third is a share between 0 and 1."
            )
        if self.duration < self.step:
            raise ValueError(f"duration = {self.duration:g} s is shorter than one step of {self.step:g} s.")
        if abs(self.every * self.step - self.gnss_step) > 1e-9 * self.gnss_step:
            raise ValueError(f"step = {self.step:g} s does not divide gnss_step = {self.gnss_step:g} s.")

    @property
    def t(self) -> Array:
        """Epochs (N,) [s]."""
        return self.step * np.arange(int(self.duration / self.step + 1e-9) + 1)

    @property
    def every(self) -> int:
        """Epochs from one GNSS position to the next."""
        return max(1, round(self.gnss_step / self.step))

    @property
    def n(self) -> float:
        """Mean motion [rad/s]."""
        return 2.0 * math.pi / self.period


@dataclass(frozen=True)
class Observations:
    """What a filter may see, NaN where there is nothing.

    t : (N,) [s]; gnss : (N, 1) separation less its mean, or (N, 2) radial and along-track position [m]; rate : (N, 1)
    range-rate [m/s]; range : (N, 1) biased range [m], on the line less the mean separation; prior : Gaussian at t[0].
    """

    t: Array
    gnss: Array
    rate: Array
    range: Array
    prior: Gaussian


@dataclass(frozen=True)
class Tuning:
    """What a filter assumes: the motion, and the standard deviation of every instrument. SI units.

    n : mean motion; sigma_a, tau : the Gauss-Markov acceleration; q : power density of white jerk, for the filter that
    knows no dynamics [m^2 s^-5]; sigma_gnss, sigma_rate, sigma_range.
    """

    n: float = 2.0 * math.pi / 5640.0
    sigma_a: float = 1e-6
    tau: float = 600.0
    q: float = 1e-13
    sigma_gnss: float = 0.02
    sigma_rate: float = 1e-6
    sigma_range: float = 1e-4


def along_the_line(n: float, sigma_a: float, tau: float) -> tuple[Array, Array]:
    """Give F and W of x' = F x + w for [s, v, a], with E w w' = W delta: a swing, pushed by a Gauss-Markov process.

    s' = v,   v' = -n^2 s + a,   a' = -a/tau + w,   W_33 = 2 sigma_a^2 / tau.

    >>> F, W = along_the_line(1e-3, 1e-6, 500.0)
    >>> F.tolist(), float(W[2, 2])
    ([[0.0, 1.0, 0.0], [-1e-06, 0.0, 1.0], [0.0, 0.0, -0.002]], 4e-15)
    """
    F = np.array([[0.0, 1.0, 0.0], [-(n**2), 0.0, 1.0], [0.0, 0.0, -1.0 / tau]])
    return F, np.diag([0.0, 0.0, 2.0 * sigma_a**2 / tau])


def in_the_plane(n: float, q: float) -> tuple[Array, Array]:
    """Give F and W of x' = F x + w for [x, y, vx, vy] by Hill's equations with white accelerations.

    x'' = 2 n y' + 3 n^2 x + w_x,   y'' = -2 n x' + w_y,   power density q [m^2 s^-3] on each axis.
    Source: Clohessy and Wiltshire (1960), Journal of the Aerospace Sciences 27, 653-658.

    >>> in_the_plane(1e-3, 0.0)[0][2].tolist()
    [3e-06, 0.0, 0.0, 0.002]
    """
    F = np.zeros((4, 4))
    F[:2, 2:] = np.eye(2)
    F[2, 0], F[2, 3], F[3, 2] = 3.0 * n**2, 2.0 * n, -2.0 * n
    return F, np.diag([0.0, 0.0, q, q])
