"""The vertical channel of a strapdown gravimeter with Gauss-Markov gravity: states, tuning, transition, observation.

Source throughout: Xiong, Guo, Li, Luo & Li (2017), equations (7) to (15), as rebuilt in the book. Accelerations are in
mGal, velocities in mGal s, heights in mGal s^2; the matrices are in units of the initial standard deviations of the
states.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geokalman.kalman.discretise import gauss_markov, van_loan
from geokalman.kalman.gaussian import Gaussian

Array = NDArray[np.float64]

METRE = 1e5
"""One metre in mGal s^2, one m/s in mGal s."""
STATES = ("dv", "dh", "tau3", "k1", "k2", "k3", "bias", "dg", "dg1", "dg2", "colour")
"""Names of all states; those without prior variance are left out of a model. (15) has the first six and the gravity
three.
"""
DV, DH, TAU3, K1, K2, K3, BIAS, DG, DG1, DG2, COLOUR = range(11)
CORRELATION = 2.903
"""beta L / V of the third-order Gauss-Markov model: its correlation falls to 1/e (0.3682) at the length L."""
ORDERS = {1: 1.0, 2: 2.146, 3: CORRELATION}
"""beta L / V of the Gauss-Markov models of each order, whose correlations fall to 1/e at the length L."""
SHORTEST = 240.0
"""A line below this length [s] is refused: it holds hardly more than its two filtered ends."""


@dataclass(frozen=True)
class Tuning:
    """Everything that the filter assumes; none of it is printed in the paper.

    L_km : correlation length of gravity [km]; sigma_mgal : its standard deviation [mGal], 0 for a filter without
    gravity;
    q_f : root power density of the gravimeter's noise [mGal/sqrt(Hz)]; R_m : standard deviation of the height [m];
    sd_* : prior standard deviations of dv [m/s], dh [m], tau3 [s], k1 and k2 [rad], k3 [-], bias [mGal];
    colour_m, colour_s : standard deviation [m] and time constant [s] of a coloured error of the height, 0 m for none;
    V : speed [m/s], 0 for that of the line; k3_from : f3' counts from here in the k3 column [mGal].
    order : of the Gauss-Markov model of gravity, 3 in (13); wander_s : time [s] in which tau3, k1, k2 and k3 wander by
    their prior standard deviations, q_k of (15); 0 for constants.

    Raises ValueError for a value that is not finite or has a wrong sign.
    """

    L_km: float = 28.0
    sigma_mgal: float = 12.0
    q_f: float = 1.5
    R_m: float = 0.016
    V: float = 0.0
    sd_dv: float = 1.0
    sd_dh: float = 0.1
    sd_tau3: float = 0.02
    sd_k12: float = 1e-4
    sd_k3: float = 3e-7
    sd_bias: float = 0.0
    colour_m: float = 0.0
    colour_s: float = 80.0
    k3_from: float = 0.0
    order: int = 3
    wander_s: float = 0.0

    def __post_init__(self) -> None:
        positive = {"L_km", "R_m", "sd_dv", "sd_dh", "colour_s"}
        for item in fields(self):
            value = getattr(self, item.name)
            if not math.isfinite(value) or value < 0 or (item.name in positive and value == 0):
                rule = "positive" if item.name in positive else "zero or positive"
                raise ValueError(f"{item.name} = {value:g}: it must be finite and {rule}.")
        if self.order not in ORDERS:
            raise ValueError(f"order = {self.order:g}: the gravity models are of order {', '.join(map(str, ORDERS))}.")

    @classmethod
    def preset(cls, name: str, **changes: Any) -> Tuning:
        """The tuning that belongs to a preset: paper_like, rough, matched (simulated), kauring, eastvic (real),
        joint.
        """
        if name not in TUNINGS:
            raise ValueError(f"preset {name!r} is unknown; the presets are {', '.join(TUNINGS)}.")
        return replace(TUNINGS[name], **changes)

    def coloured(self, white_m: float, colour_m: float, colour_s: float) -> Tuning:
        """The same tuning with a coloured error of the height beside a white one [m, m, s]."""
        return replace(self, R_m=white_m, colour_m=colour_m, colour_s=colour_s)

    def beta(self, V: float) -> float:
        """Decay rate of the gravity model at a speed V [m/s], equation (13): 2.903 V / L [1/s] where its order is 3."""
        return ORDERS[self.order] * (self.V or V) / (1e3 * self.L_km)


_KAURING = Tuning(L_km=6.0, sigma_mgal=15.0, q_f=5.0, R_m=0.02, sd_dv=3.0, sd_dh=0.01, sd_k12=1e-5, sd_k3=3e-5)
TUNINGS = {
    "paper_like": Tuning(),
    "rough": Tuning(L_km=18.0, sigma_mgal=20.0, q_f=2.0, R_m=0.02),
    "matched": Tuning(L_km=12.0, sigma_mgal=20.0, q_f=8.0, R_m=0.02, sd_k3=3e-6),
    "kauring": _KAURING,
    "eastvic": Tuning(
        L_km=8.0, sigma_mgal=30.0, q_f=10.0, R_m=0.15, sd_dv=10.0, sd_tau3=0.1, sd_k12=1e-4, sd_k3=1e-4
    ),
    "joint": replace(_KAURING, sigma_mgal=0.0, q_f=4.5, R_m=0.008, sd_k3=1e-5, sd_bias=10.0, k3_from=980_000.0),
}  # fmt: skip


@dataclass(frozen=True)
class Line:
    """One flight line as a filter is given it: no truth, no reference, one constant step, no gap.

    name : of the line; t : (n,) [s]; z : (n,) dh' of (12) [mGal s^2]; f3 : (n,) vertical specific force f3' [mGal];
    first, second : (n - 1, 4) single and double integrals over each step of (df3'/dt, f1', f2', f3') [mGal s, mGal
    s^2];
    V : mean speed [m/s].
    """

    name: str
    t: Array
    z: Array
    f3: Array
    first: Array
    second: Array
    V: float

    @property
    def dt(self) -> float:
        """Step [s]."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)

    def lagged(self, c: float) -> Line:
        """The same line with z + c (f3' - f3'(0)): a second-order lag, mu3 d2f3'/dt2 in (7); c [s^2]."""
        return replace(self, z=self.z + c * (self.f3 - self.f3[0]))

    def part(self, keep: slice) -> Line:
        """Consecutive epochs of the same line."""
        start, stop, step = keep.indices(len(self.t))
        if step != 1 or stop - start < 2:
            raise ValueError(f"part {keep} of line {self.name}: give at least two consecutive epochs.")
        steps = slice(start, stop - 1)
        return replace(
            self, t=self.t[keep], z=self.z[keep], f3=self.f3[keep], first=self.first[steps], second=self.second[steps]
        )


