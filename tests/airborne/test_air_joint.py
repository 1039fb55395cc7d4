"""The joint field on a small simulated survey with a known field, the waves, and what it refuses; crossovers and
levels.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag

from geokalman import memory
from geokalman.airborne import assess, joint, level
from geokalman.airborne.model import Line, Tuning, build
from geokalman.airborne.read import SurveyLine

BOX = joint.Waves(n_max=4, box=20e3, sigma=5.0, depth=500.0, power=1.0, fine=0.1, fine_depth=500.0, height=300.0)


def flight(name, east, north, gravity, rng, noise=1.0):
    n, dt = len(east), 0.5
    t = dt * np.arange(n)
    drive = gravity + noise * np.sqrt(1 / dt) * rng.standard_normal(n)
    from geokalman.airborne.model import double_integral

    z = double_integral(drive, dt, rng.normal(0, 1e5))[1] + 500 * rng.standard_normal(n)
    zeros = np.zeros((n - 1, 4))
    line = Line(name, t, z, np.full(n, 980_000.0), zeros, zeros, 50.0)
    return SurveyLine(line, east * 0, north * 0, east, north, np.full(n, 300.0), {"truth": gravity})


@pytest.fixture(scope="module")
def toy():
    rng = np.random.default_rng(8)
    x = np.sqrt(BOX.variances()) * rng.standard_normal(BOX.count)
    along = np.linspace(2e3, 18e3, 641)
    flights = []
    for k, across in enumerate(np.linspace(4e3, 16e3, 7)):
        for name, e, n in ((f"{k}", np.full(641, across), along), (f"{k + 10}", along, np.full(641, across))):
            gravity = BOX.rows(e - 0.0, n - 0.0, np.full(641, 300.0)) @ x
            flights.append(flight(name, e, n, gravity, rng))
    return flights, x


def toy_tuning():
    return Tuning(
        sigma_mgal=0.0, q_f=1.0, R_m=0.005, sd_dv=3.0, sd_dh=0.02, sd_tau3=0.0, sd_k12=0.0, sd_k3=0.0, sd_bias=1.0
    )


def test_a_known_field_is_found_within_its_sigma(toy):
    flights, _ = toy
    field = joint.joint_field(flights, toy_tuning(), BOX, lag=0.0, weigh=False)
    error, sigma = [], []
    for f in flights:
        error.append(field.gravity[f.name] - f.references["truth"])
        sigma.append(field.sigma_at(f.easting[::80], f.northing[::80], f.height[::80]))
    error, sigma = np.concatenate([e[::80] for e in error]), np.concatenate(sigma)
    assert error.std() < 0.8  # of 5 mGal; the band between the outer lines and the edge is guessed
    assert 0.5 < np.sqrt(np.mean((error / sigma) ** 2)) < 1.5
    assert len(flights) == 14 and all(w == 1.0 for w in field.weights.values())
    f = flights[3]
    np.testing.assert_allclose(field.at(f.easting, f.northing, f.height), field.gravity[f.name], atol=0.02)


def test_the_likelihood_is_that_of_the_dense_covariance(toy):
    """Against z ~ N(0, C): C from the states' covariances propagated by themselves, and the waves' prior."""
    tuning, cut = toy_tuning(), slice(0, 90)
    columns = ("easting", "northing", "height", "lon", "lat")
    flights = [replace(f, line=f.line.part(cut), **{c: getattr(f, c)[cut] for c in columns}) for f in toy[0][:3]]
    field = joint.joint_field(flights, tuning, BOX, lag=0.0, weigh=False)
    z, blocks, design = [], [], []
    for f in flights:
        built, n = build(f.line, tuning), len(f.line.t)
        C, P, m = np.zeros((n, n)), built.prior.cov, len(built.names)
        for k in range(n):
            if k:
                P = built.Phi[k - 1] @ P @ built.Phi[k - 1].T + built.Q
            cross = P @ built.H[0]
            for j in range(k, n):
                if j > k:
                    cross = built.Phi[j - 1] @ cross
                C[k, j] = C[j, k] = built.H[0] @ cross
        assert m == 3
        blocks.append(C + built.R[0, 0] * np.eye(n))
        spline = joint.Spline.of(f.line.t, 5.0)
        track = (f.easting - field.origin[0], f.northing - field.origin[1], f.height)
        place = [np.interp(spline.at, f.line.t, x) for x in track]
        design.append(spline.integrated @ BOX.rows(*place))
        z.append(f.line.z)
    z, G = np.concatenate(z), np.vstack(design)
    C = block_diag(*blocks) + G @ (BOX.variances()[:, None] * G.T)
    sign, logdet = np.linalg.slogdet(C)
    assert sign == 1 and field.log_likelihood == pytest.approx(-0.5 * (z @ np.linalg.solve(C, z) + logdet), rel=1e-7)


def test_settings_are_compared_one_change_at_a_time(toy):
    flights = toy[0][:6]
    found = joint.compare(flights, toy_tuning(), BOX, 0.0, [(), (("R_m", 0.02),), (("sigma", 2.0),), (("lag", 0.01),)])
    plain = joint.joint_field(flights, toy_tuning(), BOX, 0.0, weigh=False)
    assert found[0].log_likelihood == plain.log_likelihood
    np.testing.assert_array_equal(found[0].gravity["0"], plain.unweighted["0"])
    assert found[1].log_likelihood < found[0].log_likelihood - 10.0  # the toy's own noise is the likelier one
    assert found[3].log_likelihood == pytest.approx(found[0].log_likelihood)  # a constant force shows no lag
    with pytest.raises(ValueError, match="'depht' is no setting of a Tuning or of Waves, nor lag"):
        joint.compare(flights, toy_tuning(), BOX, 0.0, [(("depht", 1.0),)])


def test_noisy_lines_get_less_weight(toy):
    flights, _ = toy
    rng = np.random.default_rng(1)
    loud = flight("99", flights[0].easting + 500, flights[0].northing, flights[0].references["truth"], rng, noise=20.0)
    field = joint.joint_field([*flights, loud], toy_tuning(), BOX, lag=0.0)
    assert field.weights["99"] == min(field.weights.values()) < 0.3
    assert set(field.unweighted) == set(field.gravity)


def test_waves_add_up_to_the_prior_and_fade_with_height():
    assert joint.Waves().count == 2289
    v = joint.Waves().variances()
    assert v.sum() == pytest.approx(46.0**2 + 0.24**2, rel=1e-9)
    low, high = (BOX.rows(np.array([7e3]), np.array([3e3]), np.array([h])) for h in (300.0, 1300.0))
    k = np.concatenate([BOX.k, BOX.k[BOX.k != 0]])
    np.testing.assert_allclose(high, low * np.exp(-1000.0 * k), rtol=1e-12)


def test_the_spline_carries_its_double_integral():
    t = np.arange(0, 100.01, 0.5)
    spline = joint.Spline.of(t, 5.0)
    assert len(spline.at) == 21
    np.testing.assert_allclose(spline.values @ spline.at**3, t**3, atol=1e-6 * 1e6)
    np.testing.assert_allclose(spline.integrated @ spline.at**2, t**4 / 12, rtol=1e-9, atol=1e-4)


def test_what_the_joint_estimate_refuses(toy):
    with pytest.raises(ValueError, match="There are no lines"):
        joint.joint_field([])
    with pytest.raises(ValueError, match="sigma_mgal = 12: the whitening filter has no gravity"):
        joint.joint_field(toy[0], Tuning(), BOX)
    with pytest.raises(ValueError, match="box = 9000 m is smaller than the survey, 16000 m from west to east"):
        joint.joint_field(toy[0], toy_tuning(), replace(BOX, box=9e3))
    with pytest.raises(ValueError, match="both must be positive"):
        joint.Waves(n_max=0)


def test_the_whitening_filter_has_no_gravity(toy):
    assert "dg" not in build(toy[0][0].line, toy_tuning()).names


def test_crossings_of_straight_and_bent_tracks():
    a = np.column_stack([np.zeros(201), np.linspace(0, 2000, 201)])
    b = np.column_stack([np.linspace(-500, 500, 101), np.full(101, 755.0)])
    assert level.crossing(a, b) == pytest.approx((75.5, 50.0))
    assert level.crossing(a, b + [0, 5000]) is None
    assert level.crossovers({"a": a}, {"b": b}, margin_m=600.0) == []


def test_levels_are_found_up_to_a_common_one():
    points = [level.Crossover(f"l{i}", f"t{j}", 10 * j, 10 * i) for i in range(4) for j in range(3)]
    values = {f"l{i}": np.full(100, float(i)) for i in range(4)} | {f"t{j}": np.full(100, 5.0 * j) for j in range(3)}
    found = level.levels(points, values)
    after = level.differences(points, level.levelled(values, found))
    assert np.abs(after).max() < 1e-3
    assert found["l3"] - found["l0"] == pytest.approx(3.0, abs=1e-3)
    with pytest.raises(ValueError, match="nothing to level by"):
        level.levels([], values)


def test_repeatability_of_known_scatter():
    rng = np.random.default_rng(2)
    x = np.linspace(0, 10e3, 500)
    tracks = [np.column_stack([s * x if s > 0 else x[::-1], 0.1 * x if s > 0 else 0.1 * x[::-1]]) for s in (1, -1, 1)]
    axis, along = level.common_track(tracks, 50.0)
    passes = level.repeat_values(axis, along, [np.sin(track[:, 0] / 1e3) for track in tracks])
    assert level.repeatability(passes) < 1e-3
    assert level.repeatability(rng.normal(0, 2.0, (50, 2000))) == pytest.approx(2.0, rel=0.02)
    with pytest.raises(ValueError, match="The passes overlap on"):
        level.common_track([tracks[0], tracks[0] + [50e3, 5e3]], 50.0)


def test_statistics_of_the_paper_in_both_readings():
    one = assess.statistics(np.array([1.0, 3.0]))
    assert one == (2.0, pytest.approx(np.sqrt(5.0)), pytest.approx(1.0))
    assert assess.inner(0.5 * np.arange(1000), 60.0) == slice(120, 880)
    with pytest.raises(ValueError, match="has nothing left without 60 s"):
        assess.inner(0.5 * np.arange(200), 60.0)


def test_paired_differences_and_their_blocks():
    ours, theirs = np.arange(12.0), np.arange(12.0) + np.repeat([1.0, 3.0], 6)
    one = assess.paired(ours, theirs)
    assert one.mean == -2.0 and one.better == 12 and one.count == 12
    assert one.error == pytest.approx(np.std(theirs - ours, ddof=1) / np.sqrt(12))
    assert one.block_error == pytest.approx(np.sqrt(2) / np.sqrt(2))


def test_a_field_that_memory_does_not_hold_is_refused(toy, monkeypatch):
    """Both the normal matrix and the rows of 14 lines of 65 knots, twice each, 8 bytes a number."""
    monkeypatch.setattr(memory, "available", lambda: 1e8)
    waves = replace(BOX, n_max=40)
    size = memory.text(16 * waves.count * (waves.count + 14 * 65))
    with pytest.raises(
        memory.TooLarge, match=rf"^A field of {waves.count} unknowns needs {size} of memory, .*lower n_max"
    ):
        joint.joint_field(toy[0], waves=waves)
