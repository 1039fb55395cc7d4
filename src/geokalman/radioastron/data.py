"""What an estimator may see and assume: the data of a session, the levels of noise and prior, the weights.

The sizes are assumptions of radioastron-orbit section 3; the paper prints none.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geokalman.constants import GM_EARTH, R_EARTH
from geokalman.kalman.checks import plain, scalar, whole
from geokalman.radioastron.model import Array, find_station

LONGEST_GAP = 86400.0
"""Longest pause between measurements [s] that an estimator bridges."""
FIRST_DAY, LAST_DAY = 36934, 88069
"""Modified Julian dates of 1960 and 2100."""
LIMITS = {"range": (1e5, 1e10, "m"), "rate": (-2e4, 2e4, "m/s")}
"""What a measurement of a satellite of the Earth lies between; outliers do, nulls do not."""
NULLS = (-999.0, -9999.0, 9999.0)
"""Numbers between these limits that are written where there is none."""
RATE_DISAGREEMENT = 0.1
"""Largest difference [m/s] between range-rates and the slope of ranges that noise, bias or an outlier may make."""


def _positive(name: str, value: float) -> None:
    value = scalar(name, value)
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} = {value:g} must be a positive finite sigma.")


@dataclass(frozen=True)
class Scenario:
    """Noise of the data and size of the errors before: SI.

    prior_position [m], prior_velocity [m/s], sigma_range [m], sigma_rate [m/s] (noise of each datum), bias ("none",
    "common" or "per-pass") with sigmas bias_range [m] and bias_rate [m/s]; unmodelled forces: relative error of solar
    pressure, constant acceleration [m s^-2], one impulse [m/s], each 0 where it is absent. Raises ValueError for a
    sigma that is not positive, a force that is negative, or an unknown bias.
    """

    prior_position: float = 2000.0
    prior_velocity: float = 0.05
    sigma_range: float = 10.0
    sigma_rate: float = 1e-3
    bias: str = "common"
    bias_range: float = 20.0
    bias_rate: float = 0.3e-3
    pressure_error: float = 0.1
    acceleration: float = 3e-9
    impulse: float = 5e-3

    def __post_init__(self) -> None:
        for name in ("prior_position", "prior_velocity", "sigma_range", "sigma_rate", "bias_range", "bias_rate"):
            _positive(name, getattr(self, name))
        for name in ("pressure_error", "acceleration", "impulse"):
            value = scalar(name, getattr(self, name))
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(
                    f"{name} = {value:g} is the size of an unmodelled force; it must be finite, 0 or more."
                )
        if self.bias not in ("none", "common", "per-pass"):
            raise ValueError(f"bias = {self.bias!r} is unknown; give none, common or per-pass.")

    @classmethod
    def from_parameters(cls, p: dict[str, Any], **changes: Any) -> Scenario:
        """The levels of a notebook's parameters."""
        names = {
            "prior_pos_m": "prior_position", "prior_vel_m_s": "prior_velocity", "sigma_range_m": "sigma_range",
            "sigma_rate_m_s": "sigma_rate", "bias": "bias",
        }  # fmt: skip
        return cls(**{ours: p[theirs] for theirs, ours in names.items() if theirs in p} | changes)

    @property
    def prior_cov(self) -> Array:
        """Diagonal covariance (6, 6) of the a-priori state."""
        return np.diag([self.prior_position**2] * 3 + [self.prior_velocity**2] * 3)


@dataclass(frozen=True)
class Tuning:
    """What an estimator assumes: sigmas of range [m] and range-rate [m/s], and of biases where it estimates them."""

    sigma_range: float = 50.0
    sigma_rate: float = 3e-3
    estimate_bias: bool = False
    bias_range: float = 20.0
    bias_rate: float = 0.3e-3

    def __post_init__(self) -> None:
        for name in ("sigma_range", "sigma_rate", "bias_range", "bias_rate"):
            _positive(name, getattr(self, name))

    @classmethod
    def from_parameters(cls, p: dict[str, Any], **changes: Any) -> Tuning:
        """The weights of a notebook's parameters; where they are None, the noise of the data."""
        noise = {"sigma_range": "sigma_range_m", "sigma_rate": "sigma_rate_m_s"}
        given = {k: p[name] if p.get(f"filter_{name}") is None else p[f"filter_{name}"] for k, name in noise.items()}
        return cls(**given | {"estimate_bias": p.get("estimate_bias", False)} | changes)


