"""Forces, orbit and transition matrix against another integrator, another gravity recursion and other ephemerides."""

import erfa
import numba
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import gammaln

from geokalman.constants import AU, C_LIGHT
from geokalman.physics import satellite
from geokalman.physics.earth_orientation import load_orientation
from geokalman.physics.harmonics import load_field
from geokalman.physics.relativity import schwarzschild_point, shapiro
from geokalman.physics.satellite import GM_BODIES, ForceModel, budget, dynamics
from geokalman.physics.timescales import MJD_ZERO, mjd_of_date, tt_minus_utc

DAY = mjd_of_date(2013, 5, 7)
START, T0 = np.array([41951158.376, -22625101.610, 75256563.750, 21.28105446, 1821.27365598, 1871.60067831]), 47722.0
compiled = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="hours of orbit take minutes in plain Python")


@pytest.fixture(scope="module")
def world():
    return dynamics(DAY, 40000.0, 140000.0)


def cunningham(r, field, n_max):
    """Acceleration by Cunningham's un-normalised recursion (Montenbruck & Gill 3.29-3.33), equation (27) of the
    paper."""
    R2, rho = field.radius, field.radius**2 / (r @ r)
    x0, y0, z0 = field.radius * r / (r @ r)
    V, W = np.zeros((2, n_max + 2, n_max + 2))
    V[0, 0] = field.radius / np.sqrt(r @ r)
    for m in range(n_max + 2):
        if m > 0:
            V[m, m] = (2 * m - 1) * (x0 * V[m - 1, m - 1] - y0 * W[m - 1, m - 1])
            W[m, m] = (2 * m - 1) * (x0 * W[m - 1, m - 1] + y0 * V[m - 1, m - 1])
        for n in range(m + 1, n_max + 2):
            for X in (V, W):
                X[n, m] = ((2 * n - 1) * z0 * X[n - 1, m] - (n + m - 1) * rho * (X[n - 2, m] if n > 1 else 0.0)) / (
                    n - m
                )
    a = np.zeros(3)
    for n in range(n_max + 1):
        for m in range(n + 1):
            scale = np.sqrt((1 if m == 0 else 2) * (2 * n + 1) * np.exp(gammaln(n - m + 1) - gammaln(n + m + 1)))
            C, S = scale * field.C[n, m], scale * field.S[n, m]
            if m == 0:
                a += [-C * V[n + 1, 1], -C * W[n + 1, 1], -(n + 1) * C * V[n + 1, 0]]
                continue
            f = (n - m + 2) * (n - m + 1)
            a += [
                0.5 * (-C * V[n + 1, m + 1] - S * W[n + 1, m + 1] + f * (C * V[n + 1, m - 1] + S * W[n + 1, m - 1])),
                0.5 * (-C * W[n + 1, m + 1] + S * V[n + 1, m + 1] + f * (-C * W[n + 1, m - 1] + S * V[n + 1, m - 1])),
                -(n - m + 1) * (C * V[n + 1, m] + S * W[n + 1, m]),
            ]
    return field.gm / R2**2 * a


def independent_force(t, y, field):
    """All of the reference force model in plain Python: Cunningham, ERFA's matrix, un-tabulated bodies."""
    from geokalman.physics.ephemeris import load_ephemeris

    series = load_orientation()
    row = series.table(DAY, [t])[0]
    tt = DAY + (t + tt_minus_utc(DAY)) / 86400.0
    R = erfa.c2t06a(MJD_ZERO, tt, MJD_ZERO, DAY + (t + row[3]) / 86400.0, row[4], row[5])
    r, v = y[:3], y[3:]
    a = R.T @ cunningham(R @ r, field, 10)
    for name in ("sun", "moon", "venus"):
        s = load_ephemeris().position(name, DAY + MJD_ZERO, t + tt_minus_utc(DAY), "earth")
        a += GM_BODIES[name] * ((s - r) / np.linalg.norm(s - r) ** 3 - s / np.linalg.norm(s) ** 3)
        if name == "sun":
            a -= 4.56e-6 * 0.039 * AU**2 * (s - r) / np.linalg.norm(s - r) ** 3
    d = np.linalg.norm(r)
    return a + field.gm / (C_LIGHT**2 * d**3) * ((4 * field.gm / d - v @ v) * r + 4 * (r @ v) * v)


