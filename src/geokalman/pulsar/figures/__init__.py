"""Figures of the orbiter: plain arrays in, a matplotlib Figure out, in the theme of `style.theme` in force."""

from geokalman.pulsar.figures.drawings import schematic
from geokalman.pulsar.figures.flight import (
    LABELS,
    SETUPS,
    against_paper,
    axis_errors,
    consistency,
    curves,
    noise_curve,
    orbit_view,
    ranges,
    seed_strip,
    smoothing,
)  # fmt: skip
from geokalman.pulsar.figures.signal import (
    accuracy,
    arrival_residuals,
    orbit_scale,
    profiles,
    sky_map,
    timing_terms,
    transition_errors,
)  # fmt: skip

__all__ = [
    "LABELS", "SETUPS", "accuracy", "against_paper", "arrival_residuals", "axis_errors", "consistency", "curves",
    "noise_curve", "orbit_scale", "orbit_view", "profiles", "ranges", "schematic", "seed_strip", "sky_map", "smoothing",
    "timing_terms", "transition_errors",
]  # fmt: skip
