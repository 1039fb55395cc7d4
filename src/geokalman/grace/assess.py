"""Where truth and estimate meet: residual statistics, degree-variance differences, geoid errors. Plain numbers and
arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from geokalman.constants import OMEGA_EARTH
from geokalman.grace.model import DAY, Array, distance, range_rate
from geokalman.grace.recover import Recovery
from geokalman.grace.simulate import Truth
from geokalman.physics.field import GravityField
from geokalman.physics.harmonics import area_rms, degree_variance, error_degree_variance, geoid_difference
from geokalman.physics.sphere import cell_centred_grid


class Statistics(NamedTuple):
    """Statistics of a residual series, as in Table 1; std is the population standard deviation (ddof = 0)."""

    mean: float
    min: float
    max: float
    std: float


def inner(series: Array, edge: int) -> Array:
    """The series without its first and last `edge` epochs. Raises ValueError where nothing would be left."""
    if edge < 0 or len(series) <= 2 * edge:
        raise ValueError(
            f"edge = {edge} epochs at either end leave nothing of {len(series)}; give a smaller edge or more days."
        )
    return series[edge : len(series) - edge]


def statistics(residual: Array, edge: int = 100) -> Statistics:
    """Mean, extremes and standard deviation of a residual (n,), its edges left out, in the unit of the residual."""
    kept = inner(residual, edge)
    if not np.isfinite(kept).all():
        finite = np.flatnonzero(np.isfinite(residual))
        needed = max(finite[0], len(residual) - 1 - finite[-1]) if finite.size else len(residual)
        raise ValueError(
            f"the residual is not finite at epoch {edge + int((~np.isfinite(kept)).argmax())}; edge = {edge} must cover"
            f" the stencil, here {needed} epochs at either end."
        )
    return Statistics(float(kept.mean()), float(kept.min()), float(kept.max()), float(kept.std()))


def range_rate_residual(rate: Array, orbit: Truth) -> Array:
    """Range-rate of a method minus that of the simulation (n,) [m/s]; NaN where the method has none."""
    return rate - range_rate(orbit.dr, orbit.dv)


def pair_difference(first: Truth, second: Truth) -> tuple[float, float]:
    """Largest difference of range-rate [m/s] and of relative position [m] between two integrations of one pair."""
    rates = range_rate(first.dr, first.dv) - range_rate(second.dr, second.dv)
    return float(np.abs(rates).max()), float(distance(first.dr - second.dr).max())


def drift_per_revolution(orbit: Truth, revolution: float) -> float:
    """Secular change of the range [m] per revolution [s]: mean over the last revolution minus that over the first."""
    rho, k = distance(orbit.dr), round(revolution / orbit.dt)
    if len(rho) < 2 * k:
        raise ValueError(f"{len(rho)} epochs are fewer than two revolutions of {k} epochs; give more days.")
    return float((rho[-k:].mean() - rho[:k].mean()) / (len(rho) / k - 1))


def largest_node_gap(orbit: Truth, days: Sequence[float]) -> list[float]:
    """Largest gap in longitude [deg] between the trailing satellite's ascending nodes on the Earth, after so many days.

    Fewer than two nodes leave the whole circle, 360.
    """
    z = orbit.B[:, 2]
    k = np.flatnonzero((z[:-1] < 0) & (z[1:] >= 0))
    part = -z[k] / (z[k + 1] - z[k])
    t = orbit.t[k] + part * orbit.dt
    x, y = (orbit.B[k, i] + part * (orbit.B[k + 1, i] - orbit.B[k, i]) for i in (0, 1))
    longitude = np.degrees(np.arctan2(y, x) - OMEGA_EARTH * t) % 360
    gaps = []
    for span in days:
        nodes = np.sort(longitude[t <= span * DAY])
        gaps.append(float(np.diff(nodes, append=nodes[:1] + 360).max()) if len(nodes) else 360.0)
    return gaps


class Spectrum(NamedTuple):
    """What a recovery looks like by degree, arrays over n = 0..N: degree variance, its difference, error amplitude
    [m]."""

    variance: Array
    difference: Array
    amplitude: Array


def spectrum(recovery: Recovery, observable: str, truth: GravityField) -> Spectrum:
    """Degree variances (54) recovered, |their difference to the truth|, and R sqrt(sum of squared errors) [m] per
    degree.

    The difference of variances is the paper's figure 5; the error amplitude is the meaningful one, since errors cannot
    cancel in it.
    """
    C, S = recovery.coefficients(observable)
    n = recovery.n_max + 1
    reference = degree_variance(truth.C[:n, :n], truth.S[:n, :n])
    variance = degree_variance(C, S)
    error = error_degree_variance(C - truth.C[:n, :n], S - truth.S[:n, :n])
    return Spectrum(variance, np.abs(variance - reference), truth.radius * np.sqrt(error))


def formal_amplitude(recovery: Recovery, truth: GravityField, sigma: float) -> Array:
    """Error amplitude per degree [m] that white errors of standard deviation sigma [m/s^2] would leave, (N+1,)."""
    return truth.radius * sigma * np.sqrt(error_degree_variance(recovery.formal_C, recovery.formal_S))


def geometric_ratio(above: Array, below: Array) -> float:
    """Geometric mean of the quotient of two positive series of equal length."""
    return float(np.exp(np.mean(np.log(above / below))))


def geoid_error(recovery: Recovery, observable: str, truth: GravityField, step_deg: float, gauss_km: float) -> Array:
    """Geoid height of the truth minus the recovered one [m], low-passed, on a cell-centred grid (n_lat, n_lon)."""
    C, S = recovery.coefficients(observable)
    n = recovery.n_max + 1
    return geoid_difference(truth.C[:n, :n] - C, truth.S[:n, :n] - S, truth.radius, step_deg, gauss_km)


class MapStatistics(NamedTuple):
    """Area-weighted rms, largest absolute value and span (max - min) of a map, in its unit."""

    rms: float
    max: float
    span: float


def map_statistics(grid: Array) -> MapStatistics:
    """Statistics of a cell-centred global grid (n_lat, n_lon)."""
    return MapStatistics(area_rms(grid), float(np.abs(grid).max()), float(np.ptp(grid)))


def map_columns(grids: Mapping[str, Array], step_deg: float = 1.0) -> dict[str, Array]:
    """Cell-centred global grids (n_lat, n_lon) as columns: longitude_deg, latitude_deg, then each grid; cells about
    step_deg apart."""
    shape = next(iter(grids.values())).shape
    every = max(1, round(step_deg * shape[0] / 180))
    latitude, longitude = cell_centred_grid(180 / shape[0])
    lon, lat = np.meshgrid(np.degrees(longitude[::every]), np.degrees(latitude[::every]))
    columns = {"longitude_deg": lon.ravel(), "latitude_deg": lat.ravel()}
    return columns | {name: grid[::every, ::every].ravel() for name, grid in grids.items()}


def smallest_share(series: Mapping[str, Array]) -> dict[str, float]:
    """For each of several series of equal length, the share of places at which it is the smallest."""
    names = list(series)
    winners = np.argmin(np.array([series[name] for name in names]), axis=0)
    return {name: float(np.mean(winners == k)) for k, name in enumerate(names)}
