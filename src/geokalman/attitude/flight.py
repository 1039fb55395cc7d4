"""One flight, simulated or read from files, and what the whole chain makes of it: combination, increments,
solutions.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from geokalman.attitude import cameras, estimate, gyro, pointing, read
from geokalman.attitude.estimate import FILTERS, Measured, Solution
from geokalman.attitude.header import Level1Error
from geokalman.attitude.level1 import Level1Warning
from geokalman.attitude.model import GYRO_HZ, SATELLITES, Array, Raw, Scenario, Tuning, arw_density, gyro_matrix
from geokalman.attitude.simulate import simulate
from geokalman.attitude.truth import Truth
from geokalman.physics.quaternion import difference, spline

LONGEST_GAP = 10.0  # s: accelerations are interpolated over no longer hole


@dataclass(frozen=True)
class Flight:
    """Raw data of both satellites, their orbits r, v (n, 3) at the whole seconds t (n,), and the truth where it was
    simulated.

    accelerations : satellite -> (n, 3) [m/s^2] in the SRF from ACT1B, empty where there are none; edge : satellite ->
    those of the seconds t at which the clock of its files was carried beyond its tables or across a break, empty where
    simulated.
    """

    t: Array
    raw: dict[str, Raw]
    r: dict[str, Array]
    v: dict[str, Array]
    truth: dict[str, Truth]
    accelerations: dict[str, Array]
    edge: dict[str, Array] = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.t[-1] - self.t[0])

    def true_attitude(self, satellite: str, hz: int = 1) -> Array | None:
        """True attitudes (n, 4) at `hz`, or None for real data."""
        return self.truth[satellite].at(hz, self.duration).q if self.truth else None

    def true_bias(self, satellite: str, axes: tuple[int, ...], hz: int = 1) -> Array | None:
        """True gyro biases (n, 3) [rad/s] in SRF axes, as the gyros in use see them, at `hz`; None for real data."""
        if not self.truth:
            return None
        of_axes = self.truth[satellite].at(hz, self.duration).bias[:, [axis - 1 for axis in axes]]
        return np.linalg.lstsq(gyro_matrix(satellite, axes), of_axes.T, rcond=None)[0].T


def flight(scenario: Scenario, seed: int, data_dir: str = "", date: str = "") -> Flight:
    """Run `seed` of the scenario, or the first day (or `date`) of real files in `data_dir`."""
    if data_dir:
        return _from_files(Path(data_dir), date)
    truth, raw = simulate(scenario, seed)
    at = {s: truth[s].at(1, scenario.duration_s) for s in SATELLITES}
    return Flight(at["C"].t, raw, {s: at[s].r for s in SATELLITES}, {s: at[s].v for s in SATELLITES}, truth, {})


def _from_files(folder: Path, date: str) -> Flight:
    days = read.dates(folder)
    if not days:
        raise Level1Error(
            (
                f"{folder}: no SCA1A_YYYY-MM-DD_S_VV.txt; give the folder of unpacked GRACE-FO Level-1A and 1B files "
                "of one day."
            )
        )
    if not date and len(days) > 1:
        warnings.warn(
            f"{folder}: files of {len(days)} days; the first, {days[0]}, is taken.", Level1Warning, stacklevel=3
        )
    date = date or days[0]
    raw, edges = {}, {}
    for s in SATELLITES:
        raw[s], edges[s] = read.raw(folder, s, date)
    orbits = {s: read.orbit(folder, s, date) for s in SATELLITES}
    reach = [_reach(raw[s]) for s in SATELLITES]
    first = max(*(r[0] for r in reach), *(o[0][0] for o in orbits.values()))
    last = min(*(r[1] for r in reach), *(o[0][-1] for o in orbits.values()))
    t = np.arange(np.ceil(first - cameras.SNAP), np.floor(last + cameras.SNAP) + 0.5)
    if len(t) < 60:
        raise Level1Error(f"{folder}: sensors and orbits of {date} have only {len(t)} seconds in common.")
    r, v, accelerations, edge = {}, {}, {}, {}
    for s in SATELLITES:
        edge[s] = t[edges[s][_nearest(raw[s].t_camera, t)]]
        if len(edge[s]):
            warnings.warn(
                f"{folder}: {len(edge[s])} seconds of GRACE-{s} from {edge[s][0]:g} s on stand at an edge of its "
                "clock (TIM1B, CLK1B; the "
                "files of the neighbouring days are needed); they are filtered and left out of the statistics.",
                Level1Warning, stacklevel=3,
            )  # fmt: skip
        seconds, position, velocity = orbits[s]
        pick = np.searchsorted(seconds, t)
        if not (np.abs(seconds[np.minimum(pick, len(seconds) - 1)] - t) < 1e-6).all():
            raise Level1Error(
                f"{folder}: GNI1B of {s} has gaps between {t[0]:g} and {t[-1]:g} s; a whole arc at 1 Hz is needed."
            )
        r[s], v[s] = position[pick], velocity[pick]
        if read.versions(folder, "ACT1B", s, date):
            accelerations |= _accelerations(folder, s, date, t)
        raw[s] = _trim(raw[s], t[0], t[-1])
    return Flight(t, raw, r, v, {}, accelerations, edge)


def _accelerations(folder: Path, satellite: str, date: str, t: Array) -> dict[str, Array]:
    """Linear accelerations (n, 3) at t, under the satellite's letter; none, with a warning, where they have a hole."""
    seconds, a = read.accelerations(folder, satellite, date)
    gap = max(np.diff(seconds, prepend=t[0], append=t[-1]), default=np.inf)
    if gap > LONGEST_GAP:
        warnings.warn(
            f"{folder}: ACT1B of {satellite} has a hole of {gap:g} s; the accelerations are left out.",
            Level1Warning, stacklevel=4,
        )  # fmt: skip
        return {}
    return {satellite: np.stack([np.interp(t, seconds, a[:, i]) for i in range(3)], axis=1)}


