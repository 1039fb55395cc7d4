"""Mars and the kernels that an orbiter needs: anchors of the specification, finite differences, other algorithms."""

import warnings

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from geokalman.constants import AU, GM_SUN
from geokalman.physics import mars, oblate, perturbations, transition
from geokalman.physics.field import MARS, require_body
from geokalman.physics.gravity import acceleration
from geokalman.physics.harmonics import GravityField, load_field

FIELD = mars.gravity()
CONSTANTS = (FIELD.gm, FIELD.radius, mars.j2(FIELD))
R = np.array([1.2e6, -2.3e6, 2.9e6])


def test_rotation_from_the_icrf():
    expected = [
        [0.6734438693, 0.7392383613, 0.0],
        [-0.5894331718, 0.5369718032, 0.6035145553],
        [0.4461411109, -0.4064331773, 0.7973519810],
    ]
    np.testing.assert_allclose(mars.smci_from_icrf(0.14), expected, atol=1e-10)
    np.testing.assert_allclose(mars.icrf_from_smci(0.14) @ mars.smci_from_icrf(0.14), np.eye(3), atol=2e-15)


def test_the_pole_is_where_the_iau_puts_it():
    ra, dec = np.radians(317.68143 - 0.1061 * 0.14), np.radians(52.88650 - 0.0609 * 0.14)
    pole = [np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)]
    np.testing.assert_allclose(mars.icrf_from_smci(0.14) @ [0, 0, 1], pole, atol=2e-15)


def test_prime_meridian():
    assert np.degrees(mars.prime_meridian(2451545.0)) == pytest.approx(176.630)
    assert np.degrees(mars.prime_meridian(2451546.0)) == pytest.approx((176.630 + 350.89198226) % 360)


def test_constants_of_gmm2b():
    assert mars.j2(FIELD) == pytest.approx(1.955453679e-3, abs=5e-13)
    assert (FIELD.gm, FIELD.radius, FIELD.n_max) == (42828.371901284e9, 3397e3, 20)
    assert pytest.approx(-8.7450547081842e-4, rel=1e-13) == FIELD.C[2, 0]
    assert FIELD.sigma_C is not None and FIELD.sigma_C[2, 0] == pytest.approx(1.21e-10, rel=1e-2)
    with pytest.raises(ValueError, match="out of range"):
        mars.gravity(21)


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"gm": 42828.37}, "km"),
        ({"radius": 3397.0}, "in km"),
        ({"gm": 3.986e14}, "another body"),
        ({"C": np.sqrt(5) * FIELD.C}, "unnormalised"),
    ],
)
def test_a_field_in_other_units_is_refused(changes, match):
    C = np.array(changes.get("C", FIELD.C))
    C[0, 0] = 1.0
    field = GravityField("odd", changes.get("gm", FIELD.gm), changes.get("radius", FIELD.radius), C, FIELD.S)
    with pytest.raises(ValueError, match=match):
        require_body(field, MARS)
    with pytest.raises(ValueError, match="another body"):
        require_body(load_field("EGM96", 10), MARS)


def test_j2_acceleration_and_gradient():
    a, G = np.empty(3), np.empty((3, 3))
    oblate.j2_point(R, *CONSTANTS, a)
    oblate.j2_gradient_point(R, *CONSTANTS, G)
    np.testing.assert_allclose(a, [-0.86895006003, 1.66548761505, -2.10938967219], atol=1e-11)
    expected = [
        -5.189137510825e-7,
        -3.933216563025e-7,
        4.996632478290e-7,
        2.974145789e-8,
        -9.576878916723e-7,
        4.891722931923e-7,
    ]
    np.testing.assert_allclose(G[np.triu_indices(3)], expected, rtol=1e-9)
    assert abs(np.trace(G)) < 1e-20
    np.testing.assert_array_equal(G, G.T)
    numeric, ends = np.empty((3, 3)), np.empty((2, 3))
    for j in range(3):
        for k, sign in enumerate((1.0, -1.0)):
            oblate.j2_point(R + sign * np.eye(3)[j], *CONSTANTS, ends[k])
        numeric[:, j] = (ends[0] - ends[1]) / 2
    assert np.abs(numeric - G).max() < 1e-9 * np.abs(G).max()