@compiled
def test_orbit_of_an_independent_implementation(world):
    """4.4 h of session ST: scipy's adaptive DOP853, Cunningham's recursion, ERFA's matrix, bodies straight from DE421.
    1 mm."""
    field, span = load_field("EGM96", 10), (T0, T0 + 15900.0)
    other = solve_ivp(
        lambda t, y: np.concatenate([y[3:], independent_force(t, y, field)]),
        span,
        START,
        "DOP853",
        rtol=1e-11,
        atol=1e-6,
    )
    ours = world.propagate(START, np.array(span)).y[-1]
    np.testing.assert_allclose(ours[:3], other.y[:3, -1], rtol=0, atol=1e-3)
    np.testing.assert_allclose(ours[3:], other.y[3:, -1], rtol=0, atol=1e-7)


def test_acceleration_low_down_where_all_degrees_count(world):
    """At 7000 km the harmonics to degree 10 are 1e-5 m/s^2: 1e-12 relative to the whole."""
    y = np.array([4.1e6, -3.2e6, 4.9e6, 1e3, 5e3, 4e3])
    np.testing.assert_allclose(
        world.acceleration(60000.0, y), independent_force(60000.0, y, load_field("EGM96", 10)), rtol=0, atol=2e-9
    )


@compiled
def test_one_day_of_session_st(world):
    """Section 3 of the specification; 0.2 m when all constants match."""
    out = world.propagate(START, np.array([T0, T0 + 86400.0])).y[-1]
    np.testing.assert_allclose(out[:3], [6890811.04, 122974119.23, 138921956.82], rtol=0, atol=0.2)
    np.testing.assert_allclose(out[3:], [-548.19250, 1362.64810, 79.59987], rtol=0, atol=2e-5)
    back = world.propagate(out, np.array([T0 + 86400.0, T0])).y[-1]
    assert np.linalg.norm(back[:3] - START[:3]) < 1e-5


@compiled
def test_half_the_step_changes_nothing(world):
    span = np.array([T0, T0 + 86400.0])
    assert np.linalg.norm(world.propagate(START, span).r[-1, 0] - world.propagate(START, span, 300.0).r[-1, 0]) < 1e-6


@compiled
def test_transition_matrix_is_the_derivative_of_the_flow(world):
    """Against central differences; 1e-6 is what a second-order difference over 1 km and 1 m/s leaves, and the gradient
    of degree 3."""
    t1 = T0 + 16000.0
    end, Phi = world.transition(START, T0, t1)
    for j in range(6):
        e = np.zeros(6)
        e[j] = 1e3 if j < 3 else 1.0
        states = [world.propagate(START + sign * e, np.array([T0, t1])).y[-1] for sign in (1, -1)]
        np.testing.assert_allclose(
            Phi[:, j], (states[0] - states[1]) / (2 * e[j]), rtol=0, atol=1e-6 * np.abs(Phi[:, j]).max()
        )
    np.testing.assert_allclose(end, world.propagate(START, np.array([T0, t1])).y[-1], rtol=0, atol=1e-4)


@compiled
def test_euler_steps_approach_the_integrated_matrix(world):
    _, Phi = world.transition(START, T0, T0 + 5000.0)
    errors = []
    for step in (100.0, 10.0):
        y, A = START.copy(), np.eye(6)
        satellite.euler_transition_step(T0, T0 + 5000.0, step, y, world.params, A)
        errors.append(np.abs(A - Phi).max())
    assert errors[1] < 0.15 * errors[0]


def test_gradient_is_the_derivative_of_the_acceleration(world):
    G, numeric = world.gradient(T0, START), np.empty((3, 3))
    for j in range(3):
        e = np.zeros(6)
        e[j] = 100.0
        numeric[:, j] = (world.acceleration(T0, START + e) - world.acceleration(T0, START - e)) / 200.0
    np.testing.assert_allclose(G, numeric, rtol=0, atol=1e-7 * np.abs(G).max())


