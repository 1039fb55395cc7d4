"""Figures of the part: of the orbit, of observables, covariances and Monte Carlo, of the correlator.

Every function takes plain arrays and returns a matplotlib Figure, drawn in the theme of `style.theme` that is in force.
"""

from geokalman.radioastron.figures.errors import (
    bars,
    corrections,
    covariance_history,
    divergence,
    ellipses,
    histogram,
    innovations,
    scans,
    sizes,
    sweep,
)  # fmt: skip
from geokalman.radioastron.figures.fringes import losses, planes, ratio_histogram, scan_snr
from geokalman.radioastron.figures.names import BIASES, NAMES, ORBITS, SESSION_NAMES, WEIGHTS, case_name
from geokalman.radioastron.figures.orbit import around, elevation, ground_track, orbit_view
from geokalman.radioastron.figures.schematic import schematic

__all__ = [
    "BIASES", "NAMES", "ORBITS", "SESSION_NAMES", "WEIGHTS", "around", "bars", "case_name", "corrections",
    "covariance_history", "divergence", "elevation", "ellipses", "ground_track", "histogram", "innovations", "losses",
    "orbit_view", "planes", "ratio_histogram", "scan_snr", "scans", "schematic", "sizes", "sweep",
]  # fmt: skip