@dataclass(frozen=True)
class ScaledModel:
    """A linear model for the core's filters in scaled states: state = scale * x.

    names : of the states it has; scale : (m,) initial standard deviations [mGal, s]; prior : of x at the first epoch;
    Phi : (n - 1, m, m); Q : (m, m); H : (1, m); R : (1, 1).
    """

    names: tuple[str, ...]
    scale: Array
    prior: Gaussian
    Phi: Array
    Q: Array
    H: Array
    R: Array


def double_integral(a: ArrayLike, dt: float, v0: float = 0.0) -> tuple[Array, Array]:
    """Integrate an acceleration that is linear within each step: velocity and height, which starts at zero.

    v_(j+1) = v_j + (a_j + a_(j+1)) dt/2,   h_(j+1) = h_j + v_j dt + (2 a_j + a_(j+1)) dt^2/6.
    a : (n,) or (n, m), at the rate of the sensor; v0 : velocity at the start. Returns two arrays like a.
    """
    a = np.asarray(a, dtype=float)
    v, h = np.empty_like(a), np.empty_like(a)
    v[0], h[0] = v0, 0.0
    np.cumsum((a[:-1] + a[1:]) * (dt / 2), axis=0, out=v[1:])
    v[1:] += v0
    np.cumsum(v[:-1] * dt + (2 * a[:-1] + a[1:]) * (dt**2 / 6), axis=0, out=h[1:])
    return v, h


def step_integrals(f: Array, dt: float, every: int = 1) -> tuple[Array, Array]:
    """Integrals over the steps of a filter of (df3'/dt, f1', f2', f3'), from samples at the rate of the sensor.

    f : (n, 3) f1', f2', f3' [mGal] every dt [s]; every : samples per step of the filter. Returns `first`, `second` of
    a Line.
    That of df3'/dt is f3'(t_k) - f3'(t_(k-1)): a numerical derivative would be useless where the motion reaches 1 Hz.
    """
    v, h = double_integral(f, dt)
    v, h, sampled, step = v[::every], h[::every], f[::every], every * dt
    first, second = np.empty((len(v) - 1, 4)), np.empty((len(v) - 1, 4))
    first[:, 1:] = np.diff(v, axis=0)
    second[:, 1:] = np.diff(h, axis=0) - v[:-1] * step
    first[:, 0] = np.diff(sampled[:, 2])
    second[:, 0] = first[:, 3] - sampled[:-1, 2] * step
    return first, second


def gravity_density(beta: float, sigma: float, order: int = 3) -> float:
    """Power density of the white noise that drives a Gauss-Markov model: 16/3 beta^5 sigma^2 for the third order.

    2 beta sigma^2 for the first, 4 beta^3 sigma^2 for the second (Gelb 1974, table of shaping filters).
    """
    return {1: 2.0, 2: 4.0, 3: 16.0 / 3.0}[order] * beta ** (2 * order - 1) * sigma**2