def _nearest(grid: Array, t: Array) -> np.ndarray:
    """Index of the nearest of increasing epochs (m,) to each of t (n,)."""
    right = np.clip(np.searchsorted(grid, t), 1, len(grid) - 1)
    return right - (t - grid[right - 1] < grid[right] - t)


def _reach(raw: Raw) -> tuple[float, float]:
    """First and last time [s] at which all sensors have data, a second for interpolation left at either end."""
    t = raw.t_gyro[[axis - 1 for axis in gyro.present(raw)]]
    return max(raw.t_camera[0], np.nanmin(t, axis=1).max() + 1), min(raw.t_camera[-1], np.nanmax(t, axis=1).min() - 1)


def _trim(raw: Raw, first: float, last: float) -> Raw:
    keep = (raw.t_camera > first - 0.75) & (raw.t_camera < last + 0.75)
    return replace(raw, t_camera=raw.t_camera[keep], q_camera=raw.q_camera[:, keep])


@dataclass(frozen=True)
class Solved:
    """What the chain made of one satellite at the epochs t (n,) [s] of the filter.

    combined : cameras at those epochs; rates (n, 3) : mean gyro rates over +-0.5 s there (1 Hz only), NaN where lost;
    increments : at 8 Hz; measured : what the filters saw; solutions : filter -> Solution; edge (n,) : epochs at an edge
    of the clock of the files (bad input 11), none where simulated.
    """

    t: Array
    combined: cameras.Combined
    increments: gyro.Increments
    rates: Array
    measured: Measured
    solutions: dict[str, Solution]
    edge: Array

    def flagged(self, name: str, limit_rad: float) -> Array:
        """Epochs (n,) of a solution not to be relied on: at an edge of the clock, or less certain than the limit
        [rad].
        """
        return self.edge | self.solutions[name].flagged(limit_rad)


def in_satellite_axes(raw: Raw) -> Array:
    """Attitudes (3, n, 4) from each camera, SRF to ICRF."""
    return cameras.to_satellite(raw.q_camera, raw.q_qsa)


