"""Ensembles of flights: seeds times satellites, the chain on each, and the numbers that come of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from geokalman import progress
from geokalman.attitude import assess, cameras, pointing
from geokalman.attitude.estimate import FILTERS
from geokalman.attitude.flight import Flight, Solved, flight, in_satellite_axes, reference_at, solve
from geokalman.attitude.model import AXES, SATELLITES, Array, Scenario, Tuning
from geokalman.physics.quaternion import difference, exp, multiply

Table = dict[str, tuple[float, float]]


def chosen(satellite: str) -> tuple[str, ...]:
    """Satellites of a notebook's parameter: C, D or both."""
    return SATELLITES if satellite == "both" else (satellite,)


def against(data_dir: str) -> str:
    """What errors are counted from, for captions: the truth of a simulation, or with real files the smoothed
    attitude.
    """
    return "the smoothed attitude of all cameras" if data_dir else "the truth"


def error_label(data_dir: str) -> str:
    """What such a number is called on an axis: with real files it is a difference, not an error."""
    return "difference to the smoothed attitude" if data_dir else "attitude error"


def origin(data_dir: str) -> str:
    """The sentence with which a caption says where its numbers come from."""
    return f"From the files in {Path(data_dir).name}." if data_dir else "Simulated."


def flights(scenario: Scenario, n_seeds: int, seed0: int, data_dir: str = "") -> Iterator[Flight]:
    """Flights of an ensemble one after the other; real files are one flight."""
    for k in progress.track(range(1 if data_dir else n_seeds), "flights"):
        yield flight(scenario, seed0 + k, data_dir)


def filters(
    scenario: Scenario, tuning: Tuning, n_seeds: int, seed0: int, satellite: str = "both",
    names: Sequence[str] = FILTERS, data_dir: str = "",
    calibrate: bool = False, use: Sequence[int] = (1, 2, 3), pitch_offset_rad: float = 6e-4,
) -> Table:  # fmt: skip
    """Statistics of every filter, mean and spread over satellites and seeds; of the antenna correction where both fly.

    pitch_offset_rad : added to the pitch of the JPL-like product (q Exp(0, offset, 0)) on one satellite (`one`) and on
    both.
    """
    runs, pairs = [], []
    for trip in flights(scenario, n_seeds, seed0, data_dir):
        results = {s: solve(trip, s, tuning, names, use, calibrate) for s in chosen(satellite)}
        hz = tuning.update_hz
        runs += [
            assess.statistics(
                result,
                trip.true_attitude(s, hz),
                trip.true_bias(s, tuning.axes, hz),
                _smoothed(trip, s, result, tuning, use),
            )
            for s, result in results.items()
        ]
        if trip.truth and {"akf7", "jpl_like"} <= set(names):
            for run in runs[-len(results) :]:  # both see the same flight: their difference has less spread than either
                errors = [np.mean([run[f"attitude_rms.{n}.{a}"] for a in AXES]) for n in ("akf7", "jpl_like")]
                run["attitude_rms.akf7_minus_jpl_like"] = float(errors[0] - errors[1])
        if len(results) == 2 and hz == 1 and "rts" in names:
            pairs.append(_pair(trip, results, pitch_offset_rad))
    return assess.table_of(runs) | (assess.table_of(pairs) if pairs else {})


def _smoothed(trip: Flight, satellite: str, result: Solved, tuning: Tuning, use: Sequence[int]) -> Array | None:
    """For files, what a variant is held against: the smoother of all cameras at 1 Hz. None for that run itself."""
    if trip.truth or (tuple(use) == (1, 2, 3) and tuning.update_hz == 1):
        return None
    return reference_at(trip, satellite, result.t, replace(tuning, update_hz=1))


def _pair(trip: Flight, results: dict, pitch_offset_rad: float) -> dict[str, float]:
    names = list(results["C"].solutions)
    estimates = {name: {s: results[s].solutions[name].q for s in SATELLITES} for name in names}
    truth = {s: trip.true_attitude(s) if trip.truth else results[s].solutions["rts"].q for s in SATELLITES}
    r_C, r_D = trip.r["C"], trip.r["D"]
    out = assess.antenna_statistics(estimates, truth, r_C, r_D)
    if not trip.truth:
        del out["kbr_rate_error.rts"]  # held against itself
    if "mekf" in names and "jpl_like" in names:
        mekf, like = estimates["mekf"], estimates["jpl_like"]
        turned = {s: multiply(like[s], exp(np.array([0.0, pitch_offset_rad, 0.0]))) for s in SATELLITES}
        ours = pointing.antenna_correction(mekf["C"], mekf["D"], r_C, r_D)
        for word, q in (("none", like), ("one", like | {"C": turned["C"]}), ("both", turned)):
            rate = pointing.central_rate(ours - pointing.antenna_correction(q["C"], q["D"], r_C, r_D))
            out[f"kbr_rate_difference.{word}"] = float(assess.rms(rate[assess.inner(len(rate))]))
    return out


