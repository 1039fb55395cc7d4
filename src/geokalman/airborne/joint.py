"""One field for a whole survey: a two-dimensional estimate from all lines at once.

Gravity is a sum of plane waves on a periodic box; along each line it is a spline, doubly integrated. A Kalman filter
without gravity states (dv, dh, tau3, k1 to k3, a bias) whitens these columns and z; its whitened rows are ordinary
observation equations, to which the prior of the waves is added before one solve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from geokalman import memory, progress
from geokalman.airborne.estimate import innovation_log_likelihood
from geokalman.airborne.model import Array, Tuning, build
from geokalman.airborne.read import SurveyLine
from geokalman.kalman.whitening import whiten_columns
from geokalman.leastsquares import NormalEquations, Solution


@dataclass(frozen=True)
class Waves:
    """Plane waves |n| <= n_max on a periodic box, their upward continuation and the prior variances of amplitudes.

    Variance of a wave of wave number k, with k_0 = 2 pi / box and s_1, s_2 such that the variances add up to sigma^2
    and fine^2:  sigma^2 s_1 exp(-2 k depth) / (k^2 + k_0^2)^power + fine^2 s_2 exp(-2 k fine_depth).
    box, depth, fine_depth, height : [m]; sigma, fine : [mGal]; height is where the amplitudes are given.
    """

    n_max: int = 27
    box: float = 40e3
    sigma: float = 46.0
    depth: float = 588.0
    power: float = 1.93
    fine: float = 0.24
    fine_depth: float = 1029.0
    height: float = 330.0
    numbers: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.n_max < 1 or self.box <= 0:
            raise ValueError(f"n_max = {self.n_max} and box = {self.box:g} m: both must be positive.")
        n = np.arange(-self.n_max, self.n_max + 1)
        nx, ny = (a.ravel() for a in np.meshgrid(n, n, indexing="ij"))
        half = (nx**2 + ny**2 <= self.n_max**2) & ((nx > 0) | ((nx == 0) & (ny >= 0)))
        object.__setattr__(self, "numbers", np.column_stack([nx[half], ny[half]]))

    @property
    def k(self) -> Array:
        """Wave numbers [rad/m] of the pairs of cosine and sine, the constant first among those with n_x = 0."""
        return 2 * np.pi / self.box * np.hypot(*self.numbers.T)

    @property
    def count(self) -> int:
        """Number of unknowns: a cosine for every wave, a sine for all but the constant."""
        return 2 * len(self.numbers) - 1

    def variances(self) -> Array:
        """Prior variances (count,) of the amplitudes [mGal^2]."""
        k = self._unknowns(self.k)
        red = np.exp(-2 * k * self.depth) / (k**2 + (2 * np.pi / self.box) ** 2) ** self.power
        fine = np.exp(-2 * k * self.fine_depth)
        return self.sigma**2 * red / red.sum() + self.fine**2 * fine / fine.sum()

    def rows(self, east: Array, north: Array, height: Array) -> Array:
        """Values (n, count) of all waves at places [m]."""
        phases = [
            np.exp(2j * np.pi / self.box * x[:, None] * np.arange(-self.n_max, self.n_max + 1)) for x in (east, north)
        ]
        wave = phases[0][:, self.numbers[:, 0] + self.n_max] * phases[1][:, self.numbers[:, 1] + self.n_max]
        wave *= np.exp(-self.k * (np.asarray(height) - self.height)[:, None])
        constant = int(np.flatnonzero(self.k == 0)[0])
        return np.hstack([wave.real, np.delete(wave.imag, constant, axis=1)])

    def _unknowns(self, per_wave: Array) -> Array:
        return np.concatenate([per_wave, per_wave[self.k != 0]])


_SETTINGS = tuple(item.name for item in fields(Waves) if item.init)


@dataclass(frozen=True)
class Spline:
    """Cubic spline of a line: at : (m,) knots [s]; values : (n, m) at the epochs, `integrated` twice."""

    at: Array
    values: Array
    integrated: Array

    @classmethod
    def of(cls, t: Array, spacing: float) -> Spline:
        """The spline of the epochs t (n,) [s] with knots `spacing` [s] apart, shrunk to fit both ends."""
        knots = _knots(t, spacing)
        cardinal = CubicSpline(knots, np.eye(len(knots)))
        return cls(knots, cardinal(t), cardinal.antiderivative(2)(t))


def _knots(t: Array, spacing: float) -> Array:
    return np.linspace(t[0], t[-1], max(4, round((t[-1] - t[0]) / spacing) + 1))


@dataclass(frozen=True)
class LineRows:
    """Whitened observation equations of one line, compressed to a triangle: rows (m, count) of the waves, rhs (m,).

    log_likelihood : of the line without any gravity, up to a constant.
    """

    name: str
    rows: Array
    rhs: Array
    waves: Array
    values: Array
    log_likelihood: float


@dataclass(frozen=True)
class JointField:
    """The solved field: gravity along each line (name -> (n,)) [mGal], weights of the lines, amplitudes and the factor.

    unweighted : gravity along the lines before noisy ones were given less weight; log_likelihood : of all flight data
    under the settings, gravity integrated out, before any weighting, up to a constant of the data.
    """

    waves: Waves
    origin: tuple[float, float]
    solution: Solution
    gravity: dict[str, Array]
    unweighted: dict[str, Array]
    weights: dict[str, float]
    log_likelihood: float

    def at(self, easting: Array, northing: Array, height: Array) -> Array:
        """Gravity disturbance (n,) [mGal] at other places [m]."""
        rows = self.waves.rows(easting - self.origin[0], northing - self.origin[1], height)
        return rows @ self.solution.estimate[:, 0]

    def sigma_at(self, easting: Array, northing: Array, height: Array) -> Array:
        """Standard deviation (n,) [mGal] of gravity there, by the prior and the filter's noise."""
        rows = self.waves.rows(easting - self.origin[0], northing - self.origin[1], height)
        return np.sqrt(np.einsum("kn,nk->k", rows, self.solution.solve(np.ascontiguousarray(rows.T))))


