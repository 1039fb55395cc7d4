"""Observe the same flight with many seeds, each time filtered by the same methods."""

from __future__ import annotations

import itertools
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from geokalman import progress
from geokalman.kalman.consistency import monte_carlo
from geokalman.physics.field import GravityField
from geokalman.pulsar import accelerations, assess, estimate, simulate, visibility, weighting
from geokalman.pulsar.assess import Score
from geokalman.pulsar.dynamics import RADIUS, Force, j2_force
from geokalman.pulsar.estimate import Diverged, Estimate, Tuning
from geokalman.pulsar.model import Array, Belief, Mission, Preset
from geokalman.pulsar.observations import Observations
from geokalman.pulsar.simulate import Truth
from geokalman.pulsar.weighting import Weighting


@dataclass(frozen=True)
class Method:
    """One filter of an experiment: its kind, and where it differs from the others.

    tuning, belief, force : instead of the experiment's; smoothed : followed by the RTS smoother; order : it sees one
    pulsar an epoch, in this cycle; pulsars : it sees these alone; r_factor : the R it assumes over the true one;
    empirical : (sigma [m s^-2], tau [s]) of three accelerations beside its states; weighting : RAEKF in another reading
    than that of its kind.
    """

    kind: str
    tuning: Tuning | None = None
    belief: Belief | None = None
    force: Force | None = None
    smoothed: bool = False
    order: tuple[int, ...] = ()
    pulsars: tuple[int, ...] = ()
    r_factor: float = 1.0
    empirical: tuple[float, float] | None = None
    weighting: Weighting | None = None


@dataclass(frozen=True)
class Experiment:
    """A flight, how it is observed, and the filters that are tried on each seed.

    occulted : pulsars behind Mars are not observed. Called with a Generator it gives label -> Score, or
    label -> Diverged with epoch and reason where a filter stopped.
    """

    mission: Mission
    preset: Preset
    flight: Truth
    force: Force
    methods: Mapping[str, Method]
    tuning: Tuning = Tuning()
    outlier_fraction: float = 0.0
    outlier_size: float = 10.0
    bias: simulate.Bias = "white"
    first: int = assess.SETTLED
    occulted: bool = False

    def __call__(self, rng: np.random.Generator) -> dict[str, Score | Diverged]:
        data = self.observe(rng)
        return {label: self._score(method, data) for label, method in self.methods.items()}

    def _score(self, method: Method, data: Observations) -> Score | Diverged:
        try:
            return assess.score(self.estimate(method, data), self.flight, self.first)
        except Diverged as stopped:
            return stopped.with_traceback(None)

    def observe(self, rng: np.random.Generator) -> Observations:
        """Observe the flight with the noise of one seed."""
        options = self.outlier_fraction, self.outlier_size, self.bias
        data = simulate.observe(self.flight, self.mission, self.preset.world, rng, *options)
        if self.occulted:
            data = data.masked(visibility.hidden(self.flight.x[:, :3], data.H, self.force.head[RADIUS]))
        return data

    def estimate(self, method: Method, data: Observations) -> Estimate:
        """Filter the observations by a method. Raises Diverged."""
        if method.pulsars:
            keep = [self.mission.columns.index(k - 1) for k in method.pulsars]
            data = replace(data, z=data.z[:, keep], H=data.H[keep], variance=data.variance[keep])
        if method.order:
            data = simulate.one_at_a_time(data, list(method.order), self.mission.columns)
        belief, force = method.belief or self.preset.belief, method.force or self.force
        if method.empirical:
            return accelerations.run(data, self.start(), belief.P0, force, *method.empirical)
        if method.weighting:
            return weighting.run(data, self.start(), belief, force, method.weighting, method.tuning or self.tuning)
        R = np.diag(method.r_factor * data.variance)
        result = estimate.run(method.kind, data, self.start(), belief, force, method.tuning or self.tuning, R=R)
        return estimate.smooth(result) if method.smoothed else result

    def start(self) -> Array:
        """Give the initial estimate (6,): the truth plus the world's error on every component."""
        return self.flight.x0 + np.repeat(self.preset.world.error, 3)


def prepare(
    mission: Mission, preset: Preset, gravity: GravityField, methods: Mapping[str, Method],
    tuning: Tuning | None = None, **options,
) -> Experiment:  # fmt: skip
    """Fly the truth of a preset in its field; the filters carry J2.

    options : fields of `Experiment`.
    """
    flight = simulate.fly(mission, gravity, preset.world.mismatch)
    return Experiment(mission, preset, flight, j2_force(gravity), methods, tuning or Tuning(), **options)


def ensemble(trial: Experiment, seed0: int, n_seeds: int, workers: int = 1) -> dict[str, list[Score | Diverged]]:
    """Score each method over the seeds seed0, seed0 + 1, ..., on any number of threads.

    Raises ValueError for no seeds or workers.
    """
    if n_seeds < 1 or workers < 1:
        raise ValueError(f"n_seeds = {n_seeds}, workers = {workers}: both must be at least 1.")
    return over_seeds(trial, range(seed0, seed0 + n_seeds), workers)


def over_seeds(trial: Experiment, seeds, workers: int = 1) -> dict[str, list[Score | Diverged]]:
    """Score as `ensemble`, for any seeds. Raises ValueError where one is repeated."""
    seeds = list(seeds)
    if len(set(seeds)) < len(seeds):
        twice = next(s for s in seeds if seeds.count(s) > 1)
        raise ValueError(f"seed {twice} is repeated; each run of an ensemble needs a seed of its own.")
    tell, count = progress.share("runs"), itertools.count(1)

    def counted(rng: np.random.Generator) -> dict[str, Score | Diverged]:
        result = trial(rng)
        tell(next(count) / len(seeds))
        return result

    with ThreadPoolExecutor(workers) as pool:  # the compiled filters release the interpreter's lock
        results = monte_carlo(counted, seeds, pool if workers > 1 else None)
    return {label: [result[label] for result in results] for label in trial.methods}


def microseconds(trial: Experiment, method: Method, seed: int = 0, repeat: int = 3) -> float:
    """Time a method per epoch [us of the processor], least of `repeat` calls; never a gate."""
    data, times = trial.observe(np.random.default_rng(seed)), []
    for _ in range(repeat + 1):
        begun = time.process_time()
        trial.estimate(method, data)
        times.append(time.process_time() - begun)
    return 1e6 * min(times[1:]) / trial.mission.epochs


def table3_methods(preset: Preset, filters: list[str]) -> dict[str, Method]:
    """Give the methods of Table 3: filters of `estimate.KINDS`, `rts`, and `ekf_tuned`.

    Raises ValueError for another name, and for `ekf_tuned` where the preset does not define it.
    """
    methods = {}
    for name in filters:
        if name == "ekf_tuned":
            methods[name] = Method("ekf", belief=preset.tuned_belief())
        elif name == "rts":
            methods[name] = Method("ekf", smoothed=True)
        elif name in estimate.KINDS:
            methods[name] = Method(name)
        else:
            known = ", ".join([*estimate.KINDS, "rts", "ekf_tuned"])
            raise ValueError(f"filter {name!r} is unknown; give some of {known}.")
    return methods
