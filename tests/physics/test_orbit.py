"""The integrators against closed forms, against each other, against scipy, and against their own smaller steps."""

from fractions import Fraction

import numba
import numpy as np
import pytest
from numba import njit
from scipy.integrate import solve_ivp

from geokalman.constants import GM_EARTH, OMEGA_EARTH
from geokalman.physics import gauss_jackson, orbit
from geokalman.physics.dop853 import FORCE
from geokalman.physics.forces import gravity_force, gravity_params, jacobi_constant, kepler_force
from geokalman.physics.frames import to_ecef, to_eci
from geokalman.physics.gravity import acceleration
from geokalman.physics.harmonics import load_field
from geokalman.physics.kepler import kepler_to_state
from geokalman.physics.orbit import integrate

GRACE = (6834e3, 0.0018, np.radians(89.0), 0.3, 0.5, 0.1)
POINT_MASS = np.array([GM_EARTH])
compiled_only = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="hours of orbit take minutes in plain Python")


@njit(FORCE, cache=True)
def damped(t, y, params, out):
    """x'' = -w^2 x - 2 d x' + f sin t: forces that know velocity and time; closed form below."""
    for i in range(3):
        out[i] = -(params[0] ** 2) * y[i] - 2 * params[1] * y[3 + i] + params[2] * np.sin(t)


@pytest.fixture(scope="module")
def field():
    return load_field("EGM96", 20)


@pytest.fixture(scope="module")
def pair(field):
    """A quarter of a day of a pair in the field to degree 20 by Gauss-Jackson."""
    params = gravity_params(field, OMEGA_EARTH)
    B = kepler_to_state(GRACE, field.gm)
    A = integrate(gravity_force, params, B, (28.9, 1), "dop853").y[-1]
    return params, np.concatenate([A, B]), integrate(gravity_force, params, np.concatenate([A, B]), (30.0, 720))


def relative(o):
    return o.r[:, 0] - o.r[:, 1]


def range_rate(o):
    d, v = relative(o), o.v[:, 0] - o.v[:, 1]
    return np.sum(d * v, axis=1) / np.linalg.norm(d, axis=1)


def kepler_positions(elements, t):
    a = elements[0]
    mean = elements[5] + np.sqrt(GM_EARTH / a**3) * t
    return np.array([kepler_to_state((*elements[:5], m), GM_EARTH) for m in mean])


def test_gauss_jackson_weights_are_the_classical_ones():
    """Central: 1/12, -1/240, 31/60480 on even differences; Adams-Bashforth predictor of velocity, with the sum's 1."""
    u, w = gauss_jackson.weights((-1, 0, 1))
    second_difference = np.array([1.0, -2.0, 1.0])
    np.testing.assert_allclose(u, np.array([0, 1 / 12, 0]) - second_difference / 240, rtol=2e-15)
    # s_(k-1/2) + a_k/2 - (a_(k+1) - a_(k-1))/24
    np.testing.assert_allclose(w, [1 / 24, 1 / 2, -1 / 24], rtol=2e-15)
    _, w = gauss_jackson.weights((-1, -2, -3))
    # v_k - v_(k-1) = h (a_(k-1) + sum w_j (a_(k-j) - a_(k-1-j))) must be the Adams-Bashforth formula of four points
    adams = np.append(w, 0.0) - np.append(0.0, w) + [1, 0, 0, 0]
    np.testing.assert_allclose(adams, np.array([55, -59, 37, -9]) / 24, rtol=1e-14)


@pytest.mark.parametrize("nodes", [(-1, -2, -3, -4), (-2, -1, 0, 1, 2)])
def test_gauss_jackson_weights_are_exact_for_polynomials(nodes):
    """a = k^p on the grid: sums by exact fractions, positions by its second integral k^(p+2)/((p+1)(p+2))."""
    u, w = (np.array([Fraction(x).limit_denominator(10**7) for x in f]) for f in gauss_jackson.weights(nodes))
    for p in range(len(nodes)):
        K = 9
        a = [Fraction(k) ** p for k in range(-20, 21)]
        at = {k: a[k + 20] for k in range(-20, 21)}

        def position(k, p=p):
            return Fraction(k) ** (p + 2) / ((p + 1) * (p + 2))

        def velocity(k, p=p):
            return Fraction(k) ** (p + 1) / (p + 1)

        s = velocity(0) - sum(w[i] * at[j] for i, j in enumerate(nodes))
        S = position(0) - sum(u[i] * at[j] for i, j in enumerate(nodes))
        for k in range(K):
            s += at[k]
            S += s
        assert S + sum(u[i] * at[K + j] for i, j in enumerate(nodes)) == position(K)
        assert s + sum(w[i] * at[K + j] for i, j in enumerate(nodes)) == velocity(K)