def test_bodies_against_erfas_own_series(world):
    """Simon's Moon is good to kilometres, epv00 to 10 km: 1e-4 of the distance shows a wrong axis, sign or time."""
    tt = DAY + (60000.0 + tt_minus_utc(DAY)) / 86400.0
    moon = erfa.moon98(MJD_ZERO, tt)["p"] * AU
    sun = -erfa.epv00(MJD_ZERO, tt)[0]["p"] * AU
    for name, expected in (("moon", moon), ("sun", sun)):
        assert np.linalg.norm(world.body(name, 60000.0) - expected) < 1e-4 * np.linalg.norm(expected)


def test_interpolated_bodies_are_those_of_the_ephemeris(world):
    from geokalman.physics.ephemeris import load_ephemeris

    for name in GM_BODIES:
        exact = load_ephemeris().position(name, DAY + MJD_ZERO, 61234.5 + tt_minus_utc(DAY), "earth")
        assert np.linalg.norm(world.body(name, 61234.5) - exact) < 0.1


def test_budget_of_session_st(world):
    sizes = budget(world, T0, START)
    for name, value, rel in (("kepler", 5.023e-2, 1e-3), ("moon", 1.03e-5, 0.01), ("sun", 4.17e-6, 0.01), ("j2", 6.10e-7, 0.01), ("solar_pressure", 1.75e-7, 0.01),
                             ("degrees_3_up", 2.1e-10, 0.05), ("jupiter", 1.7e-11, 0.05), ("relativity", 1.1e-11, 0.05), ("venus", 2.1e-12, 0.05)):  # fmt: skip
        assert sizes[name] == pytest.approx(value, rel=rel), name


def test_no_sunlight_in_the_shadow_of_the_earth(world):
    """Behind the Earth the force without pressure is the whole force."""
    sun = world.body("sun", T0)
    behind = np.concatenate([-2e7 * sun / np.linalg.norm(sun), np.zeros(3)])
    dark = dynamics(DAY, 40000.0, 140000.0, ForceModel(kappa=0.0))
    np.testing.assert_array_equal(world.acceleration(T0, behind), dark.acceleration(T0, behind))
    assert np.linalg.norm(world.acceleration(T0, -behind) - dark.acceleration(T0, -behind)) > 1e-7


def test_constant_acceleration_and_pressure_scale(world):
    changed = world.with_changes(2.0, np.array([1e-9, 0.0, 0.0]))
    difference = changed.acceleration(T0, START) - world.acceleration(T0, START)
    without = dynamics(DAY, 40000.0, 140000.0, ForceModel(kappa=0.0)).acceleration(T0, START)
    np.testing.assert_allclose(difference, world.acceleration(T0, START) - without + [1e-9, 0, 0], rtol=0, atol=1e-15)


def test_relativity_of_a_circular_orbit():
    """On a circle 4 GM/r - v^2 = 3 GM/r: the term is 3 GM^2 / (c^2 r^3), outward."""
    r, gm = 1e7, 3.986e14
    out = np.zeros(3)
    schwarzschild_point(np.array([r, 0, 0]), np.array([0, np.sqrt(gm / r), 0]), gm, out)
    np.testing.assert_allclose(out, [3 * gm**2 / (C_LIGHT**2 * r**3), 0, 0], rtol=1e-12)


def test_shapiro_of_a_radial_ray():
    """r2 = r1 + D gives 2 GM/c^3 ln(r2/r1)."""
    assert shapiro(6.4e6, 9e7, 9e7 - 6.4e6, 3.986e14) == pytest.approx(
        2 * 3.986e14 / C_LIGHT**3 * np.log(9e7 / 6.4e6), rel=1e-12
    )


def test_bad_input(world):
    with pytest.raises(ValueError, match="outside the tables"):
        world.acceleration(1e6, START)
    with pytest.raises(ValueError, match="outside the tables"):
        world.propagate(START, np.array([T0, 1e6]))
    with pytest.raises(ValueError, match="is outside"):
        dynamics(mjd_of_date(2022, 1, 1), 0.0, 1000.0)
    with pytest.raises(ValueError, match="span"):
        dynamics(DAY, 10.0, 10.0)
    with pytest.raises(ValueError, match="pluto"):
        ForceModel(bodies=("pluto",))
    with pytest.raises(ValueError, match="degree = -1"):
        ForceModel(degree=-1)
    with pytest.raises(ValueError, match="kappa"):
        ForceModel(kappa=float("nan"))
    with pytest.raises(ValueError, match="inside the surface"):
        world.propagate(START / 20, np.array([T0, T0 + 10]))
