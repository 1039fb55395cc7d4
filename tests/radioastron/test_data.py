"""Everything that section 9 of the specification calls bad input, one sentence each."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import pytest

from geokalman.radioastron import estimate
from geokalman.radioastron.data import Scenario, Tuning, check_prior


def changed(data, **arrays):
    return dataclasses.replace(data, **arrays)


def with_value(array, k, value):
    out = array.copy()
    out[k] = value
    return out


def test_good_data_are_taken(drawn):
    data = drawn[1]
    assert len(changed(data).t) == 170
    changed(data, range=with_value(data.range, 3, np.nan))


@pytest.mark.parametrize(("make", "words"), [
    (lambda d: {"range": d.range * 1e-3}, "in km"),
    (lambda d: {"range": d.range * 2.0}, "whole way"),
    (lambda d: {"range": d.range * 1e3}, "in mm"),
    (lambda d: {"range": d.range * 5.0}, "check the units"),
    (lambda d: {"rate": -d.rate}, "sign is that of a Doppler"),
    (lambda d: {"rate": d.rate + 0.2}, "one-way Doppler"),
    (lambda d: {"range": with_value(d.range, 7, np.inf)}, "index 7 is infinite"),
    (lambda d: {"rate": with_value(d.rate, 7, -np.inf)}, "index 7 is infinite"),
    (lambda d: {"range": d.range * np.nan, "rate": d.rate * np.nan}, "pass is empty"),
    (lambda d: {"t": with_value(d.t, 5, np.nan)}, "index 5 is not finite"),
    (lambda d: {"t": with_value(d.t, 5, d.t[2])}, "sort the measurements"),
    (lambda d: {"t": with_value(d.t, 5, d.t[4])}, "measures twice"),
    (lambda d: {"t": np.where(d.arc == 1, d.t + 90000.0, d.t)}, "longer than a day"),
    (lambda d: {"range": d.range[:-1]}, "shape"),
    (lambda d: {"stations": ("Goldstone",)}, "unknown"),
    (lambda d: {"prior_mean": d.prior_mean / 20}, "inside the Earth"),
    (lambda d: {"prior_mean": d.prior_mean * [1, 1, 1, 2, 2, 2]}, "e >= 1"),
    (lambda d: {"prior_mean": d.prior_mean * np.nan}, "six finite numbers"),
    (lambda d: {"prior_cov": np.eye(5)}, "finite \\(6, 6\\)"),
    (lambda d: {"prior_cov": d.prior_cov + np.triu(np.full((6, 6), 1e3), 1)}, "not symmetric"),
    (lambda d: {"prior_cov": -d.prior_cov}, "not positive definite"),
    (lambda d: {name: getattr(d, name)[:0] for name in ("t", "station", "arc", "range", "rate")}, "no measurement"),
])  # fmt: skip
def test_bad_data_are_refused(drawn, make, words):
    data = drawn[1]
    with pytest.raises(ValueError, match=words):
        changed(data, **make(data))


def test_one_pass_alone_is_taken_with_a_warning(drawn):
    data, first = drawn[1], drawn[1].arc == 0
    with pytest.warns(UserWarning, match="one pass alone"):
        changed(data, **{name: getattr(data, name)[first] for name in ("t", "station", "arc", "range", "rate")})


def test_an_outlier_does_not_look_like_another_link(drawn):
    data = drawn[1]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        changed(data, range=with_value(data.range, 40, data.range[40] + 500.0))


@pytest.mark.parametrize(
    "kwargs",
    [{"prior_position": 0.0}, {"sigma_range": -1.0}, {"sigma_rate": float("nan")}, {"bias_rate": float("inf")}],
)
def test_sigmas_must_be_positive(kwargs):
    with pytest.raises(ValueError, match="must be a positive finite sigma"):
        Scenario(**kwargs)
    if next(iter(kwargs)) in Tuning.__dataclass_fields__:
        with pytest.raises(ValueError, match="must be a positive finite sigma"):
            Tuning(**kwargs)


@pytest.mark.parametrize(
    "kwargs", [{"pressure_error": -0.1}, {"acceleration": float("nan")}, {"impulse": float("inf")}]
)
def test_unmodelled_forces_may_be_absent_but_not_negative(kwargs):
    with pytest.raises(ValueError, match="is the size of an unmodelled force"):
        Scenario(**kwargs)
    assert Scenario(pressure_error=0.0, acceleration=0.0, impulse=0.0).impulse == 0.0


def test_data_know_their_day(drawn, st):
    """Seconds of one day given to the forces of another are refused."""
    assert drawn[1].day == st[0].day == 56419
    with pytest.raises(ValueError, match="the data are of 2013-05-08, the forces of 2013-05-07"):
        estimate.extended(changed(drawn[1], day=drawn[1].day + 1), st[1])


@pytest.mark.parametrize("method", [estimate.extended, estimate.unscented, estimate.batch])
def test_a_link_through_the_ground_is_refused_by_every_estimator(drawn, st, method):
    """Data that claim to come from the other side of the Earth: the a-priori state stands below the station's
    horizon.
    """
    below = changed(drawn[1], prior_mean=drawn[1].prior_mean * [-1.0, -1.0, -1.0, 1.0, 1.0, 1.0])
    with pytest.raises(ValueError, match="above the horizon of Bear Lakes"):
        method(below, st[1])


def test_unknown_bias():
    with pytest.raises(ValueError, match="bias = 'daily' is unknown"):
        Scenario(bias="daily")


def test_weights_default_to_the_noise():
    p = {
        "sigma_range_m": 7.0,
        "sigma_rate_m_s": 2e-3,
        "filter_sigma_range_m": None,
        "filter_sigma_rate_m_s": 5e-3,
        "estimate_bias": True,
    }
    assert Tuning.from_parameters(p) == Tuning(7.0, 5e-3, True)
    assert Scenario.from_parameters({"prior_pos_m": 3.0, "bias": "none"}) == Scenario(prior_position=3.0, bias="none")


def test_a_correlated_prior_is_a_prior(drawn):
    P = drawn[1].prior_cov.copy()
    P[0, 3] = P[3, 0] = 0.5 * np.sqrt(P[0, 0] * P[3, 3])
    check_prior(drawn[1].prior_mean, P)


def masked(values, k):
    return np.ma.masked_array(values, np.arange(len(values)) == k)


@pytest.mark.parametrize("name", ["range", "rate"])
def test_a_masked_measurement_is_a_missing_one(drawn, name):
    data = changed(drawn[1], **{name: masked(with_value(getattr(drawn[1], name), 3, 99999.0), 3)})
    assert np.isnan(getattr(data, name)[3]) and np.isfinite(getattr(data, name)[4])
    assert changed(drawn[1], **{name: getattr(drawn[1], name).tolist()}).range.dtype == float


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda d: {"t": masked(d.t, 3)}, r"t\[3\] is masked"),
        (lambda d: {"t": d.t.astype("m8[s]")}, "t holds time spans"),
        (lambda d: {"range": d.range + 0j}, "range holds complex numbers"),
        (lambda d: {"rate": d.rate.astype(str)}, "rate holds text"),
        (lambda d: {"range": None}, "range has shape"),
        (lambda d: {"prior_cov": np.ma.masked_array(d.prior_cov, np.eye(6) > 0)}, "prior_cov.* is masked"),
        (lambda d: {"range": with_value(d.range, 3, -9999.0)}, "range at index 3 is -9999 m, a null or not between"),
        (lambda d: {"range": with_value(d.range, 3, 0.0)}, "range at index 3 is 0 m"),
        (lambda d: {"range": with_value(d.range, 3, 1e32)}, "range at index 3 is 1e.32 m"),
        (lambda d: {"rate": with_value(d.rate, 3, -99999.0)}, "rate at index 3 is -99999 m/s"),
        (lambda d: {"rate": with_value(d.rate, 3, -9999.0)}, "rate at index 3 is -9999 m/s"),
        (lambda d: {"station": d.station + 99}, "station at index 0 is .*, an index into the"),
        (lambda d: {"station": d.station - 9}, "station at index 0 is .*, an index into the"),
        (lambda d: {"arc": d.arc + 0.5}, "arc holds numbers that are not whole"),
        (lambda d: {"day": 2456419}, "day = 2456419 is no modified Julian date"),
        (lambda d: {"day": "2013-05-07"}, "day holds text"),
        (lambda d: {"rate": d.rate + 1e3}, "check the units and the times of both"),
    ],
)
def test_data_carry_numbers_and_no_nulls(drawn, make, words):
    with pytest.raises(ValueError, match=words):
        changed(drawn[1], **make(drawn[1]))


def test_levels_are_numbers():
    with pytest.raises(ValueError, match="sigma_range holds text"):
        Scenario(sigma_range="10")
