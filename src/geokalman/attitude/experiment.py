"""Experiments: flights over seeds and satellites, the whole chain on each, and the numbers that come of it.

The only place where truth and filters are brought together; `assess` makes the numbers, nothing here is drawn.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import detrend

from geokalman import progress
from geokalman.attitude import assess, cameras, effect, estimate, pointing, read
from geokalman.attitude.estimate import FILTERS, Estimate, Observations, Processed
from geokalman.attitude.model import AXES, GYRO_HZ, SATELLITES, Array, Scenario, Tuning
from geokalman.attitude.simulate import simulate
from geokalman.attitude.truth import Recording
from geokalman.physics.quaternion import difference, exp, multiply, spline

Table = dict[str, tuple[float, float]]


def chosen(satellite: str) -> tuple[str, ...]:
    """Satellites of a notebook's parameter: C, D or both."""
    return SATELLITES if satellite == "both" else (satellite,)


def against(data_dir: str) -> str:
    """What errors count from, for captions: the truth of a simulation, or with real files the smoothed attitude."""
    return "the smoothed attitude of all cameras" if data_dir else "the truth"


def error_label(data_dir: str) -> str:
    """What such a number is called on an axis: with real files it is a difference, not an error."""
    return "difference to the smoothed attitude" if data_dir else "attitude error"


def origin(data_dir: str) -> str:
    """The sentence with which a caption says where its numbers come from."""
    return f"From the files in {Path(data_dir).name}." if data_dir else "Simulated."


def flight(scenario: Scenario, seed: int, data_dir: str = "", date: str = "") -> Recording:
    """Run `seed` of the scenario, or the first day (or `date`) of real files in `data_dir`."""
    return read.flight(data_dir, date) if data_dir else simulate(scenario, seed)


def flights(scenario: Scenario, n_seeds: int, seed0: int, data_dir: str = "") -> Iterator[Recording]:
    """Flights of an ensemble one after the other; real files are one flight."""
    for k in progress.track(range(1 if data_dir else n_seeds), "flights"):
        yield flight(scenario, seed0 + k, data_dir)


def per_satellite(
    scenario: Scenario, n_seeds: int, seed0: int, satellite: str, data_dir: str
) -> Iterator[tuple[Recording, str]]:
    """Every satellite asked for of every flight."""
    for recording in flights(scenario, n_seeds, seed0, data_dir):
        for s in chosen(satellite):
            yield recording, s


def solve(
    recording: Recording, satellite: str, tuning: Tuning, filters: Iterable[str] = FILTERS,
    use: Sequence[int] = (1, 2, 3), calibrate: bool = False,
) -> Processed:  # fmt: skip
    """Estimate the attitude of one satellite by the whole chain, see `estimate.solve`.

    >>> recording = flight(Scenario(duration_s=600.0), seed=1)
    >>> result = solve(recording, "C", Tuning(), ("mekf", "rts"))
    >>> truth, keep = reference(recording, "C", result), assess.inner(len(result.t))
    >>> errors = [assess.error(result.solutions[name].q, truth)[keep] for name in ("mekf", "rts")]
    >>> filtered, smoothed = (assess.rms(error).max() for error in errors)
    >>> bool(smoothed < filtered < 5e-6)  # rms about the worst axis [rad]
    True
    """
    edge = recording.edge.get(satellite, ())
    return estimate.solve(recording.raw[satellite], recording.t, tuning, filters, use, calibrate, edge)


def reference(recording: Recording, satellite: str, result: Processed) -> Array:
    """Attitudes (n, 4) that errors are counted from: the truth where simulated, else the smoothed solution."""
    q_true = recording.true_attitude(satellite, round(1.0 / result.measured.dt))
    return result.solutions["rts"].q if q_true is None else q_true


def reference_at(recording: Recording, satellite: str, t: Array, tuning: Tuning) -> Array:
    """The same at epochs t (n,) inside the flight: the truth on its grid, or a spline through the smoothed solution."""
    if recording.truth:
        motion = recording.truth[satellite]
        k = np.round((t - motion.t[0]) * GYRO_HZ).astype(int)
        if np.abs(motion.t[k] - t).max() < 1e-9:
            return motion.q[k]
        return spline(motion.t, motion.q, t)
    result = solve(recording, satellite, tuning, ("rts",))
    q = result.solutions["rts"].q
    good = np.isfinite(q[:, 0])
    return spline(result.t[good], q[good], np.clip(t, result.t[good][0], result.t[good][-1]))


