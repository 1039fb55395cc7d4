"""The simulator: exact motion, sizes of noise, shared field, lag and misalignment found again, ensemble values."""

import numpy as np
import pytest

from geokalman.airborne import experiment, simulate
from geokalman.airborne.model import METRE, Tuning


@pytest.fixture(scope="module")
def two_seeds():
    scenario, tuning = simulate.Scenario(), Tuning.preset("paper_like")
    return experiment.ensemble(scenario, tuning, range(2), tuning.coloured(0.003, 0.004, 80.0))


def test_motion_has_exact_derivatives_and_the_asked_size():
    motion = simulate.Motion(200_001, 0.01)
    up = motion.band(np.random.default_rng(0), simulate.TURBULENCE, 0.3, derivative=2)
    h, v, a = (motion.series(up, k) for k in range(3))
    np.testing.assert_allclose(np.gradient(h, 0.01)[1:-1], v[1:-1], atol=2e-3 * v.std())
    assert a.std() == pytest.approx(0.3, rel=0.05)
    assert abs(h).max() < 5.0  # it does not drift
    shifted = motion.series(motion.ahead(up, 0.02))
    np.testing.assert_allclose(shifted[:-2], h[2:], atol=1e-9)


def test_six_lines_as_asked(two_seeds):
    lines = two_seeds[0]
    assert [line.name for line in lines] == ["1", "2", "3", "4", "5", "6"]
    flown = simulate.survey_of_seed(simulate.Scenario(length_km=20.0), 0)
    north = [np.sign(truth.north[-1] - truth.north[0]) for truth, _ in flown]
    assert north == [1, -1, 1, -1, 1, -1]
    assert np.mean([truth.height[truth.proper].mean() for truth, _ in flown]) == pytest.approx(1500, abs=5)
    assert np.mean([np.abs(np.diff(truth.north[truth.proper])).mean() / 0.5 for truth, _ in flown]) == pytest.approx(
        65, abs=0.5
    )
    assert np.all(np.diff([truth.east.mean() for truth, _ in flown]) > 1900)


def test_neighbouring_lines_share_their_field():
    flown = simulate.survey_of_seed(simulate.Scenario(n_lines=2, spacing_m=500.0, length_km=40.0), 5)
    (a, _), (b, _) = flown
    north = np.linspace(-15e3, 15e3, 300)
    ga, gb = (np.interp(north, t.north[np.argsort(t.north)], t.gravity[np.argsort(t.north)]) for t in (a, b))
    assert np.corrcoef(ga, gb)[0, 1] > 0.99


def test_the_field_has_the_asked_rms():
    field = simulate.random_field(simulate.Scenario(), np.random.default_rng(0))
    assert field.std() == pytest.approx(12.0) and abs(field.mean()) < 1e-9


def test_z_without_errors_is_doubly_integrated_gravity():
    quiet = simulate.Scenario(
        n_lines=1,
        length_km=20.0,
        white=0.0,
        drift=0.0,
        k3=0.0,
        k12=0.0,
        tau3=0.0,
        gnss_white=0.0,
        gnss_colour=0.0,
        gnss_velocity=0.0,
    )
    truth, line = simulate.survey_of_seed(quiet, 2)[0]
    from scipy.interpolate import CubicSpline

    whole = CubicSpline(line.t, truth.gravity).antiderivative(2)(line.t)
    # what remains is the low-passed Eotvos term and quadrature at 100 Hz: centimetres in height after ten minutes
    rest = line.z - whole
    assert np.abs(rest - np.polyval(np.polyfit(line.t, rest, 1), line.t)).max() < 0.1 * METRE


def test_two_seeds_of_the_paper_like_survey(two_seeds):
    fb, forward = experiment.six_line_means(two_seeds, "fb"), experiment.six_line_means(two_seeds, "forward")
    assert fb.mean() == pytest.approx(0.92, abs=0.13)
    assert forward.mean() == pytest.approx(1.15, abs=0.18)
    assert np.mean(fb / forward) == pytest.approx(0.80, abs=0.10)
    assert experiment.six_line_means(two_seeds, "fb", "truth").mean() == pytest.approx(0.203, abs=0.04)
    assert experiment.six_line_means(two_seeds, "forward", "truth").mean() == pytest.approx(0.643, abs=0.12)


def test_consistency_of_white_and_coloured_filters(two_seeds):
    lines = [line for run in two_seeds for line in run]
    assert np.mean([line.nis("fb") for line in lines]) == pytest.approx(0.049, abs=0.01)
    assert np.mean([line.nis("coloured") for line in lines]) == pytest.approx(1.0, abs=0.04)


def test_matched_world_is_consistent():
    run = experiment.simulated(simulate.Scenario.preset("matched"), Tuning.preset("matched"), 0)
    assert np.mean([line.nis() for line in run]) == pytest.approx(1.0, abs=0.05)
    assert 0.3 < np.mean([line.nees("fb") for line in run]) < 3.0


def test_a_lag_is_found():
    run = experiment.simulated(
        simulate.Scenario(n_lines=1, length_km=30.0, tau3=0.020), Tuning.preset("paper_like"), 0
    )[0]
    assert run.estimated["tau3"] == pytest.approx(0.020, abs=1e-3)  # f3' = f3 + tau3 df3/dt: early, not late


def test_misalignments_and_scale_are_found_with_their_signs():
    scenario = simulate.Scenario(n_lines=2, length_km=60.0, k12=2e-3)
    for run in experiment.simulated(scenario, Tuning.preset("paper_like", sd_k12=5e-3), 4):
        for name in ("k1", "k2"):
            assert run.estimated[name] == pytest.approx(run.true[name], abs=1.5e-4)


def test_decimating_before_integrating_destroys_everything():
    run = experiment.simulated(
        simulate.Scenario(n_lines=1, length_km=20.0, integrate_at=2.0), Tuning.preset("paper_like"), 0
    )[0]
    # The prototype had 1.2e4 mGal with its own motion; how much is aliasing and how much quadrature is not separated.
    assert run.against_truth("fb") > 500.0


def test_levelling_removes_the_level_of_lines():
    one = experiment.levelling(simulate.Scenario(k3=2e-6, length_km=30.0), Tuning.preset("paper_like", sd_k3=2e-6), 0)
    assert one.floor <= one.after < 0.5 * one.before


def test_throughput_reports_and_the_smoothers_agree():
    one = experiment.throughput(
        simulate.Scenario(length_km=17.0, lead_s=0.0, rate=10.0), Tuning.preset("paper_like"), 0
    )
    assert one.epochs == 2616 and one.difference < 1e-4 and min(one.forward, one.rts, one.two_filter) > 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"n_lines": 0}, "n_lines = 0"),
        ({"truth": "x"}, "truth = 'x' is unknown; give field or gm3"),
        ({"imu_rate": 99.0}, "must be a whole multiple of rate"),
        ({"length_km": 300.0}, "more than the field holds"),
    ],
)
def test_scenarios_that_cannot_be_flown(change, message):
    with pytest.raises(ValueError, match=message):
        simulate.Scenario(**change)


def test_an_unknown_world():
    with pytest.raises(ValueError, match="preset 'x' is unknown; the presets are paper_like"):
        simulate.Scenario.preset("x")
