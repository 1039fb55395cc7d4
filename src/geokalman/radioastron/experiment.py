"""Monte Carlo of a session: draw a truth and its data, estimate the orbit in several ways, hold both together.

Run i of every experiment draws from default_rng(seed0 + i); stations : none is the session's own; source : text as in
`model.find_source`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from geokalman import progress
from geokalman.kalman.consistency import nees
from geokalman.physics.satellite import Dynamics
from geokalman.radioastron import assess, estimate, formal
from geokalman.radioastron.assess import Runs
from geokalman.radioastron.correlator import Setup, scan_snr
from geokalman.radioastron.data import INFLATED, NAIVE, Observations, Scenario, Tuning
from geokalman.radioastron.model import Array, Session, find_stations, toward, world
from geokalman.radioastron.simulate import Truth, draw


class Method(NamedTuple):
    """A way to an orbit: prior, batch, ukf or a name of `EXTENDED`; the weights; the process noise [m^2 s^-3]."""

    method: str
    weights: Tuning = INFLATED
    process_noise: float = 0.0


STANDARD: dict[str, Method] = {
    "prior": Method("prior"),
    "ekf": Method("ekf", INFLATED),
    "naive": Method("ekf", NAIVE),
}
"""What one station gives: nothing, the recommended filter, the naive one."""
ALL: dict[str, Method] = STANDARD | {
    "substeps": Method("ekf-substeps", NAIVE),
    "single": Method("ekf-single", NAIVE),
    "iterated": Method("iterated", NAIVE),
    "ukf": Method("ukf", INFLATED),
    "batch": Method("batch", NAIVE),
    "batch-bias": Method("batch", Tuning(10.0, 1e-3, True)),
    "process-noise": Method("ekf", INFLATED, 1e-12),
    "single-inflated": Method("ekf-single", INFLATED),
}
"""The estimators that are compared."""


EXTENDED = {
    "ekf": {},
    "ekf-substeps": {"transition": "substeps"},
    "ekf-single": {"transition": "single"},
    "iterated": {"iterations": 3},
}
"""Extended filters and what each gives to `estimate.extended`."""


def run_estimator(how: Method, data: Observations, forces: Dynamics) -> estimate.StateEstimate:
    """The orbit that an estimator finds. Raises ValueError for an unknown method."""
    if how.method == "prior":
        return estimate.prior_orbit(data)
    if how.method == "batch":
        return estimate.batch(data, forces, how.weights)
    if how.method == "ukf":
        return estimate.unscented(data, forces, how.weights).orbit
    if how.method not in EXTENDED:
        raise ValueError(f"method {how.method!r} is unknown; give prior, batch, ukf, {', '.join(EXTENDED)}.")
    options = EXTENDED[how.method] | {"process_noise": how.process_noise}
    return estimate.extended(data, forces, how.weights, **options).orbit


def _draws(
    session: Session, levels: Scenario, stations: tuple[str, ...], seed0: int, n_seeds: int
) -> Iterator[tuple[Truth, Observations]]:
    names, forces = find_stations(stations, session), world(session)
    for seed in progress.track(range(seed0, seed0 + n_seeds), "runs"):
        yield draw(session, forces, levels, names, np.random.default_rng(seed))


def standard(
    session: Session,
    levels: Scenario,
    seed0: int,
    n_seeds: int,
    stations: tuple[str, ...] = (),
    source: str = "",
    estimators: Mapping[str, Method] | None = None,
    prior_scale: float = 1.0,
) -> dict[str, Runs]:
    """Errors of the `STANDARD` or other estimators at mid-observation, at the scans and at the end of tracking.

    prior_scale : sigmas of P(0) that the estimators are told, in units of those that the error is drawn from.
    """
    estimators, forces, direction = estimators or STANDARD, world(session), toward(session, source)
    times = np.unique(np.append(session.scan_middles(), session.middle))
    middle, scans = np.searchsorted(times, session.middle), np.searchsorted(times, session.scan_middles())
    found: dict[str, list[tuple]] = {name: [] for name in estimators}
    for truth, data in _draws(session, levels, stations, seed0, n_seeds):
        data, end = replace(data, prior_cov=prior_scale**2 * data.prior_cov), data.t[-1:]
        for name, how in estimators.items():
            orbit = run_estimator(how, data, forces)
            residual, error, consistency = assess.errors(orbit, truth, forces, times, direction)
            last = orbit.at(forces, float(end[0]))
            found[name].append((
                residual.delay[middle], residual.rate[middle], residual.acceleration[middle], error[middle],
                consistency[middle], residual.delay[scans], residual.rate[scans],
                nees(last.mean - truth.states(end)[0], last.cov),
            ))  # fmt: skip
    return {name: Runs(*map(np.array, zip(*runs, strict=True))) for name, runs in found.items()}


def signal_to_noise(setup: Setup, runs: Runs, seed0: int) -> Array:
    """SNR (runs,) of a scan at mid-observation of each run; beyond the lag window that of the peak of the noise."""
    residuals = progress.track(zip(runs.delay, runs.rate, runs.acceleration, strict=True), "scans", len(runs.delay))
    return np.array([scan_snr(setup, *r, np.random.default_rng(seed0 + k)) for k, r in enumerate(residuals)])


def large_sample(
    session: Session,
    levels: Scenario,
    weights: Tuning,
    stations: tuple[str, ...] = (),
    source: str = "",
    draws: int = 4000,
    seed: int = 1,
) -> tuple[Runs, Runs]:
    """Linear draws of a session, before and after: the values about which a Monte Carlo scatters."""
    g = formal.linearise(session, world(session), find_stations(stations, session))
    sample = formal.large_sample(g, levels, weights, np.random.default_rng(seed), draws)
    gradient, direction, none = g.world.gradient(session.middle, g.middle), toward(session, source), np.empty(0)
    return tuple(Runs(*assess.residual(e, gradient, direction), e, none, none, none, none) for e in sample)


def correction_history(
    session: Session,
    levels: Scenario,
    how: Method,
    seed0: int,
    n_seeds: int,
    times: Array,
    stations: tuple[str, ...] = (),
) -> tuple[Array, Array]:
    """Filter minus a-priori orbit over times (k,) [s]: position (runs, k, 3) and geocentric radius (runs, k) [m].

    Raises ValueError for times before the last measurement or after the tables.
    """
    forces, differences, radii = world(session), [], []
    if times[0] < session.passes[-1][1]:
        raise ValueError(f"time {times[0]:g} s is before the end of tracking, {session.passes[-1][1]:g} s.")
    for _, data in _draws(session, levels, stations, seed0, n_seeds):
        end = float(data.t[-1])
        orbits = (estimate.prior_orbit(data), run_estimator(how, data, forces))
        before, after = (forces.propagate(o.at(forces, end).mean, np.append(end, times)).r[1:, 0] for o in orbits)
        differences.append(after - before)
        radii.append(np.linalg.norm(after, axis=1) - np.linalg.norm(before, axis=1))
    return np.array(differences), np.array(radii)