def angles_of(recording: Recording, satellite: str, q: Array, frame: Array | None = None) -> Array:
    """Pointing angles (n, 3) of attitudes at the whole seconds of the flight; frame as `pointing.angles` takes it."""
    other = SATELLITES[1 - SATELLITES.index(satellite)]
    return pointing.angles(q, recording.r[satellite], recording.r[other], frame)


def camera_angles(
    recording: Recording, satellite: str, tuning: Tuning, uses: Sequence[tuple[int, ...]]
) -> dict[str, Array]:
    """Pointing angles (n, 3) [rad] of cameras at the whole seconds at which all three see (else NaN).

    uses : single cameras or combinations, e.g. [(1,), (2,), (1, 2, 3)]; the result has the names sca1, sca2, sca123.
    """
    raw, out = recording.raw[satellite], {}
    everyone = cameras.at_seconds(cameras.combination(raw, tuning))
    for use in uses:
        combined = cameras.at_seconds(cameras.combination(raw, tuning, use))
        keep = (combined.t > recording.t[0] - 0.1) & (combined.t < recording.t[-1] + 0.1)
        values = angles_of(recording, satellite, combined.q[keep])
        values[everyone.used[keep] != 7] = np.nan
        out["sca" + "".join(map(str, use))] = values
    return out


def filters(
    scenario: Scenario, tuning: Tuning, n_seeds: int, seed0: int, satellite: str = "both",
    names: Sequence[str] = FILTERS, data_dir: str = "", calibrate: bool = False, use: Sequence[int] = (1, 2, 3),
    pitch_offset_rad: float = 6e-4,
) -> Table:  # fmt: skip
    """Statistics of every filter, mean and spread over satellites and seeds; of the antenna correction where both fly.

    pitch_offset_rad : added to the pitch of the JPL-like product on one satellite (`one`) and on both.
    """
    runs, pairs = [], []
    hz = tuning.update_hz
    for recording in flights(scenario, n_seeds, seed0, data_dir):
        results = {s: solve(recording, s, tuning, names, use, calibrate) for s in chosen(satellite)}
        for s, result in results.items():
            smoothed = None
            if not recording.truth and (tuple(use) != (1, 2, 3) or hz != 1):
                # for files a variant is held against the smoother of all cameras at 1 Hz
                smoothed = reference_at(recording, s, result.t, replace(tuning, update_hz=1))
            bias = recording.true_bias(s, tuning.axes, hz)
            runs.append(assess.statistics(result, recording.true_attitude(s, hz), bias, smoothed))
        if recording.truth and {"akf7", "jpl_like"} <= set(names):
            for run in runs[-len(results) :]:  # both see the same flight: their difference has less spread than either
                errors = [np.mean([run[f"attitude_rms.{n}.{a}"] for a in AXES]) for n in ("akf7", "jpl_like")]
                run["attitude_rms.akf7_minus_jpl_like"] = float(errors[0] - errors[1])
        if len(results) == 2 and hz == 1 and "rts" in names:
            pairs.append(_pair(recording, results, pitch_offset_rad))
    return assess.table_of(runs) | (assess.table_of(pairs) if pairs else {})


def _pair(recording: Recording, results: dict[str, Processed], pitch_offset_rad: float) -> dict[str, float]:
    """Statistics of the antenna correction, and how its rate changes with a pitch offset of the JPL-like product."""
    q = {name: {s: results[s].solutions[name].q for s in SATELLITES} for name in results["C"].solutions}
    r_C, r_D = recording.r["C"], recording.r["D"]
    out = assess.antenna_statistics(q, {s: reference(recording, s, results[s]) for s in SATELLITES}, r_C, r_D)
    if not recording.truth:
        del out["kbr_rate_error.rts"]  # held against itself
    if "mekf" in q and "jpl_like" in q:
        like = q["jpl_like"]
        turned = {s: effect.turned(like[s], pitch_offset_rad) for s in SATELLITES}
        ours = pointing.antenna_correction(q["mekf"]["C"], q["mekf"]["D"], r_C, r_D)
        for word, other in (("none", like), ("one", like | {"C": turned["C"]}), ("both", turned)):
            rate = pointing.central_rate(ours - pointing.antenna_correction(other["C"], other["D"], r_C, r_D))
            out[f"kbr_rate_difference.{word}"] = float(assess.rms(rate[assess.inner(len(rate))]))
    return out