def line_rows(
    flight: SurveyLine, tuning: Tuning, waves: Waves, origin: tuple[float, float], lag: float, knots_s: float
) -> LineRows:
    """Observation equations of one line: whitened by the filter without gravity, then reduced by a QR factorisation."""
    line = flight.line.lagged(lag)
    if tuning.sigma_mgal:
        raise ValueError(f"sigma_mgal = {tuning.sigma_mgal:g}: the whitening filter has no gravity, give 0.")
    model = build(line, tuning)
    spline = Spline.of(line.t, knots_s)
    columns = np.column_stack([spline.integrated, line.z])
    white = whiten_columns(model.prior.cov, line.t, model.H, model.R, (model.Phi, model.Q), columns)
    triangle = np.linalg.qr(white, mode="r")
    m = len(spline.at)
    place = (
        np.interp(spline.at, line.t, x)
        for x in (flight.easting - origin[0], flight.northing - origin[1], flight.height)
    )
    at_knots = waves.rows(*place)
    alone = innovation_log_likelihood(line, tuning)
    return LineRows(flight.name, triangle[:m, :m] @ at_knots, triangle[:m, m], at_knots, spline.values, alone)


def joint_field(
    flights: Sequence[SurveyLine],
    tuning: Tuning | None = None,
    waves: Waves | None = None,
    lag: float = 0.0155,
    knots_s: float = 5.0,
    weigh: bool = True,
) -> JointField:
    """Estimate one field from all lines; with `weigh`, noisy lines are solved for once more with less weight.

    The weight of a line is 1/r^2, r the rms of its whitened residuals over the median of all lines, at least 1.
    Raises ValueError for no lines or a tuning with gravity states, SingularNormalMatrix.
    """
    if not flights:
        raise ValueError("There are no lines to estimate a field from.")
    tuning, waves = tuning or Tuning.preset("joint"), waves or Waves()
    ends = [(min(c.min() for c in part), max(c.max() for c in part))
            for part in ([f.easting for f in flights], [f.northing for f in flights])]  # fmt: skip
    extent = [last - first for first, last in ends]
    if max(extent) > waves.box:
        raise ValueError(
            f"box = {waves.box:g} m is smaller than the survey, {extent[0]:.0f} m from west to east and {extent[1]:.0f}"
            " m from south to north."
        )
    origin = tuple(0.5 * (first + last) - waves.box / 2 for first, last in ends)
    rows = sum(len(_knots(flight.line.t, knots_s)) for flight in flights)
    memory.require(
        f"A field of {waves.count} unknowns",
        16.0 * waves.count * (waves.count + rows),
        "take a lower n_max or fewer lines",
    )
    parts = [line_rows(flight, tuning, waves, origin, lag, knots_s) for flight in flights]
    weights = np.ones(len(parts))
    solution = _solve(parts, weights, waves)
    unweighted, likelihood = _along(parts, solution), _log_likelihood(parts, solution, waves)
    if weigh:
        x = solution.estimate[:, 0]
        rms = np.array([np.sqrt(np.mean((part.rhs - part.rows @ x) ** 2)) for part in parts])
        weights = 1.0 / np.maximum(rms / np.median(rms), 1.0) ** 2
        solution = _solve(parts, weights, waves)
    return JointField(
        waves, origin, solution, _along(parts, solution), unweighted,
        {part.name: float(w) for part, w in zip(parts, weights, strict=True)}, likelihood,
    )  # fmt: skip


