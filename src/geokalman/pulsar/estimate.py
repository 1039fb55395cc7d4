"""Filter the ranges: EKF, adaptive and robust EKFs, innovation weighting, UKF, and RTS.

One model for the core's `run`: the state by Runge-Kutta steps, its covariance by a chain of Markley's transition
matrices, (8) and (9). The core's hooks judge the prediction, (17) to (20), before the update, (21).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from geokalman.kalman import smoothing
from geokalman.kalman.adaptive import Adaptive
from geokalman.kalman.checks import NotPositiveDefinite, array, covariance
from geokalman.kalman.dense import copy_state
from geokalman.kalman.gaussian import Gaussian, Stopped, Trajectory
from geokalman.kalman.model import PROPAGATE, Model, Sensor
from geokalman.kalman.robust import thresholds
from geokalman.kalman.run import Kind
from geokalman.kalman.run import run as run_filter
from geokalman.physics.transition import chain_step, check_step, markley_step
from geokalman.pulsar.dynamics import GM, RADIUS, Force, gradient_point, runge_kutta_step, unpack
from geokalman.pulsar.model import STEP, Array, Belief
from geokalman.pulsar.observations import Observations

KINDS = {
    "ekf": None, "aekf1_prw": "ratio", "aekf1_pr3": "three_part", "aekf1_pr2": "two_part", "aekf2": "discrepancy",
    "raekf": "robust", "igg": "innovations", "ukf": None, "trace": "trace", "norm": "norm", "literal": "literal",
}  # fmt: skip
"""Hook of each filter: the paper's four (AEKF1 in three variants), `igg` with weighted innovations, `ukf`, and three
unwhitened traps."""
DIVERGED = 1e7
"""Position sigma or innovation [m] beyond which a filter has diverged."""


class Diverged(ArithmeticError):
    """A filter that lost its orbit; `epoch` is k, `why` what gave it away."""

    def __init__(self, epoch: int, why: str) -> None:
        self.epoch, self.why = epoch, why
        super().__init__(f"the filter diverged at epoch k = {epoch}: {why}.")

    def __reduce__(self):
        return Diverged, (self.epoch, self.why)


@dataclass(frozen=True)
class Tuning:
    """How a filter computes: thresholds of factors and weights, and its steps.

    k0, k1 : thresholds; floor : of the factor; substeps : of the transition matrix in 500 s; rk_step : longest step of
    the state [s], None for one Runge-Kutta step a substep.
    Raises ValueError for thresholds out of order, a floor outside (0, 1], and substeps too long for Markley's
    matrix unless allow_coarse; warns where they are long.
    """

    k0: float = 1.5
    k1: float = 2.5
    floor: float = 1e-3
    substeps: int = 50
    rk_step: float | None = 10.0
    allow_coarse: bool = False

    def __post_init__(self) -> None:
        thresholds(self.k0, self.k1)
        if not 0.0 < self.floor <= 1.0:
            raise ValueError(f"floor = {self.floor:g} of the adaptive factor must be above 0 and at most 1.")
        if self.substeps < 1:
            raise ValueError(f"substeps = {self.substeps} must be at least 1.")
        if self.rk_step is not None and not 0.0 < self.rk_step <= STEP:
            raise ValueError(f"rk_step = {self.rk_step:g} s must be above 0 and at most {STEP:g} s.")
        check_step(STEP / self.substeps, self.allow_coarse)


@dataclass(frozen=True)
class Estimate:
    """States of the orbiter at the epochs, and what the filter thought of them.

    t (n,) [s]; x (n, 6) [m, m/s] with covariances P (n, 6, 6); alpha (n,) adaptive factors; weights (n, m) of the
    observations, NaN where missing; nis (n,) normalised innovation squared, with S of the prediction before any
    adaptation, and observed (n,) how many ranges it counts; skipped (n,): the adaptation of this epoch was skipped,
    fewer than three independent pulsars. course : of the filter, with the initial estimate in its first row.
    """

    t: Array
    x: Array
    P: Array
    alpha: Array
    weights: Array
    nis: Array
    observed: Array
    skipped: Array
    course: Trajectory


def run(
    kind: str, data: Observations, x0: Array, belief: Belief, force: Force, tuning: Tuning | None = None,
    P0: Array | None = None, R: Array | None = None,
) -> Estimate:  # fmt: skip
    """Filter the observations from the initial estimate x0 (6,) [m, m/s].

    kind : a name of `KINDS`; belief, force : of start, noise and motion; P0 (6, 6), R (m, m) diagonal : instead of the
    belief's and the data's.
    Raises ValueError for an unknown kind and an R that is not diagonal, NotPositiveDefinite for a P0 or R that is no
    covariance, Diverged as `filtered`.

    >>> from geokalman.physics.harmonics import load_field
    >>> from geokalman.pulsar import assess, simulate
    >>> from geokalman.pulsar.dynamics import j2_force
    >>> from geokalman.pulsar.model import Mission, preset
    >>> mission, B, gravity = Mission(days=2.0), preset("B"), load_field("GMM2B")
    >>> flight = simulate.fly(mission, gravity, B.world.mismatch)
    >>> data = simulate.observe(flight, mission, B.world, np.random.default_rng(1))
    >>> start = flight.x0 + np.repeat([1000.0, 1.0], 3)  # wrong by 1 km and 1 m/s in every axis
    >>> result = run("ekf", data, start, B.belief, j2_force(gravity))
    >>> score = assess.score(result, flight)
    >>> score.d3 < 100.0, 0.7 < score.nees6 < 1.3  # 3-D rms [m], after the first 100 epochs
    (True, True)
    """
    if kind not in KINDS:
        raise ValueError(f"filter {kind!r} is unknown; the filters are {', '.join(KINDS)}.")
    tuning, hook = tuning or Tuning(), KINDS[kind]
    prior = Gaussian(array("x0", x0, 6), covariance("P0", belief.P0 if P0 is None else P0, 6))
    substep = STEP / tuning.substeps
    inner = 1 if tuning.rk_step is None else max(1, int(np.ceil(substep / tuning.rk_step - 1e-9)))
    lengths, which = np.unique(np.diff(data.t, prepend=0.0), return_inverse=True)
    noise = np.array([belief.process_noise(float(dt)) for dt in lengths])
    Q = noise[0] if len(noise) == 1 else noise[which]
    model = Model(f=_propagate, Q=Q, params=np.r_[substep, inner, force.packed])
    adaptive = Adaptive(by=hook, k0=tuning.k0, k1=tuning.k1, floor=tuning.floor) if hook else None
    return filtered(data, prior, model, force, R, "unscented" if kind == "ukf" else "extended", adaptive)


def filtered(
    data: Observations, prior: Gaussian, model: Model, force: Force, R: Array | None = None, kind: Kind = "extended",
    adaptive: Adaptive | None = None,
) -> Estimate:  # fmt: skip
    """Filter with a model whose state begins with [r, v].

    prior : at t = 0; R (m, m) diagonal, else the data's.
    Raises ValueError for an R that is not diagonal or not positive; Diverged with the first epoch where the predicted
    position is inside Mars, the orbit open, or sigma or innovation above 1e7 m, or where a covariance lost its root.
    """
    m = data.z.shape[1]
    R = np.diag(data.variance) if R is None else covariance("R", R, m)
    if np.count_nonzero(R - np.diag(np.diag(R))):
        raise ValueError("R has elements off its diagonal; the ranges to different pulsars must be uncorrelated.")
    if not (np.diag(R) > 0.0).all():
        raise ValueError(f"the diagonal of R is {np.diag(R).tolist()}; each element must be positive.")
    H = np.pad(data.H, ((0, 0), (0, len(prior.mean) - 3)))
    sensor = Sensor(np.vstack([np.full(m, np.nan), data.z]), R, H=H, sequential=False)
    try:
        spread = {"alpha": 1.0, "beta": 0.0, "kappa": -3.0}
        course = run_filter(prior, np.r_[0.0, data.t], model, [sensor], kind, **spread, adaptive=adaptive)
    except (NotPositiveDefinite, Stopped) as error:
        if error.course is None:
            raise
        require_orbit(error.course, data, force)
        if isinstance(error, Stopped):
            raise Diverged(error.epoch, "its state is not finite") from None
        later = error.matrix == "filtered covariance"  # sigma points of the next epoch were to be drawn from it
        raise Diverged(error.epoch + later, "its covariance lost its root") from None
    require_orbit(course, data, force)
    alpha = course.alpha[1:] if adaptive else np.ones(len(data.t))
    weights = course.weights[1:] if adaptive else np.where(np.isnan(data.z), np.nan, 1.0)
    skipped = np.isnan(alpha)
    return Estimate(
        data.t, course.mean[1:, :6], course.cov[1:, :6, :6], np.where(skipped, 1.0, alpha), weights,
        np.nansum(course.whitened[1:] ** 2, axis=1), np.isfinite(data.z).sum(axis=1), skipped, course,
    )  # fmt: skip


def smooth(forward: Estimate) -> Estimate:
    """Smooth a run (Rauch-Tung-Striebel): the honest meaning of "non-real-time".

    Raises NotPositiveDefinite with the time. The innovations stay those of the forward filter.
    """
    smoothed = smoothing.smooth(forward.course)
    return replace(forward, x=smoothed.mean[1:, :6], P=smoothed.cov[1:, :6, :6])


def require_orbit(course: Trajectory, data: Observations, force: Force) -> None:
    """Raise Diverged for the first prediction, if any, that is not that of an orbiter."""
    x, P = course.predicted_mean[1:], course.predicted_cov[1:]
    with np.errstate(all="ignore"):
        r = np.linalg.norm(x[:, :3], axis=1)
        lost = np.column_stack([
            ~(r >= force.head[RADIUS]),
            ~(0.5 * (x[:, 3:6] ** 2).sum(axis=1) < force.head[GM] / r),
            ~(np.trace(P[:, :3, :3], axis1=1, axis2=2) <= DIVERGED**2),
            (np.abs(data.z[: len(x)] - x[:, :3] @ data.H.T) > DIVERGED).any(axis=1),
        ])  # fmt: skip
    if lost.any():
        k, sign = np.argwhere(lost)[0]
        signs = (
            f"its position came inside Mars, {r[k] / 1e3:.0f} km from the centre", "its orbit opened into a hyperbola",
            f"a position sigma exceeded {DIVERGED:g} m", f"an innovation exceeded {DIVERGED:g} m",
        )  # fmt: skip
        raise Diverged(int(k) + 1, signs[sign])


@njit(cache=True)
def propagate_loop(t0, dt, x, substep, inner, head, field, sun, x_out, Phi):
    """Propagate the state over dt [s] and, unless Phi has size zero, its transition matrix.

    Markley factors of about `substep` seconds, `inner` Runge-Kutta steps in each.
    """
    count = max(1, int(np.ceil(dt / substep - 1e-9)))
    h = dt / count
    work, factor, G = np.empty((3, 6)), np.empty((6, 6)), np.empty((2, 3, 3))
    for i in range(6):
        x_out[i] = x[i]
    if Phi.size:
        copy_state(x, np.eye(6), x_out, Phi)
        gradient_point(x_out[:3], head, G[0])
    for k in range(count):
        for i in range(inner):
            runge_kutta_step(t0 + k * h + i * h / inner, x_out, h / inner, head, field, sun, work)
        if Phi.size:
            gradient_point(x_out[:3], head, G[(k + 1) % 2])
            markley_step(G[k % 2], G[(k + 1) % 2], h, factor)
            chain_step(factor, Phi)


@njit(PROPAGATE, cache=True)
def _propagate(t0, t1, x, u, p, x_out, F, Q):
    """Move by the parameters substep, inner and force; stop where the state is not finite."""
    head, field, sun = unpack(p[2:])
    propagate_loop(t0, t1 - t0, x, p[0], int(p[1]), head, field, sun, x_out, F)
    return 0 if np.isfinite(x_out.sum()) else 1
