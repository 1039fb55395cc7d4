"""Crossovers of flight lines, the level of each line from them, and repeated passes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from geokalman.airborne.model import Array
from geokalman.leastsquares import NormalEquations


class Crossover(NamedTuple):
    """Where two tracks cross: names, and the places on each as fractions of epochs."""

    line: str
    tie: str
    i: float
    j: float


def crossing(a: Array, b: Array, stride: int = 10) -> tuple[float, float] | None:
    """Fractional epochs at which track a (n, 2) crosses track b (m, 2), or None; chords over `stride` epochs."""
    rows = [np.append(np.arange(0, len(x) - 1, stride), len(x) - 1) for x in (a, b)]
    p, q = a[rows[0]], b[rows[1]]
    r, s = np.diff(p, axis=0), np.diff(q, axis=0)
    det = r[:, None, 0] * s[None, :, 1] - r[:, None, 1] * s[None, :, 0]
    gap = q[None, :-1] - p[:-1, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        u = (gap[..., 0] * s[None, :, 1] - gap[..., 1] * s[None, :, 0]) / det
        v = (gap[..., 0] * r[:, None, 1] - gap[..., 1] * r[:, None, 0]) / det
    hit = np.argwhere((u >= 0) & (u < 1) & (v >= 0) & (v < 1))
    if len(hit) == 0:
        return None
    k, m = hit[0]
    return (
        float(rows[0][k] + u[k, m] * (rows[0][k + 1] - rows[0][k])),
        float(rows[1][m] + v[k, m] * (rows[1][m + 1] - rows[1][m])),
    )


def crossovers(lines: Mapping[str, Array], ties: Mapping[str, Array], margin_m: float = 0.0) -> list[Crossover]:
    """All crossings of lines with ties (tracks (n, 2) [m]) that lie at least `margin_m` along both from their ends."""
    out = []
    for name, track in lines.items():
        along = _along(track)
        for tie, other in ties.items():
            hit = crossing(track, other)
            if hit is None:
                continue
            across = _along(other)
            here, there = (
                np.interp(hit[0], np.arange(len(along)), along),
                np.interp(hit[1], np.arange(len(across)), across),
            )
            if min(here, along[-1] - here, there, across[-1] - there) >= margin_m:
                out.append(Crossover(name, tie, *hit))
    return out


def differences(points: Sequence[Crossover], values: Mapping[str, Array]) -> Array:
    """Line minus tie at each crossover, values interpolated linearly between epochs."""
    return np.array([_at(values[p.line], p.i) - _at(values[p.tie], p.j) for p in points])


def levels(points: Sequence[Crossover], values: Mapping[str, Array], sd_level: float = 100.0) -> dict[str, float]:
    """One level per line and tie, by least squares from the crossover differences; their sum is held by a weak prior.

    d = l_line - l_tie + e; sd_level : prior standard deviation of a level [mGal] against a unit error of d.
    Raises ValueError where there is no crossover.
    """
    if not points:
        raise ValueError("The lines do not cross: there is nothing to level by.")
    names = list(dict.fromkeys([p.line for p in points] + [p.tie for p in points]))
    d = differences(points, values)
    A = np.zeros((len(points), len(names)))
    for row, p in zip(A, points, strict=True):
        row[names.index(p.line)], row[names.index(p.tie)] = 1.0, -1.0
    normals = NormalEquations(len(names), names=names)
    normals.add(A, d)
    normals.regularise(1.0 / sd_level**2)
    return dict(zip(names, normals.factor().estimate[:, 0].tolist(), strict=True))


class Levelling(NamedTuple):
    """Levels of lines and ties, their drifts from end to end, and the crossovers by these [mGal].

    level, drift : by name, drift 0 where none is estimated; residual : (points,) after levelling; left_out : (points,)
    of each crossover when it takes no part in the levelling.
    """

    level: dict[str, float]
    drift: dict[str, float]
    residual: Array
    left_out: Array

    def of(self, name: str, epochs: int) -> Array:
        """What to take from the values of a line (epochs,) [mGal]."""
        return self.level.get(name, 0.0) + self.drift.get(name, 0.0) * (np.arange(epochs) / (epochs - 1) - 0.5)


def adjust(
    points: Sequence[Crossover],
    values: Mapping[str, Array],
    drift: bool = False,
    robust: bool = False,
    sd_level: float = 100.0,
    sd_drift: float = 10.0,
) -> Levelling:
    """Levels by least squares as `levels` gives them, with a drift of every line and Huber's weights where asked for.

    d = l_line - l_tie + s_line u_line - s_tie u_tie + e, u from -1/2 to 1/2 along a line;
    w = min(1, 1.5 s / |e|), s = 1.4826 median |e|, iterated. The residual of a point that is left out is
    e / (1 - w h), h its diagonal of A (A'WA + P^-1)^-1 A'.
    sd_level, sd_drift : prior standard deviations [mGal] against a unit error of d. Raises ValueError for no crossover.
    """
    if not points:
        raise ValueError("The lines do not cross: there is nothing to level by.")
    names = list(dict.fromkeys([p.line for p in points] + [p.tie for p in points]))
    d, m = differences(points, values), len(names)
    A = np.zeros((len(points), 2 * m if drift else m))
    for row, p in zip(A, points, strict=True):
        for name, sign, at in ((p.line, 1.0, p.i), (p.tie, -1.0, p.j)):
            row[names.index(name)] = sign
            if drift:
                row[m + names.index(name)] = sign * (at / (len(values[name]) - 1) - 0.5)
    prior = np.diag(np.repeat([sd_level, sd_drift], m)[: A.shape[1]] ** -2.0)
    w = np.ones(len(d))
    for _ in range(50 if robust else 1):
        N = A.T @ (w[:, None] * A) + prior
        x = np.linalg.solve(N, A.T @ (w * d))
        e = d - A @ x
        if robust:
            w = np.minimum(1.0, 1.5 * 1.4826 * np.median(np.abs(e)) / np.maximum(np.abs(e), 1e-12))
    h = np.einsum("ij,ji->i", A, np.linalg.solve(N, A.T))
    slopes = x[m:] if drift else np.zeros(m)
    return Levelling(
        dict(zip(names, x[:m].tolist(), strict=True)),
        dict(zip(names, slopes.tolist(), strict=True)),
        e,
        e / (1.0 - w * h),
    )


def levelled(values: Mapping[str, Array], level: Mapping[str, float]) -> dict[str, Array]:
    """The same values less the level of each line."""
    return {name: value - level.get(name, 0.0) for name, value in values.items()}


def common_track(tracks: Sequence[Array], step_m: float) -> tuple[Array, list[Array]]:
    """Repeated passes on one axis: distance along the common line [m] and each pass's own distance at its epochs (n,).

    The axis is the first principal direction of all places. Raises ValueError where the passes do not overlap.
    """
    places = np.vstack(tracks)
    centre = places.mean(axis=0)
    axis = np.linalg.svd(places[:: max(1, len(places) // 2000)] - centre, full_matrices=False)[2][0]
    along = [(track - centre) @ axis for track in tracks]
    low, high = max(x.min() for x in along), min(x.max() for x in along)
    if high - low < step_m:
        raise ValueError(f"The passes overlap on {high - low:.0f} m only.")
    return np.arange(low, high, step_m), along


def repeat_values(axis: Array, along: Sequence[Array], values: Sequence[Array]) -> Array:
    """Values of all passes on the common axis, (passes, points), each pass with its own mean removed; NaN stays."""
    out = np.empty((len(values), len(axis)))
    for row, x, value in zip(out, along, values, strict=True):
        order = np.argsort(x)
        row[:] = np.interp(axis, x[order], value[order])
    return out - np.nanmean(out, axis=1, keepdims=True)


def repeatability(passes: Array) -> float:
    """Standard deviation of a pass about the mean of all of them, (passes, points): sqrt of the mean variance, n -
    1.
    """
    return float(np.sqrt(np.nanmean(np.nanvar(passes, axis=0, ddof=1))))


def _along(track: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track, axis=0).T))])


def _at(values: Array, k: float) -> float:
    return float(np.interp(k, np.arange(len(values)), values))
