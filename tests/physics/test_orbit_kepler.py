"""Kepler elements and states: the two-body integrals, round trips, special orbits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geokalman.physics.kepler import Elements, eccentric_anomaly, kepler_to_state, state_to_kepler

GM = 3.986004415e14
angle = st.floats(0.0, 2 * np.pi, exclude_max=True)


def same_angle(a, b, tolerance):
    return abs((a - b + np.pi) % (2 * np.pi) - np.pi) < tolerance


@settings(deadline=None, max_examples=200)
@given(st.floats(-50.0, 50.0), st.floats(0.0, 0.999999))
def test_kepler_equation(M, e):
    E = eccentric_anomaly(M, e)
    assert abs(E - e * np.sin(E) - M) < 8 * np.spacing(max(1.0, abs(M)))


@settings(deadline=None, max_examples=200)
@given(st.floats(6.6e6, 4e8), st.floats(0.01, 0.95), st.floats(0.05, 3.0), angle, angle, angle)
def test_round_trip(a, e, inc, raan, argp, M):
    elements = Elements(a, e, inc, raan, argp, M)
    back = state_to_kepler(kepler_to_state(elements, GM), GM)
    assert abs(back.a / a - 1) < 1e-11
    assert abs(back.e - e) < 1e-12
    assert abs(back.inc - inc) < 1e-12
    for name in ("raan", "argp", "mean_anomaly"):
        assert same_angle(getattr(back, name), getattr(elements, name), 1e-10)


def test_integrals_of_the_two_body_problem():
    a, e, inc, raan = 2.66e7, 0.7, 1.1, 0.4
    for M in np.linspace(0, 6, 7):
        state = kepler_to_state((a, e, inc, raan, 0.9, M), GM)
        r, v = state[:3], state[3:]
        h = np.cross(r, v)
        np.testing.assert_allclose(v @ v / 2 - GM / np.linalg.norm(r), -GM / (2 * a), rtol=1e-12)
        normal = np.array([np.sin(raan) * np.sin(inc), -np.cos(raan) * np.sin(inc), np.cos(inc)])
        np.testing.assert_allclose(h, np.sqrt(GM * a * (1 - e**2)) * normal, rtol=1e-13)
    at_pericentre = kepler_to_state((a, e, inc, raan, 0.9, 0.0), GM)
    np.testing.assert_allclose(np.linalg.norm(at_pericentre[:3]), a * (1 - e), rtol=2e-15)


def test_textbook_axes():
    """Node on x, pericentre on the node: the satellite starts on x and goes north."""
    state = kepler_to_state((7e6, 0.1, np.pi / 2, 0.0, 0.0, 0.0), GM)
    np.testing.assert_allclose(state[:3], [6.3e6, 0, 0], atol=1e-9)
    assert state[5] > 0 and np.allclose(state[3:5], 0.0, atol=1e-9)


@pytest.mark.parametrize("inc", [0.0, 1.0, np.pi])
@pytest.mark.parametrize("e", [0.0, 0.2])
def test_orbits_without_node_or_pericentre_come_back(e, inc):
    state = kepler_to_state((7e6, e, inc, 0.5, 0.6, 0.7), GM)
    elements = state_to_kepler(state, GM)
    np.testing.assert_allclose(kepler_to_state(elements, GM), state, rtol=0, atol=2e-7)
    assert elements.e == pytest.approx(e, abs=2e-15)


def test_errors():
    with pytest.raises(ValueError, match=r"eccentricity 1 is no ellipse's: it must be in \[0, 1\)"):
        kepler_to_state((7e6, 1.0, 1, 0, 0, 0), GM)
    with pytest.raises(ValueError, match="eccentricity -0.1"):
        eccentric_anomaly(0.0, -0.1)
    with pytest.raises(ValueError, match="semi-major axis -7e[+]06 m must be positive"):
        kepler_to_state((-7e6, 0.1, 1, 0, 0, 0), GM)
    with pytest.raises(ValueError, match="GM = 0 m"):
        kepler_to_state((7e6, 0.1, 1, 0, 0, 0), 0.0)
    with pytest.raises(ValueError, match="angles .* must be finite"):
        kepler_to_state((7e6, 0.1, np.nan, 0, 0, 0), GM)
    escaping = np.array([7e6, 0, 0, 0, 1.5 * np.sqrt(GM / 7e6), 0])
    with pytest.raises(ValueError, match="eccentricity 1.25 at state .* e must be below 1"):
        state_to_kepler(escaping, GM)
    with pytest.raises(ValueError, match="straight line through the centre"):
        state_to_kepler(np.array([7e6, 0, 0, 100.0, 0, 0]), GM)
    with pytest.raises(ValueError, match=r"a state has shape \(6,\)"):
        state_to_kepler(np.zeros(3), GM)
