"""The values that the core takes and gives: Gaussians, innovations, trajectories."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from geokalman.kalman.checks import NotPositiveDefinite, array, covariance, plain
from geokalman.kalman.model import Manifold

__all__ = [
    "Gaussian", "Information", "Innovation", "NotPositiveDefinite", "Smoothed", "Stopped", "Trajectory", "gaussian",
]  # fmt: skip


class Stopped(ArithmeticError):
    """A run that a function of its model or sensor stopped.

    who : "model" or "sensor"; epoch, t [s] : where; code : what the function returned; course : the Trajectory so far.

    >>> print(Stopped("model", 3, 30.0, 1))
    the model stopped at epoch 3 (t = 30 s) with code 1
    """

    def __init__(self, who: str, epoch: int, t: float, code: int) -> None:
        self.who, self.epoch, self.t, self.code, self.course = who, epoch, t, code, None
        super().__init__(f"the {who} stopped at epoch {epoch} (t = {t:g} s) with code {code}")

    def __reduce__(self):
        return Stopped, (self.who, self.epoch, self.t, self.code)


class Gaussian(NamedTuple):
    """A normal distribution N(mean, cov); make it with `gaussian`, which checks.

    mean : (n,) [state units]; cov : (n, n), symmetric positive semidefinite.

    >>> mean, cov = gaussian([1.0], [4.0])
    >>> mean.item(), cov.item()
    (1.0, 4.0)
    """

    mean: np.ndarray
    cov: np.ndarray


class Information(NamedTuple):
    """A normal distribution by its information, matrix = cov^-1 and vector = cov^-1 mean.

    Zeros say that nothing is known. vector : (n,); matrix : (n, n), symmetric positive semidefinite.

    >>> from geokalman.kalman import smooth_information
    >>> prior = Information(np.array([4.0]), np.array([[2.0]]))  # mean 2, variance 1/2
    >>> smooth_information([0.0], [[8.0]], [[1.0]], [[1.0]], ([[1.0]], [[1.0]]), prior).mean.round(12).item()
    4.0
    """

    vector: np.ndarray
    matrix: np.ndarray


class Innovation(NamedTuple):
    """What an observation brought.

    residual = z - prediction, its covariance S = L L', and whitened = L^-1 residual.
    residual, whitened : (m,), NaN where a component is missing; S : (m, m) [sensor units]. If the model is right,
    whitened ~ N(0, I); its components do not depend on whether the update was joint or sequential.

    >>> from geokalman.kalman.linear import update
    >>> posterior, innovation = update(gaussian([1.0], [3.0]), [5.0], [[1.0]], [[1.0]])
    >>> innovation.residual.item(), innovation.S.item(), innovation.whitened.item()
    (4.0, 4.0, 2.0)
    """

    residual: np.ndarray
    S: np.ndarray
    whitened: np.ndarray


@dataclass(frozen=True, slots=True)
class Trajectory:
    """The course of a filter over N epochs, time first, and what a smoother needs of it.

    t : (N,) [s]; predicted_mean, mean : (N, n) before and after the update; predicted_cov, cov : (N, n, n);
    whitened : (N, m) innovations, NaN where missing; step : (N - 1,) index into transition, process_noise : (K, n, n)
    for the step from epoch k to k + 1 (an extended or unscented filter keeps its linearisation there);
    alpha : (N,) factors (of several sensors the last one's) and weights : (N, m) of an adaptive hook, else None. On a
    manifold the means have as many columns as the state needs, and n counts the components of its error.
    Raises ValueError for arrays that carry more than numbers or do not fit one another.

    >>> from geokalman.kalman import Model, Sensor, run
    >>> walk, sensor = Model(F=[[1.0]], Q=[[1.0]]), Sensor([[2.0], [np.nan]], [[1.0]], H=[[1.0]])
    >>> course = run(gaussian([0.0], [3.0]), [0.0, 1.0], walk, [sensor])
    >>> len(course), course[1].cov.item(), course.whitened[:, 0].tolist()  # an observation, then none
    (2, 1.75, [1.0, nan])
    """

    t: np.ndarray
    predicted_mean: np.ndarray
    predicted_cov: np.ndarray
    mean: np.ndarray
    cov: np.ndarray
    whitened: np.ndarray
    transition: np.ndarray
    process_noise: np.ndarray
    step: np.ndarray
    alpha: np.ndarray | None = None
    weights: np.ndarray | None = None
    manifold: Manifold | None = None

    def __post_init__(self) -> None:
        for item in fields(self)[:8]:  # step holds indices
            values = plain(item.name, getattr(self, item.name), missing=item.name == "whitened")
            object.__setattr__(self, item.name, values)
        size = self.mean if self.manifold is None else self.cov
        N, n = self.t.size, size.shape[-1] if size.ndim else 0
        nx = n if self.manifold is None else None
        for name, shape in {
            "predicted_mean": (N, nx), "mean": (N, nx), "predicted_cov": (N, n, n), "cov": (N, n, n),
            "whitened": (N, None), "transition": (None, n, n), "process_noise": (None, n, n), "step": (max(N - 1, 0),),
        }.items():  # fmt: skip
            have = np.shape(getattr(self, name))
            if len(have) != len(shape) or any(want not in (None, h) for want, h in zip(shape, have, strict=True)):
                raise ValueError(
                    f"{name} of a trajectory has the shape {have}, with {N} epochs of {n} states it must be {shape}."
                )

        step, count = plain("step", self.step), min(len(self.transition), len(self.process_noise))
        if not ((step >= 0) & (step < count) & (step == np.floor(step))).all():
            raise ValueError(f"step of a trajectory must hold whole numbers from 0 to {count - 1}.")
        object.__setattr__(self, "step", step.astype(np.int64))

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, k: int) -> Gaussian:
        """Give the filtered Gaussian of epoch k."""
        return Gaussian(self.mean[k], self.cov[k])


@dataclass(frozen=True, slots=True)
class Smoothed:
    """The smoothed states of N epochs, time first.

    t : (N,) [s]; mean : (N, n); cov : (N, n, n), or None.

    >>> from geokalman.kalman import Model, Sensor, run, smooth
    >>> still, sensor = Model(F=[[1.0]], Q=[[0.0]]), Sensor([[1.0], [3.0]], [[1.0]], H=[[1.0]])
    >>> smoothed = smooth(run(gaussian([2.0], [0.5]), [0.0, 1.0], still, [sensor]))
    >>> smoothed.mean[:, 0].round(12).tolist(), smoothed[0].cov.round(12).item()  # one mean of all
    ([2.0, 2.0], 0.25)
    """

    t: np.ndarray
    mean: np.ndarray
    cov: np.ndarray | None

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, k: int) -> Gaussian:
        """Give the smoothed Gaussian of epoch k."""
        return Gaussian(self.mean[k], self.cov[k])


def gaussian(mean, cov) -> Gaussian:
    """Make a checked Gaussian from anything array-like.

    mean : (n,); cov : (n, n), or (n,) variances for a diagonal covariance.
    Raises ValueError for wrong shapes, values that are not finite and an unsymmetric cov; NotPositiveDefinite for a cov
    with a negative eigenvalue.

    >>> gaussian([1.0, 2.0], [4.0, 9.0]).cov.tolist()
    [[4.0, 0.0], [0.0, 9.0]]
    """
    m, cov = array("mean", mean, None), plain("covariance", cov)
    return Gaussian(m, covariance("covariance", np.diag(cov) if cov.ndim == 1 else cov, len(m)))
