"""The claims of the paper in one of its readings: a world of `readings.yml`, flown for two days with a single seed.

A world gives the numbers that decide claims under the names of the pages that record them; a page's name with a
variant in it (`aekf1_prw`, `aekf2_15_25`) then holds the filter as the world reads it. "Three at once" are the
accurate pulsars: with the fourth, far from the equator, in the worlds that have it.
"""

from __future__ import annotations

import functools
import math
import zlib
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from geokalman.physics import mars
from geokalman.pulsar import assess, catalogue, simulate
from geokalman.pulsar.assess import Score
from geokalman.pulsar.dynamics import j2_force
from geokalman.pulsar.estimate import DIVERGED, Diverged, Estimate, Tuning
from geokalman.pulsar.experiment import Experiment, Method
from geokalman.pulsar.model import CENTURIES, TRANSFER, Belief, Mission, Orbit, Preset, World, all_sigmas, preset
from geokalman.pulsar.observations import Observations
from geokalman.pulsar.simulate import Truth
from geokalman.pulsar.weighting import Weighting

DAYS = 2.0
"""Length of the flight of a world [d]."""
RANGES = {"calibrated": 0.067, "four-times": 0.25, "square-metre": 1.0}
NOISE = {"small": (1.0, 1e-3), "mismatch": (70.0, 0.28), "tuned": (150.0, 0.6)}
AEKF1 = {"ratio": "aekf1_prw", "three-part": "aekf1_pr3", "two-part": "aekf1_pr2"}
FACTOR = {"k15-25": (1.5, 2.5), "k175-29": (1.75, 2.9), "k25-6": (2.5, 6.0), "k15-8": (1.5, 8.0)}
START = {"overconfident": (10.0, 0.01), "truthful": (1e3, 1.0)}
POLAR = 3, 300.0
"""Column and accuracy [m] of the pulsar far from the equator."""
_TABLE, _START, _SETS, _WEIGHTS = (
    f"mars-pulsar/{n}:" for n in ("05-table3", "07-initial-error", "10-sequential", "09-robustness")
)


def metrics(world: Mapping[str, str | float], days: float = DAYS) -> dict[str, float]:
    """Run one world: `notebook:key` -> number, in the units of the pages.

    A filter that lost its orbit counts with an error of 1e7 m. The seed is the check sum of the world's options.
    """
    seed = zlib.crc32(repr(sorted(world.items())).encode())
    table, start, clean = _trials(world, days)
    given = _observe(table, world, seed)
    scores = {label: _score(table, method, given, world) for label, method in table.methods.items()}
    best, raekf = scores["aekf1"], scores["raekf"].d3
    numbers = {f"{_TABLE}velocity.max": max(best.vx, best.vy, best.vz)}
    for label, key in (("ekf", "ekf"), ("aekf1", "aekf1_prw"), ("aekf2", "aekf2"), ("raekf", "raekf")):
        for axis, field in (("x", "x"), ("y", "y"), ("z", "z"), ("3d", "d3")):
            numbers[f"{_TABLE}table3.{key}.rms.{axis}"] = getattr(scores[label], field)
    numbers[f"{_WEIGHTS}sweep.e.15_25.3d"] = raekf
    numbers[f"{_WEIGHTS}sweep.e.best.3d"] = min(s.d3 for label, s in scores.items() if label.startswith("raekf k"))
    numbers[f"{_SETS}e.aekf1_prw.all.3d"] = best.d3
    for label, key in (("aekf1 123", "aekf1_prw.123"), ("aekf1 cycle", "aekf1_prw.cycle.123")):
        numbers[f"{_SETS}e.{key}.3d"] = scores[label].d3
    for label in ("aekf2", "raekf"):
        numbers[f"{_SETS}e.{label}.cycle.123.3d"] = scores[f"{label} cycle"].d3
    same = world["second-experiment"] == "same"
    before = {label: scores[label] for label in ("ekf", "aekf2", "raekf")} if same else {}
    return numbers | _wrong_start(world, start, clean, seed, before) | _geometry(world)


def _trials(world: Mapping[str, str | float], days: float) -> tuple[Experiment, Experiment, Experiment]:
    """Give the experiments of a world: Table 3, the wrong start, and that without an initial error."""
    scale, transfer = RANGES[world["ranges"]], None if world["transfer"] == "scaled" else 1.0
    real = 1.0 if world["field"] == "real" else 0.0
    q_pos, q_vel = NOISE[world["noise"]]
    table = Preset("E", "Table 3", World(real, scale, transfer_scale=transfer), Belief(q_pos=q_pos, q_vel=q_vel))
    base = preset("B") if world["second-experiment"] == "matched" else table
    wrong = replace(
        base, world=replace(base.world, error=(1000.0, 0.5)), belief=replace(base.belief, p0=START[world["start"]])
    )
    factor, cycle = FACTOR[world["factor"]], (1, 2, 3)
    accurate = (*cycle, POLAR[0] + 1) if world["pulsars"] == "polar" else cycle
    tuning = Tuning(*factor)
    weighting = Weighting(world["weights"], (1.5, 2.5), factor)
    four = {
        "ekf": Method("ekf"),
        "aekf1": Method(AEKF1[world["aekf1-table3"]], tuning),
        "aekf2": Method("aekf2", tuning),
        "raekf": Method("raekf", weighting=weighting),
    }
    others = {
        f"raekf {name}": Method("raekf", weighting=replace(weighting, factor=pair))
        for name, pair in FACTOR.items()
        if name != world["factor"]
    }
    sets = {"aekf1 123": replace(four["aekf1"], pulsars=accurate)}
    sets |= {f"{label} cycle": replace(four[label], order=cycle) for label in ("aekf1", "aekf2", "raekf")}
    then = four | {"aekf1": Method(AEKF1[world["aekf1-start"]], tuning)}
    made = []
    for chosen, methods in ((table, four | others | sets), (wrong, then), (base, then)):
        flight, force = _flight(world["node"], chosen.world.mismatch, days)
        bias = "const" if world["transfer"] == "constant" else "white"
        occulted = world["occultation"] == "hidden"
        mission = Mission(Orbit(raan=math.radians(float(world["node"][1:]))), days)
        made.append(Experiment(mission, chosen, flight, force, methods, bias=bias, occulted=occulted))
    return tuple(made)


