"""Levelling by crossovers: against deletion of single points, and on lines whose levels and drifts are known."""

import numpy as np
import pytest

from geokalman.airborne import experiment, level
from geokalman.airborne.model import Tuning


@pytest.fixture
def crossed():
    """Points of six lines and five ties, values with known levels and drifts, and these."""
    rng = np.random.default_rng(1)
    lines = {f"l{k}": np.column_stack([np.full(401, 100.0 * k), np.linspace(-300, 900, 401)]) for k in range(6)}
    ties = {f"t{k}": np.column_stack([np.linspace(-200, 700, 301), np.full(301, 150.0 * k)]) for k in range(5)}
    tracks = lines | ties
    put_in = {name: (2.0 * rng.standard_normal(), rng.standard_normal()) for name in tracks}
    values = {
        name: 0.01 * track[:, 0] + put_in[name][0] + put_in[name][1] * (np.arange(len(track)) / (len(track) - 1) - 0.5)
        for name, track in tracks.items()
    }
    return level.crossovers(lines, ties), values, put_in


def test_equal_weights_are_the_levels_of_old(crossed):
    points, values, _ = crossed
    found, old = level.adjust(points, values), level.levels(points, values)
    for name, value in old.items():
        assert found.level[name] == pytest.approx(value, abs=1e-9)
    flat = level.levelled(values, old)
    np.testing.assert_allclose(found.residual, level.differences(points, flat), atol=1e-9)


def test_drifts_are_found(crossed):
    points, values, put_in = crossed
    found = level.adjust(points, values, drift=True, sd_drift=1e3)
    assert np.abs(found.residual).max() < 1e-4
    for kind in ("l", "t"):  # what is a + b x + c y + d x y over the survey stays open
        gap = np.array([found.drift[name] - drift for name, (_, drift) in put_in.items() if name[0] == kind])
        assert np.abs(np.diff(gap, 2)).max() < 1e-3
    one = found.of("l0", 401)
    assert one[-1] - one[0] == pytest.approx(found.drift["l0"]) and one[200] == pytest.approx(found.level["l0"])


@pytest.mark.parametrize("drift", [False, True])
def test_what_a_point_has_when_it_takes_no_part(crossed, drift):
    points, values, _ = crossed
    found = level.adjust(points, values, drift)
    for k in (0, 13, 29):
        rest = level.adjust(points[:k] + points[k + 1 :], values, drift)
        line, tie = points[k].line, points[k].tie
        left = {n: values[n] - rest.of(n, len(values[n])) for n in (line, tie)}
        assert found.left_out[k] == pytest.approx(level.differences([points[k]], left)[0], rel=1e-3)


def test_one_wild_crossover_does_not_move_robust_levels(crossed):
    points, values, _ = crossed
    clean = level.adjust(points, values, drift=True, sd_drift=1e3)
    k = round(points[7].i)
    wild = {**values, points[7].line: values[points[7].line].copy()}
    wild[points[7].line][k - 1 : k + 2] += 50.0
    shift = {
        robust: max(
            abs(level.adjust(points, wild, True, robust, sd_drift=1e3).level[n] - clean.level[n]) for n in clean.level
        )
        for robust in (False, True)
    }
    assert shift[True] < 0.1 * shift[False]


def test_no_crossover_is_refused():
    with pytest.raises(ValueError, match=r"The lines do not cross: there is nothing to level by\."):
        level.adjust([], {})


def test_another_trim_of_the_same_estimates(kauring):
    flights = kauring.select([104000])
    wide, narrow = (experiment.real(flights, Tuning.preset("kauring"), 0.0, trim) for trim in (60.0, 100.0))
    np.testing.assert_array_equal(wide.trimmed(100.0).sd("fb", "ground"), narrow.sd("fb", "ground"))
