"""Kepler elements and inertial states: osculating ellipses about a point mass."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np


class Elements(NamedTuple):
    """Osculating elements: axis a [m], eccentricity, and inclination, node, pericentre, mean anomaly [rad]."""

    a: float
    e: float
    inc: float
    raan: float
    argp: float
    mean_anomaly: float


def eccentric_anomaly(mean_anomaly: float, e: float) -> float:
    """Solve Kepler's equation E - e sin E = M for the eccentric anomaly E [rad] by Newton's method.

    Raises ValueError for an eccentricity outside [0, 1).
    """
    if not 0.0 <= e < 1.0:
        raise ValueError(f"eccentricity {e:g} is no ellipse's: it must be in [0, 1).")
    turns = math.floor(mean_anomaly / (2.0 * math.pi) + 0.5)
    M = mean_anomaly - 2.0 * math.pi * turns
    low, high = M - e, M + e  # |E - M| <= e: a bracket that keeps Newton from leaving near e = 1
    E = M + math.copysign(e, M) if e > 0.8 else M + e * math.sin(M)
    for _ in range(200):
        f = E - e * math.sin(E) - M
        if f > 0.0:
            high = E
        else:
            low = E
        step = f / (1.0 - e * math.cos(E))
        E_new = E - step
        if not low <= E_new <= high:
            E_new = 0.5 * (low + high)
        if abs(E_new - E) <= 2e-16 * max(1.0, abs(E)):
            return E_new + 2.0 * math.pi * turns
        E = E_new
    return E + 2.0 * math.pi * turns


def kepler_to_state(elements: Elements | tuple[float, ...], gm: float) -> np.ndarray:
    """Inertial state (6,) [m, m/s] of osculating elements (a, e, inc, raan, argp, mean_anomaly) [m, -, rad].

    Raises ValueError for e outside [0, 1), a semi-major axis or GM [m^3 s^-2] that is not positive.
    """
    a, e, inc, raan, argp, mean_anomaly = elements
    if not (a > 0.0 and math.isfinite(a)):
        raise ValueError(f"semi-major axis {a:g} m must be positive and finite.")
    if not gm > 0.0:
        raise ValueError(f"GM = {gm:g} m^3/s^2 must be positive.")
    if not all(map(math.isfinite, (inc, raan, argp, mean_anomaly))):
        raise ValueError(f"angles (inc, raan, argp, M) = {(inc, raan, argp, mean_anomaly)} rad must be finite.")
    E = eccentric_anomaly(mean_anomaly, e)
    minor = math.sqrt((1.0 - e) * (1.0 + e))
    rate = math.sqrt(gm / a) / (1.0 - e * math.cos(E))
    x, y = a * (math.cos(E) - e), a * minor * math.sin(E)
    vx, vy = -rate * math.sin(E), rate * minor * math.cos(E)
    cO, sO, ci, si, cw, sw = (f(angle) for angle in (raan, inc, argp) for f in (math.cos, math.sin))
    P = np.array([cO * cw - sO * sw * ci, sO * cw + cO * sw * ci, sw * si])
    Q = np.array([-cO * sw - sO * cw * ci, -sO * sw + cO * cw * ci, cw * si])
    return np.concatenate([x * P + y * Q, vx * P + vy * Q])


def state_to_kepler(state: np.ndarray, gm: float) -> Elements:
    """Osculating elements of an inertial state (6,) [m, m/s]; angles in [0, 2 pi), the inverse of `kepler_to_state`.

    Where an angle has no meaning it is zero and its neighbour takes over: the node of an equatorial orbit (x axis), the
    pericentre of a circular one (node). Raises ValueError for a state on a parabola, hyperbola or straight line.
    """
    state = np.asarray(state, dtype=float)
    if state.shape != (6,):
        raise ValueError(f"a state has shape (6,), position and velocity, not {state.shape}.")
    r, v = state[:3], state[3:]
    distance = np.linalg.norm(r)
    momentum = np.cross(r, v)
    h = np.linalg.norm(momentum)
    if not (distance > 0.0 and h > 1e-12 * distance * np.linalg.norm(v)):
        raise ValueError(f"state {state.tolist()} moves on a straight line through the centre, no ellipse fits it.")
    energy = 0.5 * (v @ v) - gm / distance
    eccentricity = np.cross(v, momentum) / gm - r / distance
    e = float(np.linalg.norm(eccentricity))
    if not energy < 0.0 or e >= 1.0:
        raise ValueError(
            f"eccentricity {e:g} at state {state.tolist()}: not bound to GM = {gm:g} m^3/s^2, e must be below 1."
        )
    a = -0.5 * gm / energy
    inc = math.atan2(math.hypot(momentum[0], momentum[1]), momentum[2])
    node = np.array([-momentum[1], momentum[0], 0.0])
    if np.linalg.norm(node) <= 1e-14 * h:
        node = np.array([1.0, 0.0, 0.0])
    node /= np.linalg.norm(node)
    across = np.cross(momentum / h, node)  # in the plane, a quarter turn ahead of the node
    raan = math.atan2(node[1], node[0])
    pericentre = eccentricity / e if e > 1e-14 else node
    argp = math.atan2(pericentre @ across, pericentre @ node)
    ahead = np.cross(momentum / h, pericentre)
    minor = math.sqrt((1.0 - e) * (1.0 + e))
    E = math.atan2((r @ ahead) / (a * minor), (r @ pericentre) / a + (e if e > 1e-14 else 0.0))
    turn = 2.0 * math.pi
    return Elements(float(a), e, inc, raan % turn, argp % turn, (E - e * math.sin(E)) % turn)