NAIVE = Tuning(10.0, 1e-3)
"""R = 10/1: the noise of the data and nothing for what else is wrong."""
INFLATED = Tuning(50.0, 3e-3)
"""R = 50/3, the recommended default: it makes room for the bias."""


@dataclass(frozen=True)
class Observations:
    """What an estimator may see: two-way ranges and range-rates of one or more stations, and an a-priori state.

    t (n,) reception times [s since 0h UTC of day, a modified Julian date], sorted; several stations may share a time;
    station (n,) index into stations; arc (n,) number of the pass; range (n,) half of the two-way range [m]; rate (n,)
    its rate [m/s], positive when receding; NaN where missing; prior_mean (6,), prior_cov (6, 6) at t[0] [m, m/s].
    Masked ranges and rates are missing ones. Raises ValueError, one sentence each: units, dates and text, nulls,
    shapes, infinities, times unsorted or doubled, an empty pass, a gap over a day, a covariance that is none, a state
    inside the Earth or unbound, and ranges that are in km, of the whole way, or of the wrong sign. Warns when there is
    one pass alone, which leaves the state undetermined across the line of sight.
    """

    t: Array
    station: NDArray[np.int64]
    arc: NDArray[np.int64]
    range: Array
    rate: Array
    stations: tuple[str, ...]
    prior_mean: Array
    prior_cov: Array
    day: int

    def __post_init__(self) -> None:
        for name in ("t", "range", "rate", "prior_mean", "prior_cov"):
            object.__setattr__(self, name, plain(name, getattr(self, name), missing=name in LIMITS))
        for name in ("station", "arc"):
            object.__setattr__(self, name, _indices(name, getattr(self, name)))
        object.__setattr__(self, "day", whole("day", self.day))
        if not FIRST_DAY <= self.day <= LAST_DAY:
            raise ValueError(f"day = {self.day} is no modified Julian date from {FIRST_DAY} to {LAST_DAY}.")
        self._check_shapes()
        for name in LIMITS:
            self._check_values(name)
        if np.isnan(self.range).all() and np.isnan(self.rate).all():
            raise ValueError("every measurement is missing: the pass is empty.")
        self._check_times()
        for name in self.stations:
            find_station(name)
        check_prior(self.prior_mean, self.prior_cov)
        self._check_ranges()
        self._check_rates()
        if len(np.unique(self.arc)) < 2:
            warnings.warn(
                "one pass alone leaves the orbit undetermined across the line of sight; "
                "the a-priori state decides there", stacklevel=3,
            )  # fmt: skip

    def _check_shapes(self) -> None:
        if self.t.ndim != 1:
            raise ValueError(f"t has shape {self.t.shape}; it must be (n,).")
        n = len(self.t)
        if n == 0:
            raise ValueError("there is no measurement: the pass is empty.")
        for name in ("station", "arc", "range", "rate"):
            if getattr(self, name).shape != (n,):
                raise ValueError(f"{name} has shape {getattr(self, name).shape}; with {n} times it must be ({n},).")
        count = len(self.stations)
        if (k := _first((self.station < 0) | (self.station >= count))) is not None:
            raise ValueError(
                f"station at index {k} is {self.station[k]}, an index into the {count} stations is needed."
            )

    def _check_values(self, name: str) -> None:
        """Refuse infinities, and nulls and impossible sizes where they are few: where many, the unit is another."""
        values, (low, high, unit) = getattr(self, name), LIMITS[name]
        if (k := _first(np.isinf(values))) is not None:
            raise ValueError(f"{name} at index {k} is infinite; a missing one is NaN.")
        bad = (values < low) | (values > high) | np.isin(values, NULLS)
        if 2 * bad.sum() < len(values) and (k := _first(bad)) is not None:
            raise ValueError(
                f"{name} at index {k} is {values[k]:g} {unit}, a null or not between {low:g} and {high:g} {unit}; "
                "a missing one is NaN."
            )

    def _check_times(self) -> None:
        t = self.t
        if (k := _first(~np.isfinite(t))) is not None:
            raise ValueError(f"time at index {k} is not finite.")
        step = np.diff(t, prepend=t[0])
        if (k := _first(step < 0.0)) is not None:
            raise ValueError(f"time {t[k]:g} s at index {k} is before the one ahead of it; sort the measurements.")
        if (k := _first((step[1:] == 0.0) & (np.diff(self.station) == 0))) is not None:
            name = self.stations[self.station[k]]
            raise ValueError(f"station {name} measures twice at {t[k]:g} s (index {k + 1}); drop the duplicate.")
        if (k := _first(step[1:] > LONGEST_GAP)) is not None:
            raise ValueError(
                f"the gap of {step[k + 1]:g} s after {t[k]:g} s is longer than a day; estimate arc by arc."
            )

    def _check_ranges(self) -> None:
        """Hold the first range against the distance of the a-priori state: another unit shows."""
        seen = np.flatnonzero(np.isfinite(self.range))
        if not seen.size:
            return
        k = seen[0]
        value, expected = self.range[k], float(np.linalg.norm(self.prior_mean[:3]))
        spread = 2.0 * R_EARTH + 10.0 * math.sqrt(np.trace(self.prior_cov[:3, :3]))
        if abs(value - expected) <= spread:
            return
        hint = "check the units"
        for factor, words in (
            (1e-3, "it seems to be in km"),
            (2.0, "it seems to be the whole way up and down, not half"),
            (1e3, "it seems to be in mm"),
        ):
            if abs(value / factor - expected) <= spread:
                hint = words
        raise ValueError(
            f"range {value:.6g} m at index {k} is {value / expected:.4g} times the distance {expected:.6g} m of the "
            f"a-priori state: {hint}."
        )

    def _check_rates(self) -> None:
        """Hold the range-rates of each pass against the slope of its ranges: another sign or link shows."""
        seen = np.isfinite(self.range) & np.isfinite(self.rate)
        for arc in np.unique(self.arc):
            for station in np.unique(self.station):
                rows = np.flatnonzero((self.arc == arc) & (self.station == station) & seen)
                if len(rows) < 5:
                    continue
                t, y = (values[rows] - values[rows].mean() for values in (self.t, self.range))
                fit, (squares, *_) = np.polynomial.polynomial.polyfit(t, y, 2, full=True)
                spread = math.sqrt(float(np.sum(squares)) / max(1, len(rows) - 3) / (t @ t))
                rate, slope = float(np.median(self.rate[rows])), fit[1]
                limit = max(RATE_DISAGREEMENT, 6.0 * spread)
                if abs(rate - slope) <= limit:
                    continue
                hint = "a constant near 0.2 m/s means that one-way Doppler was given to the two-way model"
                if abs(rate + slope) <= limit:
                    hint = "their sign is that of a Doppler; a range-rate is positive when receding"
                elif abs(rate - slope) > 1.0:
                    hint = "check the units and the times of both"
                raise ValueError(
                    f"the range-rates of {self.stations[station]} in pass {arc + 1}, {rate:.4f} m/s, disagree with "
                    f"the slope {slope:.4f} m/s of its ranges: {hint}."
                )


