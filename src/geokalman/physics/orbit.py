"""Orbits: one call that integrates k bodies in any compiled force, by Gauss-Jackson, DOP853 or Runge-Kutta 4(5).

Use a fixed step for micrometre range-rates: at equal cost it is more accurate than adaptive steps, whose dense output
and changing errors show in the differences of two orbits.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from geokalman.physics import gauss_jackson as gj
from geokalman.physics.dop853 import STAGES, dop853_steps

STEP = {"gj": 10.0, "dop853": 15.0}
"""Default steps [s] for low Earth orbits in a field to degree 70; h against h/2 is a test."""
PREDICTION = 1e-9
"""Largest disagreement of predicted and corrected positions, relative; 7 mm where a good step has nanometres."""
CHUNK = 8640
"""Steps between two looks at Ctrl-C and calls of the progress callback (a day of 10 s steps)."""


@dataclass(frozen=True)
class Orbits:
    """Orbits of k bodies on a grid of times, inertial.

    t (n,) [s]; r (n, k, 3) [m]; v (n, k, 3) [m/s]; method, h [s] (0 for adaptive steps) and evaluations of the force
    say how they were made.
    """

    t: np.ndarray
    r: np.ndarray
    v: np.ndarray
    method: str
    h: float
    evaluations: int

    @property
    def y(self) -> np.ndarray:
        """States (n, 6 k): position and velocity of the first body, of the second, ..."""
        return np.concatenate([self.r, self.v], axis=2).reshape(self.t.size, -1)


def integrate(
    force: Callable,
    params: np.ndarray,
    y0: np.ndarray,
    t: np.ndarray | tuple[float, int],
    method: str = "gj",
    h: float | None = None,
    *,
    surface: float = 0.0,
    rtol: float = 1e-12,
    atol: float = 1e-9,
    progress: Callable[[float], None] | None = None,
) -> Orbits:
    """Integrate r'' = a(t, r, v) of k bodies from the state y0 at t[0] and return the states at all t.

    force : compiled ``force(t, y, params, acceleration)`` with the signature `dop853.FORCE`
    params : (p,) float64, handed to the force as it is
    y0 : (6 k,) or (k, 6) position and velocity of each body at the first time [m, m/s]
    t : times, strictly increasing or decreasing [s], or (dt, n): n intervals of dt from 0, both ends given
    method : "gj" Gauss-Jackson (all times on the grid t[0] + i h), "dop853" fixed step (every interval in equal steps
        no longer than h), "rk45" adaptive with dense output, the mode of the paper
    h : step [s], default 10 (gj) or 15 (dop853); rk45 chooses its own
    surface : distance from the origin below which a body has hit something [m]
    rtol, atol : tolerances of rk45 alone
    progress : called with the fraction done after every 8640 steps (rk45: evaluations)
    Returns Orbits. Raises ValueError for bad input, ArithmeticError when a body falls below the surface or diverges.
    A long run stops at Ctrl-C; looks at it do not change a bit of the result.
    Source: Hairer, Norsett & Wanner 1993 (DOP853); Berry & Healy 2004 (Gauss-Jackson).
    """
    params = np.ascontiguousarray(params, dtype=float)
    times = _checked_times(t)
    y = _checked_state(y0, surface)
    if method == "rk45":
        states, evaluations = _rk45(force, params, y, times, surface, rtol, atol, progress)
        h = 0.0
    elif method in STEP:
        h = STEP[method] if h is None else float(h)
        if not (h > 0.0 and np.isfinite(h)):
            raise ValueError(f"step h = {h:g} s must be positive and finite.")
        solve = _gauss_jackson if method == "gj" else _dop853
        states, evaluations = solve(force, params, y, times, h, surface, progress)
    else:
        raise ValueError(f"method {method!r} is unknown, take one of gj, dop853, rk45.")
    bodies = states.reshape(times.size, -1, 6)
    return Orbits(times, bodies[..., :3].copy(), bodies[..., 3:].copy(), method, h, evaluations)


def _checked_times(t: np.ndarray | tuple[float, int]) -> np.ndarray:
    if isinstance(t, tuple) and len(t) == 2:
        dt, n = t
        if n != int(n) or n < 1:
            raise ValueError(f"{n} intervals of {dt:g} s: their number must be a positive whole number.")
        t = np.arange(int(n) + 1) * float(dt)
    times = np.array(t, dtype=float)
    if times.ndim != 1 or times.size < 2:
        raise ValueError(f"times have shape {times.shape}, at least a start and an end are needed in one dimension.")
    step = np.diff(times)
    if not np.all(np.isfinite(times)) or not (np.all(step > 0.0) or np.all(step < 0.0)):
        i = int(np.argmin(np.where(np.isfinite(step), step * np.sign(step[0]), -np.inf)))
        raise ValueError(
            f"times {times[i]:g}, {times[i + 1]:g} s at index {i}: times must go strictly one way and be finite."
        )
    return times


def _checked_state(y0: np.ndarray, surface: float) -> np.ndarray:
    y = np.array(y0, dtype=float).ravel()
    if y.size == 0 or y.size % 6 or (np.ndim(y0) > 1 and np.shape(y0)[-1] != 6):
        raise ValueError(
            f"state of shape {np.shape(y0)}: six numbers, position and velocity, are needed for each body."
        )
    if not np.all(np.isfinite(y)):
        raise ValueError(f"state {y.tolist()} holds a number that is not finite.")
    distance = np.linalg.norm(y.reshape(-1, 6)[:, :3], axis=1)
    if np.any(distance < surface):
        b = int(np.argmin(distance))
        raise ValueError(
            f"body {b} starts {distance[b]:.10g} m from the centre, inside the surface at {surface:.10g} m."
        )
    return y


def _fail(time: float, surface: float) -> None:
    raise ArithmeticError(
        f"a body came within {surface:.10g} m of the centre, or its state stopped being finite, about t = {time:g} s: "
        "raise the orbit, shorten the run or the step."
    )


def _substeps(times: np.ndarray, h: float) -> np.ndarray:
    # 1e-9: an interval that is a multiple of h up to rounding gets exactly that many steps
    return np.maximum(np.ceil(np.abs(np.diff(times)) / h - 1e-9), 1).astype(np.int64)


def _dop853(force, params, y, times, h, surface, progress):
    substeps = _substeps(times, h)
    done = np.concatenate([[0], np.cumsum(substeps)])
    states = np.empty((times.size, y.size))
    lost = np.zeros(y.size)
    i = 0
    while i < times.size - 1:
        j = max(i + 1, int(np.searchsorted(done, done[i] + CHUNK, side="right")) - 1)
        bad = dop853_steps(force, params, times[i : j + 1], y, lost, substeps[i:j], surface, states[i : j + 1])
        if bad >= 0:
            _fail(times[i + bad + 1], surface)
        if progress is not None:
            progress(done[j] / done[-1])
        i = j
    return states, int(done[-1]) * STAGES


def _gauss_jackson(force, params, y, times, h, surface, progress):
    h = float(np.copysign(h, times[1] - times[0]))
    index = np.rint((times - times[0]) / h).astype(np.int64)
    off = np.abs(times - times[0] - index * h)
    if np.any(off > 1e-6 * abs(h)):
        i = int(np.argmax(off > 1e-6 * abs(h)))
        interval = times[i] - times[i - 1]
        raise ValueError(
            f"output interval dt = {interval:.10g} s at index {i} is no multiple of the step h = {abs(h):.10g} s: "
            f"take h = {abs(interval) / np.ceil(abs(interval / h)):.10g} s, or method dop853 for free times."
        )
    half, reach, last = gj.HALF, 2 * gj.HALF, int(index[-1])
    if last <= reach:
        return _dop853(force, params, y, times, abs(h), surface, progress)

    # Start arc: the states at steps 0..2 HALF by DOP853 at half the step, and their accelerations.
    grid = times[0] + h * np.arange(reach + 1)
    arc = np.empty((reach + 1, y.size))
    two = np.full(reach, 2, dtype=np.int64)
    bad = dop853_steps(force, params, grid, y.copy(), np.zeros(y.size), two, surface, arc)
    if bad >= 0:
        _fail(grid[bad + 1], surface)
    size = y.size // 2
    a, s1, s2 = (np.zeros((reach + 1, size)) for _ in range(3))
    for k in range(reach + 1):
        force(grid[k], arc[k], params, a[k])
    u, w = gj.central()
    bodies = arc[half].reshape(-1, 2, 3)
    s1[half] = bodies[:, 1].ravel() / h - w @ a
    s2[half] = bodies[:, 0].ravel() / h**2 - u @ a
    lost = np.zeros((2, size))
    for k in range(half, reach):  # the sums of the rest of the arc follow from its accelerations
        s1[k + 1] = s1[k] + a[k]
        s2[k + 1] = s2[k] + s1[k + 1]

    states = np.empty((times.size, y.size))
    early = index < half
    states[early] = arc[index[early]]
    ready = int(np.count_nonzero(early))  # outputs done
    begin, evaluations = reach, STAGES * 2 * reach + reach + 1  # step of the last row of the window
    weights_u, weights_w = gj.predictor()
    while begin < last:
        end = min(begin + CHUNK, last)
        rows = reach + 1 + end - begin
        window = [np.empty((rows, size)) for _ in range(3)]
        for old, new in zip((a, s1, s2), window, strict=True):
            new[: reach + 1] = old[-reach - 1 :]
        a, s1, s2 = window
        first = begin - reach
        bad = gj.gauss_jackson_steps(
            force, params, times[0], h, first, reach + 1, weights_u, weights_w, surface, a, s1, s2, lost
        )
        if bad >= 0:
            _fail(times[0] + (first + bad) * h, surface)
        if rows > half + gj.PREDICTOR:
            difference, distance = gj.disagreement(h, a, s2)
            if not difference <= PREDICTION * distance:
                raise ArithmeticError(
                    f"step h = {abs(h):g} s is too long for Gauss-Jackson here, prediction and correction differ by "
                    f"{difference:.3g} m at t = {times[0] + h * end:g} s: shorten the step or take method dop853."
                )
        until = int(np.searchsorted(index, end - half, side="right"))
        gj.central_states(h, index[ready:until] - first, u, w, a, s1, s2, states[ready:until])
        ready, begin = until, end
        evaluations += rows - reach - 1
        if progress is not None:
            progress(end / last)
    if ready < times.size:  # the last steps have no neighbours ahead: Runge-Kutta from the last central state
        k = last - half
        tail = np.empty((1, y.size))
        gj.central_states(h, np.array([k - first]), u, w, a, s1, s2, tail)
        grid = np.concatenate([[times[0] + h * k], times[ready:]])
        steps = 2 * _substeps(grid, abs(h))
        ends = np.empty((grid.size, y.size))
        bad = dop853_steps(force, params, grid, tail[0], np.zeros(y.size), steps, surface, ends)
        if bad >= 0:
            _fail(grid[bad + 1], surface)
        states[ready:] = ends[1:]
        evaluations += int(steps.sum()) * STAGES
    return states, evaluations


def _rk45(force, params, y, times, surface, rtol, atol, progress):
    if not (rtol > 0.0 and atol > 0.0):
        raise ValueError(f"tolerances rtol = {rtol:g}, atol = {atol:g} must be positive.")
    acceleration = np.empty(y.size // 2)
    calls = itertools.count(1)

    def slope(time, state):
        if progress is not None and next(calls) % CHUNK == 0:
            progress(float((time - times[0]) / (times[-1] - times[0])))
        force(time, state, params, acceleration)
        bodies = np.empty((y.size // 6, 2, 3))
        bodies[:, 0] = state.reshape(-1, 2, 3)[:, 1]
        bodies[:, 1] = acceleration.reshape(-1, 3)
        return bodies.ravel()

    def clearance(time, state):
        return np.min(np.linalg.norm(state.reshape(-1, 2, 3)[:, 0], axis=1)) - surface

    clearance.terminal = True
    events = clearance if surface else None
    solution = solve_ivp(slope, times[[0, -1]], y, "RK45", times, events=events, rtol=rtol, atol=atol)
    if solution.status != 0:
        reached = solution.t_events[0][0] if solution.status == 1 else solution.t[-1] if solution.t.size else times[0]
        _fail(reached, surface)
    if progress is not None:
        progress(1.0)
    return np.ascontiguousarray(solution.y.T), int(solution.nfev)
