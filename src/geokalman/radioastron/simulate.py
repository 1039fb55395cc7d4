"""The simulated session: a true orbit with forces that no filter knows, and what its stations measure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from geokalman.physics.satellite import Dynamics, satellite_force
from geokalman.radioastron.data import Observations, Scenario
from geokalman.radioastron.model import STATIONS, Array, Session, nominal_state
from geokalman.radioastron.twoway import observe_step
from geokalman.radioastron.visibility import check_passes


@dataclass(frozen=True, eq=False)
class Truth:
    """What really happens: the forces, the state (6,) at t0 [s], and an impulse (3,) [m/s] at its time [s]."""

    world: Dynamics
    t0: float
    state: Array
    impulse: Array
    impulse_time: float

    def states(self, t: Array) -> Array:
        """True states (n, 6) at sorted times t (n,) [s] from t0 on; the impulse counts from its own time on."""
        t = np.asarray(t, dtype=float)
        out = np.empty((len(t), 6))
        before = t < self.impulse_time
        out[before] = _states(self.world, self.t0, self.state, t[before])
        if not before.all():
            at = _states(self.world, self.t0, self.state, np.array([self.impulse_time]))[0]
            at[3:] += self.impulse
            out[~before] = _states(self.world, self.impulse_time, at, t[~before])
        return out


def _states(world: Dynamics, t0: float, state: Array, t: Array) -> Array:
    """States at sorted times, which may repeat and begin at t0."""
    out = np.empty((len(t), 6))
    if len(t):
        times, place = np.unique(np.append(t, t0), return_inverse=True)
        out = (world.propagate(state, times).y if len(times) > 1 else state[None])[place[:-1]]
    return out


@njit(cache=True)
def _observe(t, states, station, itrs, params, shapiro, z):
    a = np.empty(3)
    for k in range(len(t)):
        satellite_force(t[k], states[k], params, a)
        observe_step(t[k], states[k], a, itrs[station[k]], params, shapiro, z[k])


def observe(
    world: Dynamics, t: Array, states: Array, station: Array, stations: tuple[str, ...], shapiro: bool = True
) -> Array:
    """Two-way ranges [m] and range-rates [m/s] without noise, (n, 2), of states (n, 6) at reception times t (n,) [s].

    shapiro : with the delay of light in the field of the Earth, or without.
    """
    z = np.empty((len(t), 2))
    itrs = np.array([STATIONS[name] for name in stations])
    t, states, station = (np.ascontiguousarray(x) for x in (t, states, station))
    _observe(t, states, station, itrs, world.params, shapiro, z)
    return z


def schedule(session: Session, stations: tuple[str, ...], interval: float = 10.0) -> tuple[Array, Array, Array]:
    """Times, station indices and pass numbers (n,): every station measures at every epoch of both passes."""
    epochs = session.epochs(interval)
    t = np.repeat(epochs, len(stations))
    return t, np.tile(np.arange(len(stations)), len(epochs)), session.pass_numbers(t)


def isotropic(rng: np.random.Generator) -> Array:
    """Unit vector (3,) in a random direction."""
    v = rng.standard_normal(3)
    return v / np.linalg.norm(v)


def draw(
    session: Session, world: Dynamics, levels: Scenario, stations: tuple[str, ...], rng: np.random.Generator
) -> tuple[Truth, Observations]:
    """One realisation of a session: the truth, and the data that an estimator may see.

    Truth: the nominal state, solar pressure with a relative error, a constant acceleration and one impulse in random
    directions that the estimators do not know. Data: noise and station biases, the same in both passes ("common") or
    drawn for each. Raises ValueError where a station does not see the spacecraft at the ends of a pass.
    """
    state = nominal_state(session, world)
    t, station, arc = schedule(session, stations)
    check_passes(world, t, station, state, stations)
    forces = world.with_changes(
        1.0 + levels.pressure_error * rng.standard_normal(), levels.acceleration * isotropic(rng)
    )
    impulse_time = rng.uniform(session.first, session.observation[1])
    truth = Truth(forces, session.first, state, levels.impulse * isotropic(rng), impulse_time)
    z = observe(forces, t, truth.states(t), station, stations)
    z += rng.standard_normal(z.shape) * (levels.sigma_range, levels.sigma_rate)
    if levels.bias != "none":
        bias = rng.standard_normal((len(stations), len(session.passes), 2)) * (levels.bias_range, levels.bias_rate)
        z += bias[station, arc if levels.bias == "per-pass" else 0]
    error = rng.standard_normal(6) * np.sqrt(np.diag(levels.prior_cov))
    return truth, Observations(
        t, station, arc, z[:, 0], z[:, 1], stations, state + error, levels.prior_cov, session.day
    )
