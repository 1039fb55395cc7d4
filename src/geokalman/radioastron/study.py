"""Monte Carlo of a session: draw a truth and its data, estimate the orbit in several ways, look at it when the
telescope does.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from geokalman import progress
from geokalman.constants import C_LIGHT
from geokalman.kalman.consistency import monte_carlo, nees
from geokalman.radioastron import assess, estimate
from geokalman.radioastron.correlator import Setup, scan_snr
from geokalman.radioastron.data import INFLATED, NAIVE, Levels, Observations, Weights
from geokalman.radioastron.formal import Sample, linearise
from geokalman.radioastron.formal import large_sample as formal_sample
from geokalman.radioastron.model import BANDS, Array, Session, find_stations, toward, world
from geokalman.radioastron.simulate import draw


class Estimator(NamedTuple):
    """A way to an orbit: prior, ekf, ekf-substeps, ekf-single, iterated, ukf or batch; the weights; process noise
    [m^2 s^-3].
    """

    method: str
    weights: Weights = INFLATED
    process_noise: float = 0.0


STANDARD: dict[str, Estimator] = {
    "prior": Estimator("prior"),
    "ekf": Estimator("ekf", INFLATED),
    "naive": Estimator("ekf", NAIVE),
}
"""What one station gives: nothing, the recommended filter, the naive one."""
ALL: dict[str, Estimator] = STANDARD | {
    "substeps": Estimator("ekf-substeps", NAIVE),
    "single": Estimator("ekf-single", NAIVE),
    "iterated": Estimator("iterated", NAIVE),
    "ukf": Estimator("ukf", INFLATED),
    "batch": Estimator("batch", NAIVE),
    "batch-bias": Estimator("batch", Weights(10.0, 1e-3, True)),
    "process-noise": Estimator("ekf", INFLATED, 1e-12),
    "single-inflated": Estimator("ekf-single", INFLATED),
}
"""The estimators that are compared."""


@dataclass(frozen=True)
class Case:
    """What is repeated: session, stations (none: its own), levels, estimators by name, source (text as in
    `find_source`).
    """

    session: Session
    levels: Levels
    estimators: tuple[tuple[str, Estimator], ...]
    stations: tuple[str, ...] = ()
    source: str = ""


class Runs(NamedTuple):
    """Results of an estimator over runs: at mid-observation delay, rate, acceleration (runs,), error (runs, 6), nees
    (runs,); at the scans scan_delay, scan_rate (runs, scans); nees_end (runs,) at the last measurement."""

    delay: Array
    rate: Array
    acceleration: Array
    error: Array
    nees: Array
    scan_delay: Array
    scan_rate: Array
    nees_end: Array


def run_estimator(how: Estimator, data: Observations, dynamics) -> estimate.Orbit:
    """The orbit that an estimator finds. Raises ValueError for an unknown method."""
    if how.method == "prior":
        return estimate.prior_orbit(data)
    if how.method == "batch":
        return estimate.batch(data, dynamics, how.weights)
    if how.method == "ukf":
        return estimate.unscented(data, dynamics, how.weights).orbit
    options = {
        "ekf": {},
        "ekf-substeps": {"transition": "substeps"},
        "ekf-single": {"transition": "single"},
        "iterated": {"iterations": 3},
    }
    if how.method not in options:
        raise ValueError(f"method {how.method!r} is unknown; give prior, batch, ukf, {', '.join(options)}")
    return estimate.extended(data, dynamics, how.weights, process_noise=how.process_noise, **options[how.method]).orbit


def one_run(case: Case, rng: np.random.Generator) -> dict[str, assess.Errors]:
    """One draw: errors of each estimator at mid-observation, then at the scans; the last of nees is that at the end
    of tracking.
    """
    session = case.session
    dynamics, stations = world(session), find_stations(case.stations, session)
    truth, data = draw(session, dynamics, case.levels, stations, rng)
    source = toward(session, case.source)
    times = np.unique(np.append(session.scan_middles(), session.middle))
    end = float(data.t[-1])
    out = {}
    for name, how in case.estimators:
        orbit = run_estimator(how, data, dynamics)
        errors = assess.errors(orbit, truth, dynamics, times, source)
        last = orbit.at(dynamics, end)
        at_end = nees(last.mean - truth.states(np.array([end]))[0], last.cov)
        out[name] = errors._replace(nees=np.append(errors.nees, at_end))
    return out


def repeat(case: Case, seeds: Iterable[int], executor: Executor | None = None) -> dict[str, Runs]:
    """All runs of a case, run i from default_rng(seed i): results by estimator."""
    results = monte_carlo(partial(one_run, case), progress.track(seeds, "runs"), executor)
    session = case.session
    times = np.unique(np.append(session.scan_middles(), session.middle))
    middle = int(np.searchsorted(times, session.middle))
    scans = np.searchsorted(times, session.scan_middles())
    out = {}
    for name, _ in case.estimators:
        runs = [r[name] for r in results]
        delay, rate, acceleration = (np.array([r.residual[k] for r in runs]) for k in range(3))
        error, consistency = np.array([r.error for r in runs]), np.array([r.nees for r in runs])
        out[name] = Runs(
            delay[:, middle],
            rate[:, middle],
            acceleration[:, middle],
            error[:, middle],
            consistency[:, middle],
            delay[:, scans],
            rate[:, scans],
            consistency[:, -1],
        )
    return out


def standard(
    session: Session,
    levels: Levels,
    seed0: int,
    n_seeds: int,
    stations: tuple[str, ...] = (),
    source: str = "",
    estimators: Mapping[str, Estimator] | None = None,
) -> dict[str, Runs]:
    """`repeat` over seeds seed0, seed0 + 1, ... with the `STANDARD` estimators or others."""
    case = Case(session, levels, tuple((estimators or STANDARD).items()), stations, source)
    return repeat(case, range(seed0, seed0 + n_seeds))


def signal_to_noise(setup: Setup, runs: Runs, seed0: int) -> Array:
    """SNR (runs,) of a scan at mid-observation of each run. A residual beyond the lag window leaves the peak of the
    noise.
    """
    return np.array([
        scan_snr(setup, *residual, np.random.default_rng(seed0 + k))
        for k, residual in enumerate(progress.track(
            zip(runs.delay, runs.rate, runs.acceleration, strict=True), "scans", len(runs.delay)
        ))
    ])  # fmt: skip


def summary(prior: Runs, post: Runs, band: str) -> dict[str, tuple[float, str]]:
    """Numbers of an estimator against the a-priori orbit: name -> (value, unit).

    delay_us, rate: rms and median of the size; fringe_hz: rms; standard errors of the rms; gain and shares of both.
    """
    microseconds, fringe = 1e6, BANDS[band]
    delay, rate = assess.gain(prior.delay, post.delay), assess.gain(prior.rate, post.rate)
    return {
        "delay_us.rms": (microseconds * assess.rms(post.delay), "µs"),
        "delay_us.rms_error": (microseconds * assess.standard_error(post.delay), "µs"),
        "delay_us.median": (microseconds * float(np.median(np.abs(post.delay))), "µs"),
        "rate.rms": (assess.rms(post.rate), "s/s"),
        "rate.rms_error": (assess.standard_error(post.rate), "s/s"),
        "rate.median": (float(np.median(np.abs(post.rate))), "s/s"),
        "fringe_hz.rms": (fringe * assess.rms(post.rate), "Hz"),
        "acceleration.rms": (assess.rms(post.acceleration), "1/s"),
        "gain.delay.median": (delay.median, ""),
        "gain.rate.median": (rate.median, ""),
        "share.delay.better": (delay.better, ""),
        "share.rate.better": (rate.better, ""),
        "share.rate.tenfold": (rate.tenfold, ""),
        "share.delay.tenfold": (delay.tenfold, ""),
    }


def scan_columns(runs: Mapping[str, Runs]) -> dict[str, Array]:
    """Columns for a figure of the scans: median, 16 and 84 % points of the size of delay [s] and rate [s/s], by
    orbit.
    """
    columns: dict[str, Array] = {}
    for name, r in runs.items():
        for kind, values in (("delay_s", r.scan_delay), ("rate", r.scan_rate)):
            low, middle, high = np.quantile(np.abs(values), [0.16, 0.5, 0.84], axis=0)
            columns |= {
                f"{name}_{kind}_median": middle,
                f"{name}_{kind}_16_percent": low,
                f"{name}_{kind}_84_percent": high,
            }
    return {"scan": np.arange(1.0, len(next(iter(columns.values()))) + 1.0)} | columns


def linear_runs(sample: Sample, gradient: Array, source: Array) -> tuple[Runs, Runs]:
    """The draws of `formal.large_sample` as Runs before and after, for `summary`; what a linear draw has not is empty.

    gradient (3, 3) of the acceleration at mid-observation [s^-2]; source (3,) the unit vector to the source.
    """
    none = np.empty(0)

    def runs(error: Array) -> Runs:
        r, v = error[:, :3], error[:, 3:]
        return Runs(
            r @ source / C_LIGHT, v @ source / C_LIGHT, r @ gradient.T @ source / C_LIGHT, error, none, none, none, none
        )

    return runs(sample.prior), runs(sample.post)


def large_sample(
    session: Session,
    levels: Levels,
    weights: Weights,
    stations: tuple[str, ...] = (),
    source: str = "",
    draws: int = 4000,
    seed: int = 1,
) -> tuple[Runs, Runs]:
    """Linear draws of a session about its nominal orbit, before and after: the values about which a Monte Carlo
    scatters.
    """
    g = linearise(session, world(session), find_stations(stations, session))
    sample = formal_sample(g, levels, weights, np.random.default_rng(seed), draws)
    gradient = g.world.gradient(session.middle, g.middle)
    return linear_runs(sample, gradient, toward(session, source))


def correction_history(
    session: Session,
    levels: Levels,
    how: Estimator,
    seed0: int,
    n_seeds: int,
    times: Array,
    stations: tuple[str, ...] = (),
) -> tuple[Array, Array]:
    """Filter minus a-priori orbit over times (k,) [s]: position (runs, k, 3) and geocentric radius (runs, k) [m].

    stations : none is the session's own. Raises ValueError for times before the last measurement or after the tables.
    """
    dynamics, differences, radii = world(session), [], []
    names = find_stations(stations, session)
    if times[0] < session.passes[-1][1]:
        raise ValueError(f"time {times[0]:g} s is before the end of tracking, {session.passes[-1][1]:g} s")
    for seed in progress.track(range(seed0, seed0 + n_seeds), "runs"):
        _, data = draw(session, dynamics, levels, names, np.random.default_rng(seed))
        tracks = []
        for orbit in (estimate.prior_orbit(data), run_estimator(how, data, dynamics)):
            start = orbit.at(dynamics, float(data.t[-1]))
            tracks.append(dynamics.propagate(start.mean, np.append(start.t, times)).r[1:, 0])
        differences.append(tracks[1] - tracks[0])
        radii.append(np.linalg.norm(tracks[1], axis=1) - np.linalg.norm(tracks[0], axis=1))
    return np.array(differences), np.array(radii)


def prior_scale(
    session: Session,
    levels: Levels,
    weights: Weights,
    scale: float,
    seed0: int,
    n_seeds: int,
    stations: tuple[str, ...] = (),
    source: str = "",
) -> tuple[Array, Array]:
    """Delay [s] and rate [s/s] errors (runs,) of the filter when it is told P(0) with sigmas `scale` times the true
    ones.

    stations : none is the session's own; source as in `model.find_source`.
    """
    dynamics, direction = world(session), toward(session, source)
    names = find_stations(stations, session)
    delay, rate = np.empty(n_seeds), np.empty(n_seeds)
    for k in progress.track(range(n_seeds), "runs"):
        truth, data = draw(session, dynamics, levels, names, np.random.default_rng(seed0 + k))
        data = replace(data, prior_cov=scale**2 * data.prior_cov)
        orbit = estimate.extended(data, dynamics, weights).orbit
        residual = assess.errors(orbit, truth, dynamics, np.array([session.middle]), direction).residual
        delay[k], rate[k] = residual.delay[0], residual.rate[0]
    return delay, rate
