"""Motion of an Earth satellite in the GCRS: geopotential in the true Earth-fixed frame, Sun, Moon, Venus and Jupiter,
solar pressure with shadow, relativity; and the variational equations.

Time t is uniform, in seconds since 0h UTC of a day. Positions of the bodies (6-point Lagrange) and the Earth's
orientation (linear) are interpolated in tables; TDB is taken for TT.
Source: Montenbruck & Gill (2000), Satellite Orbits, chapter 3; radioastron-orbit (24)-(27).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit

from geokalman.physics.dop853 import FORCE
from geokalman.physics.earth_orientation import (
    COLUMNS,
    ERA_RATE,
    Array,
    era_at_midnight,
    load_orientation,
    orientation_point,
)
from geokalman.physics.ephemeris import load_ephemeris
from geokalman.physics.gradient import gradient_point, pack_gradient
from geokalman.physics.gravity import acceleration_point, pack
from geokalman.physics.harmonics import load_field
from geokalman.physics.orbit import Orbits, integrate
from geokalman.physics.perturbations import SOLAR_PRESSURE, solar_pressure_point, third_body_point
from geokalman.physics.relativity import schwarzschild_point
from geokalman.physics.timescales import MJD_ZERO, tt_minus_utc
from geokalman.physics.transition import chain_step, variational_step

GM_BODIES = {"sun": 1.32712440018e20, "moon": 4.902800076e12, "venus": 3.24858599e14, "jupiter": 1.26712764e17}
"""GM of the disturbing bodies of DE421 [m^3 s^-2]; their order is that of the table's columns."""
STEP = 1800.0
"""Step of the tables [s]."""
MARGIN = 3
"""Steps by which the tables reach beyond the span on each side, for the 6-point interpolation."""
INTEGRATION_STEP = 600.0
"""Longest DOP853 step [s]; above 40 000 km half of it changes a day's orbit by less than a micrometre."""
_BODIES = len(GM_BODIES)
_WIDTH = COLUMNS + 3 * _BODIES
# Places in the flat parameters
_FIRST, _ROWS, _ERA, _PRESSURE, _RADIUS, _RELATIVITY, _CONSTANT, _GM = 0, 1, 2, 3, 4, 5, 6, 9
_FIELD, _GRADIENT, _HEADER = _GM + _BODIES, _GM + _BODIES + 1, _GM + _BODIES + 2


@dataclass(frozen=True)
class ForceModel:
    """What acts on the satellite; the defaults are the reference configuration of radioastron-orbit.

    degree of the EGM96 field; bodies: their names; kappa = C_R A/m [m^2/kg]; relativity: the Schwarzschild term;
    constant: an acceleration that does not turn [m s^-2].
    """

    degree: int = 10
    bodies: tuple[str, ...] = ("sun", "moon", "venus")
    kappa: float = 0.039
    relativity: bool = True
    constant: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.degree < 0:
            raise ValueError(f"degree = {self.degree} of the field must be 0 (a sphere) or more.")
        for name in self.bodies:
            if name not in GM_BODIES:
                raise ValueError(f"body {name!r} is unknown; give some of {', '.join(GM_BODIES)}.")
        if not self.kappa >= 0.0:
            raise ValueError(f"kappa = {self.kappa} m^2/kg must not be negative.")


