"""Line-of-sight gravity differences by every route, equation (47): the paper's and the consistent ones beside it.

======  ======================================================================================================
id      how e . (g_A - g_B) is formed
======  ======================================================================================================
X       exact, from the field (a control)
N1      Newton: D9 D9 rho, with D9 rho and dv = D9 dr
N2      Newton with one second derivative: D2_9 rho, with D9 rho and dv = D9 dr
E0      the causal filter's own e . da, no smoother
E1      EKF + RTS: D9 of the smoothed range-rate, smoothed rho and dv
E2      EKF + RTS: the smoothed state's own e . da
U1      UKF + RTS: D9 of the smoothed range-rate, smoothed rho and dv
U2      UKF + RTS: the smoothed state's own e . da
K0      exact rho, rate and dv, range-acceleration by D9 (a control: what a perfect K-band would give)
P2      EKF + RTS with the weight of E0, e . da: positions alone, weighted for accelerations
B11     degree-11 splines of the exact rate and of dr: better mathematics instead of a filter
======  ======================================================================================================
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from geokalman.grace import estimate
from geokalman.grace.differentiate import derivative, spline_derivative
from geokalman.grace.estimate import Differentiated, States
from geokalman.grace.model import Array, Observations, Tuning, distance, los_gravity, range_rate
from geokalman.grace.simulate import Truth, accelerations
from geokalman.physics.field import GravityField

IDS = ("X", "N1", "N2", "E0", "E1", "E2", "U1", "U2", "K0", "B11", "P2")
PAPER = ("N1", "E1", "U2")
"""The mix of our first edition, which gives the paper's Figure 5 best and which no sentence of the text supports."""


def exact(orbit: Truth, gravity: GravityField) -> Array:
    """X: e . (g_A - g_B) of the field itself (n,) [m/s^2]."""
    a_A, a_B = accelerations(orbit, gravity)
    return np.einsum("ij,ij->i", orbit.dr, a_A - a_B) / distance(orbit.dr)


def from_newton(newton: Differentiated, twice: bool) -> Array:
    """N1 (`twice`: D9 of the D9 range-rate) or N2 (one second derivative of rho), (n,) [m/s^2]; NaN at the edges."""
    acceleration = derivative(newton.rate, newton.dt) if twice else derivative(newton.rho, newton.dt, order=2)
    return los_gravity(newton.rho, newton.rate, acceleration, newton.dv)


def from_range_rate(states: States) -> Array:
    """E1, U1: equation (47) with the range-acceleration from D9 of the states' range-rate, (n,) [m/s^2]."""
    return los_gravity(states.rho, states.rate, derivative(states.rate, states.dt), states.dv)


def observables(
    orbit: Truth,
    gravity: GravityField,
    data: Observations,
    tuning: Tuning,
    literal: Tuning,
    ids: Iterable[str] = IDS,
) -> dict[str, Array]:
    """Line-of-sight gravity differences (n,) [m/s^2] for the wanted ids, in their order.

    orbit and gravity serve the controls X, K0 and B11 alone, which no receiver could form; everything else sees `data`.
    literal: the tuning of E0 and P2. Raises ValueError for an unknown id.
    """
    wanted = tuple(ids)
    unknown = [name for name in wanted if name not in IDS]
    if unknown:
        raise ValueError(f"observable {unknown[0]!r} is unknown; the observables are {', '.join(IDS)}.")
    out: dict[str, Array] = {}
    if "X" in wanted:
        out["X"] = exact(orbit, gravity)
    if {"N1", "N2"} & set(wanted):
        newton = estimate.newton(data)
        out |= {"N1": from_newton(newton, twice=True), "N2": from_newton(newton, twice=False)}
    if {"E0", "P2"} & set(wanted):
        kinematic = estimate.ekf(data, literal)
        out |= {"E0": kinematic.filtered.los, "P2": kinematic.smoothed.los}
    if {"E1", "E2"} & set(wanted):
        smoothed = estimate.ekf(data, tuning).smoothed
        out |= {"E1": from_range_rate(smoothed), "E2": smoothed.los}
    if {"U1", "U2"} & set(wanted):
        smoothed = estimate.ukf(data, tuning).smoothed
        out |= {"U1": from_range_rate(smoothed), "U2": smoothed.los}
    if {"K0", "B11"} & set(wanted):
        rho, rate = distance(orbit.dr), range_rate(orbit.dr, orbit.dv)
        out["K0"] = los_gravity(rho, rate, derivative(rate, orbit.dt), orbit.dv)
        if "B11" in wanted:
            dv = spline_derivative(orbit.dr, orbit.dt, 11)
            out["B11"] = los_gravity(rho, rate, spline_derivative(rate, orbit.dt, 11), dv)
    return {name: out[name] for name in wanted}


def companions(orbit: Truth, farther: GravityField, data: Observations, fused: Tuning) -> dict[str, Array]:
    """Two series (n,) [m/s^2] beside the observables.

    omission: exact gravity difference of a field that goes on beyond the degree recovered, at the same positions.
    Q2: the UKF's own e . da with the weights `fused`, tuned for accelerations as those of P2 are.
    """
    return {"omission": exact(orbit, farther), "Q2": estimate.ukf(data, fused).smoothed.los}