def camera_errors(
    scenario: Scenario, tuning: Tuning, n_seeds: int, seed0: int, satellite: str = "both", data_dir: str = ""
) -> Table:
    """Errors of single cameras and of every combination at epochs at which all three see: rms and mean per axis [rad].

    Names: single.<1|2|3>.rms.<axis>, combined.<12|13|23|123>.<rms|mean|std>.<axis>, valid.<1|2|3>, seen.<0..3>.
    """
    flown = per_satellite(scenario, n_seeds, seed0, satellite, data_dir)
    return assess.table_of([camera_run(recording, s, tuning) for recording, s in flown])


def camera_run(recording: Recording, satellite: str, tuning: Tuning) -> dict[str, float]:
    """What `camera_errors` averages, of one satellite of one flight."""
    raw = recording.raw[satellite]
    q = cameras.in_satellite_axes(raw)
    keep = np.isfinite(q).all(axis=(0, 2))
    edge = assess.inner(len(keep), 0.5)
    keep[: edge.start] = keep[edge.stop :] = False
    q_true = reference_at(recording, satellite, raw.t_camera, tuning)
    run: dict[str, float] = {}
    for i in range(3):
        run |= assess.by_axis(f"single.{i + 1}.rms", assess.rms(difference(q[i], q_true)[keep]))
        run[f"valid.{i + 1}"] = float(np.isfinite(q[i, :, 0]).mean())
    count = np.isfinite(q[:, :, 0]).sum(axis=0)
    run |= {f"seen.{k}": float((count == k).mean()) for k in range(4)}
    means = []
    for use in ((1, 2), (1, 3), (2, 3), (1, 2, 3)):
        e = difference(cameras.combination(raw, tuning, use).q, q_true)[keep]
        name = "combined." + "".join(map(str, use))
        run |= assess.by_axis(f"{name}.rms", assess.rms(e)) | assess.by_axis(f"{name}.mean", e.mean(axis=0))
        run |= assess.by_axis(f"{name}.std", e.std(axis=0))
        means.append(e.mean(axis=0))
    spread = np.ptp(means, axis=0)
    return run | assess.by_axis("spread", spread) | {"spread.largest": float(spread.max())}


def weights(
    scenario: Scenario, tuning: Tuning, ks: Sequence[float], n_seeds: int, seed0: int, satellite: str = "both",
    data_dir: str = "",
) -> dict[float, Array]:  # fmt: skip
    """Rms error (3,) [rad] of the three-camera combination for each assumed anisotropy k."""
    total: dict[float, list[Array]] = {k: [] for k in ks}
    for recording, s in per_satellite(scenario, n_seeds, seed0, satellite, data_dir):
        raw = recording.raw[s]
        q = cameras.in_satellite_axes(raw)
        keep = np.isfinite(q).all(axis=(0, 2))
        q_true = reference_at(recording, s, raw.t_camera, tuning)[keep]
        for k in ks:
            e = difference(cameras.combine(raw.t_camera[keep], q[:, keep], raw.q_qsa, tuning.sigma, k).q, q_true)
            total[k].append(np.mean(e**2, axis=0))
    return {k: np.sqrt(np.mean(values, axis=0)) for k, values in total.items()}


