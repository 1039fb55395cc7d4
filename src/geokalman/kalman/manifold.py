"""Filtering on a manifold: the error lives in a tangent space, R^n, and a retraction puts its estimate back into the
state.

x_true = x [+] d with the error d ~ N(0, P). Prediction maps the error by its transition matrix, an update estimates d
and resets it into the state, and the smoother estimates d again from the next epoch. The compiled steps know the error
only; the loop around them holds the state (an attitude quaternion, say) and its retraction. `filter_manifold` and
`smooth_manifold` are that loop for any manifold, in Python.

Source: Lefferts, Markley & Shuster (1982), J. Guidance 5(5), 417-429; Hertzberg et al. (2013), Information Fusion 14,
57-77.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from geokalman.kalman.checks import NotPositiveDefinite, array, covariance
from geokalman.kalman.linear import predict_step, update_step
from geokalman.kalman.smoothing import rts_step


@njit(cache=True)
def error_predict_step(P: np.ndarray, A: np.ndarray, Q: np.ndarray, P_out: np.ndarray) -> None:
    """Propagate the covariance of the error through d_next = A d + w, w ~ N(0, Q): P_out = A P A' + Q.

    P, A, Q, P_out : (n, n); P_out must not overlap the others. The state itself is propagated by its own law.
    """
    n = P.shape[0]
    predict_step(np.zeros(n), P, A, Q, np.empty(n), P_out)


@njit(cache=True)
def error_update_step(
    P: np.ndarray,
    residual: np.ndarray,
    H: np.ndarray,
    R: np.ndarray,
    d: np.ndarray,
    S: np.ndarray,
    whitened: np.ndarray,
) -> int:
    """Condition the error, of mean zero, on m observations with residual = H d + v, v ~ N(0, R) (Joseph form).

    P : (n, n) in place; residual, whitened : (m,); H : (m, n); R, S : (m, m); d : (n,) output, to be retracted into the
    state.
    Returns 0, or k >= 1 when S is not positive definite in row k - 1 (P is then unchanged and d zero).
    """
    for j in range(d.shape[0]):
        d[j] = 0.0
    return update_step(d, P, residual, H, R, S, whitened)


@njit(cache=True)
def error_rts_step(
    P: np.ndarray,
    P_predicted: np.ndarray,
    A: np.ndarray,
    Q: np.ndarray,
    d_next: np.ndarray,
    P_next: np.ndarray,
    d: np.ndarray,
    P_out: np.ndarray,
) -> int:
    """One backward step of the RTS smoother on a manifold: d = C d_next, C = P A' P_predicted^-1, to be retracted at
    this epoch.

    d_next : (n,) smoothed minus predicted state of the next epoch, in the tangent space of the predicted one;
    P : filtered at this epoch; P_predicted, A, Q : of the step to the next; P_next : smoothed there. d : (n,), P_out : (n, n) outputs.
    Returns 0, or k >= 1 when P_predicted is not positive definite in row k - 1.
    """
    n = P.shape[0]
    zero = np.zeros(n)
    return rts_step(zero, P, zero, P_predicted, A, Q, d_next, P_next, d, P_out)


class Manifold(NamedTuple):
    """retract(x, d) = x [+] d, a state from a state and an error (n,); local(x, y) = y [-] x, the error that leads from
    x to y."""

    retract: Callable[[Any, np.ndarray], Any]
    local: Callable[[Any, Any], np.ndarray]


@dataclass(frozen=True, slots=True)
class Course:
    """A filter's course on a manifold: states before and after the update (lists of N), covariances (N, n, n) of their
    errors.

    transition, process_noise : (N - 1, n, n) of the step from epoch k to k + 1; whitened : innovation of each epoch,
    None in gaps.
    """

    predicted: list[Any]
    predicted_cov: np.ndarray
    state: list[Any]
    cov: np.ndarray
    whitened: list[np.ndarray | None]
    transition: np.ndarray
    process_noise: np.ndarray


Observed = tuple[np.ndarray, np.ndarray, np.ndarray]


def filter_manifold(
    manifold: Manifold,
    start: Any,
    cov: np.ndarray,
    epochs: int,
    propagate: Callable[[int, Any], tuple[Any, np.ndarray, np.ndarray]],
    observe: Callable[[int, Any], Observed | None],
) -> Course:
    """Error-state Kalman filter over a number of epochs.

    start, cov : state and (n, n) covariance of its error before the observation of epoch 0;
    propagate(k, x) -> (x_next, A, Q) : state at epoch k + 1, transition and noise of the error;
    observe(k, x) -> (residual (m,), H (m, n), R (m, m)) at the predicted state, or None where there is no observation.
    Returns the Course. Raises ValueError for arrays that do not fit, NotPositiveDefinite with the epoch.
    """
    P = covariance("cov", cov)
    n = len(P)
    x = start
    predicted, state, whitened = [], [], []
    predicted_cov, covs = np.empty((epochs, n, n)), np.empty((epochs, n, n))
    transition, noise = np.empty((max(epochs - 1, 0), n, n)), np.empty((max(epochs - 1, 0), n, n))
    for k in range(epochs):
        if k:
            x, A, Q = propagate(k - 1, x)
            transition[k - 1], noise[k - 1] = array("A", A, n, n), covariance("Q", Q, n)
            error_predict_step(covs[k - 1], transition[k - 1], noise[k - 1], predicted_cov[k])
        else:
            predicted_cov[0] = P
        predicted.append(x)
        covs[k] = predicted_cov[k]
        seen = observe(k, x)
        if seen is None:
            whitened.append(None)
        else:
            residual = array("residual", seen[0], None)
            m = len(residual)
            d, w = np.empty(n), np.empty(m)
            if error_update_step(
                covs[k], residual, array("H", seen[1], m, n), covariance("R", seen[2], m), d, np.empty((m, m)), w
            ):
                raise NotPositiveDefinite("innovation covariance", k)
            x = manifold.retract(x, d)
            whitened.append(w)
        state.append(x)
    return Course(predicted, predicted_cov, state, covs, whitened, transition, noise)


def smooth_manifold(manifold: Manifold, course: Course) -> tuple[list[Any], np.ndarray]:
    """Rauch-Tung-Striebel smoother over a Course: states (list of N) and covariances (N, n, n) of their errors.

    Raises NotPositiveDefinite with the epoch whose predicted covariance is not.
    """
    states, covs = list(course.state), course.cov.copy()
    for k in range(len(states) - 2, -1, -1):
        d_next = array("local(x, y)", manifold.local(course.predicted[k + 1], states[k + 1]), covs.shape[-1])
        d = np.empty(len(d_next))
        status = error_rts_step(
            course.cov[k],
            course.predicted_cov[k + 1],
            course.transition[k],
            course.process_noise[k],
            d_next,
            covs[k + 1],
            d,
            covs[k],
        )
        if status:
            raise NotPositiveDefinite("predicted covariance", k + 1)
        states[k] = manifold.retract(course.state[k], d)
    return states, covs
