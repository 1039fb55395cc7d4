"""Simulate the flight: the true orbit, and the ranges of pulsar photons with their errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from geokalman.physics.field import GravityField
from geokalman.physics.kepler import kepler_to_state
from geokalman.pulsar.dynamics import Force, orbit_loop, rich_force
from geokalman.pulsar.model import CLOCK, STEP, TRANSFER, Array, Mission, World, all_directions, all_sigmas
from geokalman.pulsar.observations import Observations

Bias = Literal["white", "const", "sign", "none"]
TRUTH_STEP = 10.0
"""Runge-Kutta step of the truth [s]: its error is 0.1 mm in 500 s."""


@dataclass(frozen=True)
class Truth:
    """The true orbit in the inertial Mars frame.

    x0 : initial state (6,); t (n,) [s]; x : states (n, 6) [m, m/s].
    """

    x0: Array
    t: Array
    x: Array


def initial_state(mission: Mission, gravity: GravityField) -> Array:
    """Give the true state (6,) [m, m/s] at k = 0 from the elements of the orbit.

    Raises ValueError for an orbit that is no ellipse or meets Mars.
    """
    orbit = mission.orbit
    if orbit.a * (1.0 - orbit.e) <= gravity.radius:
        radius = gravity.radius / 1e3
        raise ValueError(f"a = {orbit.a / 1e3:g} km with e = {orbit.e:g} meets Mars, whose radius is {radius:g} km.")
    return kepler_to_state(orbit[:6], gravity.gm)


def fly(mission: Mission, gravity: GravityField, mismatch: float = 0.0, step: float = TRUTH_STEP) -> Truth:
    """Fly the true orbit to every epoch of the mission, in Runge-Kutta steps of `step` s.

    mismatch : lambda of the field that is true, 0 for J2 and 1 for the rich one. Raises ArithmeticError where it
    meets Mars.
    """
    force = rich_force(gravity, mission, mismatch)
    return fly_in(force, initial_state(mission, gravity), mission.t, step)


def fly_in(force: Force, x0: Array, t: Array, step: float = TRUTH_STEP) -> Truth:
    """Fly from x0 at t = 0 in a force to t (n,) [s], up to STEP apart, in steps up to `step`."""
    out = np.empty((len(t), 6))
    failed = orbit_loop(x0, t, max(1, round(STEP / step)), force.head, force.field, force.sun, out)
    if failed >= 0:
        raise ArithmeticError(f"the orbit meets Mars before epoch k = {failed + 1}; raise the pericentre.")
    return Truth(x0, t, out)


def observe(
    flight: Truth, mission: Mission, world: World, rng: np.random.Generator, outlier_fraction: float = 0.0,
    outlier_size: float = 10.0, bias: Bias = "white",
) -> Observations:  # fmt: skip
    """Ranges along the lines to the pulsars (11) with the errors of the experiment.

    The draws are those of all seven pulsars, whatever is observed, in this order: range noise (n, 7); transfer
    noise (n, 7) where bias is "white"; seven signs where it is "sign"; then, where there are outliers, mask, sign.
    `const` adds the transfer error as one constant, `none` leaves clock and transfer out. Outliers have
    `outlier_size` range sigmas.
    Raises ValueError for a fraction outside [0, 1].
    """
    if not 0.0 <= outlier_fraction <= 1.0:
        raise ValueError(f"outlier_fraction = {outlier_fraction:g} is outside [0, 1].")
    n, transfer = len(flight.t), world.transfer * TRANSFER
    directions, sigma = all_directions(), world.sigma_scale * all_sigmas()
    z = flight.x[:, :3] @ directions.T + rng.standard_normal((n, len(sigma))) * sigma
    if bias == "white":
        z += CLOCK + rng.standard_normal(z.shape) * transfer
    elif bias == "const":
        z += CLOCK + transfer
    elif bias == "sign":
        z += CLOCK + rng.choice([-1, 1], len(sigma)) * transfer
    if outlier_fraction > 0.0:
        mask = rng.random(z.shape) < outlier_fraction
        z += mask * rng.choice([-1, 1], z.shape) * outlier_size * sigma
    columns = mission.columns
    variance = (sigma**2 + transfer**2)[columns]
    return Observations(flight.t, np.ascontiguousarray(z[:, columns]), mission.H(), variance)


def one_at_a_time(data: Observations, order: list[int], columns: list[int]) -> Observations:
    """Observe by one detector: epoch j sees pulsar order[j mod n], the rest is NaN.

    order : numbers of Table 1; columns : what the columns of the data hold. Raises ValueError for a pulsar
    that is not there.
    """
    missing = [k for k in order if k - 1 not in columns]
    if missing or not order:
        there = [c + 1 for c in columns]
        raise ValueError(f"order = {order}: pulsars {missing} are not observed; give some of {there}.")
    z = np.full_like(data.z, np.nan)
    rows = np.arange(len(z))
    seen = np.array([columns.index(k - 1) for k in order])[rows % len(order)]
    z[rows, seen] = data.z[rows, seen]
    return Observations(data.t, z, data.H, data.variance)


def mismatch_rms(truth: Truth, force: Force) -> tuple[float, float]:
    """Give what one step of 500 s of a force misses of the truth, from every true state anew.

    RMS per component of position [m] and velocity [m/s].
    """
    starts = np.vstack([truth.x0, truth.x[:-1]])
    miss = np.empty_like(starts)
    out = np.empty((1, 6))
    for k, state in enumerate(starts):
        orbit_loop(state, np.array([STEP]), round(STEP / TRUTH_STEP), force.head, force.field, force.sun, out)
        miss[k] = truth.x[k] - out[0]
    return float(np.sqrt((miss[:, :3] ** 2).mean())), float(np.sqrt((miss[:, 3:] ** 2).mean()))
