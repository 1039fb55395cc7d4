"""The extended Kalman filter: the linear steps at the Jacobians of nonlinear f and h."""

from __future__ import annotations

import numpy as np

from geokalman.kalman.checks import array, covariance
from geokalman.kalman.gaussian import Gaussian, Innovation, gaussian
from geokalman.kalman.linear import joint_update_step, predict_step, refuse


def predict(posterior: Gaussian, f, F, Q) -> Gaussian:
    """Propagate a Gaussian through x_next = f(x) + w, w ~ N(0, Q), linearised at its mean.

    mean = f,   cov = F cov F' + Q.
    f : (n,) the propagated mean; F : (n, n) = df/dx; Q : (n, n), positive semidefinite. Returns the next prior.
    Raises ValueError for wrong shapes, values that are not finite, a Q that is no covariance.

    >>> from geokalman.kalman import gaussian
    >>> x = gaussian([2.0], [0.25])
    >>> predict(x, x.mean**2, [2.0 * x.mean], [[0.0]]).cov.item()
    4.0
    """
    x, P = gaussian(*posterior)
    n = len(x)
    P_out = np.empty((n, n))
    predict_step(x, P, array("F", F, n, n), covariance("Q", Q, n), np.empty(n), P_out)
    return Gaussian(array("f", f, n), P_out)


def update(prior: Gaussian, z, h, H, R) -> tuple[Gaussian, Innovation]:
    """Condition a Gaussian on z = h(x) + v, v ~ N(0, R), linearised at its mean.

    z, h : (m,), measured (NaN where missing) and predicted observation [sensor units]; H : (m, n) = dh/dx; R : (m, m).
    Returns the posterior and Innovation(residual, S, whitened), whitened ~ N(0, I) if the model is right.
    Raises ValueError for wrong shapes and infinite values, NotPositiveDefinite for S.
    Source: grace-fusion (18)-(20).

    >>> from geokalman.kalman import gaussian
    >>> x = gaussian([2.0], [0.25])
    >>> posterior, innovation = update(x, [5.0], x.mean**2, [2.0 * x.mean], [[4.0]])
    >>> posterior.mean.item(), posterior.cov.item()
    (2.125, 0.125)
    """
    x, P = gaussian(*prior)
    z = array("z", z, None, missing=True)
    m = len(z)
    H, R = array("H", H, m, len(x)), covariance("R", R, m)
    residual, S, whitened = z - array("h", h, m), H @ P @ H.T + R, np.full(m, np.nan)
    refuse(joint_update_step(x, P, residual, H, R, whitened))
    return Gaussian(x, P), Innovation(residual, 0.5 * (S + S.T), whitened)
