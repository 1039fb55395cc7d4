"""Where truth and estimate meet: statistics, gaps, spectra and geoid maps against closed forms and brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geokalman.constants import OMEGA_EARTH
from geokalman.grace import assess
from geokalman.grace.model import range_rate
from geokalman.grace.recover import Recovery
from geokalman.grace.simulate import Truth
from geokalman.physics.harmonics import cell_centred_grid, degree_variance, load_field


@pytest.fixture
def recovery() -> Recovery:
    """EGM96 to degree 6 with one coefficient changed by 1e-9, and one sign-preserving error that cancels in the
    variance."""
    truth = load_field("EGM96", 6)
    C, S = np.repeat(truth.C[None], 2, axis=0), np.repeat(truth.S[None], 2, axis=0)
    C[0, 4, 2] += 1e-9
    C[1, 5, 3], S[1, 5, 3] = truth.S[5, 3], truth.C[5, 3]  # turned about the axis: the same degree variance
    zero = np.zeros((7, 7))
    return Recovery(6, ("one", "turned"), C, S, zero, zero, 1.0, 100, 45)


@pytest.fixture
def truth():
    return load_field("EGM96", 6)


# --- statistics ------------------------------------------------------------------------------------------------------


def test_statistics_leave_the_edges_out():
    series = np.r_[[1e9] * 3, [1.0, 2.0, 3.0, 6.0], [np.nan] * 3]
    found = assess.statistics(series, 3)
    assert found == (3.0, 1.0, 6.0, np.std([1.0, 2.0, 3.0, 6.0]))  # ddof = 0
    assert found._fields == ("mean", "min", "max", "std")


@pytest.mark.parametrize(("edge", "n"), [(5, 10), (100, 150), (-1, 10), (0, 0)])
def test_an_edge_too_large(edge, n):
    with pytest.raises(
        ValueError, match=f"edge = {edge} epochs at either end leave nothing of {n}; give a smaller edge or more days"
    ):
        assess.inner(np.zeros(n), edge)


def test_a_residual_that_is_not_finite_is_named_with_its_epoch():
    series = np.zeros(50)
    series[[4, 17]] = np.nan
    with pytest.raises(ValueError, match="the residual is not finite at epoch 17; edge = 10 must cover the stencil"):
        assess.statistics(series, 10)


def test_residual_is_method_minus_simulation(tiny):
    rate = range_rate(tiny.orbit.dr, tiny.orbit.dv)
    np.testing.assert_allclose(assess.range_rate_residual(rate + 1e-3, tiny.orbit), 1e-3, rtol=1e-9)


def test_geometric_ratio_and_shares():
    assert assess.geometric_ratio(np.array([2.0, 8.0]), np.array([1.0, 1.0])) == pytest.approx(4.0)
    shares = assess.smallest_share(
        {"a": np.array([1, 2, 3, 9.0]), "b": np.array([2, 1, 4, 8.0]), "c": np.full(4, 10.0)}
    )
    assert shares == {"a": 0.5, "b": 0.5, "c": 0.0}


# --- pairs -----------------------------------------------------------------------------------------------------------


def test_difference_of_two_pairs(tiny):
    A = tiny.orbit.A.copy()
    A[100, :3] += (
        2e-3 * tiny.orbit.dr[100] / np.linalg.norm(tiny.orbit.dr[100])
    )  # along the line of sight: no change of e
    A[50, 3:] += 3e-4 * tiny.orbit.dr[50] / np.linalg.norm(tiny.orbit.dr[50])
    rate, position = assess.pair_difference(Truth(tiny.orbit.t, A, tiny.orbit.B), tiny.orbit)
    assert position == pytest.approx(2e-3, rel=1e-5)
    assert rate == pytest.approx(3e-4, rel=1e-6)


def uniform(revolutions: int, drift: float = 0.0) -> Truth:
    """Circular polar orbits of 100 epochs a revolution of 6000 s, `drift` metres further apart after each."""
    t = 60.0 * np.arange(100 * revolutions + 1)
    u = 2 * np.pi * t / 6000.0 - 0.001
    B = 6.8e6 * np.column_stack([np.cos(u), 0 * u, np.sin(u)])
    A = B + np.column_stack([0 * u, 2e5 + drift * t / 6000.0, 0 * u])
    return Truth(t, np.hstack([A, 0 * A]), np.hstack([B, 0 * B]))


def test_drift_per_revolution():
    assert assess.drift_per_revolution(uniform(5, 37.0), 6000.0) == pytest.approx(37.0, rel=1e-9)
    with pytest.raises(ValueError, match="101 epochs are fewer than two revolutions of 100 epochs; give more days"):
        assess.drift_per_revolution(uniform(1), 6000.0)


def test_node_gap_of_a_uniform_orbit():
    """One node a revolution, each omega_E T further west; three nodes leave the rest of the circle as the largest
    gap."""
    step = np.degrees(OMEGA_EARTH * 6000.0)
    gaps = assess.largest_node_gap(uniform(15), [3 * 6000 / 86400, 14.5 * 6000 / 86400])
    assert gaps[0] == pytest.approx(360 - 2 * step, abs=1e-6)
    assert gaps[1] == pytest.approx(step, abs=1e-6)


def test_no_node_leaves_the_whole_circle():
    assert assess.largest_node_gap(uniform(3), [0.0]) == [360.0]


def test_node_gap_after_five_days(mid):
    """Section 3: 7.3 deg."""
    assert assess.largest_node_gap(mid.orbit, [5.0])[0] == pytest.approx(7.3, abs=0.05)


# --- spectra and maps ------------------------------------------------------------------------------------------------


def test_spectrum_of_one_wrong_coefficient(recovery, truth):
    found = assess.spectrum(recovery, "one", truth)
    np.testing.assert_allclose(found.variance, degree_variance(recovery.C[0], recovery.S[0]), rtol=2e-15)
    assert found.difference[4] == pytest.approx(abs((truth.C[4, 2] + 1e-9) ** 2 - truth.C[4, 2] ** 2), rel=1e-5)
    assert found.amplitude[4] == pytest.approx(truth.radius * 1e-9, rel=1e-6)
    for n in (0, 1, 2, 3, 5, 6):
        assert found.difference[n] == found.amplitude[n] == 0.0


def test_errors_cancel_in_the_variance_and_not_in_the_amplitude(recovery, truth):
    """Why the paper's Figure 5 is not the meaningful one."""
    found = assess.spectrum(recovery, "turned", truth)
    assert found.difference[5] <= 1e-15 * found.variance[5]
    assert found.amplitude[5] == pytest.approx(
        truth.radius * np.sqrt(2) * abs(truth.C[5, 3] - truth.S[5, 3]), rel=1e-12
    )


