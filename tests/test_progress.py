"""Loops that say how far they have come."""

import pytest

from geokalman import progress


@pytest.fixture
def heard():
    """What the loops of this process tell."""
    told: list[tuple[str, float]] = []
    progress.listen(lambda what, share: told.append((what, share)))
    yield told
    progress.listen(None)


def test_the_items_come_as_they_are_and_the_share_is_told(heard):
    assert list(progress.track("abcd", "letters")) == list("abcd")
    assert heard == [("letters", share) for share in (0.0, 0.25, 0.5, 0.75, 1.0)]


def test_an_item_counts_when_it_is_done_with(heard):
    for k in progress.track(range(4), "numbers"):
        assert heard[-1] == ("numbers", k / 4)


@pytest.mark.parametrize("total, last", [(3, 1.0), (2, 1.0), (6, 0.5), (None, 0.0)])
def test_an_iterator_needs_to_be_told_how_long_it_is(heard, total, last):
    assert list(progress.track(iter("abc"), "letters", total)) == list("abc")
    assert heard[-1] == ("letters", last)


def test_nobody_listens():
    progress.listen(None)
    assert list(progress.track([1, 2], "numbers")) == [1, 2]
    progress.share("orbits")(0.5)


def test_the_last_listener_alone_hears(heard):
    other = []
    progress.listen(lambda *told: other.append(told))
    progress.share("orbits")(0.5)
    assert (heard, other) == ([], [("orbits", 0.5)])
