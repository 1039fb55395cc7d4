"""Recovery: from exact data to rounding; rows against the field; counts; what the equations cannot determine."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from geokalman import memory, progress
from geokalman.constants import OMEGA_EARTH
from geokalman.grace import assess, observables, recover
from geokalman.grace.model import distance
from geokalman.grace.simulate import Truth
from geokalman.leastsquares import SingularNormalMatrix
from geokalman.physics.frames import enu_from_ecef, spherical, to_ecef
from geokalman.physics.gravity import acceleration
from geokalman.physics.harmonics import legendre, load_field
from geokalman.physics.partials import column_count, column_names, design_block, to_vector


@pytest.fixture(scope="module")
def day(fly):
    """One day at degree 4 every 5 minutes: 289 equations that see all 21 unknowns."""
    return fly(days=1.0, dt=300.0, h=30.0, n_max=4)


@pytest.fixture(scope="module")
def exact(day):
    return {"X": observables.exact(day.orbit, day.gravity)}


def lines_of_sight(flight, every):
    orbit = flight.orbit.every(every)
    r_A, r_B = (to_ecef(orbit.t, state[:, :3], OMEGA_EARTH) for state in (orbit.A, orbit.B))
    return r_A, r_B, (r_A - r_B) / distance(r_A - r_B)[:, None]


# --- rows of the design matrix ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("n_max", [2, 30, 70])
def test_number_of_unknowns(n_max):
    """(N+1)^2 - 4: the print has it the other way round."""
    count = column_count(n_max)
    assert count == (n_max + 1) ** 2 - 4
    assert count == len(column_names(n_max)) == len(set(column_names(n_max)))
    assert {2: 5, 30: 957, 70: 5037}[n_max] == count


@pytest.mark.parametrize("n_max", [4, 70])
def test_row_times_true_coefficients_is_the_gravity_difference(tiny, n_max):
    """Section 8: e . dg to 1e-14 m/s^2, relative 1e-10 of the part above the point mass."""
    gravity = load_field("EGM96", n_max)
    r_A, r_B, e = lines_of_sight(tiny, 10)
    rows = design_block(gravity.gm, gravity.radius, n_max, r_A, r_B, e)
    C, S = np.zeros((2, 3, 3))
    C[0, 0] = 1.0
    point = replace(gravity, C=C, S=S, sigma_C=None, sigma_S=None)
    both = [acceleration(gravity, r) - acceleration(point, r) for r in (r_A, r_B)]
    wanted = np.einsum("ij,ij->i", e, both[0] - both[1])
    assert np.abs(rows @ to_vector(gravity.C, gravity.S, n_max) - wanted).max() < 1e-14 + 1e-10 * np.abs(wanted).max()


def paper_row(flight, n_max: int, northern) -> tuple[np.ndarray, np.ndarray]:
    """One row by (48), (49) in the local frames (east, north, up), and ours; `northern` gives the factor of the
    meridian."""
    gravity = load_field("EGM96", n_max)
    r_A, r_B, e = (x[11] for x in lines_of_sight(flight, 10))
    row = dict.fromkeys(column_names(n_max), 0.0)
    for r, sign in ((r_A, 1.0), (r_B, -1.0)):
        radius, phi, lam = (x.item() for x in spherical(r))
        east, north, up = sign * (enu_from_ecef(r) @ e) * gravity.gm / radius**2
        P, dP = legendre(n_max, phi)[0], northern(n_max, phi)
        for kind, n, m in row:
            q = (gravity.radius / radius) ** n
            wave, turned = (np.cos(m * lam), -np.sin(m * lam)) if kind == "C" else (np.sin(m * lam), np.cos(m * lam))
            row[kind, n, m] += q * (
                east * m * turned * P[n, m] / np.cos(phi) + north * wave * dP[n, m] - up * (n + 1) * wave * P[n, m]
            )
    return (
        np.array(list(row.values())),
        design_block(gravity.gm, gravity.radius, n_max, r_A[None], r_B[None], e[None])[0],
    )


def test_row_by_the_formulas_of_the_paper(tiny):
    """With the derivative of P in the northern component, here by the relation that section 2 gives."""

    def derivative(n_max, phi):
        P, out = legendre(n_max, phi)[0], np.zeros((n_max + 1, n_max + 1))
        for n in range(1, n_max + 1):
            for m in range(n + 1):
                f = np.sqrt((n * n - m * m) * (2 * n + 1) / (2 * n - 1))
                out[n, m] = (f * P[n - 1, m] - n * np.sin(phi) * P[n, m]) / np.cos(phi)
        return out

    paper, ours = paper_row(tiny, 8, derivative)
    np.testing.assert_allclose(ours, paper, rtol=0, atol=1e-13 * np.abs(paper).max())


def test_erratum_49_rows_of_the_text(tiny):
    """Rows (latitude without the derivative of P, longitude, radius) as the text we have gives them, on its axes."""
    n_max, gravity = 8, load_field("EGM96", 8)
    r_A, r_B, e = (x[11] for x in lines_of_sight(tiny, 10))
    text = []
    for kind, n, m in column_names(n_max):
        total = 0.0
        for r, sign in ((r_A, 1.0), (r_B, -1.0)):
            radius, phi, lam = (x.item() for x in spherical(r))
            axes = sign * (enu_from_ecef(r) @ e) * gravity.gm / radius**2 * (gravity.radius / radius) ** n
            wave, turned = (np.cos(m * lam), -np.sin(m * lam)) if kind == "C" else (np.sin(m * lam), np.cos(m * lam))
            P = legendre(n_max, phi)[0][n, m]
            total += axes @ [wave * P, m * turned * P / np.cos(phi), (n + 1) * wave * P]
        text.append(total)
    ours = design_block(gravity.gm, gravity.radius, n_max, r_A[None], r_B[None], e[None])[0]
    assert np.abs(np.array(text) - ours).max() > 0.1 * np.abs(ours).max()


def test_the_northern_row_needs_the_derivative_of_P(tiny):
    without, ours = paper_row(tiny, 8, lambda n_max, phi: legendre(n_max, phi)[0])
    assert np.abs(without - ours).max() > 0.1 * np.abs(ours).max()


# --- recovery --------------------------------------------------------------------------------------------------------


def test_recovery_from_exact_data_at_degree_4(day, exact):
    """To rounding: section 8 wants 1e-8 m in geoid height."""
    recovery = recover.recover(day.orbit, day.gravity, exact, edge=0)
    assert (recovery.n_max, recovery.unknowns, recovery.equations, recovery.ids) == (4, 21, 289, ("X",))
    assert assess.map_statistics(assess.geoid_error(recovery, "X", day.gravity, 5.0, 0.0)).max < 1e-8
    C, S = recovery.coefficients("X")
    assert C[0, 0] == 1.0 and not C[1].any() and not S[:, 0].any()


def test_recovery_from_exact_data_at_degree_30(quick, quick_recovery):
    """Section 8: below 1e-8 m in geoid height, rms and largest; 957 unknowns, 14201 equations, condition 67.1."""
    stats = assess.map_statistics(assess.geoid_error(quick_recovery, "X", quick.gravity, 1.0, 0.0))
    assert stats.rms < 1e-8 and stats.max < 1e-8
    assert (quick_recovery.unknowns, quick_recovery.equations) == (957, 14201)
    assert quick_recovery.condition == pytest.approx(67.1, rel=0.05)


@pytest.mark.parametrize(
    ("name", "rms"),
    [("N1", 9.59e-4), ("N2", 1.41e-4), ("E1", 7.36e-4), ("E2", 1.13e-3), ("U1", 7.09e-4), ("U2", 1.07e-3)],
)
def test_geoid_errors_at_degree_30(quick, quick_recovery, name, rms):
    """Section 8, g05 QUICK: the ranking is the other way round than at degree 70."""
    assert assess.map_statistics(
        assess.geoid_error(quick_recovery, name, quick.gravity, 1.0, 0.0)
    ).rms == pytest.approx(rms, rel=0.03)


def test_splines_at_degree_30(quick, quick_recovery):
    assert assess.map_statistics(assess.geoid_error(quick_recovery, "B11", quick.gravity, 1.0, 0.0)).rms < 2e-8


@pytest.mark.parametrize(("name", "rms"), [("N1", 4.16e-4), ("E1", 3.15e-4), ("U2", 4.86e-4)])
def test_smoothed_geoid_errors_at_degree_30(quick, quick_recovery, name, rms):
    """Section 8, g06 QUICK, Gaussian radius 500 km."""
    assert assess.map_statistics(
        assess.geoid_error(quick_recovery, name, quick.gravity, 1.0, 500.0)
    ).rms == pytest.approx(rms, rel=0.03)


def test_ekf_against_newton_at_degree_30(quick, quick_recovery):
    maps = [assess.geoid_error(quick_recovery, name, quick.gravity, 1.0, 500.0) for name in ("N1", "E1")]
    assert assess.map_statistics(maps[0] - maps[1]).rms == pytest.approx(1.03e-4, rel=0.04)


def test_recovery_does_not_use_the_fields_own_coefficients(day, exact):
    other = day.gravity.with_coefficients(np.eye(5) * np.r_[1, 0, 1, 1, 1], np.zeros((5, 5)), "other")
    one, two = (recover.recover(day.orbit, g, exact, edge=0) for g in (day.gravity, other))
    np.testing.assert_array_equal(one.C, two.C)


def test_all_observables_at_once_are_each_alone(day, exact):
    """Many right-hand sides of one factor."""
    both = {"X": exact["X"], "N2": exact["X"] + 1e-9 * np.sin(np.arange(289))}
    together = recover.recover(day.orbit, day.gravity, both, edge=4)
    for name, series in both.items():
        alone = recover.recover(day.orbit, day.gravity, {name: series}, edge=4)
        np.testing.assert_allclose(together.coefficients(name), alone.coefficients(name), rtol=0, atol=1e-14)


def test_blocks_do_not_matter(day, exact, monkeypatch):
    whole = recover.recover(day.orbit, day.gravity, exact, edge=0)
    monkeypatch.setattr(recover, "BLOCK", 60)
    done: list[tuple[str, float]] = []
    progress.listen(lambda *told: done.append(told))
    parts = recover.recover(day.orbit, day.gravity, exact, edge=0)
    progress.listen(None)
    assert done == [("normal equations", share) for share in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)]
    np.testing.assert_allclose(parts.C, whole.C, rtol=0, atol=1e-12)
    with ThreadPoolExecutor(2) as pool:
        spread = recover.recover(day.orbit, day.gravity, exact, edge=0, executor=pool)
    np.testing.assert_allclose(spread.C, parts.C, rtol=0, atol=1e-12)


def test_formal_errors_are_those_of_the_dense_problem(day, exact):
    """sqrt(diag(N^-1)) from the design matrix itself by QR, and the condition of its scaled columns."""
    recovery = recover.recover(day.orbit, day.gravity, exact, edge=0)
    r_A, r_B, e = lines_of_sight(day, 1)
    A = design_block(day.gravity.gm, day.gravity.radius, 4, r_A, r_B, e)
    R = np.linalg.qr(A, mode="r")
    sigma = np.linalg.norm(np.linalg.inv(R), axis=1)
    np.testing.assert_allclose(to_vector(recovery.formal_C, recovery.formal_S, 4), sigma, rtol=1e-6)
    values = np.linalg.svd(A / np.linalg.norm(A, axis=0), compute_uv=False)
    assert recovery.condition == pytest.approx((values[0] / values[-1]) ** 2, rel=1e-4)


def test_a_lower_degree_can_be_recovered(day):
    """A field of degree 3 flown, its found with degree 3 as the highest unknown."""
    low = day.gravity.truncate(3)
    los = {"X": observables.exact(day.orbit, low)}
    recovery = recover.recover(day.orbit, day.gravity, los, edge=0, n_max=3)
    np.testing.assert_allclose(recovery.coefficients("X"), (low.C, low.S), rtol=0, atol=1e-14)


# --- what is refused -------------------------------------------------------------------------------------------------


def test_fewer_epochs_than_unknowns(day, exact):
    with pytest.raises(
        ValueError,
        match=(
            r"21 epochs \(of 289, without 134 at either end\) cannot determine the 32 coefficients of degrees 2 to 5;"
            r" give at least 1\.04 days"
        ),
    ):
        recover.recover(day.orbit, day.gravity, exact, edge=134, n_max=5)


def test_edges_that_leave_no_epoch(day, exact):
    with pytest.raises(ValueError, match=r"0 epochs \(of 289, without 150 at either end\)"):
        recover.recover(day.orbit, day.gravity, exact, edge=150)


@pytest.mark.parametrize("edge", [-1, -100])
def test_a_negative_edge(day, exact, edge):
    with pytest.raises(ValueError, match=f"edge = {edge} is not a number of epochs; give 0 or more"):
        recover.recover(day.orbit, day.gravity, exact, edge=edge)


def test_an_edge_that_does_not_cover_the_stencils(day):
    newton = observables.observables(day.orbit, day.gravity, day.data, None, None, ["N1"])
    with pytest.raises(ValueError, match=r"observable N1 is not finite at epoch 4; edge = 4 must cover the stencils"):
        recover.recover(day.orbit, day.gravity, newton, edge=4)
    recover.recover(day.orbit, day.gravity, newton, edge=8)


def test_an_observable_that_is_not_finite_is_named_with_its_epoch(day, exact):
    broken = exact["X"].copy()
    broken[77] = np.inf
    with pytest.raises(ValueError, match="observable Y is not finite at epoch 77"):
        recover.recover(day.orbit, day.gravity, {"X": exact["X"], "Y": broken}, edge=10)


def test_unknowns_that_no_equation_sees_are_named(day):
    """Both satellites in the meridian of Greenwich for ever: no S coefficient shows."""
    angle = np.linspace(0, 2 * np.pi, 80)
    A, B = (
        np.column_stack([6.8e6 * np.cos(a), 0 * a, 6.8e6 * np.sin(a), np.zeros((80, 3))]) for a in (angle + 0.03, angle)
    )
    polar = Truth(np.zeros(80), A, B)
    with pytest.raises(
        SingularNormalMatrix, match=r"No observation depends on 9 of 21 unknowns: S\[2,1\], S\[2,2\], S\[3,1\]"
    ):
        recover.recover(polar, day.gravity, {"X": observables.exact(polar, day.gravity)}, edge=0)


def test_unknowns_that_cannot_be_told_apart_are_named(fly):
    """Twenty minutes of one arc against degree 12."""
    arc = fly(days=20 / 1440, dt=5.0, h=5.0, n_max=12)
    with pytest.raises(
        SingularNormalMatrix,
        match=r"undetermined, or cannot tell from one another, \d+ of 165 unknowns: [CS]\[\d+,\d+\], ",
    ):
        recover.recover(arc.orbit, arc.gravity, {"X": observables.exact(arc.orbit, arc.gravity)}, edge=0)


def test_an_observable_that_was_not_recovered(day, exact):
    recovery = recover.recover(day.orbit, day.gravity, exact, edge=0)
    with pytest.raises(KeyError, match="observable 'U2' was not recovered; at hand are X"):
        recovery.coefficients("U2")


def test_no_observable_at_all(day):
    with pytest.raises(ValueError, match="there is no observable to recover from"):
        recover.recover(day.orbit, day.gravity, {})


def test_a_degree_that_memory_does_not_hold_is_refused_before_any_work(day, exact, monkeypatch):
    """Twice the normal matrix and a block of rows, 8 bytes a number."""
    monkeypatch.setattr(memory, "available", lambda: 1.2e9)
    last = max(n for n in range(2, 200) if 8 * ((n + 1) ** 2 - 4) * (2 * ((n + 1) ** 2 - 4) + recover.BLOCK) <= 1.2e9)
    sentence = (
        r"^The normal matrix of 40397 coefficients to degree 200, with its inverse, needs 26.8 GB of memory, "
        rf"and 1.2 GB are available; an n_max of {last} fits\.$"
    )
    with pytest.raises(memory.TooLarge, match=sentence):
        recover.outlook(86401, 200)
    with pytest.raises(memory.TooLarge, match=sentence):
        recover.recover(day.orbit, day.gravity, exact, n_max=200)
    recover.outlook(1000, 20)


def test_the_time_of_a_recovery_is_foreseen():
    """It grows with the epochs, and beyond the sampled part with the unknowns."""
    assert 0 < recover.outlook(1000, 20) < recover.outlook(10**6, 20) < recover.outlook(10**7, 40) < np.inf


def test_an_observable_of_another_length(day, exact):
    with pytest.raises(ValueError, match=r"observable X has the shape \(288,\), the orbit has 289 epochs"):
        recover.recover(day.orbit, day.gravity, {"X": exact["X"][1:]})
