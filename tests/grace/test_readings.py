"""What each statement of the text makes of the figures: against numbers by hand; observables beside the paper's."""

from __future__ import annotations

import numpy as np
import pytest

from geokalman.grace import estimate, observables, readings, recover
from geokalman.grace.model import Tuning

SERIES = {
    "newton": np.r_[9.0, 9.0, np.full(29, 2.0), np.full(40, 8.0)],
    "ekf": np.r_[9.0, 9.0, np.full(29, 2.0), np.full(40, 4.0)],
    "ukf": np.r_[1e9, 1e9, np.full(29, 2.0), np.full(40, 1.0)],
}


@pytest.mark.parametrize(("measure", "value"), [("geometric-mean", 4.0), ("median", 4.0), ("ratio-of-sums", 20 / 11)])
def test_ratio_by_hand(measure, value):
    above, below = (
        np.array([1.0, 16.0, 3.0]),
        np.array([1.0, 1.0, 9.0]) if measure == "ratio-of-sums" else np.array([1.0, 4.0, 0.1875]),
    )
    assert readings.ratio(above, below, measure) == pytest.approx(value)


def test_ratio_of_an_unknown_measure():
    with pytest.raises(
        ValueError, match=r"measure = 'mean' is unknown; give geometric-mean, median or ratio-of-sums\."
    ):
        readings.ratio(np.ones(2), np.ones(2), "mean")


def test_by_degree_leaves_out_degrees_0_and_1_and_splits_at_30():
    numbers = readings.by_degree(SERIES)
    assert numbers["above30.newton_over_ukf"] == pytest.approx(8.0)
    assert numbers["above30.ekf_over_ukf"] == pytest.approx(4.0)
    assert numbers["all.newton_over_ekf"] == pytest.approx(2 ** (40 / 69))
    assert numbers["all.newton_over_ukf"] == pytest.approx(8 ** (40 / 69))
    assert numbers["smallest_share.ukf"] == pytest.approx(40 / 69)


def test_by_degree_to_degree_30_has_no_upper_part():
    numbers = readings.by_degree({name: series[:31] for name, series in SERIES.items()})
    assert not any(key.startswith("above30") for key in numbers) and numbers["all.newton_over_ekf"] == 1.0


@pytest.mark.parametrize("size", ["span", "rms"])
def test_of_geoid_is_linear_in_the_maps(size):
    pattern = np.random.default_rng(3).standard_normal((18, 36))
    maps = {"newton": 8.0 * pattern, "ekf": 6.0 * pattern, "ukf": -2.0 * pattern}
    numbers = readings.of_geoid(maps, size)
    assert numbers["geoid_ratio.newton_over_ukf"] == pytest.approx(4.0)
    assert numbers["geoid_ratio.ekf_over_ukf"] == pytest.approx(3.0)
    assert numbers["against_newton"] == pytest.approx(5.0)  # (8 + 2) / (8 - 6)
    assert numbers["geoid_span.ukf"] == pytest.approx(2 * np.ptp(pattern))
    weights = np.cos(np.radians(np.arange(-85.0, 90.0, 10.0)))
    assert numbers["geoid_rms.ekf"] == pytest.approx(
        6 * np.sqrt(np.average((pattern**2).mean(axis=1), weights=weights)), rel=1e-2
    )


def test_of_geoid_of_an_unknown_size():
    with pytest.raises(ValueError, match=r"size = 'max' is unknown; give span or rms\."):
        readings.of_geoid({}, "max")


def test_every_statement_makes_a_reading_of_known_observables():
    assert {made for _, made in readings.STATEMENTS} == set(readings.ROUTES) and len(readings.STATEMENTS) == 4
    assert readings.DEFAULT in readings.ROUTES
    for route in readings.ROUTES.values():
        assert tuple(route) == readings.METHODS and set(route.values()) <= set(observables.IDS)


def test_companions(quick):
    """Without a field beyond, the omission is none; Q2 is the UKF with the other weights."""
    fused = Tuning(lambda_q=8000.0, mu=1.0)
    found = observables.companions(quick.orbit, quick.gravity, quick.data, fused)
    np.testing.assert_array_equal(found["omission"], observables.exact(quick.orbit, quick.gravity))
    np.testing.assert_array_equal(found["Q2"], estimate.ukf(quick.data, fused).smoothed.los)


def test_coefficients_are_those_of_the_recovery(quick, quick_los, quick_recovery):
    found = recover.coefficients(quick.orbit, quick.gravity, {name: quick_los[name] for name in ("N1", "U2")})
    for name, (C, S) in found.items():
        for ours, full in zip((C, S), quick_recovery.coefficients(name), strict=True):
            np.testing.assert_allclose(ours, full, rtol=0, atol=1e-18)