@dataclass(frozen=True, eq=False)
class Dynamics:
    """Forces, Earth orientation and bodies over a span of t, as the flat parameters of the kernels below.

    day: modified Julian date of t = 0h UTC; first, last: the span [s]; params: flat parameters.
    """

    model: ForceModel
    day: int
    first: float
    last: float
    params: Array = field(repr=False)

    def with_changes(self, pressure_scale: float = 1.0, constant: Array | None = None) -> Dynamics:
        """The same with solar pressure scaled and another constant acceleration (3,) [m s^-2]."""
        params = self.params.copy()
        params[_PRESSURE] *= pressure_scale
        if constant is not None:
            params[_CONSTANT : _CONSTANT + 3] = constant
        return replace(self, params=params)

    def check_span(self, *times: float) -> None:
        """Raise ValueError where a time [s] is outside the span of the tables."""
        for t in times:
            if not self.first <= t <= self.last:
                raise ValueError(
                    f"t = {t:.10g} s is outside the tables of MJD {self.day}, which span {self.first:.10g} to"
                    f" {self.last:.10g} s."
                )

    def propagate(self, state: Array, t: Array, step: float = INTEGRATION_STEP) -> Orbits:
        """Integrate the state (6,) at t[0] [GCRS, m, m/s] by DOP853 to all times t (n,) [s], forward or backward.

        Raises ValueError for times outside the tables, ArithmeticError where the satellite comes down.
        """
        self.check_span(t[0], t[-1])
        return integrate(
            satellite_force,
            self.params,
            state,
            np.asarray(t, dtype=float),
            "dop853",
            step,
            surface=self.params[_RADIUS],
        )

    def acceleration(self, t: float, state: Array) -> Array:
        """Acceleration (3,) at the state (6,) [m s^-2]."""
        self.check_span(t)
        out = np.empty(3)
        satellite_force(float(t), np.ascontiguousarray(state, dtype=float), self.params, out)
        return out

    def gradient(self, t: float, r: Array) -> Array:
        """Gradient (3, 3) of the acceleration with respect to position [s^-2]."""
        self.check_span(t)
        out = np.empty((3, 3))
        gradient_step(float(t), np.ascontiguousarray(r[:3], dtype=float), self.params, out)
        return out

    def transition(self, state: Array, t0: float, t1: float, step: float = 60.0) -> tuple[Array, Array]:
        """State (6,) at t1 and transition matrix (6, 6) from t0, by fourth-order steps of at most `step` [s]."""
        self.check_span(t0, t1)
        y, Phi = np.array(state, dtype=float), np.eye(6)
        transition_step(float(t0), float(t1), step, y, self.params, Phi)
        return y, Phi

    def gcrs_from_itrs(self, t: float) -> Array:
        """R_gcrs_itrs (3, 3) at t [s]."""
        self.check_span(t)
        out = np.empty((3, 3))
        gcrs_from_itrs_step(float(t), self.params, out)
        return out

    def body(self, name: str, t: float) -> Array:
        """Geocentric position (3,) of a body of `GM_BODIES` at t [m]."""
        self.check_span(t)
        out = np.empty(3)
        body_step(float(t), list(GM_BODIES).index(name), self.params, out)
        return out


def dynamics(day: int, first: float, last: float, model: ForceModel | None = None) -> Dynamics:
    """Make the tables for times from first to last [s since 0h UTC of the day].

    Raises OutsideOrientation or OutsideEphemeris where they do not reach, ValueError for a span that is empty.
    """
    model = model or ForceModel()
    if not first < last:
        raise ValueError(f"the span from {first:g} to {last:g} s is empty.")
    low, rows = math.floor(first / STEP) - MARGIN, math.ceil(last / STEP) - math.floor(first / STEP) + 2 * MARGIN + 1
    table = _table(day, low, rows)
    gravity = load_field("EGM96", max(model.degree, 2))
    packed = pack(gravity, model.degree)
    header = np.zeros(_HEADER)
    header[_FIRST], header[_ROWS] = low * STEP, rows
    header[_ERA] = era_at_midnight(day)
    header[_PRESSURE] = SOLAR_PRESSURE * model.kappa
    header[_RADIUS] = gravity.radius
    header[_RELATIVITY] = model.relativity
    header[_CONSTANT : _CONSTANT + 3] = model.constant
    for k, (name, gm) in enumerate(GM_BODIES.items()):
        header[_GM + k] = gm if name in model.bodies else 0.0
    header[_FIELD] = _HEADER + table.size
    header[_GRADIENT] = header[_FIELD] + packed.size
    params = np.concatenate([header, table.ravel(), packed, pack_gradient(gravity, min(model.degree, 2))])
    return Dynamics(model, day, float(first), float(last), params)


@functools.lru_cache(maxsize=16)
def _table(day: int, low: int, rows: int) -> Array:
    t = STEP * (low + np.arange(rows))
    ephemeris = load_ephemeris()
    seconds = t + tt_minus_utc(day)
    bodies = [ephemeris.position(name, day + MJD_ZERO, seconds, "earth") for name in GM_BODIES]
    return np.concatenate([load_orientation().table(day, t), *bodies], axis=1)