class Compared(NamedTuple):
    """A field with one setting changed: gravity along the lines [mGal], and the log-likelihood of the flight data."""

    gravity: dict[str, Array]
    log_likelihood: float


def compare(
    flights: Sequence[SurveyLine],
    tuning: Tuning,
    waves: Waves,
    lag: float,
    changes: Sequence[Sequence[tuple[str, float]]],
) -> list[Compared]:
    """The same lines under changed settings, each a list of (name, value): fields of Tuning or Waves, or `lag` [s^2].

    Raises ValueError for a setting that is none of these.
    """
    out = []
    for change in progress.track(changes, "settings"):
        of_waves = {name: value for name, value in change if name in _SETTINGS}
        of_noise = {name: value for name, value in change if name not in _SETTINGS and name != "lag"}
        unknown = [name for name in of_noise if not hasattr(tuning, name)]
        if unknown:
            raise ValueError(f"{unknown[0]!r} is no setting of a Tuning or of Waves, nor lag.")
        field = joint_field(
            flights, replace(tuning, **of_noise), replace(waves, **of_waves), dict(change).get("lag", lag), weigh=False
        )
        out.append(Compared(field.unweighted, field.log_likelihood))
    return out


def _along(parts: Sequence[LineRows], solution: Solution) -> dict[str, Array]:
    return {part.name: part.values @ (part.waves @ solution.estimate[:, 0]) for part in parts}


def _log_likelihood(parts: Sequence[LineRows], solution: Solution, waves: Waves) -> float:
    """log p(z) = sum over lines without gravity + (x' b - log det N - log det of the prior covariance) / 2."""
    gained = float(solution.estimate[:, 0] @ solution.rhs[:, 0])
    spread = solution.log_determinant + float(np.log(waves.variances()).sum())
    return sum(part.log_likelihood for part in parts) + 0.5 * (gained - spread)


def _solve(parts: Sequence[LineRows], weights: Array, waves: Waves) -> Solution:
    normals = NormalEquations(waves.count)
    for part, weight in zip(parts, weights, strict=True):
        normals.add(part.rows, part.rhs, weight)
    normals.regularise(1.0 / waves.variances())
    return normals.factor(overwrite=True)
