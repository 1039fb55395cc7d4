"""Worlds of readings: the numbers that decide claims, in one combination of what the paper leaves open.

A world is a mapping choice -> option or number, as `book/grace-fusion/readings.yml` declares, with its place `world`,
which seeds its noise. `rates` gives the numbers
of Table 1 on the world's own orbit; `field` gives those of Figures 4 to 7 on the nearest, in height and separation, of
eight orbits, because the normal matrix of one serves every reading. Names and units are those of the pages.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from geokalman.grace import assess, estimate, observables, readings, recover, simulate
from geokalman.grace.model import Array, Observations, Scenario, Tuning
from geokalman.grace.simulate import Truth
from geokalman.physics.field import GravityField
from geokalman.physics.harmonics import degree_amplitude, degree_variance, error_degree_variance, geoid_difference

World = Mapping[str, str | float]

NOISE = {"none": 0.0, "micrometres": 5e-6}
"""Option -> white noise of each satellite's position, per axis [m]."""
UPDATES = {"sequential": "sequential", "joint": "simultaneous"}
ORBITS = (
    (6834.0, 28.9, 0.3, 0.5, 0.1),
    (6857.0, 28.9, 1.1, 2.0, 4.0),
    (6821.0, 22.0, 2.2, 4.1, 1.3),
    (6844.0, 21.5, 3.4, 5.6, 2.9),
    (6871.0, 22.5, 4.3, 1.2, 5.5),
    (6823.0, 36.5, 5.2, 3.0, 0.8),
    (6847.0, 36.0, 0.9, 0.1, 3.3),
    (6872.0, 36.0, 2.8, 4.8, 4.9),
)
"""Semi-major axis [km], lead time [s], node, perigee and anomaly [rad]: the default, the 480 km of the introduction,
and six that fill heights of 440 to 500 km and separations of 160 to 280 km."""
_REACH = (60.0, 19.7)  # widths of the ranges of semi-major axis [km] and lead time [s]


class Extent(NamedTuple):
    """How large the worlds of `field` and `rates` are.

    days, n_max : span [d] and degree; every : of so many epochs one enters the normal equations; grid : spacing of the
    geoid [deg].
    """

    days: float
    n_max: int
    every: int = 1
    grid: float = 2.0


RATES, FIELD = Extent(3.0, 70), Extent(13.5, 70, 4)
SMALL_RATES, SMALL_FIELD = Extent(1.0, 31), Extent(5.0, 31, 5)
EDGE = 100


def rates(world: World) -> dict[str, float]:
    """Numbers of Table 1 and of what the text says of the range-rates, three days of the world's own orbit."""
    return rates_at(RATES, world)


def field(world: World) -> dict[str, float]:
    """Numbers of Figures 4 to 7, thirteen and a half days to degree 70, every fourth epoch in the normal equations."""
    return field_at(FIELD, world)


def small_rates(world: World) -> dict[str, float]:
    """`rates` for a quick run: one day to degree 31."""
    return rates_at(SMALL_RATES, world)


def small_field(world: World) -> dict[str, float]:
    """`field` for a quick run: five days to degree 31."""
    return field_at(SMALL_FIELD, world)


def rates_at(scale: Extent, world: World) -> dict[str, float]:
    """`rates` at a scale; page and keys are those of 04-ukf."""
    scenario = Scenario(
        days=scale.days,
        n_max=scale.n_max,
        a=1e3 * world["semi-major-axis"],
        tau=world["lead-time"],
        raan=world["node"],
        argp=world["perigee"],
        m0=world["anomaly"],
    )
    gravity = scenario.gravity()
    orbit = simulate.orbit_pair(scenario, gravity)
    data = _observed(orbit, gravity, NOISE[world["noise"]], int(world["world"]))
    update, kind = UPDATES[world["update"]], world["estimate"]
    states = {
        "ekf": estimate.ekf(data, Tuning()),
        "ukf": estimate.ukf(data, Tuning(), update),
        "fused": estimate.fused_ekf(data, Tuning(), update),
    }
    series = {name: getattr(each, kind).rate for name, each in states.items()}
    series["newton"] = estimate.newton(data).rate
    stats = {name: assess.statistics(assess.range_rate_residual(rate, orbit), EDGE) for name, rate in series.items()}
    keys = {f"table1.{name}.{key}": v for name in readings.METHODS for key, v in stats[name]._asdict().items()}
    keys["fused.ekf.std"] = stats["fused"].std
    keys["ratio.fused_ekf_over_ukf.std"] = stats["fused"].std / stats["ukf"].std
    keys["ratio.ekf_over_ukf.std"] = stats["ekf"].std / stats["ukf"].std
    keys |= {f"asymmetry.{name}": -stats[name].min / stats[name].max for name in readings.METHODS}
    return {f"grace-fusion/04-ukf:{key}": value for key, value in keys.items()}