@compiled_only
@pytest.mark.parametrize(("method", "h", "tolerance"), [("gj", 10.0, 3e-6), ("dop853", 15.0, 6e-5)])
def test_kepler_orbit_over_many_revolutions(method, h, tolerance):
    """Five days, 77 revolutions: the closed form is met to micrometres (Gauss-Jackson) in 3e9 m travelled."""
    elements = (6834e3, 0.0018, 1.2, 0.3, 0.5, 0.1)
    o = integrate(kepler_force, POINT_MASS, kepler_to_state(elements, GM_EARTH), (600.0, 720), method, h)
    exact = kepler_positions(elements, o.t)
    # the closed form itself: the mean motion times 4.3e5 s rounds at 1e-13 rad, 7e-7 m
    assert np.abs(o.r[:, 0] - exact[:, :3]).max() < tolerance
    assert np.abs(o.v[:, 0] - exact[:, 3:]).max() < 1.2e-3 * tolerance


@compiled_only
def test_order_of_convergence_of_dop853():
    elements = (6834e3, 0.01, 1.2, 0.3, 0.5, 0.1)
    error = []
    for h in (240.0, 120.0):
        o = integrate(kepler_force, POINT_MASS, kepler_to_state(elements, GM_EARTH), (1200.0, 20), "dop853", h)
        error.append(np.abs(o.y[-1, :3] - kepler_positions(elements, o.t[-1:])[0, :3]).max())
    assert 7.3 < np.log2(error[0] / error[1]) < 9.5


@pytest.mark.parametrize("e", [0.01, 0.15])
def test_gauss_jackson_until_its_limit(e):
    """Up to w h = 0.045 truncation is below rounding (its order: the test of the weights); beyond, it must refuse."""
    elements = (7e6 / (1 - e), e, 1.2, 0.3, 0.5, 0.1)
    y0 = kepler_to_state(elements, GM_EARTH)
    o = integrate(kepler_force, POINT_MASS, y0, (600.0, 40), "gj", 40.0)
    assert np.abs(o.r[:, 0] - kepler_positions(elements, o.t)[:, :3]).max() < 1e-6
    with pytest.raises(ArithmeticError, match="step h = 100 s is too long for Gauss-Jackson here, .* or take"):
        integrate(kepler_force, POINT_MASS, y0, (600.0, 40), "gj", 100.0)


def test_force_of_velocity_and_time():
    """A damped driven oscillator: both methods meet the closed form, which asks for v and t in the predictor."""
    w, d, f = 1.0, 0.002, 0.01
    params, y0 = np.array([w, d, f]), np.array([1.0, 0, 0, 0, 0.3, 0])
    for method in ("gj", "dop853"):
        o = integrate(damped, params, y0, (0.5, 60), method, 0.05)
        # particular solution p sin t + q cos t of x'' + 2 d x' + x = f sin t for w = 1
        q = -f / (2 * d)
        root = np.sqrt(1 - d * d)
        for i in range(3):
            x0, v0 = y0[i] - q, y0[3 + i]
            decay = np.exp(-d * o.t)
            free = decay * (x0 * np.cos(root * o.t) + (v0 + d * x0) / root * np.sin(root * o.t))
            np.testing.assert_allclose(o.r[:, 0, i], free + q * np.cos(o.t), rtol=0, atol=2e-12)


def test_gravity_force_is_the_turning_field(field):
    params, t = gravity_params(field, OMEGA_EARTH), 12345.0
    y = np.concatenate([kepler_to_state(GRACE, GM_EARTH), kepler_to_state((8e6, 0.1, 1.0, 2.0, 3.0, 4.0), GM_EARTH)])
    out = np.empty(6)
    gravity_force(t, y, params, out)
    r = y.reshape(2, 6)[:, :3]
    expected = to_eci(t, acceleration(field, to_ecef(t, r, OMEGA_EARTH)), OMEGA_EARTH)
    np.testing.assert_allclose(out.reshape(2, 3), expected, rtol=0, atol=8 * np.spacing(np.abs(expected).max()))


@compiled_only
def test_gauss_jackson_equals_dop853(pair):
    params, y0, o = pair
    other = integrate(gravity_force, params, y0, (30.0, 720), "dop853", 10.0)
    assert np.abs(relative(o) - relative(other)).max() < 5e-7
    assert np.abs(range_rate(o) - range_rate(other)).max() < 2e-10
    assert np.abs(o.r - other.r).max() < 2e-6


