"""Closeness to the gyro: the law of the difference, fits to printed levels, the windows of the gyro rate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from execbook.ledger import ledger
from execbook.project import root
from geokalman.attitude import assess, comparison, estimate, tunings
from geokalman.attitude.model import AXES, Tuning, arw_density

N = arw_density(7e-4) * tunings.REDUCED
APM, JPL = 1.69e-7, 4.46e-7


@pytest.mark.parametrize("window", assess.WINDOWS)
@pytest.mark.parametrize(("name", "factor"), [("mekf", 1.0), ("akf7", 1.0), ("jpl_like", 3.0)])
def test_the_difference_follows_from_the_gain(solved, window, name, factor):
    """0.71 f N where the windows match, whatever the camera; beside it the noise between the windows."""
    for s in "CD":
        apart = assess.rate_difference(solved[s].solutions[name], solved[s], window)[600:-600]
        np.testing.assert_allclose(assess.std(apart), tunings.difference(N, factor, window), rtol=0.07)


def test_the_mismatch_is_that_of_white_increments():
    """Weights of both windows on white 8 Hz increments of variance N^2 / 8."""
    wide = np.full(16, 0.5)
    for window, weights in (
        ("half", np.where(np.abs(np.arange(16) - 7.5) < 4, 1.0, 0.0)),
        ("sampled", np.concatenate([np.zeros(6), np.array([-1, 7, 7, -1]) * 8 / 12, np.zeros(6)])),
    ):
        expected = {"half": 0.5, "sampled": 5.06}[window]
        assert np.sum((wide - weights) ** 2) / 8 == pytest.approx(expected, rel=1e-3)
        assert tunings.variances(window) == pytest.approx((0.5, expected), rel=1e-3)
    assert tunings.variances("matched") == (0.5, 0.0)


def test_a_copy_of_the_gyro_differs_by_the_windows_alone(solved):
    copied = comparison.gyro_copy(solved["C"])
    levels = {w: assess.std(assess.rate_difference(copied, solved["C"], w)[600:-600]) for w in assess.WINDOWS}
    assert levels["matched"].max() < 1e-14
    for window in ("half", "sampled"):
        np.testing.assert_allclose(levels[window], tunings.difference(N, 0.0, window), rtol=0.07)


def test_an_unknown_window_says_which_there_are(solved):
    with pytest.raises(ValueError, match="matched, half, sampled"):
        assess.gyro_rates(solved["C"], "whole")


@pytest.mark.parametrize("window", assess.WINDOWS)
@pytest.mark.parametrize("factor", [0.3, 1.0, 3.0])
def test_a_fit_meets_both_levels(window, factor):
    fit = tunings.fit(APM, JPL, factor, window)
    noise = arw_density(fit.arw_deg_sqrt_h) * tunings.REDUCED
    assert tunings.difference(noise, fit.apm_factor, window) == pytest.approx(APM)
    assert tunings.difference(noise, fit.kappa, window) == pytest.approx(JPL)


def test_levels_that_no_gain_gives_are_refused():
    with pytest.raises(ValueError, match="no gain"):
        tunings.fit(JPL, APM)


def test_a_low_pass_is_in_the_law():
    """White steps of the attitude against the gyro, low-passed, and the gyro's noise that it takes away."""
    rng = np.random.default_rng(7)
    w = rng.standard_normal((200000, 8)) / np.sqrt(8.0)  # increments at 8 Hz, N = 1
    kernel = tunings.lowpass_kernel(0.2)
    c = np.cumsum(3.0 * rng.standard_normal(len(w)))
    angle = np.concatenate([[0.0], np.cumsum(w.sum(axis=1))])[:-1]
    low = np.convolve(c + angle, kernel, "valid")
    reach = len(kernel) // 2
    rates = 0.5 * (low[2:] - low[:-2])
    k = np.arange(reach + 1, len(w) - reach - 1)
    gyro_rates = 0.5 * (angle[k + 1] - angle[k - 1])
    assert np.std(rates - gyro_rates) == pytest.approx(tunings.difference(1.0, 3.0, "matched", 0.2), rel=0.02)


