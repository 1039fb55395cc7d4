"""Which observable of each method feeds gravity: what the text says in four places, and what follows for its figures.

The four statements give three triples of observables (`ROUTES`; ids as in `observables`). Numbers are formed here for
the pages and for the worlds of readings alike, so that both mean the same by a name.
Source: Sharifi, Farzaneh & Amootaghi (2019), Section 3, Section 4 and English summary.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from geokalman.grace.model import Array
from geokalman.physics.harmonics import area_rms

ROUTES: dict[str, dict[str, str]] = {
    "range-rates": {"newton": "N1", "ekf": "E1", "ukf": "U1"},
    "accelerations": {"newton": "N1", "ekf": "E2", "ukf": "U2"},
    "second-derivative": {"newton": "N2", "ekf": "E2", "ukf": "U2"},
}
"""Reading -> method -> observable."""
DEFAULT = "range-rates"
STATEMENTS = (
    ("Section 3, first paragraph: filters deliver relative velocity and acceleration", "accelerations"),
    ("Section 4, on the simulated data: nine-point Newton for the second derivative of the range", "second-derivative"),
    ("Section 4, after Table 1: relative orbits and reconstructed observations of all methods", "range-rates"),
    ("English summary: the reconstructed range-rates", "range-rates"),
)
"""What the text says, and the reading it makes."""
METHODS = ("newton", "ekf", "ukf")
SPLIT = 30
"""Degree above which Figure 5 is said to show the gain."""
Measure = Literal["geometric-mean", "median", "ratio-of-sums"]
Size = Literal["span", "rms"]


def ratio(above: Array, below: Array, measure: Measure = "geometric-mean") -> float:
    """How many times larger a positive series is than another of equal length.

    measure : geometric mean or median of the quotients, or quotient of the sums. Raises ValueError for another.
    """
    if measure == "geometric-mean":
        return float(np.exp(np.mean(np.log(above / below))))
    if measure == "median":
        return float(np.median(above / below))
    if measure == "ratio-of-sums":
        return float(np.sum(above) / np.sum(below))
    raise ValueError(f"measure = {measure!r} is unknown; give geometric-mean, median or ratio-of-sums.")


def by_degree(differences: Mapping[str, Array], measure: Measure = "geometric-mean") -> dict[str, float]:
    """What Figures 4 and 5 say of the three methods.

    differences : newton, ekf, ukf -> (N+1,) |difference of degree variances|, degrees 0 to N; degrees from 2 count, and
    those above `SPLIT` where there are any.
    """
    newton, ekf, ukf = (differences[name][2:] for name in METHODS)
    high = slice(SPLIT - 1, None)
    numbers = {
        "all.newton_over_ekf": ratio(newton, ekf, measure),
        "all.newton_over_ukf": ratio(newton, ukf, measure),
        "smallest_share.ukf": float(np.mean((ukf < newton) & (ukf < ekf))),
    }
    if newton[high].size:
        numbers["above30.newton_over_ukf"] = ratio(newton[high], ukf[high], measure)
        numbers["above30.ekf_over_ukf"] = ratio(ekf[high], ukf[high], measure)
    return numbers


def of_geoid(maps: Mapping[str, Array], size: Size = "span") -> dict[str, float]:
    """What Figures 6 and 7 say of the three methods.

    maps : newton, ekf, ukf -> geoid-height error (n_lat, n_lon) [m] on a cell-centred grid; size : of a map, its span
    (largest minus smallest, of which the text speaks) or its area-weighted rms [m]. Figure 7 is the size of UKF minus
    Newton over that of EKF minus Newton. Raises ValueError for another size.
    """
    sizes = {"span": lambda grid: float(np.ptp(grid)), "rms": area_rms}
    if size not in sizes:
        raise ValueError(f"size = {size!r} is unknown; give span or rms.")
    of = sizes[size]
    numbers = {f"geoid_{name}.{method}": f(grid) for method, grid in maps.items() for name, f in sizes.items()}
    numbers["geoid_ratio.newton_over_ukf"] = of(maps["newton"]) / of(maps["ukf"])
    numbers["geoid_ratio.ekf_over_ukf"] = of(maps["ekf"]) / of(maps["ukf"])
    numbers["against_newton"] = of(maps["newton"] - maps["ukf"]) / of(maps["newton"] - maps["ekf"])
    return numbers