def _first(bad: NDArray[np.bool_]) -> int | None:
    """Index of the first that is bad, if any is."""
    return int(bad.argmax()) if bad.any() else None


def _indices(name: str, value: Any) -> NDArray[np.int64]:
    """Whole numbers (n,), from what `plain` admits."""
    out = plain(name, value)
    if not (np.isfinite(out).all() and (out == np.floor(out)).all()):
        raise ValueError(f"{name} holds numbers that are not whole; indices are needed.")
    return out.astype(np.int64)


def check_prior(mean: Array, cov: Array) -> None:
    """Raise ValueError for an a-priori state (6,) inside the Earth or unbound, or a cov (6, 6) that is none."""
    if mean.shape != (6,) or not np.isfinite(mean).all():
        raise ValueError(f"the a-priori state must be six finite numbers, not {np.array2string(mean, threshold=8)}.")
    distance = float(np.linalg.norm(mean[:3]))
    if distance < R_EARTH:
        raise ValueError(f"the a-priori position is {distance / 1e3:.1f} km from the centre, inside the Earth.")
    if 0.5 * mean[3:] @ mean[3:] >= GM_EARTH / distance:
        raise ValueError("the a-priori velocity exceeds that of escape: e >= 1, no ellipse.")
    if cov.shape != (6, 6) or not np.isfinite(cov).all():
        raise ValueError(f"P(0) must be a finite (6, 6) matrix, it has shape {cov.shape}.")
    if np.abs(cov - cov.T).max() > 1e-9 * np.abs(cov).max():
        raise ValueError("P(0) is not symmetric.")
    sigma = np.sqrt(np.abs(np.diag(cov)))
    if not (np.diag(cov) > 0.0).all() or np.linalg.eigvalsh(cov / np.outer(sigma, sigma))[0] <= 0.0:
        raise ValueError("P(0) is not positive definite.")