def field_at(scale: Extent, world: World) -> dict[str, float]:
    """`field` at a scale; pages and keys are those of 05-recovery and 06-geoid."""
    flown = _flown(nearest(world), scale)
    variant = Variant(world["estimate"], UPDATES[world["update"]], NOISE[world["noise"]])
    route = readings.ROUTES[world["range-acceleration"]]
    errors = {method: flown.errors[variant.name(route[method])] for method in readings.METHODS}
    differences = {
        method: np.abs(degree_variance(flown.C - dC, flown.S - dS) - flown.reference)
        for method, (dC, dS) in errors.items()
    }
    degrees = readings.by_degree(differences, world["measure"])
    amplitude = degree_amplitude(error_degree_variance(*errors["ukf"])[-1], flown.radius)
    degrees["last_degree.ukf"] = float(amplitude / degree_amplitude(flown.reference[-1], flown.radius))
    maps = {
        method: geoid_difference(dC, dS, flown.radius, scale.grid, world["gaussian-radius"])
        for method, (dC, dS) in errors.items()
    }
    geoid = readings.of_geoid(maps, world["size"])
    std = {method: flown.rate_std[variant.name(id_)] for method, id_ in (("newton", "N1"), ("ukf", "U2"))}
    return (
        {f"grace-fusion/05-recovery:paper.{key}": value for key, value in degrees.items()}
        | {f"grace-fusion/06-geoid:paper.{key}": value for key, value in geoid.items()}
        | {"grace-fusion/04-ukf:ratio.newton_over_ukf.std": std["newton"] / std["ukf"]}
    )


def nearest(world: World) -> int:
    """Index in `ORBITS` of the orbit that is nearest to the world's in semi-major axis and lead time."""
    wanted = (world["semi-major-axis"], world["lead-time"])

    def distance(orbit: tuple[float, ...]) -> float:
        return sum(((x - y) / width) ** 2 for x, y, width in zip(orbit, wanted, _REACH, strict=False))

    return min(range(len(ORBITS)), key=lambda k: distance(ORBITS[k]))


class Variant(NamedTuple):
    """How states are estimated: filtered or smoothed, the update of the UKF, the noise of the positions [m]."""

    estimate: str
    update: str
    noise: float

    def name(self, observable: str) -> str:
        """Name an observable of this variant; what does not matter to it is left out."""
        parts = {"N": (), "E": (self.estimate,), "U": (self.estimate, self.update)}[observable[0]]
        return " ".join((observable, *parts, f"{self.noise:g}"))


class Flown(NamedTuple):
    """An orbit with everything that was recovered from it.

    C, S, reference, radius : the field's coefficients (N+1, N+1), degree variances (N+1,) and radius [m];
    errors : name of a variant's observable -> coefficients of the field minus those recovered;
    rate_std : the same names -> standard deviation of the range-rate residual [m/s].
    """

    C: Array
    S: Array
    reference: Array
    radius: float
    errors: Mapping[str, tuple[Array, Array]]
    rate_std: Mapping[str, float]


@functools.lru_cache(maxsize=len(ORBITS))
def _flown(index: int, scale: Extent) -> Flown:
    a_km, tau, raan, argp, m0 = ORBITS[index]
    scenario = replace(Scenario(days=scale.days, n_max=scale.n_max), a=1e3 * a_km, tau=tau, raan=raan, argp=argp, m0=m0)
    gravity = scenario.gravity()
    orbit = simulate.orbit_pair(scenario, gravity)
    los: dict[str, Array] = {}
    rate: dict[str, Array] = {}
    for noise in NOISE.values():
        _differentiated(_observed(orbit, gravity, noise, index), noise, los, rate)
    kept = slice(EDGE, len(orbit.t) - EDGE, scale.every)
    thinned = Truth(orbit.t[kept], orbit.A[kept], orbit.B[kept])
    solved = recover.coefficients(thinned, gravity, {name: series[kept] for name, series in los.items()}, edge=0)
    errors = {name: (gravity.C - C, gravity.S - S) for name, (C, S) in solved.items()}
    std = {
        name: assess.statistics(assess.range_rate_residual(series, orbit), EDGE).std for name, series in rate.items()
    }
    return Flown(gravity.C, gravity.S, degree_variance(gravity.C, gravity.S), gravity.radius, errors, std)


def _differentiated(data: Observations, noise: float, los: dict[str, Array], rate: dict[str, Array]) -> None:
    """Enter every observable of one set of data under the name of its variant."""
    newton, plain = estimate.newton(data), Variant("", "", noise)
    for name, twice in (("N1", True), ("N2", False)):
        los[plain.name(name)], rate[plain.name(name)] = observables.from_newton(newton, twice), newton.rate
    runs = [("E", "", estimate.ekf(data, Tuning()))]
    runs += [("U", update, estimate.ukf(data, Tuning(), update)) for update in UPDATES.values()]
    for letter, update, run in runs:
        for kind in ("filtered", "smoothed"):
            states, variant = getattr(run, kind), Variant(kind, update, noise)
            los[variant.name(f"{letter}1")] = observables.from_range_rate(states)
            los[variant.name(f"{letter}2")] = states.los
            rate[variant.name(f"{letter}1")] = rate[variant.name(f"{letter}2")] = states.rate


def _observed(orbit: Truth, gravity: GravityField, noise: float, seed: int) -> Observations:
    return simulate.observe(orbit, gravity, np.random.default_rng(seed), noise)
