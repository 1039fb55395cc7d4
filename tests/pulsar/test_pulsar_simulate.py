"""Orbit and observations: anchors of the specification, another integrator, order of the draws, what is refused."""

import numpy as np
import pytest

from geokalman.physics.ephemeris import OutsideEphemeris
from geokalman.physics.forces import kepler_force
from geokalman.physics.orbit import integrate
from geokalman.pulsar import linearise, simulate
from geokalman.pulsar.dynamics import Force, force_point, rich_force
from geokalman.pulsar.model import CLOCK, PRESETS, TRANSFER, Mission, Orbit, all_sigmas, preset
from geokalman.pulsar.observations import Observations


def test_states_of_the_specification(day):
    np.testing.assert_allclose(
        day.flight.x0, [-94807.881, 164212.067, -3743070.317, 2939.964636, 1697.389374, 0], atol=6e-4
    )
    np.testing.assert_allclose(day.flight.x[0, :3], [1335729.139, 968454.654, -3370694.703], atol=1e-3)
    np.testing.assert_allclose(day.rich.x[0, :3], [1335733.392, 968397.106, -3370635.286], atol=1e-2)


def test_first_observation_of_the_specification(day):
    expected = [1742038.083, -1825132.433, -3660393.390, 2944082.697, -3627327.728, 1103359.864, -915652.850]
    # the noise of all epochs is drawn in one array: with another length the transfer noise differs
    mission = Mission(days=5.0)
    data = simulate.observe(simulate.fly(mission, day.gravity), mission, preset("B").world, np.random.default_rng(0))
    np.testing.assert_allclose(data.z[0], expected, atol=1e-3)
    assert data.z.shape == (864, 7) and data.t[0] == 500.0


def test_the_force_without_oblateness_is_keplers(day):
    head = day.force.head.copy()
    head[2] = 0.0
    flight = simulate.fly_in(Force(head, day.force.field, day.force.sun), day.flight.x0, day.flight.t)
    exact = integrate(
        kepler_force, np.array([day.gravity.gm]), day.flight.x0, np.concatenate([[0.0], day.flight.t]), "dop853", 10.0
    )
    assert np.abs(flight.x[:, :3] - exact.r[1:, 0]).max() < 1.0  # the Runge-Kutta error of 60 epochs
    finer = simulate.fly_in(Force(head, day.force.field, day.force.sun), day.flight.x0, day.flight.t, step=2.5)
    assert np.abs(finer.x[:, :3] - exact.r[1:, 0]).max() < 5e-3


def test_mismatch_interpolates_the_forces(day):
    r, t = np.array([1.2e6, -2.3e6, 2.9e6]), 7777.0
    a = {share: np.empty(3) for share in (0.0, 0.3, 1.0)}
    for share, out in a.items():
        force = rich_force(day.gravity, day.mission, share)
        force_point(t, r, force.head, force.field, force.sun, out)
    np.testing.assert_allclose(a[0.3], a[0.0] + 0.3 * (a[1.0] - a[0.0]), rtol=1e-12)
    assert 1e-6 < np.linalg.norm(a[1.0] - a[0.0]) < 1e-2


def test_what_one_step_of_j2_misses(day):
    position, velocity = simulate.mismatch_rms(day.rich, day.force)
    assert 50 < position < 100 and 0.2 < velocity < 0.4


def test_noise_has_the_variance_that_is_told(day):
    mission = Mission(days=5.0)
    flight = simulate.fly(mission, day.gravity)
    chosen = preset("E")
    data = simulate.observe(flight, mission, chosen.world, np.random.default_rng(1))
    noise = data.z - flight.x[:, :3] @ data.H.T - CLOCK
    np.testing.assert_allclose((noise**2).mean(axis=0), data.variance, rtol=0.15)
    np.testing.assert_allclose(data.variance, 0.067**2 * (all_sigmas() ** 2 + TRANSFER**2))


def test_draws_do_not_depend_on_what_is_observed(day):
    few = Mission(days=day.mission.days, pulsars=(2, 5))
    data = simulate.observe(day.flight, few, preset("B").world, np.random.default_rng(0))
    np.testing.assert_array_equal(data.z, day.data.z[:, [1, 4]])


def test_outliers_and_biases_follow_the_noise(day):
    dirty = simulate.observe(day.flight, day.mission, preset("B").world, np.random.default_rng(0), 0.3)
    jump = (dirty.z - day.data.z) / all_sigmas()
    assert set(np.round(jump[jump != 0], 6)) == {-10.0, 10.0}
    assert 0.2 < (jump != 0).mean() < 0.4
    none, const, sign = (
        simulate.observe(day.flight, day.mission, preset("B").world, np.random.default_rng(0), bias=b).z
        for b in ("none", "const", "sign")
    )
    np.testing.assert_allclose(const - none, CLOCK + TRANSFER, atol=1e-6)
    np.testing.assert_allclose(np.abs(sign - none - CLOCK), TRANSFER, atol=1e-6)
    assert np.ptp(sign - none, axis=0).max() < 1e-6  # a constant for each pulsar
    with pytest.raises(ValueError, match="outlier_fraction"):
        simulate.observe(day.flight, day.mission, preset("B").world, np.random.default_rng(0), 1.5)


def test_one_detector(day):
    data = simulate.one_at_a_time(day.data, [3, 1], day.mission.columns)
    assert (np.isfinite(data.z).sum(axis=1) == 1).all()
    assert data.z[0, 2] == day.data.z[0, 2] and data.z[1, 0] == day.data.z[1, 0]
    with pytest.raises(ValueError, match=r"pulsars \[9\] are not observed"):
        simulate.one_at_a_time(day.data, [1, 9], day.mission.columns)