@compiled_only
def test_gauss_jackson_equals_scipy(pair):
    """solve_ivp knows nothing of us but the acceleration: DOP853 with free steps."""
    params, y0, o = pair
    out = np.empty(6)

    def slope(t, y):
        gravity_force(t, y, params, out)
        return np.concatenate([y[3:6], out[:3], y[9:12], out[3:]])

    atol = np.tile(np.repeat([1e-7, 1e-10], 3), 2)
    last = solve_ivp(slope, (0, o.t[-1]), y0, "DOP853", rtol=1e-13, atol=atol, max_step=30.0).y[:, -1]
    assert np.abs(o.y[-1] - last)[[0, 1, 2, 6, 7, 8]].max() < 1e-5
    assert np.abs(o.y[-1] - last)[[3, 4, 5, 9, 10, 11]].max() < 1e-8


@compiled_only
def test_half_the_step(pair):
    params, y0, o = pair
    fine = integrate(gravity_force, params, y0, (30.0, 720), "gj", 5.0)
    assert np.abs(relative(o) - relative(fine)).max() < 2e-7
    assert np.abs(range_rate(o) - range_rate(fine)).max() < 3e-11


@compiled_only
def test_time_reversal(pair):
    params, _y0, o = pair
    for method in ("gj", "dop853"):
        back = integrate(gravity_force, params, o.y[-1], o.t[::-1], method)
        assert np.abs(back.r[-1] - o.r[0]).max() < 3e-6
        assert np.abs(back.r[::-1] - o.r).max() < 3e-6


def test_jacobi_constant_of_a_point_mass(field):
    """-GM/2a - omega h_z in closed form, for two bodies at two times."""
    elements = [(6834e3, 0.0018, 1.5, 0.3, 0.5, 0.1), (8e6, 0.1, 1.0, 2.0, 3.0, 4.0)]
    y = np.array([[kepler_to_state(e, GM_EARTH) for e in elements]] * 2)
    J = jacobi_constant(np.array([0.0, 5000.0]), y[..., :3], y[..., 3:], field, OMEGA_EARTH, n_max=0)
    momentum = [np.sqrt(GM_EARTH * a * (1 - e * e)) * np.cos(i) for a, e, i, *_ in elements]
    exact = [-GM_EARTH / (2 * a[0]) - OMEGA_EARTH * h_z for a, h_z in zip(elements, momentum, strict=True)]
    np.testing.assert_allclose(J, [exact, exact], rtol=1e-14)


@compiled_only
def test_jacobi_constant_is_kept(pair, field):
    _, _, o = pair
    J = jacobi_constant(o.t, o.r, o.v, field, OMEGA_EARTH)
    assert J.shape == (721, 2)
    np.testing.assert_allclose(J[0], -2.9e7, rtol=0.01)
    assert np.max(np.ptp(J, axis=0) / np.abs(J.mean(axis=0))) < 1e-13
    energy = J + OMEGA_EARTH * (o.r[..., 0] * o.v[..., 1] - o.r[..., 1] * o.v[..., 0])
    assert np.ptp(energy[:, 0]) > 1e-10 * 2.9e7  # the energy alone is not constant: the test above can fail


@pytest.mark.parametrize("method", ["gj", "dop853"])
def test_chunks_do_not_change_a_bit(method, monkeypatch):
    y0 = np.concatenate([kepler_to_state(GRACE, GM_EARTH), kepler_to_state((8e6, 0.1, 1.0, 2.0, 3.0, 4.0), GM_EARTH)])
    whole = integrate(kepler_force, POINT_MASS, y0, (30.0, 100), method)
    seen = []
    monkeypatch.setattr(orbit, "CHUNK", 37)
    parts = integrate(kepler_force, POINT_MASS, y0, (30.0, 100), method, progress=seen.append)
    np.testing.assert_array_equal(parts.y, whole.y)
    assert len(seen) > 4 and seen[-1] == 1.0 and np.all(np.diff(seen) > 0)


def test_interrupt_reaches_a_long_run(monkeypatch):
    monkeypatch.setattr(orbit, "CHUNK", 50)

    def stop(done):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        integrate(kepler_force, POINT_MASS, kepler_to_state(GRACE, GM_EARTH), (30.0, 200), progress=stop)


@compiled_only
def test_short_runs_and_uneven_times(pair):
    """Fewer steps than the start arc, and output at some of the grid's points alone."""
    params, y0, o = pair
    short = integrate(gravity_force, params, y0, (30.0, 3))
    np.testing.assert_allclose(short.r, o.r[:4], rtol=0, atol=2e-8)
    assert short.method == "gj"
    some = integrate(gravity_force, params, y0, np.array([0.0, 10.0, 240.0, 6000.0, 21600.0]))
    np.testing.assert_allclose(some.r[[2, 3]], o.r[[8, 200]], rtol=0, atol=1e-8)
    np.testing.assert_allclose(some.r[-1], o.r[720], rtol=0, atol=1e-8)
    later = integrate(gravity_force, params, o.y[100], o.t[100:300])
    np.testing.assert_allclose(later.r, o.r[100:300], rtol=0, atol=1e-6)


