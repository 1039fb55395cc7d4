"""Accelerations over an arc: against flights, solved equations of motion and stepped quaternions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from geokalman.attitude import arcs, effect, pointing
from geokalman.attitude.model import Scenario
from geokalman.constants import GM_EARTH, R_EARTH
from geokalman.physics.quaternion import difference, normalise


def test_the_difference_is_that_of_a_flight(hours):
    """Pointing angles of a few 0.1 mrad change it by a part in a thousand."""
    arc = arcs.difference(Scenario(duration_s=7200.0), 1, 6e-4, (1e-6, 0.0, 1e-6))
    q = hours.true_attitude("C")
    a = effect.accelerometer(hours, "C", q, (1e-6, 0.0, 1e-6))
    whole = pointing.acceleration_difference(q, effect.turned(q, 6e-4), a)
    k = np.round(arc.t).astype(int)
    np.testing.assert_allclose(arc.change, whole[k], atol=2e-3 * np.abs(whole).max())


def test_revolutions_are_taken_off():
    t = np.arange(0.0, 20000.0, 30.0)
    w = 2 * np.pi / 5668.0 * t
    series = np.column_stack([1 + np.cos(w), np.sin(2 * w + 0.3), 0.5 - np.cos(w - 1)])
    assert arcs.left_after_revolutions(arcs.Arc(t, series), 5668.0) < 1e-12
    series[:, 0] += 1e-2 * np.cos(5 * w)
    assert 1e-3 < arcs.left_after_revolutions(arcs.Arc(t, series), 5668.0) < 1e-2


def test_departures():
    """A fixed start at phase zero is the older function; a second phase and the fit against another integrator."""
    a, duration = 4.61e-10, 21600.0
    found = arcs.departures(a, duration, phases=4)
    assert found.fixed[0] == pytest.approx(effect.constant_force_departure(a, duration), rel=1e-9)
    n = np.sqrt(GM_EARTH / (R_EARTH + 490e3) ** 3)

    def rate(t, x, on=1.0, phase=np.pi / 2):
        up, along = on * a * np.sin(n * t + phase), on * a * np.cos(n * t + phase)
        return [x[2], x[3], 3 * n * n * x[0] + 2 * n * x[3] + up, -2 * n * x[2] + along]

    t = np.arange(0.0, duration + 5, 10.0)
    forced = solve_ivp(rate, (0, duration), np.zeros(4), t_eval=t, rtol=1e-11, atol=1e-15).y[:2]
    assert found.fixed[1] == pytest.approx(np.hypot(*forced).max(), rel=1e-4)
    s, c = np.sin(n * t), np.cos(n * t)  # the free motions in closed form (Clohessy and Wiltshire)
    free = [
        np.concatenate([4 - 3 * c, 6 * (s - n * t)]), np.concatenate([0 * t, 1 + 0 * t]),
        np.concatenate([s, -2 * (1 - c)]), np.concatenate([2 * (1 - c), 4 * s - 3 * n * t]),
    ]  # fmt: skip
    A, y = np.column_stack(free), forced.ravel()
    left = (y - A @ np.linalg.lstsq(A, y, rcond=None)[0]).reshape(2, -1)
    assert found.estimated[1] == pytest.approx(np.hypot(*left).max(), rel=1e-3)


def test_a_step_of_first_order_is_short():
    """Stepped quaternions: (omega dt)^3 / 12 a step."""
    w, dt = 1.1077e-3, 1.0
    q = np.array([1.0, 0, 0, 0])
    moved = normalise(q + 0.5 * dt * np.array([0.0, 0.0, w, 0.0]))
    turned = difference(q, moved)[1]
    assert w * dt - turned == pytest.approx(arcs.first_order_step(w, dt), rel=1e-5)
    assert arcs.first_order_step(w, dt) == pytest.approx((w * dt) ** 3 / 12, rel=1e-5)
    assert arcs.first_order_step(w, 0.125) * 8 * 86400 == pytest.approx(1.5e-7, rel=0.03)