@functools.lru_cache(maxsize=16)
def _flight(node: str, mismatch: float, days: float):
    """Fly the truth once for all worlds that share it; it and the J2 force of the filters."""
    gravity = mars.gravity()
    mission = Mission(Orbit(raan=math.radians(float(node[1:]))), days)
    return simulate.fly(mission, gravity, mismatch), j2_force(gravity)


def _observe(trial: Experiment, world: Mapping[str, str | float], seed: int) -> Observations:
    data = trial.observe(np.random.default_rng(seed))
    return sharpened(data, trial.flight, trial.preset.world, *POLAR) if world["pulsars"] == "polar" else data


def sharpened(data: Observations, flight: Truth, world: World, column: int, sigma: float) -> Observations:
    """Give observations in which a pulsar has ranges of that sigma [m] in 500 s and a square metre."""
    was, transfer = all_sigmas()[column], world.transfer * TRANSFER
    ratio = math.hypot(world.sigma_scale * sigma, transfer) / math.hypot(world.sigma_scale * was, transfer)
    z, variance, place = data.z.copy(), data.variance.copy(), flight.x[:, :3] @ data.H[column]
    z[:, column] = place + ratio * (z[:, column] - place)
    variance[column] *= ratio**2
    return replace(data, z=z, variance=variance)


def _estimate(trial: Experiment, method: Method, data: Observations) -> Estimate | None:
    try:
        return trial.estimate(method, data)
    except Diverged:
        return None


def _score(
    trial: Experiment, method: Method, data: Observations, world: Mapping[str, str | float], run: Estimate | None = None
) -> Score:
    """Score a run in the axes of the world; 1e7 m, and 1e4 m/s, where the filter lost its orbit."""
    run = run or _estimate(trial, method, data)
    if run is None:
        lost = dict.fromkeys(("x", "y", "z", "d3", "early"), DIVERGED) | dict.fromkeys(("vx", "vy", "vz"), 1e4)
        return Score(**lost, nees6=np.inf, nis=np.inf, last=len(data.t), fired=np.nan, skipped=np.nan)
    score = assess.score(run, trial.flight, trial.first)
    if world["axes"] == "icrf":
        return score
    x, y, z = assess.rms((run.x - trial.flight.x)[trial.first :, :3])
    return score._replace(x=float(x), y=float(y), z=float(z))


def _wrong_start(
    world: Mapping[str, str | float], start: Experiment, clean: Experiment, seed: int, before: dict[str, Score]
) -> dict[str, float]:
    """Give the numbers of the experiment with a wrong start; before : scores without it that are known already."""
    data = _observe(start, world, seed)
    run = _estimate(start, start.methods["aekf1"], data)
    scores = {
        label: _score(start, method, data, world, run if label == "aekf1" else None)
        for label, method in start.methods.items()
    }
    later = {label: method for label, method in clean.methods.items() if label not in before}
    before = before | {label: _score(clean, method, data, world) for label, method in later.items()}
    numbers = {}
    for label, key in (("ekf", "ekf"), ("aekf1", "aekf1_pr3"), ("aekf2", "aekf2_15_25"), ("raekf", "raekf_15_25")):
        numbers[f"{_START}a.{key}.rms.3d"] = scores[label].d3
    errors = [s.d3 for s in scores.values()]
    ratios = [max(errors) / min(errors)]
    if world["similar"] == "table3":
        ratios = [max(s.d3 / before[label].d3, before[label].d3 / s.d3) for label, s in scores.items()]
    far = (DIVERGED, 1e4)
    if run is not None:
        far = (float(np.sqrt((e[assess.SETTLED :] ** 2).sum(axis=1)).max()) for e in assess.errors(run, start.flight))
    position, velocity = far
    return numbers | {
        f"{_START}similar.ratio": max(ratios),
        f"{_START}a.aekf1_pr3.last.max": float(scores["aekf1"].last),
        f"{_START}b.aekf1_pr3.rms.3d": before["aekf1"].d3,
        "mars-pulsar/06-figures12:after100.position.max": position,
        "mars-pulsar/06-figures12:after100.velocity.max": velocity,
    }


def _geometry(world: Mapping[str, str | float]) -> dict[str, float]:
    """Give the sigmas of a position of a single epoch, range noise of a square metre alone [m]."""
    sigmas, vectors = all_sigmas(), catalogue.directions(catalogue.PULSARS)
    if world["pulsars"] == "polar":
        sigmas[POLAR[0]] = POLAR[1]
    if world["axes"] == "mars":
        vectors = vectors @ mars.icrf_from_smci(CENTURIES)
    axes = np.sqrt(np.diag(catalogue.single_epoch_covariance(vectors, sigmas)))
    return {f"mars-pulsar/03-pulsars:ls.icrf.{axis}": float(s) for axis, s in zip("xyz", axes, strict=True)}