@compiled_only
def test_one_body_does_not_feel_the_other(pair):
    params, y0, o = pair
    alone = integrate(gravity_force, params, y0[6:], (30.0, 720))
    np.testing.assert_array_equal(alone.r[:, 0], o.r[:, 1])


@compiled_only
def test_rk45_is_the_papers_mode(pair):
    params, y0, o = pair
    tight = integrate(gravity_force, params, y0, (30.0, 720), "rk45", rtol=1e-12, atol=1e-9)
    loose = integrate(gravity_force, params, y0, (30.0, 720), "rk45", rtol=1e-6, atol=1e-6)
    assert np.abs(range_rate(tight) - range_rate(o)).max() < 5e-9
    assert np.abs(range_rate(loose) - range_rate(o)).max() > 1e-4
    assert tight.h == 0.0 and tight.evaluations > 3 * loose.evaluations


def test_compiled_equals_python():
    """The kernels as Python, on a short arc."""
    y0 = np.concatenate([kepler_to_state(GRACE, GM_EARTH), kepler_to_state((8e6, 0.1, 1.0, 2.0, 3.0, 4.0), GM_EARTH)])
    compiled = {m: integrate(kepler_force, POINT_MASS, y0, (60.0, 10), m, 20.0) for m in ("gj", "dop853")}
    kernels = [(orbit, "dop853_steps"), (gauss_jackson, "gauss_jackson_steps"), (gauss_jackson, "central_states")]
    with pytest.MonkeyPatch.context() as patch:
        for module, name in kernels:
            kernel = getattr(module, name)
            patch.setattr(module, name, getattr(kernel, "py_func", kernel))
        for method, fast in compiled.items():
            plain = integrate(kepler_force, POINT_MASS, y0, (60.0, 10), method, 20.0)
            np.testing.assert_allclose(plain.y, fast.y, rtol=0, atol=1e-8)


@pytest.mark.parametrize("method", ["gj", "dop853", "rk45"])
def test_a_fall_is_refused(method):
    low = kepler_to_state((6.6e6, 0.05, 1.0, 0, 0, np.pi), GM_EARTH)  # pericentre at 6270 km
    with pytest.raises(ArithmeticError, match=r"within 6378137 m of the centre.* about t = \d+"):
        integrate(kepler_force, POINT_MASS, low, (30.0, 200), method, surface=6378137.0)
    integrate(kepler_force, POINT_MASS, low, (30.0, 10), method, surface=6378137.0)  # not there yet


def test_errors_say_what_would_be_right(field):
    params, y0 = gravity_params(field, OMEGA_EARTH), kepler_to_state(GRACE, field.gm)
    run = lambda **changes: integrate(gravity_force, params, **{"y0": y0, "t": (30.0, 20), **changes})
    with pytest.raises(ValueError, match=r"dt = 30 s at index 1 is no multiple of the step h = 7 s: take h = 6 s"):
        run(h=7.0)
    with pytest.raises(ValueError, match=r"no multiple of the step h = 10 s: take h = 9.633333333 s, or method dop853"):
        run(t=(28.9, 20))
    with pytest.raises(ValueError, match="method 'euler' is unknown, take one of gj, dop853, rk45"):
        run(method="euler")
    with pytest.raises(ValueError, match="step h = -10 s must be positive"):
        run(h=-10.0)
    with pytest.raises(ValueError, match="0 intervals of 30 s"):
        run(t=(30.0, 0))
    with pytest.raises(ValueError, match=r"times 60, 30 s at index 1: times must go strictly one way"):
        run(t=np.array([0.0, 60.0, 30.0]))
    with pytest.raises(ValueError, match="must go strictly one way and be finite"):
        run(t=np.array([0.0, np.nan, 30.0]))
    with pytest.raises(ValueError, match=r"times have shape \(1,\)"):
        run(t=np.array([0.0]))
    with pytest.raises(ValueError, match=r"state of shape \(7,\): six numbers"):
        run(y0=np.ones(7))
    with pytest.raises(ValueError, match="not finite"):
        run(y0=np.full(6, np.nan))
    with pytest.raises(ValueError, match="body 1 starts 1000 m from the centre, inside the surface at 6378137 m"):
        run(y0=np.array([[7e6, 0, 0, 0, 7e3, 0], [1e3, 0, 0, 0, 0, 0]]), surface=6378137.0)
    with pytest.raises(ValueError, match="rtol = 0, atol = 1e-09 must be positive"):
        run(method="rk45", rtol=0.0)
    with pytest.raises(ValueError, match="omega = nan rad/s must be a finite number"):
        gravity_params(load_field("EGM96", 2), np.nan)