def test_presets():
    assert list(PRESETS) == list("ABCDE")
    np.testing.assert_allclose(preset("D").belief.process_noise(500.0), np.diag(np.repeat([150.0**2, 0.6**2], 3)))
    Q = preset("B").belief.process_noise(500.0)
    assert (
        Q[0, 0] == pytest.approx(1e-14 * 500**3 / 3)
        and Q[0, 3] == pytest.approx(1e-14 * 500**2 / 2)
        and Q[3, 3] == pytest.approx(1e-14 * 500)
    )
    assert preset("E", q_pos=None, q_vel=3.0).belief.q_vel == 3.0 and preset("E", q_vel=3.0).belief.q_pos == 1.0
    assert preset("C").tuned_belief().q_pos == 150.0


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda: preset("F"), "the presets are A, B, C, D, E"),
        (lambda: preset("A", q_pos=-1.0), "q_pos = -1"),
        (lambda: preset("A", sigma_scale=0.0), "sigma_scale = 0"),
        (lambda: preset("A", p0=(0.0, 1.0)), "sigmas must be positive"),
        (lambda: preset("A", noise="white"), "give qd or qc"),
        (lambda: preset("A").tuned_belief(), "defines no tuned"),
        (lambda: Mission(days=0.001), "leaves no epoch"),
        (lambda: Mission(pulsars=(1, 8)), "numbers of Table 1"),
        (lambda: Mission(pulsars=()), "numbers of Table 1"),
        (lambda: Mission(pulsars=(1, 2, 1)), "names one twice"),
    ],
)
def test_settings_that_are_refused(call, match):
    with pytest.raises(ValueError, match=match):
        call()


def test_orbits_that_are_refused(day):
    with pytest.raises(ValueError, match="meets Mars"):
        simulate.fly(Mission(Orbit(a=3500e3, e=0.1)), day.gravity)
    with pytest.raises(ValueError, match="mismatch lambda"):
        rich_force(day.gravity, day.mission, -1.0)
    with pytest.raises(OutsideEphemeris):
        rich_force(day.gravity, Mission(Orbit(epoch=2400000.5)))
    falling = day.flight.x0.copy()
    falling[3:] = 0.0
    with pytest.raises(ArithmeticError, match="meets Mars before epoch k = 1"):
        simulate.fly_in(day.force, falling, day.flight.t)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"t": np.array([500.0, 500.0, 1000.0])}, "must increase"),
        ({"t": np.array([0.0, 500.0, 1000.0])}, "initial state is at 0"),
        ({"z": np.zeros((2, 2))}, "do not fit"), ({"z": np.full((3, 2), np.inf)}, "epoch k = 1 is infinite"),
        ({"variance": np.array([1.0, 0.0])}, "positive and finite"),
        ({"H": np.array([[1.0, 0, 0], [1.0, 0, 0]])}, "same pulsar"),
    ],
)  # fmt: skip
def test_observations_that_are_refused(change, match):
    good = {"t": np.array([500.0, 1000.0, 1500.0]), "z": np.zeros((3, 2)), "H": np.eye(3)[:2], "variance": np.ones(2)}
    Observations(**good)
    with pytest.raises(ValueError, match=match):
        Observations(**{**good, **change})


def test_masked_ranges_are_missing(day):
    mask = np.zeros(day.data.z.shape, bool)
    mask[3, 2] = True
    data = day.data.masked(mask)
    assert np.isnan(data.z[3, 2]) and np.isnan(data.z).sum() == 1


@pytest.mark.parametrize(
    ("n", "errors"),
    [
        (1, (1.54e-2, 2.43, 8.5e-5, 1.50e-2)),
        (5, (9.0e-4, 0.128, 3.9e-6, 8.2e-4)),
        (50, (9.6e-6, 1.49e-3, 3.9e-8, 8.8e-6)),
    ],
)
def test_transition_matrix_errors_of_the_specification(day, n, errors):
    reference = linearise.by_differences(day.force, day.flight.x0)
    found = linearise.block_errors(linearise.markley(day.force, day.flight.x0, n), reference)
    np.testing.assert_allclose(list(found.values()), errors, rtol=0.05)


def test_the_integrated_transition_matrix_is_better(day):
    reference = linearise.by_differences(day.force, day.flight.x0)
    exact = linearise.integrated(day.force, day.flight.x0, 50)
    assert linearise.block_errors(exact, reference)["rv"] < 1e-5
    J = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
    np.testing.assert_allclose(exact.T @ J @ exact, J, atol=1e-6)  # symplectic, as a conservative force wants


def test_runge_kutta_errors_of_the_specification(day):
    found = [linearise.step_error(day.force, day.flight.x0, h) for h in (5.0, 10.0, 25.0, 50.0, 100.0)]
    np.testing.assert_allclose(found, [6e-6, 9e-5, 3.5e-3, 0.057, 0.93], rtol=0.08)


def test_a_masked_range_is_a_missing_one(day):
    data = day.data
    mask = np.arange(data.z.size).reshape(data.z.shape) == 3
    taken = Observations(data.t, np.ma.masked_array(np.where(mask, 99999.0, data.z), mask), data.H, data.variance)
    assert np.array_equal(np.isnan(taken.z), mask)
    with pytest.raises(ValueError, match="z holds complex numbers"):
        Observations(data.t, data.z + 0j, data.H, data.variance)
