"""The backward pass in covariance form as the paper prints it, equations (4) to (6), with the starts one may read
into it.

Kept apart from `estimate`, whose information form needs none of this: here the start decides the result.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geokalman.airborne.estimate import States, run_filter
from geokalman.airborne.model import Array, Line, ScaledModel, Tuning, build
from geokalman.kalman.checks import NotPositiveDefinite
from geokalman.kalman.dense import root_semidefinite
from geokalman.kalman.gaussian import Trajectory
from geokalman.kalman.linear import predict_step, scalar_update_step
from geokalman.kalman.smoothing import smooth

STARTS = {
    "literal": "state 0, covariance 0, as printed",
    "wide": "state 0, covariance 1e4 P0",
    "prior": "dv and dh from the forward filter, the rest 0, covariance P0",
    "forward-certain": "forward final estimate, covariance 0",
    "forward": "forward final estimate, forward final covariance",
}
"""Readings of the start x_b(n/n-1), P_b(n/n-1), in covariance form; P_b^-1 = 0 is `estimate` with "two-filter"."""


@dataclass(frozen=True)
class BackwardStart:
    """Mean and covariance of the backward filter before it takes the last observation."""

    mean: Array
    cov: Array


def forward_backward(line: Line, tuning: Tuning, start: str) -> States:
    """Forward estimate and backward one-step prediction combined by (6), the backward filter started as `start` says.

    (4) correct by z_k, (5) x_b(k-1) = Phi^-1 x_b(k), P_b(k-1) = Phi^-1 (P_b(k) + Q) Phi^-T,
    (6) x_s = x + P (P + P_b)^-1 (x_b - x), P_s = (I - W) P (I - W)' + W P_b W', W = P (P + P_b)^-1.
    Raises ValueError for an unknown start, NotPositiveDefinite where (P + P_b) cannot be solved.
    """
    if start not in STARTS:
        raise ValueError(f"start {start!r} is unknown; the starts are {', '.join(STARTS)}.")
    model = build(line, tuning)
    forward = run_filter(line, model)
    N, n = forward.mean.shape
    first = _start(start, forward.mean[-1], forward.cov[-1], model.prior.cov)
    x, P = first.mean.copy(), first.cov.copy()
    mean, cov = np.empty((N, n)), np.empty((N, n, n))
    x_next, P_next = np.empty(n), np.empty((n, n))
    for k in range(N - 1, -1, -1):
        mean[k], cov[k] = combine(forward.mean[k], forward.cov[k], x, P, k)
        if not scalar_update_step(x, P, line.z[k] - model.H[0] @ x, model.H[0], model.R[0, 0]) > 0:
            raise NotPositiveDefinite("innovation covariance of the backward filter", k)
        if k:
            back = np.linalg.solve(model.Phi[k - 1], np.eye(n))
            predict_step(x, P, back, back @ model.Q @ back.T, x_next, P_next)
            x[:], P[:] = x_next, P_next
    return States(model.names, model.scale, line.t, mean, cov)


def ended_in_zero(model: ScaledModel, course: Trajectory) -> States:
    """The literal start without a backward filter: its certainty is that of a last state that is known to be zero.

    RTS from x_s(n) = 0, P_s(n) = 0 gives the numbers of `forward_backward` with the start "literal".
    model, course : of a line, and its forward filter.
    """
    mean, cov = course.mean.copy(), course.cov.copy()
    mean[-1], cov[-1] = 0.0, 0.0
    both = smooth(replace(course, mean=mean, cov=cov))
    return States(model.names, model.scale, both.t, both.mean, both.cov)


def combine(x: Array, P: Array, x_b: Array, P_b: Array, epoch: int = 0) -> tuple[Array, Array]:
    """Equation (6): the better known of the two estimates gets the larger weight.

    x, x_b : (n,); P, P_b : (n, n), P_b may be singular, even zero, where P is positive definite.
    Raises NotPositiveDefinite with the epoch.
    """
    n = len(x)
    total = P + P_b
    if root_semidefinite(total, np.empty((n, n))) != 0 or not (total.diagonal() > 0).all():
        raise NotPositiveDefinite("sum of the forward and backward covariances", epoch)
    W = np.linalg.solve(total, P).T
    keep = np.eye(n) - W
    return x + W @ (x_b - x), keep @ P @ keep.T + W @ P_b @ W.T


def _start(name: str, x: Array, P: Array, P0: Array) -> BackwardStart:
    zero = np.zeros_like(x)
    if name == "literal":
        return BackwardStart(zero, np.zeros_like(P))
    if name == "wide":
        return BackwardStart(zero, 1e4 * P0)
    if name == "prior":
        zero[:2] = x[:2]
        return BackwardStart(zero, P0)
    return BackwardStart(x, np.zeros_like(P) if name == "forward-certain" else P)