def mounting(
    scenario: Scenario, tuning: Tuning, n_seeds: int, seed0: int, satellite: str = "C", data_dir: str = ""
) -> Table:
    """Filter with mounting errors before and after relative calibration.

    Names: <before|after>.std.<axis>, .mean.<axis>, .rate.<axis>, .nis3.
    """
    runs = []
    for recording, s in per_satellite(scenario, n_seeds, seed0, satellite, data_dir):
        run: dict[str, float] = {}
        for word, calibrate in (("before", False), ("after", True)):
            result = solve(recording, s, tuning, ("mekf", "rts"), calibrate=calibrate)
            solution, keep = result.solutions["mekf"], assess.inner(len(result.t))
            e = assess.error(solution.q, reference(recording, s, result))[keep]
            apart = assess.rate_difference(solution, result)[assess.inner(len(result.t) - 2)]
            run |= assess.by_axis(f"{word}.std", e.std(axis=0)) | assess.by_axis(f"{word}.mean", e.mean(axis=0))
            run |= assess.by_axis(f"{word}.rate", assess.std(apart))
            run[f"{word}.nis3"] = float(np.nanmean(solution.nis[keep]) / 3)
        runs.append(run)
    return assess.table_of(runs)


def shifted(scenario: Scenario, tuning: Tuning, shift_s: float, n_seeds: int, seed0: int, data_dir: str = "") -> Table:
    """Change of the smoothed attitude's mean when every camera reports late: <C|D>.<axis> [rad].

    Simulated: the tag t carries the attitude of t - shift, with the same noise. Real files: camera tags are moved.
    """
    runs = []
    for k, one in enumerate(flights(scenario, n_seeds, seed0, data_dir)):
        if data_dir:
            moved = {s: replace(raw, t_camera=raw.t_camera + shift_s) for s, raw in one.raw.items()}
            inside = one.t[(one.t > one.t[0] + shift_s + 1) & (one.t < one.t[-1] + shift_s - 1)]
            other = replace(one, raw=moved, t=inside)  # r and v keep their own epochs; nothing here uses them
        else:
            other = flight(replace(scenario, shift_s=shift_s), seed0 + k)
        run: dict[str, float] = {}
        for s in SATELLITES:
            a, b = (solve(x, s, tuning, ("rts",)) for x in (one, other))
            _, i, j = np.intersect1d(a.t, b.t, return_indices=True)
            change = difference(a.solutions["rts"].q[i], b.solutions["rts"].q[j])
            run |= assess.by_axis(s, change[assess.inner(len(change))].mean(axis=0))
        runs.append(run)
    return assess.table_of(runs)


