"""A family of calibrations against direct simulation; gravity models of other orders; what filters take of gravity."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm

from geokalman.airborne import classical, experiment, family, model, simulate
from geokalman.airborne.estimate import settled
from geokalman.airborne.model import Tuning
from geokalman.kalman.discretise import gauss_markov

SCENARIO = simulate.Scenario(n_lines=2, length_km=20.0, imu_rate=10.0, drift_s=900.0)


def test_a_member_is_what_a_survey_with_its_errors_gives():
    tuning, seeds = Tuning(), (3, 4)
    member = family.family(SCENARIO, tuning, seeds, [0.4], 0.9073)[0]
    runs = experiment.ensemble(replace(SCENARIO, reference=0.4, drift=member.drift), tuning, seeds)
    assert member.drift > 0 and member.fb == pytest.approx(0.9073, abs=1e-9)
    for name, found in (("fb", member.fb), ("forward", member.forward)):
        D = [line.against_reference(name).D_raw for run in runs for line in run]
        assert np.mean(D) == pytest.approx(found, abs=1e-6)
    lines = [line for run in runs for line in run]
    gain = np.mean([x.against_truth("forward") for x in lines]) / np.mean([x.against_truth("fb") for x in lines])
    assert member.gain == pytest.approx(gain, rel=1e-6) and member.ratio == member.fb / member.forward
    assert member.sag == pytest.approx(np.mean([x.rms("fb") for x in lines]), rel=1e-6)
    assert member.gt == pytest.approx(np.mean([x.rms("reference") for x in lines]), rel=1e-6)


def test_a_reference_that_errs_too_much_leaves_no_room_for_a_drift():
    member = family.family(SCENARIO, Tuning(), (3,), [2.0], 0.9073)[0]
    assert member.drift == 0.0 and member.fb > 0.9073


def test_a_mean_that_no_drift_reaches_is_refused():
    with pytest.raises(ValueError, match=r"No drift up to 20 mGal gives a mean of 1000 mGal\."):
        family.family(SCENARIO, Tuning(), (3,), [0.4], 1000.0)


def test_correlation_and_error_of_an_outcome_by_hand():
    line = experiment.simulated(SCENARIO, Tuning(), 0)[0]
    p = line.proper
    a, b = line.curves["fb"][p], line.reference[p]
    assert line.correlation("fb") == pytest.approx(
        np.mean((a - a.mean()) * (b - b.mean())) / a.std() / b.std(), rel=1e-9
    )
    assert line.rms("fb") ** 2 == pytest.approx(
        line.against_truth("fb") ** 2 + np.mean(a - line.gravity[p]) ** 2, rel=1e-9
    )


@pytest.mark.parametrize("order", [1, 2, 3])
def test_gravity_models_of_every_order(order):
    tuning = Tuning(L_km=12.0, sigma_mgal=5.0, order=order)
    beta = tuning.beta(65.0)
    F = np.diag(np.ones(order - 1), 1)
    F[-1] = -np.poly(np.full(order, -beta))[1:][::-1]
    P = model.gravity_covariance(beta, 5.0, order)
    at_L = expm(F * (12e3 / 65.0)) @ P
    assert at_L[0, 0] / P[0, 0] == pytest.approx(np.exp(-1), abs=1e-3)
    q = model.gravity_density(beta, 5.0, order)
    power = quad(lambda w: q / (beta**2 + (w * beta) ** 2) ** order * beta / np.pi, 0, np.inf)[0]
    assert power == pytest.approx(25.0, rel=1e-6)
    Phi, Q = gauss_markov(0.5, 1 / beta, 5.0, order=order)
    whole, noise = model.block(0.5, beta, 5.0, 1.0, order)
    np.testing.assert_allclose(whole[2:, 2:], Phi, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(noise[2:, 2:], Q, rtol=1e-6, atol=1e-18)
    names = settled(replace(tuning, sd_tau3=0.0, sd_k12=0.0, sd_k3=0.0), 65.0).forward.names
    assert names == ("dv", "dh", "dg", "dg1", "dg2")[: 2 + order]


def test_an_order_that_there_is_not():
    with pytest.raises(ValueError, match=r"order = 4: the gravity models are of order 1, 2, 3\."):
        Tuning(order=4)


def test_error_states_that_wander_double_their_variance_in_the_given_time():
    zero = np.zeros((2000, 4))
    line = model.Line("x", 0.5 * np.arange(2001), np.zeros(2001), np.zeros(2001), zero, zero, 65.0)
    built = model.build(line, Tuning(wander_s=1000.0))
    P = built.prior.cov
    for Phi in built.Phi:
        P = Phi @ P @ Phi.T + built.Q
    k = [built.names.index(name) for name in ("tau3", "k1", "k2", "k3")]
    np.testing.assert_allclose(P[k, k], 2.0, rtol=1e-9)


def test_variance_along_a_line_is_that_of_random_fields():
    scenario = simulate.Scenario(source_km=3.0, sigma_mgal=20.0)
    wavelength, variance = simulate.along_track(scenario)
    assert variance.sum() == pytest.approx(400.0)
    rng, found = np.random.default_rng(0), 0.0
    for _ in range(100):
        spectrum = np.fft.fft(simulate.random_field(scenario, rng), axis=0) / simulate.NODES[0]
        found = found + 2 * np.mean(np.abs(spectrum) ** 2, axis=1)[1 : len(variance) + 1] / 100
    for band in (
        wavelength > 60e3,
        (wavelength < 60e3) & (wavelength > 30e3),
        (wavelength < 30e3) & (wavelength > 15e3),
    ):
        assert variance[band].sum() / variance.sum() == pytest.approx(
            found[band].sum() / found.sum(), rel=0.15
        )  # each field is scaled to its own rms
    markov = simulate.along_track(replace(scenario, truth="gm3", L_km=12.0))[1]
    assert markov.sum() == pytest.approx(400.0) and markov[0] == markov.max()


def test_signal_that_a_filter_takes_away():
    t, wave = 0.5 * np.arange(4001), 10e3
    gravity = np.sin(2 * np.pi * 65.0 * t / wave)
    z = model.double_integral(gravity, 0.5)[1]
    steps = np.zeros((4000, 4))
    line = model.Line("x", t, z, np.zeros(4001), steps, steps, 65.0)
    inner = slice(1000, 3000)
    for filtered, gain in (
        (classical.fir(line, 140.0), classical.fir_gain(140.0, 0.5, np.array([65.0 / wave]))),
        (classical.butterworth(line, 140.0, cut_ends=True), classical.butterworth_gain(140.0, [65.0 / wave])),
    ):
        rms = np.sqrt(np.mean((filtered - gravity)[inner] ** 2))
        assert classical.signal_lost(gain, np.array([0.5])) == pytest.approx(rms, rel=0.01)
