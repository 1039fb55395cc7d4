"""What the sessions give in one reading of the paper: quantiles over linear draws, at mid-observation.

A number of the paper is one draw of a session; `low` and `high` bound the central nine tenths of ours.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from geokalman.constants import C_LIGHT
from geokalman.kalman.consistency import nees
from geokalman.radioastron import assess, formal, orbits
from geokalman.radioastron.correlator import Setup, drifting
from geokalman.radioastron.data import INFLATED, NAIVE, Scenario, Tuning
from geokalman.radioastron.model import BANDS, Array, Session, nominal_state, toward, world
from geokalman.radioastron.visibility import elevations

Numbers = dict[str, tuple[float, str]]
"""Name -> value and unit."""
SESSIONS = ("ST", "OE", "BC")
"""The sessions with a correlation."""
PRIORS = {"figure-5": (2000.0, 0.05), "official": (500.0, 0.02)}
"""A-priori error of each coordinate [m] and velocity [m/s]: from Figures 2(c) and 5, or as the introduction has it."""
WEIGHTS = {"inflated": INFLATED, "naive": NAIVE, "bias-states": Tuning(10.0, 1e-3, True)}
SNR_FREE = {"ST": 65.0, "OE": 184.0, "BC": 40.0}
"""SNR of each session without residuals: the upper ends of Figures 2(a), 3 and 4(a). The noise of an SNR is 0.7."""
PRINTED_CORRECTION = np.array([2750.0, -2250.0, 1300.0])
"""Middles of the ranges of Figure 5 [m]; the sign of the last one is uncertain."""
LARGE = 50.0
"""Any large number: sigmas of P(0), in units of the real ones."""
PRINTED = (
    ("fringe rate before, Figure 1 [Hz]", 0.3, "st.prior.fringe_hz"),
    ("fringe rate after, Figure 1 [Hz]", 0.03, "st.post.fringe_hz"),
    ("change of the delay, Figure 1 [µs]", 1.0, "st.change_us"),
    ("delay after, Figure 2(b) [µs]", 19.0, "st.post.delay_us"),
    ("rate before, Figure 2(c) [s/s]", 1.8e-10, "st.prior.rate"),
    ("rate after, Figure 2(c) [s/s]", 2.0e-11, "st.post.rate"),
    ("gain of the rate", 10.0, "st.gain.rate"),
    ("SNR before, Figure 2(a)", 27.5, "st.prior.snr"),
    ("SNR after, Figure 2(a)", 62.5, "st.post.snr"),
    ("ratio of SNR, Figure 2(a)", 2.0, "st.snr.ratio"),
    ("ratio of SNR, Figure 3", 1.0, "oe.stage.ratio"),
    ("ratio of SNR, Figure 4(a)", 1.14, "bc.snr.ratio"),
    ("change of the delay, Figure 4(b) [µs]", 6.0, "bc.change_us"),
    ("delay after, Figure 4(b) [µs]", 9.0, "bc.post.delay_us"),
    ("rate before, Figure 4(c) [s/s]", 1.35e-10, "bc.prior.rate"),
    ("rate after, Figure 4(c) [s/s]", 1.35e-10, "bc.post.rate"),
    ("size of dX, Figure 5 [m]", 2750.0, "bc.correction.dx_m"),
    ("size of dY, Figure 5 [m]", 2250.0, "bc.correction.dy_m"),
    ("size of dZ, Figure 5 [m]", 1300.0, "bc.correction.dz_m"),
    ("size of the correction, Figure 5 [m]", 3784.0, "bc.correction.total_m"),
)
"""What the paper prints of a session, or we read off an axis: words, the number, the quantity that it is a draw of."""
_SEGMENT = 64e-6  # s, of 1024 channels in 16 MHz
_ENDS = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class Reading:
    """One way to fill in what the paper leaves open.

    orbit : "real" or "assumed";  angle : position angle [deg] of the source about the baseline, from north to east;
    prior : of `PRIORS`;  weights : of `WEIGHTS`;  bias : "none", "common" or "per-pass";  impulse : of the wheels
    [m/s];  bandwidth [Hz];  band : of session BC, "L", "C" or "K";  stage : what Figure 3 compares, see `signals`.
    """

    orbit: str = orbits.REAL
    angle: float = 90.0
    prior: str = "figure-5"
    weights: str = "inflated"
    bias: str = "common"
    impulse: float = 5e-3
    bandwidth: float = 16e6
    band: str = "L"
    stage: str = "predicted"

    @property
    def levels(self) -> Scenario:
        """The sizes of all errors."""
        position, velocity = PRIORS[self.prior]
        return Scenario(prior_position=position, prior_velocity=velocity, bias=self.bias, impulse=self.impulse)


class Linearised(NamedTuple):
    """A session that was linearised, and the effects of unknown forces on it."""

    linear: formal.Geometry
    effects: formal.Effects


@functools.lru_cache(maxsize=16)
def geometry(name: str, orbit: str) -> Linearised:
    """Linearise a session about its nominal orbit, once."""
    session = orbits.on_orbit(name, orbit)
    linear = formal.linearise(session, world(session), (session.station,))
    return Linearised(linear, formal.effects(linear))


class Draws(NamedTuple):
    """Draws of a session: errors (n, 6) before and after, residuals, the stated covariance, direction of the source."""

    session: Session
    errors: formal.Sample
    prior: assess.Residual
    post: assess.Residual
    own: Array
    source: Array


def draw(name: str, reading: Reading, draws: int, rng: np.random.Generator, prior_scale: float = 1.0) -> Draws:
    """Draw the errors of a session in a reading; prior_scale : as in `formal.reduced_sample`."""
    g, effects = geometry(name, reading.orbit)
    session = orbits.toward_circle(g.session, reading.angle)
    source, gradient = toward(session), g.world.gradient(session.middle, g.middle)
    errors, own = formal.reduced_sample(g, effects, reading.levels, WEIGHTS[reading.weights], rng, draws, prior_scale)
    prior, post = (assess.residual(e, gradient, source) for e in errors)
    return Draws(session, errors, prior, post, own, source)


class Signals(NamedTuple):
    """SNR of scans (n,) of the first correlation, a priori and after the filter, and of both as Figure 3 has them."""

    prior: Array
    post: Array
    corrected: Array
    staged: Array


def signals(
    d: Draws, setup: Setup, free: float, rng: np.random.Generator, count: int, stage: str = "delay-and-rate"
) -> Signals:
    """SNR of the first draws, with noise; free : SNR without residuals.

    Post-correlation of the a-priori orbit takes off the delay and the rate that the first correlation found, or with
    stage "delay" the delay alone; the acceleration stays. With stage "predicted" the filter's SNR, too, is that after
    post-correlation.
    """
    n = min(count, len(d.prior.rate))
    found = [
        np.maximum(0.0, 1.0 - np.abs(r.delay[:n]) / _SEGMENT) * drifting(setup, r.rate[:n], r.acceleration[:n])
        for r in (d.prior, d.post)
    ]
    found.append(drifting(setup, d.prior.rate[:n] if stage == "delay" else np.zeros(n), d.prior.acceleration[:n]))
    seen = [np.hypot(free * x + math.sqrt(0.5) * rng.standard_normal(n), 1.0) for x in found]
    if stage == "predicted":
        clean = drifting(setup, np.zeros(n), d.post.acceleration[:n])
        return Signals(*seen, np.hypot(free * clean + math.sqrt(0.5) * rng.standard_normal(n), 1.0))
    return Signals(*seen, seen[1])


def session_numbers(d: Draws, signal: Signals, band: str) -> Numbers:
    """Numbers of the draws of a session: delay, rate, fringe rate, SNR, correction, consistency."""
    out: Numbers = {}
    for word, r, e in (("prior", d.prior, d.errors.prior), ("post", d.post, d.errors.post)):
        delay, rate = np.abs(r.delay), np.abs(r.rate)
        out |= dict(_ends(f"{word}.delay_us", 1e6 * delay, "µs")) | dict(_ends(f"{word}.rate", rate, "s/s"))
        out |= dict(_ends(f"{word}.fringe_hz", BANDS[band] * rate, "Hz")) | dict(
            _ends(f"{word}.snr", getattr(signal, word))
        )
        out[f"{word}.delay_us.rms"] = 1e6 * assess.rms(delay), "µs"
        out[f"{word}.rate.rms"] = assess.rms(rate), "s/s"
        out[f"{word}.fringe_k_hz.rms"] = BANDS["K"] * assess.rms(rate), "Hz"
        out[f"{word}.position_m.rms"] = assess.rms(np.linalg.norm(e[:, :3], axis=1)), "m"
    out |= dict(_ends("change_us", 1e6 * (np.abs(d.prior.delay) - np.abs(d.post.delay)), "µs"))
    out |= dict(_ends("snr.ratio", signal.post / signal.prior))
    out |= dict(_ends("stage.ratio", signal.staged / signal.corrected))
    for kind in ("delay", "rate"):
        gain = np.abs(getattr(d.prior, kind)) / np.abs(getattr(d.post, kind))
        out |= dict(_ends(f"gain.{kind}", gain))
        out[f"share.{kind}.better"] = float(np.mean(gain > 1.0)), ""
        out[f"share.{kind}.tenfold"] = float(np.mean(gain >= 10.0)), ""
    scale = np.sqrt(np.diag(d.own))
    correlation = np.broadcast_to(d.own / np.outer(scale, scale), (len(d.errors.post), 6, 6))
    out["nees_ratio"] = float(np.mean(nees(d.errors.post / scale, correlation))) / 6.0, ""
    difference = (d.errors.post - d.errors.prior)[:, :3]
    parts = assess.correction(d.errors.prior[:, :3], d.errors.post[:, :3], d.source)
    for k, axis in enumerate(("dx", "dy", "dz")):
        out |= dict(_ends(f"correction.{axis}_m", np.abs(difference[:, k]), "m"))
    out |= dict(_ends("correction.total_m", parts.total, "m"))
    out |= dict(_ends("correction.across_share", parts.across / parts.total))
    return out


def _ends(name: str, values: Array, unit: str = "") -> Iterator[tuple[str, tuple[float, str]]]:
    for word, value in zip(("low", "median", "high"), np.quantile(values, _ENDS), strict=True):
        yield f"{name}.{word}", (float(value), unit)


def jointly(d: Draws, before: float, after: float, change: float, factor: float = 2.0) -> Numbers:
    """Shares of the draws that meet printed rates [s/s] before and after and a change of the delay [s].

    Each within a factor: alone, together, and the product of the three, which independent numbers would have.
    """
    given = (
        ("before", np.abs(d.prior.rate) / before),
        ("after", np.abs(d.post.rate) / after),
        ("change", (np.abs(d.prior.delay) - np.abs(d.post.delay)) / change),
    )
    met = {name: (ratio >= 1.0 / factor) & (ratio <= factor) for name, ratio in given}
    out: Numbers = {f"joint.{name}": (float(np.mean(hits)), "") for name, hits in met.items()}
    out["joint.share"] = float(np.mean(np.all(list(met.values()), axis=0))), ""
    out["joint.product"] = float(np.prod([np.mean(hits) for hits in met.values()])), ""
    return out


@functools.lru_cache(maxsize=4)
def of_orbit(orbit: str) -> Numbers:
    """Numbers of the geometry alone: apogee, light times, distances, elevations, and Figure 5 along the circle.

    The elevations are the lowest at the station in both passes and at each telescope during the observation.
    """
    out: Numbers = {}
    for name in (*SESSIONS, "BB"):
        session = orbits.on_orbit(name, orbit)
        dynamics, key = world(session), name.lower()
        times = np.unique([*np.ravel(session.passes), *session.observation, session.middle])
        states = dynamics.propagate(nominal_state(session, dynamics), times).y
        distance = np.linalg.norm(states[:, :3], axis=1)
        for word, k in (("first", 0), ("second", 2), ("middle", 5)):
            out[f"{key}.distance.{word}_m"] = float(distance[k]), "m"
        seen = [elevations(dynamics, times[:4], states[:4], session.station)]
        seen += [elevations(dynamics, times[4:], states[4:], t) for t in session.telescopes]
        out[f"{key}.elevation.station_deg"] = float(np.degrees(seen[0].min())), "deg"
        out[f"{key}.elevation.telescope_deg"] = float(np.degrees(min(x.min() for x in seen[1:]))), "deg"
        if name == "ST":
            out["displacement_m"] = float(np.linalg.norm(states[0, 3:]) * distance[0]) / C_LIGHT, "m"
    out["lowest_elevation_deg"] = min(value for key, (value, _) in out.items() if ".elevation." in key), "deg"
    a, e = orbits.on_orbit("ST", orbit).elements[:2]
    out |= {"apogee_m": (a * (1.0 + e), "m"), "light_time_apogee_s": (a * (1.0 + e) / C_LIGHT, "s")}
    bc = orbits.on_orbit("BC", orbit)
    made = [
        1e6 * abs(float((PRINTED_CORRECTION * [1.0, 1.0, sign]) @ orbits.circle(bc, angle))) / C_LIGHT
        for angle in range(0, 360, 5)
        for sign in (1.0, -1.0)
    ]
    return out | {
        "bc.printed.delay_us.smallest": (min(made), "µs"),
        "bc.printed.delay_us.largest": (max(made), "µs"),
    }


def numbers(reading: Reading, draws: int = 2000, correlated: int = 100, seed: int = 1) -> Numbers:
    """All numbers of a reading: of the geometry, and of each session from draws of its own stream.

    correlated : how many of the draws are correlated, for SNR.
    """
    out = dict(of_orbit(reading.orbit))
    bands = {"ST": "L", "OE": "C", "BC": reading.band}
    for k, name in enumerate(SESSIONS):
        rng = np.random.default_rng([seed, k])
        d = draw(name, reading, draws, rng)
        setup = Setup(bands[name], reading.bandwidth, 256)
        signal = signals(d, setup, SNR_FREE[name], rng, correlated, reading.stage)
        found = session_numbers(d, signal, bands[name])
        if name == "ST":
            found |= jointly(d, 1.8e-10, 2.0e-11, 1e-6)
            large = draw(name, reading, draws, np.random.default_rng([seed, k]), LARGE)
            found["large_prior.delay_us.rms"] = 1e6 * assess.rms(large.post.delay), "µs"
            found["large_prior.rate.rms"] = assess.rms(large.post.rate), "s/s"
        if name == "BC":
            found |= jointly(d, 1.35e-10, 1.35e-10, 6e-6)
        out |= {f"{name.lower()}.{key}": value for key, value in found.items()}
    return out


def printed(given: Numbers) -> list[list[str | float]]:
    """Rows of `PRINTED`: words, printed number, 5 %, median and 95 % of ours, and whether it lies between."""
    rows = []
    for words, value, key in PRINTED:
        low, median, high = (given[f"{key}.{end}"][0] for end in ("low", "median", "high"))
        rows.append([words, value, low, median, high, "yes" if low <= value <= high else "no"])
    return rows


def around(name: str, reading: Reading, angles: Array, draws: int = 2000, seed: int = 1) -> dict[str, Array]:
    """Gains and rates of a session with its source at each position angle (k,) [deg] of the circle.

    better, tenfold : shares of the draws;  median : gain of the rate;  rate : rms after the filter [s/s];  dec [deg].
    """
    rows = []
    for angle in angles:
        d = draw(name, replace(reading, angle=float(angle)), draws, np.random.default_rng([seed, 0]))
        gain = assess.gain(d.prior.rate, d.post.rate)
        rows.append(
            (gain.better, gain.tenfold, gain.median, assess.rms(d.post.rate), np.degrees(np.arcsin(d.source[2])))
        )
    return dict(
        zip(("better", "tenfold", "median", "rate", "dec"), map(np.array, zip(*rows, strict=True)), strict=True)
    )