def test_formal_amplitude_is_the_propagated_white_noise(recovery, truth):
    formal = np.tril(np.full((7, 7), 2.0))
    formal_S = formal * (np.arange(7) > 0)
    found = assess.formal_amplitude(replace(recovery, formal_C=formal, formal_S=formal_S), truth, 1e-8)
    np.testing.assert_allclose(found, truth.radius * 2e-8 * np.sqrt(2 * np.arange(7) + 1), rtol=1e-14)


def test_degree_variances_of_the_input_field():
    """Section 3's check values, and R sqrt(DV)."""
    truth = load_field("EGM96", 70)
    variance = degree_variance(truth.C, truth.S)
    for n, wanted in ((10, 1.26315e-13), (30, 3.57376e-15), (50, 1.56162e-15), (70, 5.50948e-16)):
        assert variance[n] == pytest.approx(wanted, rel=5e-6)
    amplitude = truth.radius * np.sqrt(variance)
    for n, wanted in (
        (2, 3088.12),
        (10, 2.26684),
        (20, 0.60503),
        (30, 0.38129),
        (40, 0.27893),
        (50, 0.25205),
        (60, 0.19724),
        (70, 0.14971),
    ):
        assert amplitude[n] == pytest.approx(wanted, rel=3e-5)


@pytest.mark.parametrize("gauss", [0.0, 500.0])
def test_geoid_error_is_truth_minus_recovered(recovery, truth, gauss):
    """-1e-9 R W_4 P_42 cos 2 lambda, with P_42 = (3 sqrt(5) / 4) (1 - t^2) (7 t^2 - 1) fully normalised."""
    grid = assess.geoid_error(recovery, "one", truth, 10.0, gauss)
    lat, lon = cell_centred_grid(10.0)
    t = np.sin(lat)[:, None]
    P42 = 0.75 * np.sqrt(5.0) * (1 - t**2) * (7 * t**2 - 1)
    b = np.log(2) / (1 - np.cos(500.0 / 6371.0))
    W = [1.0, 1 / np.tanh(b) - 1 / b]
    for n in range(1, 4):
        W.append(-(2 * n + 1) / b * W[n] + W[n - 1])
    weight = W[4] if gauss else 1.0
    np.testing.assert_allclose(grid, -1e-9 * truth.radius * weight * P42 * np.cos(2 * lon), rtol=0, atol=1e-13)


def test_map_statistics_weigh_by_area(recovery, truth):
    """The rms of a surface harmonic of unit coefficient is 1 by its normalisation (4 pi), whatever the grid."""
    stats = assess.map_statistics(assess.geoid_error(recovery, "one", truth, 1.0, 0.0))
    assert stats.rms == pytest.approx(1e-9 * truth.radius, rel=1e-3)
    grid = np.array([[1.0, -3.0], [2.0, 0.0]])
    found = assess.map_statistics(grid)
    assert (found.max, found.span) == (3.0, 5.0)
    assert found.rms == pytest.approx(np.sqrt(14 / 4))  # both rows have the same area


def test_an_observable_that_is_not_there(recovery, truth):
    with pytest.raises(KeyError, match="observable 'U2' was not recovered; at hand are one, turned"):
        assess.spectrum(recovery, "U2", truth)


def test_map_columns_are_thinned_on_both_axes():
    grid = np.arange(18 * 36, dtype=float).reshape(18, 36)  # cells of 10 deg
    columns = assess.map_columns({"a": grid, "b": -grid}, 20.0)
    assert list(columns) == ["longitude_deg", "latitude_deg", "a", "b"]
    np.testing.assert_allclose(columns["longitude_deg"][:3], [5.0, 25.0, 45.0])
    np.testing.assert_allclose(np.unique(columns["latitude_deg"]), np.arange(-85.0, 90.0, 20.0))
    np.testing.assert_array_equal(columns["a"], grid[::2, ::2].ravel())
    np.testing.assert_array_equal(columns["b"], -columns["a"])