@njit(cache=True)
def gcrs_from_itrs_step(t, params, out):
    """R_gcrs_itrs at t [s], written to out (3, 3)."""
    place = (t - params[_FIRST]) / STEP
    k = int(place)
    w = place - k
    row = np.empty(COLUMNS)
    at = _HEADER + k * _WIDTH
    for j in range(COLUMNS):
        row[j] = (1.0 - w) * params[at + j] + w * params[at + _WIDTH + j]
    orientation_point(row, params[_ERA] + ERA_RATE * (t + row[3]), out)


@njit(cache=True)
def body_step(t, body, params, out):
    """Geocentric position of a body at t [s], by 6-point Lagrange interpolation, written to out (3,) [m]."""
    place = (t - params[_FIRST]) / STEP
    k = int(place) - 2
    x = place - k
    out[0] = out[1] = out[2] = 0.0
    for i in range(6):
        w = 1.0
        for j in range(6):
            if j != i:
                w *= (x - j) / (i - j)
        at = _HEADER + (k + i) * _WIDTH + COLUMNS + 3 * body
        for d in range(3):
            out[d] += w * params[at + d]


@njit(FORCE, cache=True)
def satellite_force(t, y, params, acceleration):
    """All accelerations of `Dynamics` on any number of bodies, for the integrators; params are those of `dynamics`."""
    R = np.empty((3, 3))
    gcrs_from_itrs_step(t, params, R)
    bodies = np.empty((_BODIES, 3))
    for k in range(_BODIES):
        if k == 0 or params[_GM + k] > 0.0:
            body_step(t, k, params, bodies[k])
    fixed, g = np.empty(3), np.empty(3)
    packed = params[int(params[_FIELD]) : int(params[_GRADIENT])]
    for b in range(y.size // 6):
        r, v, out = y[6 * b : 6 * b + 3], y[6 * b + 3 : 6 * b + 6], acceleration[3 * b : 3 * b + 3]
        for i in range(3):
            fixed[i] = R[0, i] * r[0] + R[1, i] * r[1] + R[2, i] * r[2]
        acceleration_point(fixed, packed, g)
        for i in range(3):
            out[i] = R[i, 0] * g[0] + R[i, 1] * g[1] + R[i, 2] * g[2] + params[_CONSTANT + i]
        for k in range(_BODIES):
            if params[_GM + k] > 0.0:
                third_body_point(r, bodies[k], params[_GM + k], out)
        if params[_PRESSURE] > 0.0:
            solar_pressure_point(r, bodies[0], params[_PRESSURE], params[_RADIUS], out)
        if params[_RELATIVITY] > 0.0:
            schwarzschild_point(r, v, packed[0], out)


@njit(cache=True)
def gradient_step(t, r, params, out):
    """Gradient of the acceleration with respect to position, written to out (3, 3) [s^-2].

    Geopotential to degree 2 and the disturbing bodies; those of the higher degrees, of sunlight and of relativity are
    below 1e-8 of it at the distances of interest.
    """
    R, G, fixed, s = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(3)
    gcrs_from_itrs_step(t, params, R)
    for i in range(3):
        fixed[i] = R[0, i] * r[0] + R[1, i] * r[1] + R[2, i] * r[2]
    gradient_point(fixed, params[int(params[_GRADIENT]) :], G)
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                for m in range(3):
                    total += R[i, k] * G[k, m] * R[j, m]
            out[i, j] = total
    for b in range(_BODIES):
        gm = params[_GM + b]
        if gm > 0.0:
            body_step(t, b, params, s)
            for i in range(3):
                s[i] -= r[i]
            d2 = s[0] * s[0] + s[1] * s[1] + s[2] * s[2]
            f = gm / (d2 * math.sqrt(d2))
            for i in range(3):
                out[i, i] -= f
                for j in range(3):
                    out[i, j] += 3.0 * f * s[i] * s[j] / d2


@njit(cache=True)
def runge_kutta_step(t, h, y, params, middle, out):
    """One classical fourth-order step of the state y (6,) from t to t + h; the stage at t + h/2 is left in middle
    (3,)."""
    a = np.empty(3)
    k = np.zeros((4, 6))
    stage = np.empty(6)
    for s in range(4):
        f = 0.0 if s == 0 else (h if s == 3 else 0.5 * h)
        for i in range(6):
            stage[i] = y[i] + (f * k[s - 1, i] if s > 0 else 0.0)
        satellite_force(t + f, stage, params, a)
        for i in range(3):
            k[s, i] = stage[3 + i]
            k[s, 3 + i] = a[i]
            if s == 2:
                middle[i] = stage[i]
    for i in range(6):
        out[i] = y[i] + (h / 6.0) * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])


