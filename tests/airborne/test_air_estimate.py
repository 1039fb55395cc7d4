"""Smoothers against each other and against dense least squares, the backward starts, and the real lines."""

import numpy as np
import pytest

from geokalman import memory
from geokalman.airborne import backward, classical, experiment, model, simulate, tune
from geokalman.airborne.estimate import estimate, innovation_log_likelihood, run_filter, settled
from geokalman.airborne.model import Tuning, build


@pytest.fixture(scope="module")
def flown():
    return simulate.survey_of_seed(simulate.Scenario(n_lines=1, length_km=20.0), 1)[0]


def dense(built, z):
    """Posterior mean of all states by the covariance of everything: no filter, no smoother."""
    N, n = len(z), len(built.scale)
    joint = np.zeros((N * n, N * n))
    P = built.prior.cov
    for k in range(N):
        if k:
            P = built.Phi[k - 1] @ P @ built.Phi[k - 1].T + built.Q
        cross = P
        for j in range(k, N):
            if j > k:
                cross = built.Phi[j - 1] @ cross
            joint[j * n : (j + 1) * n, k * n : (k + 1) * n] = cross
            joint[k * n : (k + 1) * n, j * n : (j + 1) * n] = cross.T
    H = np.kron(np.eye(N), built.H)
    S = H @ joint @ H.T + built.R[0, 0] * np.eye(N)
    return (joint @ H.T @ np.linalg.solve(S, z)).reshape(N, n), S


def test_both_smoothers_are_the_dense_posterior(flown):
    line = flown[1].part(slice(0, 62))
    line = model.replace(
        line, t=8.0 * (line.t - line.t[0])
    )  # long enough for the border; the steps keep their integrals
    tuning = Tuning.preset("paper_like")
    built = build(line, tuning)
    mean, S = dense(built, line.z)
    pick = built.names.index("dg")
    for smoother in ("rts", "two-filter"):
        np.testing.assert_allclose(
            estimate(line, tuning, smoother).smoothed.gravity, built.scale[pick] * mean[:, pick], rtol=0, atol=2e-5
        )
    sign, logdet = np.linalg.slogdet(S)
    whole = -0.5 * (line.z @ np.linalg.solve(S, line.z) + logdet)
    assert sign == 1 and innovation_log_likelihood(line, tuning) == pytest.approx(whole, rel=1e-7)


@pytest.mark.parametrize("coloured", [False, True])
def test_two_filter_and_rts_agree(flown, coloured):
    tuning = Tuning.preset("paper_like")
    tuning = tuning.coloured(0.003, 0.004, 80.0) if coloured else tuning
    a, b = (estimate(flown[1], tuning, smoother) for smoother in ("rts", "two-filter"))
    assert np.abs(a.smoothed.gravity - b.smoothed.gravity).max() < 1e-6
    np.testing.assert_allclose(a.smoothed.sigma(), b.smoothed.sigma(), rtol=1e-6)
    assert a.smoothed.gravity[-1] == pytest.approx(a.forward.gravity[-1], abs=1e-9)


def test_a_state_that_is_not_there_is_refused(flown):
    with pytest.raises(ValueError, match="The model has no state 'colour'; it has dv, dh"):
        estimate(flown[1], Tuning()).smoothed.state("colour")


