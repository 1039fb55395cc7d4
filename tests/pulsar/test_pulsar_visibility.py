"""Pulsars behind Mars, the exposure, the clock aboard and the strengths of forces, against closed forms."""

import numpy as np
import pytest

from geokalman.constants import C_LIGHT, GM_SUN
from geokalman.physics import mars
from geokalman.physics.kepler import kepler_to_state
from geokalman.pulsar import experiment, perturbation, simulate, timing, visibility
from geokalman.pulsar.dynamics import rich_force
from geokalman.pulsar.experiment import Method
from geokalman.pulsar.model import preset


def circle(a, count=20_000):
    angle = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    return a * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])


@pytest.mark.parametrize("elevation", [0.0, 0.5, -0.9, 1.3])
def test_the_hidden_share_of_a_circle(elevation):
    n = np.array([[np.cos(elevation), 0.0, np.sin(elevation)]])
    share = visibility.hidden(circle(3780e3), n, 3397e3).mean()
    assert share == pytest.approx(visibility.hidden_share(3780e3, 3397e3, np.array([elevation]))[0], abs=1e-4)


def test_hidden_is_behind_and_within_the_disc():
    r = 4e6 * np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-0.1, 1.0, 0.0], [-1.0, 0.9, 0.0]])
    assert visibility.hidden(r, np.eye(3)[:1], 3397e3).ravel().tolist() == [True, False, False, False]


def test_an_experiment_leaves_out_what_is_hidden(day):
    methods = {"ekf": Method("ekf")}
    seen, occulted = (
        experiment.Experiment(day.mission, preset("B"), day.flight, day.force, methods, first=10, occulted=o).observe(
            np.random.default_rng(0)
        )
        for o in (False, True)
    )
    behind = np.isnan(occulted.z)
    assert 0.25 < behind.mean() < 0.45 and np.isfinite(seen.z).all()
    np.testing.assert_array_equal(occulted.z[~behind], seen.z[~behind])
    assert (np.einsum("ni,mi->nm", day.flight.x[:, :3], day.data.H)[behind] < 0).all()


def test_the_exposure_of_a_circle():
    v = circle(3000.0)
    arc, delay = visibility.exposure(v, np.eye(3)[:2], 500.0)
    assert arc == pytest.approx(1.5e6) and delay == pytest.approx(1.5e6 / C_LIGHT, rel=1e-6)


@pytest.mark.parametrize(("gm", "a", "e"), [(GM_SUN, 2.279e11, 0.0934), (4.2828e13, 3.78e6, 0.0085)])
def test_the_clock_on_an_ellipse(gm, a, e):
    """The integral over one revolution against drift and swing in closed form (exact for an ellipse)."""
    period = 2.0 * np.pi * np.sqrt(a**3 / gm)
    t = np.linspace(0.0, period, 20_001)
    mean = 2.0 * np.pi * t / period
    anomaly = mean.copy()
    for _ in range(50):
        anomaly = mean + e * np.sin(anomaly)
    states = np.array([kepler_to_state((a, e, 0.3, 0.2, 0.1, m), gm) for m in mean[::100]])
    offset = timing.clock_offset(t[::100], states[:, :3], states[:, 3:], gm)
    expected = timing.clock_drift(gm, a) * t + timing.clock_swing(gm, a, e) * np.sin(anomaly)
    np.testing.assert_allclose(offset, expected[::100], atol=2e-3 * timing.clock_swing(gm, a, e))


def test_the_einstein_delay_at_mars():
    assert timing.clock_swing(GM_SUN, 2.2794e11, 0.0934) == pytest.approx(11.4e-3, rel=0.01)
    assert timing.clock_place(np.array([[3.0, 4.0, 0.0]]), 2.0) == pytest.approx(10.0 / C_LIGHT**2)


def test_strengths_of_forces(day):
    gravity, r = day.gravity, np.linalg.norm(day.rich.x[:, :3], axis=1)
    strong = perturbation.strengths(day.rich, rich_force(gravity, day.mission))
    assert strong["point"] == pytest.approx(gravity.gm * np.sqrt((r**-4.0).mean()), rel=1e-12)
    latitude = day.rich.x[:, 2] / r  # |a_J2| = (3/2) J2 GM R^2/r^4 sqrt(1 - 2 s^2 + 5 s^4)
    exact = 1.5 * mars.j2(gravity) * gravity.gm * gravity.radius**2 / r**4
    exact *= np.sqrt(1.0 - 2.0 * latitude**2 + 5.0 * latitude**4)
    assert strong["j2"] == pytest.approx(np.sqrt((exact**2).mean()), rel=1e-9)
    tide = GM_SUN * r / 2.1e11**3
    assert 0.5 * tide.mean() < strong["sun"] < 3.0 * tide.mean()
    assert strong["rest"] == pytest.approx(strong["field"], rel=1e-3) and strong["light"] < 5e-8


def test_the_transfer_keeps_its_own_factor(day):
    same, kept = (preset("E", transfer_scale=scale).world for scale in (None, 1.0))
    one, other = (simulate.observe(day.rich, day.mission, w, np.random.default_rng(0)).variance for w in (same, kept))
    np.testing.assert_allclose(other - one, (1.0 - 0.067**2) * (C_LIGHT * 1e-7) ** 2)
