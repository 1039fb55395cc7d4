"""The estimator core: Gaussians in, Gaussians out.

It knows no physics, and imports numpy, scipy and numba only.

model        Model, Sensor, Manifold: motion and instruments as matrices or functions, of Python or compiled
run          run: all epochs by `loop`, the one filter loop: linear, extended, unscented, on manifolds
smoothing    smooth (Rauch-Tung-Striebel)
information  smooth_two_filter, smooth_information
adaptive     Adaptive: hooks that judge a prediction
robust       IGG-III, Huber, gate, equivalent weights
consistency  nees, nis, whiteness, chi_square_bounds, monte_carlo
gaussian     Gaussian, Information, Innovation, Trajectory, Smoothed, Stopped
linear       predict, update: one step by hand; so do extended and unscented
discretise   van Loan; kinematic and Gauss-Markov models
dense        small matrix kernels
checks       checks at the border

Functions named ``*_step`` and ``*_loop`` are compiled kernels on plain float64 arrays, callable from Python and by name
from a compiled loop; they trust their arguments and return a status (0, or 1 + the row that failed). Everything else
checks its arguments and raises ValueError, or its kind NotPositiveDefinite with the epoch. A masked observation is a
missing one; a mask elsewhere, units, dates, text and complex numbers are refused (`checks.plain`).

An extended filter, its smoother and the check whether their covariances agree with the errors: a body falls through
air, and a radar 500 m aside measures its distance ten times a second.

>>> import numpy as np
>>> from geokalman.kalman import Model, Sensor, chi_square_bounds, gaussian, nees, nis, run, smooth, whiteness
>>> def fall(x, t0, t1):  # height [m] and speed [m/s] at t1 from those at t0
...     return np.array([x[0] + (t1 - t0) * x[1], x[1] + (t1 - t0) * (1e-3 * x[1] ** 2 - 9.81)])
>>> def jacobian(x, t0, t1):
...     return np.array([[1.0, t1 - t0], [0.0, 1.0 + (t1 - t0) * 2e-3 * x[1]]])
>>> def distance(x, t):
...     return np.array([np.hypot(x[0], 500.0)])
>>> def gradient(x, t):
...     return np.array([[x[0] / np.hypot(x[0], 500.0), 0.0]])
>>> prior, Q, R = gaussian([2000.0, 0.0], [100.0, 1.0]), np.diag([1e-4, 0.01]), np.array([[4.0]])
>>> rng, t = np.random.default_rng(1), np.arange(0.0, 15.0, 0.1)
>>> truth = [rng.multivariate_normal(*prior)]
>>> for now, later in zip(t[:-1], t[1:]):
...     truth.append(fall(truth[-1], now, later) + rng.multivariate_normal([0.0, 0.0], Q))
>>> z = np.array([distance(x, now) + 2.0 * rng.standard_normal(1) for x, now in zip(truth, t)])
>>> z[60:70] = np.nan  # a gap of one second
>>> filtered = run(prior, t, Model(f=fall, F=jacobian, Q=Q), [Sensor(z, R, h=distance, H=gradient)])
>>> smoothed = smooth(filtered)
>>> error, less = (np.abs(part.mean - truth).mean(axis=0) for part in (filtered, smoothed))
>>> (less < 0.7 * error).tolist()  # of height and speed
[True, True]
>>> values, dof = nis(filtered.whitened)
>>> low, high = chi_square_bounds(dof)
>>> bool(low < values[dof > 0].mean() < high), whiteness(filtered.whitened, 10).p_value > 0.01
(True, True)
>>> bool(0.5 < nees(smoothed.mean - truth, smoothed.cov).mean() < 4.0)  # about 2, the number of states
True
"""

from geokalman import compilation as _compilation  # noqa: F401  first: it is where compiled functions are kept
from geokalman.kalman.adaptive import Adaptive
from geokalman.kalman.consistency import chi_square_bounds, monte_carlo, nees, nis, whiteness
from geokalman.kalman.discretise import gauss_markov, integrated_white_noise, van_loan, white_jerk
from geokalman.kalman.gaussian import (
    Gaussian, Information, Innovation, NotPositiveDefinite, Smoothed, Stopped, Trajectory, gaussian,
)  # fmt: skip
from geokalman.kalman.information import smooth_information, smooth_two_filter
from geokalman.kalman.model import Manifold, Model, Sensor
from geokalman.kalman.run import run
from geokalman.kalman.smoothing import smooth

__all__ = [
    "Adaptive", "Gaussian", "Information", "Innovation", "Manifold", "Model", "NotPositiveDefinite", "Sensor",
    "Smoothed", "Stopped", "Trajectory", "chi_square_bounds", "gauss_markov", "gaussian", "integrated_white_noise",
    "monte_carlo", "nees", "nis", "run", "smooth", "smooth_information", "smooth_two_filter", "van_loan", "white_jerk",
    "whiteness",
]  # fmt: skip
