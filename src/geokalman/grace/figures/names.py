"""What the routes to gravity are called: one name for tables, legends and prose."""

from __future__ import annotations

NAMES = {
    "X": "exact gravity",
    "N1": "Newton, range-rate differentiated",
    "N2": "Newton, second derivative",
    "E0": "EKF without smoother",
    "E1": "EKF, range-rate differentiated",
    "E2": "EKF, acceleration state",
    "U1": "UKF, range-rate differentiated",
    "U2": "UKF, acceleration state",
    "K0": "exact range-rate, differentiated",
    "B11": "splines of degree 11",
    "P2": "EKF, tuned for gravity",
    "Q2": "UKF, tuned for gravity",
}
"""Observable -> its name. The ids are those of `geokalman.grace.observables`; Q2 is one of its companions."""
ROUTE_NAMES = {
    "range-rates": "range-rates of all three, differentiated (N1, E1, U1)",
    "accelerations": "Newton's range-rate, differentiated; acceleration states of the filters (N1, E2, U2)",
    "second-derivative": "Newton's second derivative; acceleration states of the filters (N2, E2, U2)",
}
"""Reading of what feeds gravity -> the three observables that it takes."""
