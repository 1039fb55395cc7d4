"""Readable names of sessions, estimators and weights: the same in figures, tables and prose."""

from __future__ import annotations

NAMES = {
    "prior": "a-priori orbit",
    "ekf": "filter, inflated weights",
    "naive": "filter, noise-only weights",
    "substeps": "filter, noise-only weights, first-order steps of 10 s",
    "single": "filter, noise-only weights, one first-order step",
    "iterated": "iterated filter, noise-only weights",
    "batch": "batch, noise-only weights",
    "single-inflated": "filter, inflated weights, one first-order step",
    "ukf": "unscented filter, inflated weights",
    "process-noise": "filter, inflated weights, process noise",
    "batch-bias": "batch with bias states",
}
"""Estimators by the names of `experiment.ALL`; a filter without another word is the extended Kalman filter."""
ORBITS = {"prior": "a-priori orbit", "ekf": "filter"}
"""The two orbits of a figure that compares no filters."""
WEIGHTS = {
    "inflated": "inflated weights (50 m, 3 mm/s)",
    "naive": "noise-only weights (10 m, 1 mm/s)",
    "bias_states": "bias states (10 m, 1 mm/s)",
}
"""What an estimator assumes of its measurements."""
SESSION_NAMES = {
    "ST": "May 2013",
    "OE": "March 2013",
    "BB": "July 2012, three telescopes",
    "BC": "July 2012, Effelsberg",
}
"""Sessions by the last letters of their codes."""
BIASES = {"none": "no bias", "common": "common bias", "per-pass": "bias per pass"}
"""Biases of the data."""


def case_name(case: str) -> str:
    """Name a case that begins with the letters of its session: `ST range only` is `May 2013: range only`."""
    session, _, rest = case.partition(" ")
    rest = rest.replace("stations biases", "stations, biases estimated")
    return f"{SESSION_NAMES[session]}: {rest}" if rest else SESSION_NAMES[session]
