"""Figures of the GRACE part: a drawing of the pair, series along the orbit, and the recovered field.

Every function takes plain arrays and returns a matplotlib Figure, drawn in the theme of `style.theme` that is in force.
"""

from geokalman.grace.figures.drawings import BOXES, pair
from geokalman.grace.figures.field import (
    LOOK,
    amplitudes,
    degree_differences,
    degree_variances,
    geoid_against_radius,
    geoid_by_method,
    geoid_maps,
    ground_track,
)
from geokalman.grace.figures.names import NAMES, ROUTE_NAMES
from geokalman.grace.figures.series import (
    dial,
    error_against_step,
    integrator_effect,
    literal_filter,
    node_gaps,
    orbits_3d,
    range_and_rate,
    residuals,
    transfer_functions,
    weight_curve,
)

__all__ = [
    "BOXES",
    "LOOK",
    "NAMES",
    "ROUTE_NAMES",
    "amplitudes",
    "degree_differences",
    "degree_variances",
    "dial",
    "error_against_step",
    "geoid_against_radius",
    "geoid_by_method",
    "geoid_maps",
    "ground_track",
    "integrator_effect",
    "literal_filter",
    "node_gaps",
    "orbits_3d",
    "pair",
    "range_and_rate",
    "residuals",
    "transfer_functions",
    "weight_curve",
]