@njit(cache=True)
def propagate_step(t0, t1, longest, y, params):
    """Take the state y (6,) from t0 to t1 [s] in place, in equal fourth-order steps no longer than `longest` [s]."""
    steps = max(1, math.ceil(abs(t1 - t0) / longest - 1e-9))
    h = (t1 - t0) / steps
    middle, after = np.empty(3), np.empty(6)
    if t1 != t0:
        for i in range(steps):
            runge_kutta_step(t0 + i * h, h, y, params, middle, after)
            y[:] = after


@njit(cache=True)
def transition_step(t0, t1, longest, y, params, Phi):
    """As `propagate_step`, and put the transition matrix after that in Phi (6, 6): Phi = Phi(t1, t0) Phi, in place."""
    if t1 == t0:
        return
    steps = max(1, math.ceil(abs(t1 - t0) / longest - 1e-9))
    h = (t1 - t0) / steps
    middle, after, step = np.empty(3), np.empty(6), np.empty((6, 6))
    G0, Gm, G1 = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    gradient_step(t0, y[:3], params, G0)
    for i in range(steps):
        t = t0 + i * h
        runge_kutta_step(t, h, y, params, middle, after)
        gradient_step(t + 0.5 * h, middle, params, Gm)
        gradient_step(t + h, after[:3], params, G1)
        variational_step(G0, Gm, G1, h, step)
        chain_step(step, Phi)
        y[:] = after
        G0[:] = G1


@njit(cache=True)
def euler_transition_step(t0, t1, longest, y, params, Phi):
    """As `transition_step` with the matrix I + F T of each step, F at its start: radioastron-orbit (13)."""
    if t1 == t0:
        return
    steps = max(1, math.ceil(abs(t1 - t0) / longest - 1e-9))
    h = (t1 - t0) / steps
    G, A = np.empty((3, 3)), np.zeros((6, 6))
    for i in range(steps):
        gradient_step(t0 + i * h, y[:3], params, G)
        for r in range(6):
            for c in range(6):
                A[r, c] = 1.0 if r == c else 0.0
        for r in range(3):
            A[r, 3 + r] = h
            for c in range(3):
                A[3 + r, c] = h * G[r, c]
        propagate_step(t0 + i * h, t0 + (i + 1) * h, 60.0, y, params)
        chain_step(A, Phi)


def budget(model: Dynamics, t: float, state: Array) -> Mapping[str, float]:
    """Size of each acceleration at the state (6,) [m s^-2], by switching it on alone on top of the point mass.

    Names: kepler, j2, degrees_3_up, one for each body of `GM_BODIES`, solar_pressure, relativity.
    """

    def size(reference: ForceModel, changed: ForceModel) -> float:
        parts = [dynamics(model.day, model.first, model.last, m).acceleration(t, state) for m in (reference, changed)]
        return float(np.linalg.norm(parts[1] - parts[0]))

    bare = ForceModel(degree=0, bodies=(), kappa=0.0, relativity=False)
    sizes = {
        "kepler": float(np.linalg.norm(dynamics(model.day, model.first, model.last, bare).acceleration(t, state))),
        "j2": size(bare, replace(bare, degree=2)),
        "degrees_3_up": size(replace(bare, degree=2), replace(bare, degree=max(2, model.model.degree))),
    }
    for name in GM_BODIES:
        sizes[name] = size(bare, replace(bare, bodies=(name,)))
    sizes["solar_pressure"] = size(bare, replace(bare, kappa=model.model.kappa))
    sizes["relativity"] = size(bare, replace(bare, relativity=True))
    return sizes