def camera_errors(
    scenario: Scenario, tuning: Tuning, n_seeds: int, seed0: int, satellite: str = "both", data_dir: str = ""
) -> Table:
    """Errors of single cameras and of every combination at epochs at which all three see: rms and mean per axis [rad].

    Names: single.<1|2|3>.rms.<axis>, combined.<12|13|23|123>.<rms|mean>.<axis>, valid.<1|2|3>, seen.<0..3>.
    """
    runs = []
    for trip in flights(scenario, n_seeds, seed0, data_dir):
        for s in chosen(satellite):
            raw = trip.raw[s]
            q = in_satellite_axes(raw)
            keep = np.isfinite(q).all(axis=(0, 2))
            edge = assess.inner(len(keep), 0.5)
            keep[: edge.start] = keep[edge.stop :] = False
            true = reference_at(trip, s, raw.t_camera, tuning)
            run: dict[str, float] = {}
            for i in range(3):
                run |= assess.by_axis(f"single.{i + 1}.rms", assess.rms(difference(q[i], true)[keep]))
                run[f"valid.{i + 1}"] = float(np.isfinite(q[i, :, 0]).mean())
            count = np.isfinite(q[:, :, 0]).sum(axis=0)
            run |= {f"seen.{k}": float((count == k).mean()) for k in range(4)}
            means = []
            for use in ((1, 2), (1, 3), (2, 3), (1, 2, 3)):
                e = difference(cameras.combine(raw.t_camera, q, raw.q_qsa, tuning.sigma, tuning.k_aniso, use).q, true)[
                    keep
                ]
                name = "combined." + "".join(map(str, use))
                run |= assess.by_axis(f"{name}.rms", assess.rms(e)) | assess.by_axis(f"{name}.mean", e.mean(axis=0))
                run |= assess.by_axis(f"{name}.std", e.std(axis=0))
                means.append(e.mean(axis=0))
            run |= assess.by_axis("spread", np.ptp(means, axis=0))
            run["spread.largest"] = float(np.ptp(means, axis=0).max())
            runs.append(run)
    return assess.table_of(runs)


def weights(
    scenario: Scenario,
    tuning: Tuning,
    ks: Sequence[float],
    n_seeds: int,
    seed0: int,
    satellite: str = "both",
    data_dir: str = "",
) -> dict[float, Array]:
    """Rms error (3,) [rad] of the three-camera combination for each assumed anisotropy k."""
    total: dict[float, list[Array]] = {k: [] for k in ks}
    for trip in flights(scenario, n_seeds, seed0, data_dir):
        for s in chosen(satellite):
            raw = trip.raw[s]
            q = in_satellite_axes(raw)
            keep = np.isfinite(q).all(axis=(0, 2))
            true = reference_at(trip, s, raw.t_camera, tuning)[keep]
            for k in ks:
                e = difference(cameras.combine(raw.t_camera[keep], q[:, keep], raw.q_qsa, tuning.sigma, k).q, true)
                total[k].append(np.mean(e**2, axis=0))
    return {k: np.sqrt(np.mean(values, axis=0)) for k, values in total.items()}


def mounting(
    scenario: Scenario, tuning: Tuning, n_seeds: int, seed0: int, satellite: str = "C", data_dir: str = ""
) -> Table:
    """Filter with mounting errors before and after relative calibration: <before|after>.std.<axis>, .mean.<axis>,
    .nis3, .rate.<axis>.
    """
    runs = []
    for trip in flights(scenario, n_seeds, seed0, data_dir):
        for s in chosen(satellite):
            run: dict[str, float] = {}
            for word, calibrate in (("before", False), ("after", True)):
                result = solve(trip, s, tuning, ("mekf", "rts"), calibrate=calibrate)
                solution = result.solutions["mekf"]
                truth = trip.true_attitude(s)
                e = assess.error(solution.q, result.solutions["rts"].q if truth is None else truth)[
                    assess.inner(len(result.t))
                ]
                apart = assess.rate_difference(solution, result)[assess.inner(len(result.t) - 2)]
                run |= assess.by_axis(f"{word}.std", e.std(axis=0)) | assess.by_axis(f"{word}.mean", e.mean(axis=0))
                run |= assess.by_axis(f"{word}.rate", assess.std(apart))
                run[f"{word}.nis3"] = float(np.nanmean(solution.nis[assess.inner(len(result.t))]) / 3)
            runs.append(run)
    return assess.table_of(runs)


def shifted(scenario: Scenario, tuning: Tuning, shift_s: float, n_seeds: int, seed0: int, data_dir: str = "") -> Table:
    """Change of the smoothed attitude's mean when every camera reports late: <C|D>.<axis> [rad].

    Simulated: the tag t carries the attitude of t - shift, the noise drawn is the same. Real files: their camera tags
    are moved.
    """
    runs = []
    for k in progress.track(range(1 if data_dir else n_seeds), "flights"):
        run: dict[str, float] = {}
        one = flight(scenario, seed0 + k, data_dir)
        if data_dir:
            moved = {s: replace(raw, t_camera=raw.t_camera + shift_s) for s, raw in one.raw.items()}
            inside = one.t[(one.t > one.t[0] + shift_s + 1) & (one.t < one.t[-1] + shift_s - 1)]
            other = replace(one, raw=moved, t=inside)  # r and v keep their own epochs; nothing here uses them
        else:
            other = flight(replace(scenario, shift_s=shift_s), seed0 + k)
        for s in SATELLITES:
            a, b = (solve(x, s, tuning, ("rts",)) for x in (one, other))
            _, i, j = np.intersect1d(a.t, b.t, return_indices=True)
            change = difference(a.solutions["rts"].q[i], b.solutions["rts"].q[j])
            run |= assess.by_axis(s, change[assess.inner(len(change))].mean(axis=0))
        runs.append(run)
    return assess.table_of(runs)
