"""The simulated pair: two precise orbits in one rotating field, and the data that the methods are given."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from geokalman.constants import OMEGA_EARTH
from geokalman.grace.model import DAY, Array, Observations, Scenario, range_rate
from geokalman.physics.dop853 import STAGES
from geokalman.physics.field import GravityField
from geokalman.physics.forces import gravity_force, gravity_params
from geokalman.physics.frames import to_ecef, to_eci
from geokalman.physics.gravity import acceleration
from geokalman.physics.kepler import kepler_to_state
from geokalman.physics.orbit import integrate
from geokalman.progress import share

PRIOR_SIGMAS = (1e-2, 1e-3, 1e-4)
"""Standard deviations of the prior relative position [m], velocity [m/s] and acceleration [m/s^2], per axis."""
_SAMPLE = 100  # evaluations of the force by which the time of an orbit is foreseen


@dataclass(frozen=True)
class Truth:
    """True inertial states of both satellites: t (n,) [s], A leading and B trailing (n, 6) [m, m/s]."""

    t: Array
    A: Array
    B: Array

    @property
    def dr(self) -> Array:
        """Relative position A - B (n, 3) [m]."""
        return self.A[:, :3] - self.B[:, :3]

    @property
    def dv(self) -> Array:
        """Relative velocity A - B (n, 3) [m/s]."""
        return self.A[:, 3:] - self.B[:, 3:]

    @property
    def dt(self) -> float:
        """Sampling interval [s]."""
        return float(self.t[1] - self.t[0])

    def first(self, days: float) -> Truth:
        """The same pair over its first days."""
        keep = self.t <= days * DAY + 1e-6
        return Truth(self.t[keep], self.A[keep], self.B[keep])

    def every(self, k: int) -> Truth:
        """The same pair at every k-th epoch."""
        return Truth(self.t[::k], self.A[::k], self.B[::k])


def start_states(scenario: Scenario, gravity: GravityField) -> tuple[Array, Array]:
    """Inertial states (6,) of A and B at t = 0 [m, m/s]: A is where B arrives tau seconds later, integrated by
    DOP853."""
    elements = (scenario.a, scenario.e, scenario.inc, scenario.raan, scenario.argp)
    B = kepler_to_state((*elements, scenario.m0), gravity.gm)
    if scenario.start == "same-elements":
        later = scenario.m0 + scenario.tau * np.sqrt(gravity.gm / scenario.a**3)
        return kepler_to_state((*elements, later), gravity.gm), B
    params = gravity_params(gravity, OMEGA_EARTH)
    return integrate(gravity_force, params, B, (scenario.tau, 1), "dop853").y[-1], B


def outlook(scenario: Scenario, gravity: GravityField) -> float:
    """Seconds that `orbit_pair` may take on this machine, by a sample of its force; 0 for rk45, which chooses its
    steps."""
    if scenario.integrator == "rk45":
        return 0.0
    params, y = gravity_params(gravity, OMEGA_EARTH), np.concatenate(start_states(scenario, gravity))
    acceleration, begun = np.empty(6), time.perf_counter()
    for k in range(_SAMPLE):
        gravity_force(float(k), y, params, acceleration)
    each = (time.perf_counter() - begun) / _SAMPLE
    return each * scenario.days * DAY / scenario.h * (STAGES if scenario.integrator == "dop853" else 1)


def orbit_pair(scenario: Scenario, gravity: GravityField) -> Truth:
    """Integrate both satellites together in the field that turns with the Earth.

    gravity: the field at the scenario's degree (an argument of its own, so that a memo sees what is in it).
    Returns the pair at every dt, both ends included.
    Raises ArithmeticError where a satellite comes down.
    """
    free = scenario.integrator == "rk45"
    orbits = integrate(
        gravity_force, gravity_params(gravity, OMEGA_EARTH), np.concatenate(start_states(scenario, gravity)),
        (scenario.dt, scenario.epochs - 1), scenario.integrator, None if free else scenario.h,
        surface=gravity.radius, rtol=scenario.rtol, atol=scenario.atol, progress=share("orbits"),
    )  # fmt: skip
    A, B = (np.concatenate([orbits.r[:, k], orbits.v[:, k]], axis=1) for k in (0, 1))
    return Truth(orbits.t, A, B)


def accelerations(orbit: Truth, gravity: GravityField) -> tuple[Array, Array]:
    """True inertial gravitational accelerations (n, 3) of A and B [m/s^2]."""
    both = []
    for state in (orbit.A, orbit.B):
        fixed = acceleration(gravity, to_ecef(orbit.t, state[:, :3], OMEGA_EARTH))
        both.append(to_eci(orbit.t, fixed, OMEGA_EARTH))
    return both[0], both[1]


def observe(
    orbit: Truth,
    gravity: GravityField,
    rng: np.random.Generator | None = None,
    sigma_pos: float = 0.0,
    sigma_rr: float = 0.0,
) -> Observations:
    """Relative positions and K-band range-rates of the pair, with white noise where asked for.

    sigma_pos [m] per axis and satellite, sigma_rr [m/s]. The draws are, in this order: A (n, 3), B (n, 3), range-rate
    (n,).
    The prior mean is the truth at t = 0, as the default set-up of the part says.
    """
    baseline, rate = orbit.dr, range_rate(orbit.dr, orbit.dv)
    if sigma_pos < 0 or sigma_rr < 0:
        raise ValueError(
            f"sigma_pos = {sigma_pos:g} m and sigma_rr = {sigma_rr:g} m/s: a standard deviation is not negative."
        )
    if sigma_pos or sigma_rr:
        if rng is None:
            raise ValueError("noise needs a random generator; give numpy.random.default_rng(seed).")
        n = len(baseline)
        noise_A, noise_B = rng.standard_normal((n, 3)), rng.standard_normal((n, 3))
        baseline = baseline + sigma_pos * (noise_A - noise_B)
        rate = rate + sigma_rr * rng.standard_normal(n)
    first = Truth(orbit.t[:1], orbit.A[:1], orbit.B[:1])
    a_A, a_B = accelerations(first, gravity)
    mean = np.concatenate([first.dr[0], first.dv[0], (a_A - a_B)[0]])
    return Observations(orbit.dt, baseline, rate, mean, np.diag(np.repeat(PRIOR_SIGMAS, 3) ** 2))