def gravity_covariance(beta: float, sigma: float, order: int = 3) -> Array:
    """Stationary covariance (order, order) of gravity and its derivatives under (14)."""
    b = beta**2
    if order < 3:
        return sigma**2 * np.diag([1.0, b][:order])
    return sigma**2 * np.array([[1.0, 0.0, -b / 3], [0.0, b / 3, 0.0], [-b / 3, 0.0, b**2]])


def autocovariance(t: ArrayLike, beta: float, sigma: float) -> Array:
    """Autocovariance of the third-order model, sigma^2 exp(-b|t|) (1 + b|t| + b^2 t^2/3)."""
    x = beta * np.abs(t)
    return sigma**2 * np.exp(-x) * (1 + x + x**2 / 3)


def power_density(omega: ArrayLike, beta: float, sigma: float) -> Array:
    """Two-sided power density (16/3) b^5 sigma^2 / (b^2 + w^2)^3, whose integral over w/(2 pi) is sigma^2."""
    return gravity_density(beta, sigma) / (beta**2 + np.asarray(omega) ** 2) ** 3


def block(dt: float, beta: float, sigma: float, q_f: float, order: int = 3) -> tuple[Array, Array]:
    """Transition and process noise (2 + order, 2 + order) of the constant block [dv, dh, dg, dg', dg''] over a step.

    By van Loan's method; gravity is (d/dt + beta)^order dg = w.
    """
    n = 2 + order
    F, W = np.zeros((n, n)), np.zeros((n, n))
    F[0, 2] = F[1, 0] = 1.0
    F[range(2, n - 1), range(3, n)] = 1.0
    F[-1, 2:] = [-math.comb(order, k) * beta ** (order - k) for k in range(order)]
    W[0, 0], W[-1, -1] = q_f**2, gravity_density(beta, sigma, order)
    return van_loan(F, W, dt)


def build(line: Line, tuning: Tuning) -> ScaledModel:
    """The model of a line, equations (10) to (15): states of zero prior variance are left out, the rest is scaled."""
    n, dt, beta = len(line.t), line.dt, tuning.beta(line.V)
    size = len(STATES)
    Phi, Q, P = np.zeros((n - 1, size, size)), np.zeros((size, size)), np.zeros((size, size))
    Phi[:] = np.eye(size)
    gravity = [DG, DG1, DG2][: tuning.order]
    core = np.ix_([DV, DH, *gravity], [DV, DH, *gravity])
    constant, Q[core] = block(dt, beta, tuning.sigma_mgal, tuning.q_f, tuning.order)
    Phi[(slice(None), *core)] = constant
    first, second = line.first.copy(), line.second.copy()
    first[:, 3] -= tuning.k3_from * dt
    second[:, 3] -= tuning.k3_from * dt**2 / 2
    Phi[:, DV, TAU3 : K3 + 1] = first
    Phi[:, DH, TAU3 : K3 + 1] = second
    Phi[:, DV, BIAS], Phi[:, DH, BIAS] = dt, dt**2 / 2
    start, errors = (tuning.sd_dv * METRE, tuning.sd_dh * METRE), (tuning.sd_tau3, tuning.sd_k12, tuning.sd_k12)
    P[range(7), range(7)] = np.square([*start, *errors, tuning.sd_k3, tuning.sd_bias])
    P[np.ix_(gravity, gravity)] = gravity_covariance(beta, tuning.sigma_mgal, tuning.order)
    if tuning.wander_s:  # within a step, 1/3000 of the usual time, the wandering does not reach dv
        wandering = range(TAU3, K3 + 1)
        Q[wandering, wandering] = P[wandering, wandering] * dt / tuning.wander_s
    if tuning.colour_m:
        one, noise = gauss_markov(dt, tuning.colour_s, tuning.colour_m * METRE)
        Phi[:, COLOUR, COLOUR], Q[COLOUR, COLOUR] = one[0, 0], noise[0, 0]
        P[COLOUR, COLOUR] = (tuning.colour_m * METRE) ** 2
    H = np.zeros((1, size))
    H[0, [DH, COLOUR]] = 1.0
    kept = np.flatnonzero(P.diagonal() > 0)
    scale = np.sqrt(P.diagonal()[kept])
    pick = np.ix_(kept, kept)
    outer = scale[:, None] * scale
    return ScaledModel(
        tuple(STATES[i] for i in kept), scale, Gaussian(np.zeros(len(kept)), P[pick] / outer),
        np.ascontiguousarray(Phi[(slice(None), *pick)] / scale[:, None] * scale), Q[pick] / outer, H[:, kept] * scale,
        np.array([[(tuning.R_m * METRE) ** 2]]),
    )  # fmt: skip
