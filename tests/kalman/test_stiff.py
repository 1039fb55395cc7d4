"""Millimetre positions beside micrometre-per-second range-rates: accuracy, positive covariances, no drift.

The motion is that of a satellite pair, 9 states, the range-rate row fixed along the track, so that the problem is
linear and its exact posterior is known to 60 digits.
"""

from __future__ import annotations

import numpy as np
import pytest

from geokalman.kalman import (
    Information,
    Model,
    NotPositiveDefinite,
    Sensor,
    gaussian,
    run,
    smooth,
    smooth_information,
    smooth_two_filter,
    white_jerk,
)


class Pair:
    def __init__(self, epochs, variances, q=1.74897e-10, gap=True, seed=0):
        rng, h = np.random.default_rng(seed), 30.0
        self.t = h * np.arange(epochs)
        phase = 1.1e-3 * self.t
        r = 2e5 * np.column_stack([np.cos(phase), np.sin(phase), 0.05 * np.sin(2 * phase)])
        v = np.gradient(r, self.t, axis=0)
        rho = np.linalg.norm(r, axis=1, keepdims=True)
        e = r / rho
        rate = (e * v).sum(1, keepdims=True)
        self.H = np.zeros((epochs, 4, 9))
        self.H[:, :3, :3] = np.eye(3)
        self.H[:, 3, :3], self.H[:, 3, 3:6] = (v - rate * e) / rho, e
        self.R = np.diag([1e-6, 1e-6, 1e-6, 1e-12])
        self.transition = white_jerk(h, q)
        self.prior = gaussian(np.r_[r[0], v[0], 0.0, 0.0, 0.0], np.repeat(variances, 3))
        x = self.prior.mean + np.repeat(np.minimum(np.sqrt(variances), [100.0, 1.0, 1e-3]), 3) * rng.standard_normal(9)
        self.z = np.empty((epochs, 4))
        for k in range(epochs):
            if k:
                x = self.transition[0] @ x + np.linalg.cholesky(self.transition[1]) @ rng.standard_normal(9)
            self.z[k] = self.H[k] @ x + np.sqrt(np.diag(self.R)) * rng.standard_normal(4)
        if gap:
            self.z[3], self.z[5, 1] = np.nan, np.nan

    def filter(self, sequential=True):
        F, Q = self.transition
        return run(self.prior, self.t, Model(F=F, Q=Q), [Sensor(self.z, self.R, H=self.H, sequential=sequential)])

    def exact(self, posterior):
        N = len(self.t)
        Phi, Q = (np.broadcast_to(M, (N - 1, 9, 9)) for M in self.transition)
        return posterior(self.z, self.H, np.broadcast_to(self.R, (N, 4, 4)), Phi, Q, self.prior, digits=80)


def smallest_eigenvalue(cov):
    sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    return np.linalg.eigvalsh(cov / sigma[:, :, None] / sigma[:, None, :]).min()


def test_a_ten_kilometre_prior_beside_micrometres_per_second(posterior, close):
    """Variances from 1e8 m^2 down to 1e-12 m^2/s^2; coordinates of 2e5 m are rounded to 3e-8 of their millimetre."""
    pair = Pair(8, [1e8, 1e2, 1e-2])
    exact = pair.exact(posterior)
    for sequential in (True, False):
        course = pair.filter(sequential)
        assert smallest_eigenvalue(course.cov) > 0.0
        close(*course[-1], exact[0][-1], exact[1][-1], 1e-7)
        for s in (smooth(course), smooth_two_filter(course, pair.z, pair.H, pair.R)):
            close(s.mean, s.cov, *exact, 5e-6)
            assert smallest_eigenvalue(s.cov) > 1e-6


def test_a_prior_of_1e8_on_every_state_needs_the_information_form(posterior, close):
    """Known to 1e-9 in a direction across states of 1e4: 26 digits, more than any matrix of doubles can hold."""
    pair = Pair(8, [1e8, 1e8, 1e8])
    exact = pair.exact(posterior)
    prior = Information(pair.prior.mean / 1e8, np.eye(9) / 1e8)
    s = smooth_information(pair.t, pair.z, pair.H, pair.R, pair.transition, prior)
    close(s.mean, s.cov, *exact, 1e-7)
    assert smallest_eigenvalue(s.cov) > 1e-6
    for sequential in (True, False):
        with pytest.raises(NotPositiveDefinite, match="at epoch [1-9]"):
            smooth(pair.filter(sequential))


@pytest.fixture(scope="module")
def long_pair():
    return Pair(400, [1e-4, 1e-6, 1e-8], gap=False)


def test_unscented_filter_does_not_drift_from_the_linear_one(long_pair, close):
    """400 epochs of sequential position and range-rate; both smoothed covariances stay positive.

    A coordinate of 2e5 m is rounded to 6e-7 of the smallest standard deviation of its state: eight such ulp.
    """
    p = long_pair
    row = {float(t): H for t, H in zip(p.t, p.H, strict=True)}
    sensors = [
        Sensor(p.z[:, :3], p.R[:3, :3], lambda x, t: x[:3]),
        Sensor(p.z[:, 3:], p.R[3:, 3:], lambda x, t: row[t][3:] @ x),
    ]
    model = Model(f=lambda x, t0, t1: p.transition[0] @ x, Q=p.transition[1])
    unscented = run(p.prior, p.t, model, sensors, "unscented", alpha=1.0, beta=0.0, kappa=2.0)
    linear = p.filter()
    one, other = smooth(unscented), smooth(linear)
    sigma = np.sqrt(np.diagonal(other.cov, axis1=1, axis2=2)).min(axis=0)
    limit = 8 * (np.spacing(np.abs(other.mean).max(axis=0)) / sigma).max()
    close(unscented.mean, unscented.cov, linear.mean, linear.cov, limit)
    close(one.mean, one.cov, other.mean, other.cov, limit)
    for s in (one, other):
        assert smallest_eigenvalue(s.cov) > 0.0


def test_tight_weights_keep_smoothed_covariances_positive():
    """Tight weights (q = 1e-6, 1e-6 m/s): P + C (P_next - P_predicted) C' has lost its sign here before."""
    pair = Pair(300, [1e-4, 1e-6, 1e-8], q=1e-6, gap=False)
    for sequential in (True, False):
        course = pair.filter(sequential)
        s = smooth(course)
        assert smallest_eigenvalue(course.cov) > 0.0 and smallest_eigenvalue(s.cov) > 0.0
        sigma = np.sqrt(np.diagonal(course.cov, axis1=1, axis2=2))
        assert (np.sqrt(np.diagonal(s.cov, axis1=1, axis2=2)) <= sigma * (1 + 1e-9)).all()