def test_printed_levels_are_those_of_the_ledger():
    entries = {entry.id: entry for entry in ledger(root(Path(__file__).parent), "gracefo-attitude")}
    for word, values in (("apm", tunings.APM), ("jpl", tunings.JPL)):
        assert values == tuple(entries[f"fig4-{word}-{axis}"].printed for axis in "xyz")


def variance(factor: float, ratio: float = 1e4) -> float:
    """Variance of the error of a scalar filter after its update, in units of N^2; its gain assumes factor times N.

    ratio : variance of the camera over that of the gyro in a second.
    """
    q = factor**2
    prior = 0.5 * (q + np.sqrt(q * q + 4.0 * q * ratio))
    K = prior / (prior + ratio)
    # e+ = (1 - K)(e + w) + K v
    return ((1 - K) ** 2 + K**2 * ratio) / (1 - (1 - K) ** 2)


@pytest.mark.parametrize(("factor", "kappa"), [(0.5, 1.32), (1.0, 2.64), (2.0, 5.28), (0.3, 2.3), (0.6, 2.7)])
def test_which_is_the_more_accurate(factor, kappa):
    fit = tunings.Gains(1e-3, factor, kappa)
    assert fit.closer_is_better == (variance(factor) < variance(kappa))
    assert variance(factor) == pytest.approx(0.5 * 100 * (factor + 1 / factor), rel=0.05)


def test_the_crossing_of_matched_windows_is_the_geometric_mean():
    noise = arw_density(tunings.crossing(APM, JPL)) * tunings.REDUCED
    assert noise / np.sqrt(2) == pytest.approx(np.sqrt(APM * JPL), rel=1e-9)


def test_flights_of_two_fits_differ_in_which_is_better(hours, tuning):
    """The same two levels, opposite outcomes: f = 0.4 and f = 1."""
    from geokalman.attitude import experiment

    for factor in (0.4, 1.0):
        fit = tunings.fit(APM, JPL, factor)
        flown = experiment.flight(replace(experiment.Scenario(duration_s=7200.0), arw_deg_sqrt_h=fit.arw_deg_sqrt_h), 4)
        settings = replace(tuning, arw_deg_sqrt_h=fit.arw_deg_sqrt_h, apm_factor=fit.apm_factor, kappa=fit.kappa)
        result = experiment.solve(flown, "C", settings, comparison.PAIR)
        truth = flown.true_attitude("C")
        errors = [assess.rms(assess.error(result.solutions[n].q, truth)[600:-600]).mean() for n in comparison.PAIR]
        assert (errors[0] < errors[1]) == fit.closer_is_better


def test_a_low_pass_halves_the_power_at_its_cut_off():
    t = np.arange(4000.0)
    small = 1e-5 * np.sin(2 * np.pi * 0.1 * t)
    q = np.column_stack([np.ones_like(t), 0.5 * small, np.zeros((len(t), 2))])
    q[2000] = np.nan
    given = estimate.Estimate(q, *(np.zeros(0) for _ in range(4)))
    out = comparison.lowpassed(given, 0.1).q
    assert np.std(out[100:1900, 1]) / np.std(q[100:1900, 1]) == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert np.array_equal(out[0], q[0]) and np.isnan(out).any(axis=1).sum() == 1
    assert comparison.lowpassed(given, 0.0).q == pytest.approx(q, nan_ok=True)


def test_products_beside_each_other(hours, solved):
    out = comparison.statistics(hours, "C", solved["C"])
    low = comparison.run(hours, "C", Tuning(), 0.1)
    for axis in AXES:
        assert out[f"rate.akf7.{axis}"] == pytest.approx(out[f"rate.gyro.{axis}"], rel=0.05)
        assert out[f"below.{axis}"] == pytest.approx(1.0, abs=0.05)
        assert out[f"tail.{axis}"] > 1 > low[f"tail.{axis}"]
        # a mean over two seconds has sinc(2 f): 0.53 in the mean power of the first band, 0.068 of the second
        assert 5 < out[f"drop.gyro.{axis}"] < 13