def days(
    scenario: Scenario, tuning: Tuning, n_days: int, seed0: int, pitch_offset_rad: float, data_dir: str = "",
    step: int = 30,
) -> dict[str, Array]:  # fmt: skip
    """Range-rate differences of days one after the other, every `step` seconds [m/s], a line taken off each day.

    A constant and a drift over a day are what the accelerometer's bias makes; every recovery estimates it. `none` :
    MEKF against the JPL-like stand-in; `offset` : the same with a pitch offset in both satellites of the stand-in;
    `mekf`, `rts`, `jpl_like` : each against the truth (real data: against the smoother).
    """
    parts: dict[str, list[Array]] = {}
    for recording in flights(scenario, n_days, seed0, data_dir):
        results = {s: solve(recording, s, tuning, ("mekf", "rts", "jpl_like")) for s in SATELLITES}
        q = {name: {s: results[s].solutions[name].q for s in SATELLITES} for name in ("mekf", "rts", "jpl_like")}
        q_true = {s: reference(recording, s, results[s]) for s in SATELLITES}
        offset = {s: effect.turned(q["jpl_like"][s], pitch_offset_rad) for s in SATELLITES}
        pairs = {"none": (q["mekf"], q["jpl_like"]), "offset": (q["mekf"], offset)}
        pairs |= {name: (of_one, q_true) for name, of_one in q.items()}
        first = int(np.argmax(np.all([np.isfinite(x[s][:, 0]) for x in q.values() for s in SATELLITES], axis=0)))
        for name, (one, other) in pairs.items():
            series = effect.range_rate_difference(recording, one, other, q_true, step)
            series[: first // step + 1] = series[first // step + 1]  # the filters start with the first camera
            parts.setdefault(name, []).append(detrend(series))
    return {name: np.concatenate(series) for name, series in parts.items()}


class Gap(NamedTuple):
    """Errors and standard deviations (n, 3) [rad] of filter and smoother; first, last : epochs without a camera."""

    error: dict[str, Array]
    sigma: dict[str, Array]
    first: int
    last: int
    solutions: dict[str, Estimate]

    def flagged(self, limit_rad: float) -> Array:
        """Epochs (n,) of the filter whose standard deviation exceeds the limit [rad], or that have no estimate."""
        return self.solutions["mekf"].flagged(limit_rad)


def with_gap(measured: Observations, first: int, count: int) -> Observations:
    """The same without any camera at `count` epochs from `first` on."""
    z, R = measured.z.copy(), measured.R.copy()
    z[first : first + count], R[first : first + count] = np.nan, np.nan
    return measured._replace(z=z, R=R)


def gap(recording: Recording, satellite: str, result: Processed, tuning: Tuning, gap_s: float, start_s: float) -> Gap:
    """Filter and smoother over a gap of all cameras of gap_s from start_s after the first epoch on."""
    first, count = round(start_s / result.measured.dt), round(gap_s / result.measured.dt)
    if not 0 < first < first + count < len(result.t):
        raise ValueError(
            f"a gap of {gap_s:g} s does not lie inside {result.t[-1] - result.t[0]:g} s of data; shorten it or "
            "lengthen the flight."
        )
    forward, smooth = estimate.mekf(with_gap(result.measured, first, count), tuning, smooth=True)
    base, solutions = reference(recording, satellite, result), {"mekf": forward, "rts": smooth}
    error = {name: assess.error(x.q, base) for name, x in solutions.items()}
    sigma = {name: np.sqrt(np.einsum("kii->ki", x.cov)) for name, x in solutions.items()}
    return Gap(error, sigma, first, first + count - 1, solutions)


class Outliers(NamedTuple):
    """Rms errors (3,) [rad] with and without the gate; how many outliers and sound updates it refused."""

    gated: Array
    ungated: Array
    found: int
    false_alarms: int


def outliers(
    recording: Recording, satellite: str, result: Processed, tuning: Tuning, count: int, size_rad: float, gate: float,
    rng: np.random.Generator,
) -> Outliers:  # fmt: skip
    """Outliers of +-size on every axis with random signs, at random epochs of the combined quaternion."""
    z = result.measured.z.copy()
    keep = assess.inner(len(z), result.measured.dt)
    seen = np.flatnonzero(np.isfinite(z[keep, 0])) + keep.start
    where = rng.choice(seen, count, replace=False)
    z[where] = multiply(z[where], exp(size_rad * rng.choice([-1.0, 1.0], (count, 3))))
    spoiled, base = result.measured._replace(z=z), reference(recording, satellite, result)
    gated, ungated = (estimate.mekf(spoiled, replace(tuning, gate=limit)) for limit in (gate, 0.0))
    rms = [assess.rms(assess.error(solution.q, base)[keep]) for solution in (gated, ungated)]
    found = int(gated.rejected[where].sum())
    return Outliers(*rms, found, int(gated.rejected.sum()) - found)


def wrong_start(
    recording: Recording, satellite: str, result: Processed, tuning: Tuning, angle_rad: float, rng: np.random.Generator,
    seconds: int = 60, method: str = "mekf",
) -> Array:  # fmt: skip
    """Angle of the attitude error (seconds + 1,) [rad] after a start wrong by an angle about a random axis.

    P0 = 1 rad^2. method : mekf, akf7, or vector_part, a MEKF whose residual is twice the vector part of q* z:
    2 sin(angle / 2), short of the angle by angle^3 / 24: nothing at the level of noise, a tenth at 90 deg.
    """
    base, m = reference(recording, satellite, result), result.measured
    first = int(np.argmax(np.isfinite(m.z[:, 0])))
    axis = rng.standard_normal(3)
    start = multiply(base[first], exp(angle_rad * axis / np.linalg.norm(axis)))
    part = slice(first, first + seconds + 1)
    short = m._replace(z=m.z[part], R=m.R[part], d=m.d[first : first + seconds])
    wide = replace(tuning, p0_attitude=1.0)
    if method == "akf7":
        solution = estimate.akf7(short, wide, start=start)
    elif method == "mekf":
        solution = estimate.mekf(short, wide, start=start)
    else:  # a gate would refuse what the wrong residual makes of sound cameras
        solution = estimate.mekf(short, replace(wide, gate=0.0), start=start, vector_part=True)
    return np.linalg.norm(assess.error(solution.q, base[part]), axis=1)
