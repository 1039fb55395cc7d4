"""Simulated and real surveys through the estimators: every driver over seeds, lines and methods.

Outcomes are judged against truth and references, line by line; levelling by ties, tuning by likelihood and the time per
epoch belong to the chapter beyond the paper.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter

import numpy as np

from geokalman import progress
from geokalman.airborne import assess, classical, level, simulate, tune
from geokalman.airborne.estimate import Estimate, Smoother, estimate, run_filter, run_smoother
from geokalman.airborne.model import Array, Tuning, build
from geokalman.airborne.read import SurveyLine
from geokalman.kalman.consistency import monte_carlo

HAND_TUNED = tuple(str(100100 + 600 * j) for j in range(19)), ("102600", "104200", "106100", "107200", "109800")
"""Kauring lines on which the preset `kauring` was compared by hand: the regular nineteen, and five more, of which
106100 is one of the nineteen."""

ALIASED_R = 0.15
"""Least R [m] of a line whose specific force is aliased: that of the preset `eastvic`, whose passes all are."""


@dataclass(frozen=True)
class Outcome:
    """One simulated line: curves by method (n,) [mGal], their sigma, the innovations, and what to judge them by.

    Methods: forward and fb of the tuning, coloured of the coloured one where given, smoothers of other tunings by their
    names, fir<cutoff>, fircut<cutoff> (ends cut) and butter<cutoff>.
    """

    name: str
    t: Array
    proper: slice
    gravity: Array
    reference: Array
    curves: Mapping[str, Array]
    sigma: Mapping[str, Array]
    innovations: Mapping[str, Array]
    estimated: Mapping[str, float]
    true: Mapping[str, float]

    def against_reference(self, method: str) -> assess.Statistics:
        """Statistics (16), (17) of reference minus estimate on the line proper."""
        return assess.statistics((self.reference - self.curves[method])[self.proper])

    def against_truth(self, method: str) -> float:
        """Standard deviation of the error on the line proper [mGal]."""
        return float((self.curves[method] - self.gravity)[self.proper].std())

    def rms(self, method: str) -> float:
        """Root mean square error on the line proper [mGal], its mean included; method `reference` is the reference."""
        curve = self.reference if method == "reference" else self.curves[method]
        return float(np.sqrt(np.mean((curve - self.gravity)[self.proper] ** 2)))

    def correlation(self, method: str) -> float:
        """Correlation with the reference on the line proper."""
        return float(np.corrcoef(self.curves[method][self.proper], self.reference[self.proper])[0, 1])

    def nees(self, method: str) -> float:
        """Mean normalised squared error of gravity on the line proper."""
        e = (self.curves[method] - self.gravity)[self.proper] / self.sigma[method][self.proper]
        return float(np.mean(e**2))

    def nis(self, method: str = "fb") -> float:
        """Mean normalised innovation squared of the whole flight."""
        return float(np.mean(self.innovations[method] ** 2))


def simulated(
    scenario: simulate.Scenario,
    tuning: Tuning,
    seed: int,
    coloured: Tuning | None = None,
    fir: Sequence[float] = (),
    butter: Sequence[float] = (),
    others: Sequence[tuple[str, Tuning]] = (),
) -> list[Outcome]:
    """One simulated survey, default_rng(seed), through all estimators asked for; others : (name, tuning) pairs."""
    rng = np.random.default_rng(seed)
    return _survey(scenario, tuning, coloured, tuple(fir), tuple(butter), tuple(others), rng)


def ensemble(
    scenario: simulate.Scenario,
    tuning: Tuning,
    seeds: Sequence[int],
    coloured: Tuning | None = None,
    fir: Sequence[float] = (),
    butter: Sequence[float] = (),
    others: Sequence[tuple[str, Tuning]] = (),
    executor=None,
) -> list[list[Outcome]]:
    """Several seeds of `simulated`; executor : any concurrent.futures.Executor."""
    run = partial(_survey, scenario, tuning, coloured, tuple(fir), tuple(butter), tuple(others))
    return monte_carlo(run, progress.track(seeds, "surveys"), executor)


def six_line_means(runs: Sequence[Sequence[Outcome]], method: str, what: str = "D_raw") -> Array:
    """Mean over the lines of each run of D_raw, D_centred (against the reference) or truth (sd), (runs,)."""
    if what == "truth":
        return np.array([np.mean([line.against_truth(method) for line in run]) for run in runs])
    return np.array([np.mean([getattr(line.against_reference(method), what) for line in run]) for run in runs])


@dataclass(frozen=True)
class Judged:
    """Real lines and their estimates, with the trimmed epochs on which they are judged."""

    flights: tuple[SurveyLine, ...]
    estimates: tuple[Estimate, ...]
    keep: tuple[slice, ...]

    def series(self, method: str) -> list[Array]:
        """Curves of a method or of a reference of the survey, whole lines."""
        if method == "forward":
            return [e.forward.gravity for e in self.estimates]
        if method == "fb":
            return [e.smoothed.gravity for e in self.estimates]
        return [flight.references[method] for flight in self.flights]

    def sd(self, method: str, reference: str) -> Array:
        """Standard deviation about its mean of method minus reference, a line at a time [mGal]; NaN for no overlap."""
        return np.array([assess.sd(d) for d in self._differences(method, reference)])

    def offset(self, method: str, reference: str) -> Array:
        """Mean of method minus reference, a line at a time [mGal]."""
        return np.array(
            [np.nanmean(d) if np.isfinite(d).any() else np.nan for d in self._differences(method, reference)]
        )

    def trimmed(self, trim_s: float) -> Judged:
        """The same estimates, judged with `trim_s` left out at either end. Raises ValueError where nothing is left."""
        return replace(self, keep=tuple(assess.inner(flight.line.t, trim_s) for flight in self.flights))

    def _differences(self, method: str, reference: str) -> list[Array]:
        pairs = zip(self.series(method), self.series(reference), self.keep, strict=True)
        return [(ours - theirs)[keep] for ours, theirs, keep in pairs]


def numbered(flights: Sequence[SurveyLine], first: float, last: float, epochs: int = 800) -> list[SurveyLine]:
    """Flights with numbers from `first` to `last` that have at least so many epochs."""
    return [f for f in flights if first <= f.number <= last and len(f.line.t) >= epochs]


def sample(flights: Sequence[SurveyLine], what: str, ends: Sequence[float], epochs: int = 800) -> list[SurveyLine]:
    """Flights between two line numbers, as a parameter `what` gives them. Raises ValueError where it gives none."""
    if len(ends) != 2:
        raise ValueError(f"{what} = {list(ends)}: two numbers are wanted, the first and the last line.")
    found = numbered(flights, *ends, epochs)
    if not found:
        there = [f.number for f in flights if len(f.line.t) >= epochs]
        known = f"they run from {min(there):g} to {max(there):g}" if there else "there is none of that length at all"
        raise ValueError(f"{what} = {list(ends)}: no line of at least {epochs} points lies between; {known}.")
    return found


def unseen(flights: Sequence[SurveyLine]) -> Array:
    """Which of the flights no hand tuning of the preset `kauring` has seen (n,)."""
    return np.array([f.whole not in HAND_TUNED[0] + HAND_TUNED[1] for f in flights], dtype=bool)


def scatter(
    flights: Sequence[SurveyLine], values: Mapping[str, Array] | str, trim_s: float = 60.0, reference: str = "ground"
) -> Array:
    """Standard deviation of values minus reference about its mean, a flight at a time (n,) [mGal]; NaN for no overlap.

    values : by the flight's name, or the name of another reference.
    """
    out = []
    for f in flights:
        ours = f.references[values] if isinstance(values, str) else values[f.name]
        out.append(assess.sd((ours - f.references[reference])[assess.inner(f.line.t, trim_s)]))
    return np.array(out)


def real(
    flights: Sequence[SurveyLine],
    tuning: Tuning,
    lag: float = 0.0,
    trim_s: float = 60.0,
    smoother: Smoother = "rts",
    aliased: Collection[str] = (),
) -> Judged:
    """Estimate real lines, z corrected by a second-order lag [s^2] where given, and cut `trim_s` off either end to
    judge.

    aliased : names of lines that are estimated with an R of at least ALIASED_R (see `Survey.aliased`).
    """
    loose = replace(tuning, R_m=max(tuning.R_m, ALIASED_R))
    estimates = tuple(
        estimate(flight.line.lagged(lag), loose if flight.name in aliased else tuning, smoother) for flight in flights
    )
    return Judged(tuple(flights), estimates, tuple(assess.inner(flight.line.t, trim_s) for flight in flights))


def _survey(scenario, tuning, coloured, fir, butter, others, rng: np.random.Generator) -> list[Outcome]:
    out = []
    for truth, line in simulate.survey(scenario, rng):
        plain = estimate(line, tuning)
        curves = {"forward": plain.forward.gravity, "fb": plain.smoothed.gravity}
        sigma = {"forward": plain.forward.sigma(), "fb": plain.smoothed.sigma()}
        innovations = {"fb": plain.innovations}
        if coloured is not None:
            other = estimate(line, coloured)
            curves["coloured"], sigma["coloured"] = other.smoothed.gravity, other.smoothed.sigma()
            innovations["coloured"] = other.innovations
        for name, tuned in others:
            other = estimate(line, tuned).smoothed
            curves[name], sigma[name] = other.gravity, other.sigma()
        curves |= {f"fir{c:g}": classical.fir(line, c) for c in fir}
        curves |= {f"fircut{c:g}": classical.fir(line, c, cut_ends=True) for c in fir}
        curves |= {f"butter{c:g}": classical.butterworth(line, c) for c in butter}
        names = [name for name in ("tau3", "k1", "k2", "k3") if name in plain.smoothed.names]
        out.append(
            Outcome(
                line.name, line.t, truth.proper, truth.gravity, truth.reference, curves, sigma, innovations,
                {name: float(plain.smoothed.state(name)[-1]) for name in names},
                dict(zip(("tau3", "k1", "k2", "k3"), truth.k, strict=True)),
            )
        )  # fmt: skip
    return out


@dataclass(frozen=True)
class Levelled:
    """Root mean square error over a survey [mGal], about the survey's mean: before, after, and with every line's own
    mean out.
    """

    before: float
    after: float
    floor: float


def levelling(
    scenario: simulate.Scenario,
    tuning: Tuning,
    seed: int,
    ties: int = 3,
    tie_bias: float = 2.0,
    tie_noise: float = 0.25,
) -> Levelled:
    """Level a simulated survey by tie lines; a tie is truth with one bias and white noise [mGal], it is not filtered.

    Ties cross all lines at equal distances along them.
    """
    rng = np.random.default_rng(seed)
    flown = simulate.survey(scenario, rng)
    error, track, values = {}, {}, {}
    for truth, line in flown:
        p = truth.proper
        smoothed = estimate(line, tuning).smoothed.gravity
        error[line.name] = (smoothed - truth.gravity)[p]
        track[line.name], values[line.name] = np.column_stack([truth.east, truth.north])[p], smoothed[p]
    half = scenario.length_km * 500.0
    for k in range(ties):
        name, north = f"tie{k + 1}", half * (2 * (k + 1) / (ties + 1) - 1)
        places, truths = [], []
        for truth, _ in sorted(flown, key=lambda line: line[0].east.mean()):
            order = np.argsort(truth.north)
            places.append(np.interp(north, truth.north[order], truth.east[order]))
            truths.append(np.interp(north, truth.north[order], truth.gravity[order]))
        east = np.linspace(places[0] - 1e3, places[-1] + 1e3, 400)
        track[name] = np.column_stack([east, np.full(400, north)])
        noisy = np.array(truths) + tie_bias * rng.standard_normal() + tie_noise * rng.standard_normal(len(truths))
        values[name] = np.interp(east, places, noisy)
    lines = {name: track[name] for name in error}
    points = level.crossovers(lines, {name: t for name, t in track.items() if name not in lines})
    found = level.levels(points, values)
    before = np.concatenate(list(error.values()))
    after = np.concatenate([e - found[name] for name, e in error.items()])
    floor = np.concatenate([e - e.mean() for e in error.values()])
    return Levelled(float(before.std()), float(after.std()), float(floor.std()))


@dataclass(frozen=True)
class Tuned:
    """Error on the test lines [mGal] before and after tuning, and what the likelihood chose."""

    before: float
    after: float
    L_km: float
    sigma_mgal: float
    q_f: float
    R_m: float
    evaluations: int
    converged: bool


def likelihood_tuning(
    scenario: simulate.Scenario,
    tuning: Tuning,
    seed: int,
    colour: tuple[float, float] | None = None,
    evaluations: int = 90,
) -> Tuned:
    """Tune on lines 1 and 2 of a simulated survey, judge on the others; colour : white and coloured height error
    [m].
    """
    start = tuning.coloured(*colour, scenario.gnss_s) if colour else tuning
    flown = simulate.survey(scenario, np.random.default_rng(seed))
    found = tune.fit([line for _, line in flown[:2]], start, evaluations=evaluations)
    errors = []
    for choice in (start, found.tuning):
        errors.append(
            np.mean(
                [
                    (estimate(line, choice).smoothed.gravity - truth.gravity)[truth.proper].std()
                    for truth, line in flown[2:]
                ]
            )
        )
    best = found.tuning
    return Tuned(
        float(errors[0]), float(errors[1]), best.L_km, best.sigma_mgal, best.q_f, best.R_m, found.evaluations,
        found.converged,
    )  # fmt: skip


@dataclass(frozen=True)
class Throughput:
    """Epochs, microseconds an epoch for each part, the difference of both smoothers and the error [mGal]."""

    epochs: int
    forward: float
    rts: float
    two_filter: float
    difference: float
    error: float


def throughput(scenario: simulate.Scenario, tuning: Tuning, seed: int) -> Throughput:
    """Time the filters on one simulated line, best of three."""
    truth, line = simulate.survey(replace(scenario, n_lines=1), np.random.default_rng(seed))[0]
    model = build(line, tuning)
    times = np.full(3, np.inf)
    for _ in range(3):
        start = perf_counter()
        course = run_filter(line, model)
        one = perf_counter()
        rts = run_smoother(line, model, course, "rts")
        two = perf_counter()
        both = run_smoother(line, model, course, "two-filter")
        times = np.minimum(times, [one - start, two - one, perf_counter() - two])
    k = model.names.index("dg")
    gap = model.scale[k] * np.abs(rts.mean[:, k] - both.mean[:, k]).max()
    error = (model.scale[k] * rts.mean[:, k] - truth.gravity)[truth.proper].std()
    return Throughput(len(line.t), *(float(1e6 * t / len(line.t)) for t in times), float(gap), float(error))
