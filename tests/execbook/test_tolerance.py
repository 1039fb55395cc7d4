"""The rule that makes a tolerance from a spread, and the kinds of tolerances."""

import pytest
from pydantic import ValidationError

from execbook.tolerance import Tolerance, by_rule, usual_spread


@pytest.mark.parametrize(
    "value, spread, largest, wanted",
    [
        (2.0, 0.0, None, {"rel": 1e-9}),
        (0.0, 0.0, None, {"rel": 1e-9}),  # an exact zero stays one
        (None, 0.0, None, {"rel": 1e-9}),
        (2.0, 2e-12, None, {"rel": 1e-9}),  # 30 spreads are 3e-11: the floor
        (2.0, 2e-10, None, {"rel": 1e-8}),  # 3e-9, rounded up
        (-2.0, 2e-7, None, {"rel": 1e-5}),
        (1.0, 1e-3, None, {"rel": 0.1}),
        (1.0, 1.1e-3, 1.0, {"size": 10.0}),
        (-2e-13, 5e-13, 3e-13, {"size": 3e-12}),
        (0.0, 1e-16, 1e-16, {"size": 1e-15}),
    ],
)
def test_the_rule(value, spread, largest, wanted):
    assert by_rule(value, spread, largest).model_dump(exclude_none=True) == pytest.approx(wanted)


def test_a_number_alike_in_all_settings_by_luck_has_a_tenth_of_what_is_usual():
    """A ratio of two RMS whose parts move by 3e-7 each, seen within 3e-9 in three settings and at 2.7e-7 in another."""
    others = [(9.39, 4.5e-6), (995.0, 1.7e-4), (2.07, 2.8e-6), (3.0, 0.0), (0.0, 1e-3), (1e-17, 1e-9), (None, 0.0)]
    usual = usual_spread(others)
    assert usual == pytest.approx(4.5e-6 / 9.39), "the median of three: fixed numbers, nulls and rounding do not count"
    lucky = by_rule(1.0028806, 2.9e-9, usual=usual)
    assert lucky.holds(1.0028809, 1.0028806) and not by_rule(1.0028806, 2.9e-9).holds(1.0028809, 1.0028806)
    assert by_rule(5.0, 1e-15, usual=usual).rel == 1e-9, "what does not move stays fixed"
    assert by_rule(9.39, 4.5e-6, usual=usual) == by_rule(9.39, 4.5e-6), "it only widens"
    assert by_rule(5.0, 1e-11, usual=usual).rel == 1e-8, "by thirty at most"
    assert usual_spread([(3.0, 0.0)]) == 0.0


@pytest.mark.parametrize(
    "kinds, ours, good",
    [({"rel": 1e-3}, 100.09, True), ({"rel": 1e-3}, 100.11, False), ({"rel": 1e-3, "abs": 0.2}, 100.29, True),
     ({"rel": 1e-3, "abs": 0.2}, 99.69, False), ({"abs": 1}, 101.1, False), ({"size": 5}, -4.9, True),
     ({"size": 5}, -5.1, False), ({"min": 3}, 2.9, False), ({"max": 3}, 2.9, True), ({"min": 3, "max": 4}, 4.1, False),
     ({"factor": 2}, 51, True), ({"factor": 2}, -100, False), ({"none": True}, -1e300, True)],
)  # fmt: skip
def test_kinds(kinds, ours, good):
    assert Tolerance(**kinds).holds(ours, 100.0) == good


def test_without_a_stored_number_only_bounds_hold():
    assert Tolerance(max=3).holds(2.0, None) and Tolerance(size=3).holds(2.0, None)
    assert not Tolerance(rel=1e9).holds(2.0, None) and not Tolerance(factor=2).holds(2.0, None)


@pytest.mark.parametrize("kinds", [{}, {"rel": 1, "max": 2}, {"size": 1, "abs": 1}, {"none": True, "rel": 1}])
def test_kinds_that_do_not_go_together(kinds):
    with pytest.raises(ValidationError, match="exactly one of rel with abs, factor, size, min with max, none"):
        Tolerance(**kinds)