def test_j2_is_the_zonal_field_of_degree_two():
    C = np.zeros((3, 3))
    C[0, 0], C[2, 0] = 1.0, FIELD.C[2, 0]
    zonal = GravityField("J2", FIELD.gm, FIELD.radius, C, np.zeros((3, 3)))
    a = np.empty(3)
    oblate.j2_point(R, *CONSTANTS, a)
    np.testing.assert_allclose(a, acceleration(zonal, R), rtol=1e-13)


def test_third_body():
    sun, out = np.array([2.1e11, 4e10, -1e10]), np.zeros(3)
    perturbations.third_body_point(R, sun, GM_SUN, out)
    exact = GM_SUN * ((sun - R).astype(np.longdouble) / np.linalg.norm(sun - R) ** 3 - sun / np.linalg.norm(sun) ** 3)
    np.testing.assert_allclose(out, exact.astype(float), rtol=1e-6)
    tide = GM_SUN / np.linalg.norm(sun) ** 3 * np.linalg.norm(R)
    assert np.linalg.norm(out) < 2.1 * tide


def test_solar_pressure_and_its_shadow():
    sun, out = np.array([AU, 0.0, 0.0]), np.zeros(3)
    perturbations.solar_pressure_point(np.array([0.0, 4e6, 0.0]), sun, 1e-7, 3.4e6, out)
    np.testing.assert_allclose(out, [-1e-7, 0.0, 0.0], atol=1e-11)
    for place, shone in (
        ([-4e6, 0, 0], False),
        ([-4e6, 3.39e6, 0], False),
        ([-4e6, 3.41e6, 0], True),
        ([4e6, 0, 0], True),
    ):
        out[:] = 0.0
        perturbations.solar_pressure_point(np.array(place), sun, 1e-7, 3.4e6, out)
        assert bool(out.any()) == shone


def gradients(h):
    """Gradients of a J2 orbit at 0, h/2, h, and its transition matrix by scipy."""

    def slope(t, y):
        G, a = np.empty((3, 3)), np.empty(3)
        oblate.j2_point(y[:3], *CONSTANTS, a)
        oblate.j2_gradient_point(y[:3], *CONSTANTS, G)
        Phi = y[6:].reshape(6, 6)
        return np.concatenate([y[3:6], a, np.vstack([Phi[3:], G @ Phi[:3]]).ravel()])

    start = np.concatenate([[0.0, 3.78e6, 0.0, 0.0, 0.0, 3366.0], np.eye(6).ravel()])
    solution = solve_ivp(slope, (0, h), start, "DOP853", [0, h / 2, h], rtol=1e-12, atol=1e-12)
    out = []
    for r in solution.y[:3].T:
        G = np.empty((3, 3))
        oblate.j2_gradient_point(np.ascontiguousarray(r), *CONSTANTS, G)
        out.append(G)
    return out, solution.y[6:, -1].reshape(6, 6)


def test_transition_matrices_converge_at_their_orders():
    errors = {"markley": [], "variational": []}
    for h in (80.0, 40.0, 20.0):
        (G0, Gm, G1), exact = gradients(h)
        Phi = np.empty((6, 6))
        transition.markley_step(G0, G1, h, Phi)
        errors["markley"].append(np.abs(Phi - exact)[:3, 3:].max())
        transition.variational_step(G0, Gm, G1, h, Phi)
        errors["variational"].append(np.abs(Phi - exact)[:3, 3:].max())
    assert errors["markley"][-1] < 1e-5 and errors["variational"][-1] < 1e-5
    for values in errors.values():
        assert values[0] / values[1] > 14 and values[1] / values[2] > 14  # fourth order at least, over one step


def test_chain():
    rng = np.random.default_rng(0)
    A, B = rng.standard_normal((2, 6, 6))
    total = B.copy()
    transition.chain_step(A, total)
    np.testing.assert_allclose(total, A @ B, rtol=1e-12, atol=1e-13)


def test_long_steps_of_the_series():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        transition.check_step(100.0)
    with pytest.warns(transition.TransitionWarning, match="expect errors of about 0.39 s"):
        transition.check_step(200.0)
    with pytest.raises(ValueError, match="allow_coarse_substeps"):
        transition.check_step(500.0)
    with pytest.warns(transition.TransitionWarning):
        transition.check_step(500.0, allow_coarse=True)