def combination(raw: Raw, tuning: Tuning, use: Sequence[int] = (1, 2, 3), calibrate: bool = False) -> cameras.Combined:
    """The cameras combined at their own epochs, after calibration of their relative mounting where asked for."""
    q = in_satellite_axes(raw)
    if calibrate:
        q, _ = cameras.calibrate_mounting(raw.t_camera, q, raw.q_qsa, tuning.sigma, tuning.k_aniso)
    return cameras.combine(raw.t_camera, q, raw.q_qsa, tuning.sigma, tuning.k_aniso, tuple(use))


def solve(
    trip: Flight,
    satellite: str,
    tuning: Tuning,
    filters: Iterable[str] = FILTERS,
    use: Sequence[int] = (1, 2, 3),
    calibrate: bool = False,
) -> Solved:
    """The whole chain for one satellite: combination, increments, and the filters asked for.

    filters : of akf7, akf7_iso, mekf, rts, jpl_like. With tuning.update_hz = 2 the epochs are every half second.
    """
    raw = trip.raw[satellite]
    combined = combination(raw, tuning, use, calibrate)
    increments, tuning = sound_increments(raw, tuning, combined)
    return solved(trip, satellite, tuning, combined, increments, filters)


def sound_increments(raw: Raw, tuning: Tuning, combined: cameras.Combined) -> tuple[gyro.Increments, Tuning]:
    """8 Hz increments, and the tuning with the axes that they were made of.

    An axis without samples is left out; so is, where the parity of four axes stays beyond 6 sigma for a second, the
    axis that disagrees most with the cameras. Both with a GyroWarning. Raises Level1Error where fewer than three axes
    remain.
    """
    tuning = gyro.sound(raw, tuning)
    increments = gyro.reduced(raw, tuning)
    if len(tuning.axes) < 4:
        return increments, tuning
    sigma = 0.5 * arw_density(tuning.arw_deg_sqrt_h) / GYRO_HZ**0.5  # of one of the four residuals
    start = gyro.parity_fault(increments.parity, sigma, raw.satellite)
    if start is None:
        return increments, tuning
    whole = cameras.at_seconds(combined)
    seen = gyro.preintegrate(gyro.between(increments, whole.t[0], whole.t[-1]), 1)
    steps = seen.d @ gyro_matrix(raw.satellite).T + seen.parity
    axis = gyro.isolate(steps, difference(whole.q[:-1], whole.q[1:]), raw.satellite)
    warnings.warn(
        (
            f"GRACE-{raw.satellite}: gyro axis {axis} disagrees with the others from {increments.t[start]:.1f} s on "
            "and was left out."
        ),
        gyro.GyroWarning, stacklevel=2,
    )  # fmt: skip
    reduced = replace(tuning, axes=tuple(a for a in tuning.axes if a != axis))
    return gyro.reduced(raw, reduced), reduced


