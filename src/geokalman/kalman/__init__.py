"""The estimator core: Gaussians in, Gaussians out. It knows no physics; numpy, scipy and numba only.

model        Model, Sensor, Manifold: what a filter believes, as matrices, Python functions or compiled functions
run          run: check, then filter all epochs by `loop`, the one filter loop: linear, extended, unscented, on manifolds
smoothing    smooth (Rauch-Tung-Striebel)             information           smooth_two_filter, smooth_information
adaptive     Adaptive: hooks that judge a prediction  robust       IGG-III, Huber, gate, equivalent weights
consistency  nees, nis, whiteness, chi_square_bounds, monte_carlo
gaussian     Gaussian, Information, Innovation, Trajectory, Smoothed, Stopped
linear, extended, unscented                           predict, update: one step by hand
discretise   van Loan; kinematic and Gauss-Markov models
dense, checks   small matrix kernels; checks at the border

Functions named ``*_step`` and ``*_loop`` are compiled kernels on plain float64 arrays, callable from Python and by name
from a compiled loop; they trust their arguments and return a status (0, or 1 + the row that failed). Everything else
checks its arguments and raises ValueError, or its kind NotPositiveDefinite with the epoch. A masked observation is a
missing one; a mask elsewhere, units, dates, text and complex numbers are refused (`checks.plain`).
"""

from geokalman.kalman.adaptive import Adaptive
from geokalman.kalman.consistency import chi_square_bounds, monte_carlo, nees, nis, whiteness
from geokalman.kalman.discretise import gauss_markov, integrated_white_noise, van_loan, white_jerk
from geokalman.kalman.gaussian import (
    Gaussian,
    Information,
    Innovation,
    NotPositiveDefinite,
    Smoothed,
    Stopped,
    Trajectory,
    gaussian,
)
from geokalman.kalman.information import smooth_information, smooth_two_filter
from geokalman.kalman.model import Manifold, Model, Sensor
from geokalman.kalman.run import run
from geokalman.kalman.smoothing import smooth

__all__ = [
    "Adaptive",
    "Gaussian",
    "Information",
    "Innovation",
    "Manifold",
    "Model",
    "NotPositiveDefinite",
    "Sensor",
    "Smoothed",
    "Stopped",
    "Trajectory",
    "chi_square_bounds",
    "gauss_markov",
    "gaussian",
    "integrated_white_noise",
    "monte_carlo",
    "nees",
    "nis",
    "run",
    "smooth",
    "smooth_information",
    "smooth_two_filter",
    "van_loan",
    "white_jerk",
    "whiteness",
]
