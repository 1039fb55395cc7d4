"""The estimator core: Gaussians in, Gaussians out. It knows no physics; numpy, scipy and numba only.

gaussian     Gaussian, Information, Innovation, Trajectory, Smoothed
discretise   van Loan; kinematic and Gauss-Markov models
linear       predict, update, filter_linear           extended, unscented   the same for nonlinear f and h
adaptive     adaptive factors of a prediction         robust       IGG-III, Huber, gate, equivalent weights
smoothing    smooth (Rauch-Tung-Striebel)             information           smooth_two_filter, smooth_information
consistency  nees, nis, whiteness, chi_square_bounds, monte_carlo
dense, checks   small matrix kernels; checks at the border

Functions named ``*_step`` and ``*_loop`` are compiled kernels on plain float64 arrays, callable from Python and by name
from a compiled loop; they trust their arguments and return a status (0, or 1 + the row that failed). Everything else
checks its arguments and raises ValueError, or its kind NotPositiveDefinite with the epoch. A masked observation is a
missing one; a mask elsewhere, units, dates, text and complex numbers are refused (`checks.plain`).
"""

from geokalman import compilation as _compilation  # noqa: F401  first: it is where compiled functions are kept
from geokalman.kalman.adaptive import adaptive_update
from geokalman.kalman.consistency import chi_square_bounds, monte_carlo, nees, nis, whiteness
from geokalman.kalman.discretise import gauss_markov, integrated_white_noise, van_loan, white_jerk
from geokalman.kalman.extended import Sensor, filter_extended
from geokalman.kalman.gaussian import (
    Gaussian,
    Information,
    Innovation,
    NotPositiveDefinite,
    Smoothed,
    Trajectory,
    gaussian,
)
from geokalman.kalman.information import smooth_information, smooth_two_filter
from geokalman.kalman.linear import filter_linear
from geokalman.kalman.robust import robust_update
from geokalman.kalman.smoothing import smooth
from geokalman.kalman.unscented import filter_unscented

__all__ = [
    "Gaussian",
    "Information",
    "Innovation",
    "NotPositiveDefinite",
    "Sensor",
    "Smoothed",
    "Trajectory",
    "adaptive_update",
    "chi_square_bounds",
    "filter_extended",
    "filter_linear",
    "filter_unscented",
    "gauss_markov",
    "gaussian",
    "integrated_white_noise",
    "monte_carlo",
    "nees",
    "nis",
    "robust_update",
    "smooth",
    "smooth_information",
    "smooth_two_filter",
    "van_loan",
    "white_jerk",
    "whiteness",
]