def solved(
    trip: Flight,
    satellite: str,
    tuning: Tuning,
    combined: cameras.Combined,
    increments: gyro.Increments,
    filters: Iterable[str] = FILTERS,
) -> Solved:
    """The filters on a combination (at the cameras' epochs) and 8 Hz increments that are already there."""
    hz = tuning.update_hz
    main = gyro.between(increments, trip.t[0], trip.t[-1])
    steps = gyro.preintegrate(main, hz)
    combined = cameras.at_seconds(combined, hz)
    combined = cameras.Combined(
        *(part[(combined.t > trip.t[0] - 0.1) & (combined.t < trip.t[-1] + 0.1)] for part in combined)
    )
    epochs = steps.t
    if len(combined.t) != len(epochs):
        raise ValueError(
            f"{len(combined.t)} camera epochs and {len(epochs)} gyro epochs at {hz} Hz do not belong together."
        )
    measured = Measured(
        1.0 / hz,
        steps.d,
        combined.q,
        combined.cov,
        tuning.rate_covariance(satellite),
        tuning.bias_covariance(satellite),
    )
    solutions: dict[str, Solution] = {}
    wanted = set(filters)
    if wanted & {"mekf", "rts"}:
        forward, smooth = estimate.mekf(measured, tuning, tuning.apm_factor, smooth=True)
        solutions |= {"mekf": forward, "rts": smooth}
    if "jpl_like" in wanted:
        solutions["jpl_like"] = estimate.mekf(measured, tuning, tuning.kappa)
    at_8_hz = measured._replace(d=main.d)
    if "akf7" in wanted:
        solutions["akf7"] = estimate.akf7(at_8_hz, tuning, tuning.apm_factor, stride=GYRO_HZ // hz)
    if "akf7_iso" in wanted:
        r = 0.5 * float(np.nanmean(np.sqrt(np.einsum("kii->ki", combined.cov))))
        solutions["akf7_iso"] = estimate.akf7(at_8_hz, tuning, tuning.apm_factor, stride=GYRO_HZ // hz, isotropic=r)
    seconds, mean_rates = gyro.mean_rates(increments)
    rates = np.full((len(epochs), 3), np.nan)
    _, mine, theirs = np.intersect1d(np.round(epochs * 8), np.round(seconds * 8), return_indices=True)
    rates[mine] = mean_rates[theirs]
    edge = np.isin(np.floor(epochs + 1e-6), np.round(trip.edge.get(satellite, ())))
    return Solved(
        epochs, combined, main, rates, measured, {name: solutions[name] for name in solutions if name in wanted}, edge
    )


def reference(trip: Flight, satellite: str, result: Solved) -> Array:
    """Attitudes (n, 4) that errors are counted from: the truth where simulated, else the smoothed solution."""
    true = trip.true_attitude(satellite, round(1.0 / result.measured.dt))
    return result.solutions["rts"].q if true is None else true


def reference_at(trip: Flight, satellite: str, t: Array, tuning: Tuning) -> Array:
    """The same at any epochs t (n,) inside the flight: the truth on its grid, or a spline through the smoothed
    solution.
    """
    if trip.truth:
        motion = trip.truth[satellite]
        k = np.round((t - motion.t[0]) * GYRO_HZ).astype(int)
        if np.abs(motion.t[k] - t).max() < 1e-9:
            return motion.q[k]
        return spline(motion.t, motion.q, t)
    result = solve(trip, satellite, tuning, ("rts",))
    good = np.isfinite(result.solutions["rts"].q[:, 0])
    inside = np.clip(t, result.t[good][0], result.t[good][-1])
    return spline(result.t[good], result.solutions["rts"].q[good], inside)


def angles_of(trip: Flight, satellite: str, q: Array, frame: Array | None = None) -> Array:
    """Pointing angles (n, 3) of attitudes at the whole seconds of the flight; frame as `pointing.angles` takes it."""
    other = SATELLITES[1 - SATELLITES.index(satellite)]
    return pointing.angles(q, trip.r[satellite], trip.r[other], frame)


def camera_angles(
    trip: Flight, satellite: str, tuning: Tuning, uses: Sequence[tuple[int, ...]], calibrate: bool = False
) -> dict[str, Array]:
    """Pointing angles (n, 3) [rad] at whole seconds of single cameras or combinations, at epochs at which all three see
    (else NaN).

    uses : e.g. [(1,), (2,), (1, 2, 3)]; the result has the names sca1, sca2, sca123.
    """
    raw = trip.raw[satellite]
    q = in_satellite_axes(raw)
    if calibrate:
        q, _ = cameras.calibrate_mounting(raw.t_camera, q, raw.q_qsa, tuning.sigma, tuning.k_aniso)
    out = {}
    for use in uses:
        combined = cameras.at_seconds(cameras.combine(raw.t_camera, q, raw.q_qsa, tuning.sigma, tuning.k_aniso, use))
        everyone = cameras.at_seconds(cameras.combine(raw.t_camera, q, raw.q_qsa, tuning.sigma, tuning.k_aniso))
        keep = (combined.t > trip.t[0] - 0.1) & (combined.t < trip.t[-1] + 0.1)
        values = angles_of(trip, satellite, combined.q[keep])
        values[everyone.used[keep] != 7] = np.nan
        out["sca" + "".join(map(str, use))] = values
    return out