def test_backward_starts():
    """On a whole line: the literal start pins the height to zero, and z drifts too little on a short one."""
    truth, line = simulate.survey_of_seed(simulate.Scenario(n_lines=1), 1)[0]
    tuning = Tuning.preset("paper_like")
    rts = estimate(line, tuning).smoothed
    run = {start: backward.forward_backward(line, tuning, start) for start in backward.STARTS}
    for start in ("forward", "forward-certain"):
        assert np.abs(run[start].gravity - rts.gravity).max() < 1e-6
    assert np.abs(run["wide"].gravity - rts.gravity).max() < 0.003
    assert 1e-4 < np.abs(run["prior"].gravity - rts.gravity).max() < 0.6
    assert (run["literal"].gravity - truth.gravity)[truth.proper].std() > 10.0
    assert run["literal"].gravity[-1] == pytest.approx(0.0, abs=1e-9)
    ratio = run["forward-certain"].sigma() / rts.sigma()
    assert ratio[-1] < 1e-6 and ratio[len(ratio) // 2] == pytest.approx(0.54, abs=0.03)
    ratio = run["forward"].sigma() / rts.sigma()
    assert ratio.min() > 0.70 and ratio[len(ratio) // 2] < 0.81


def test_the_literal_start_on_real_lines(six):
    error = []
    for flight in six:
        run = backward.forward_backward(flight.line, Tuning.preset("kauring"), "literal")
        error.append((run.gravity - flight.references["ground"])[120:-120].std())
    assert np.mean(error) == pytest.approx(27.3, abs=0.1)
    assert min(error) == pytest.approx(1.6, abs=0.05) and max(error) == pytest.approx(88, abs=0.5)


def test_the_better_known_estimate_gets_the_larger_weight():
    mean, cov = backward.combine(np.array([1.0]), np.array([[1.0]]), np.array([0.0]), np.array([[4.0]]))
    assert mean[0] == pytest.approx(0.8) and cov[0, 0] == pytest.approx(0.8)
    with pytest.raises(ValueError, match="start 'x' is unknown; the starts are literal"):
        backward.forward_backward(None, None, "x")
    with pytest.raises(ValueError, match="not positive definite at epoch 3"):
        backward.combine(np.zeros(1), np.zeros((1, 1)), np.zeros(1), np.zeros((1, 1)), 3)


FORWARD = [1.768, 1.784, 1.432, 1.961, 2.335, 2.438]
BOTH = [0.993, 0.850, 0.873, 0.967, 0.899, 1.151]
CONTRACTOR = [0.881, 0.839, 0.857, 0.973, 1.043, 0.937]


def test_the_six_real_lines(six):
    judged = experiment.real(six, Tuning.preset("kauring"))
    np.testing.assert_allclose(judged.sd("forward", "ground"), FORWARD, atol=0.01)
    np.testing.assert_allclose(judged.sd("fb", "ground"), BOTH, atol=0.01)
    np.testing.assert_allclose(judged.sd("contractor", "ground"), CONTRACTOR, atol=0.001)
    np.testing.assert_allclose(
        judged.sd("forward", "contractor"), [1.725, 1.498, 1.383, 1.633, 2.059, 2.343], atol=0.01
    )
    np.testing.assert_allclose(judged.sd("fb", "contractor"), [0.290, 0.230, 0.115, 0.197, 0.389, 0.429], atol=0.01)
    np.testing.assert_allclose(judged.offset("fb", "contractor"), [0.63, 2.86, 0.16, -0.08, 4.12, 1.48], atol=0.01)


def test_the_second_order_lag_of_the_real_lines(kauring, six):
    judged = experiment.real(six, Tuning.preset("kauring"), 0.0155)
    assert judged.sd("fb", "ground").mean() == pytest.approx(0.904, abs=0.01)
    training = [f.line for f in kauring.flights if f.name in {str(100100 + 600 * j) for j in range(19)}]
    pooled, each = tune.second_order_lag(training, Tuning.preset("kauring"))
    assert pooled == pytest.approx(0.0145, abs=0.0005) and each.std() == pytest.approx(0.0036, abs=0.001)
    with pytest.raises(ValueError, match="no lines to estimate a lag from"):
        tune.second_order_lag([], Tuning())


def test_the_lag_maximises_the_likelihood(six):
    line, tuning = six[0].line, Tuning.preset("kauring")
    c = tune.second_order_lag([line], tuning)[0]
    at = [innovation_log_likelihood(line.lagged(x), tuning) for x in (c - 0.002, c, c + 0.002)]
    assert at[1] > at[0] and at[1] > at[2]


def test_likelihood_tuning_recovers_a_matched_world():
    flown = simulate.survey_of_seed(simulate.Scenario.preset("matched", n_lines=2), 3)
    start = Tuning.preset("matched", q_f=4.0, R_m=0.03)
    found = tune.fit([line for _, line in flown], start, ("q_f", "R_m"), 60)
    assert found.tuning.q_f == pytest.approx(8.0, rel=0.4) and found.tuning.R_m == pytest.approx(0.02, rel=0.05)
    truth = sum(innovation_log_likelihood(line, Tuning.preset("matched")) for _, line in flown)
    assert (
        truth - 0.1 < found.log_likelihood < truth + 5.0
    )  # two parameters gain chi-square(2)/2 over their true values
    with pytest.raises(ValueError, match="no lines to tune on"):
        tune.fit([], start)
    with pytest.raises(ValueError, match="colour_m = 0: a search in logarithms needs positive starts"):
        tune.fit([flown[0][1]], start, ("colour_m",))


GAINS = [
    ("paper_like", 65.0, [8, 10, 13, 16, 20], [0.05, 0.27, 0.74, 0.92, 0.98]),
    ("kauring", 45.0, [3, 4, 5, 6, 8], [0.04, 0.32, 0.72, 0.90, 0.98]),
]


@pytest.mark.parametrize(("preset", "V", "km", "gain"), GAINS)
def test_smoother_gains(preset, V, km, gain):
    np.testing.assert_allclose(
        classical.smoother_gain(Tuning.preset(preset), V, 0.5, 1e3 * np.array(km)), gain, atol=0.02
    )


def test_gain_and_forward_response_are_those_of_the_filters_themselves():
    tuning = Tuning(sd_tau3=0.0, sd_k12=0.0, sd_k3=0.0)
    n, V, wavelength = 4001, 65.0, 13e3
    t, w = 0.5 * np.arange(n), 2 * np.pi * 65.0 / 13e3
    zeros = np.zeros((n - 1, 4))
    wave = model.Line("wave", t, -np.sin(w * t) / w**2 + t / w, np.zeros(n), zeros, zeros, V)
    result = estimate(wave, tuning)
    middle = slice(1500, 2500)
    assert np.abs(result.smoothed.gravity[middle]).max() == pytest.approx(
        classical.smoother_gain(tuning, V, 0.5, wavelength), abs=0.01
    )
    response = classical.forward_response(wave, tuning, run_filter(wave, build(wave, tuning)), [wavelength])[0]
    expected = np.imag(response * np.exp(1j * w * t))
    np.testing.assert_allclose(result.forward.gravity[middle], expected[middle], atol=0.02)
    assert abs(response) > 1.5


def test_fir_keeps_a_constant_and_halves_its_cutoff():
    taps = classical.fir_taps(100.0, 0.5)
    assert len(taps) == 401 and taps.sum() == pytest.approx(1.0)
    assert classical.fir_gain(100.0, 0.5, np.array([0.0, 0.01]))[1] == pytest.approx(0.5, abs=0.01)
    assert classical.butterworth_gain(100.0, np.array([0.01]))[0] == pytest.approx(0.5)
    with pytest.raises(ValueError, match="below four steps"):
        classical.fir_taps(1.0, 0.5)


def test_low_pass_filters_on_a_line(flown):
    truth, line = flown
    for values in (
        classical.fir(line, 140.0),
        classical.fir(line, 140.0, cut_ends=True),
        classical.butterworth(line, 140.0),
    ):
        assert values.shape == line.t.shape
        assert np.std((values - truth.gravity)[truth.proper]) < 3.0
    with pytest.raises(ValueError, match="less than the filter's half length"):
        classical.fir(line, 5000.0)


def test_settled_filter_is_a_line_without_data():
    assert np.all(settled(Tuning(), 65.0).smoothed.gravity == 0.0)


def test_a_low_pass_that_memory_does_not_hold_is_refused():
    sentence = (
        r"^The gain of a low-pass of 280 s in steps of 1e-09 s needs .* TB of memory, and .*; give a longer dt\.$"
    )
    with pytest.raises(memory.TooLarge, match=sentence):
        classical.fir_gain(280.0, 1e-9, np.linspace(0.0, 0.1, 300))
