"""Worlds of readings: the default one gives the numbers of the pages; every declared option has its world."""

from __future__ import annotations

import json
from pathlib import Path

import numba
import numpy as np
import pytest

from execbook import claims, multiverse
from execbook.project import root as project_root
from geokalman.grace import worlds

ROOT = project_root(Path(__file__).parent)
CHOICES = multiverse.choices(ROOT, "grace-fusion")
DEFAULT = multiverse.default(CHOICES)
TINY = worlds.Extent(1.0, 4, 1, 10.0)
pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="days of orbit take hours in plain Python")


def stored(key: str) -> float:
    notebook, _, name = key.partition(":")
    path = ROOT / "tests" / "reference" / f"{notebook}.quick.json"
    return json.loads(path.read_text(encoding="utf-8"))[name]["value"]


@pytest.mark.parametrize("function", ["rates", "field"])
def test_the_default_world_gives_the_numbers_of_the_pages(function):
    """At the scale of the quick pages: five days, degree 30, every epoch, a grid of one degree.

    Range-rates of two machines differ by the rounding of the orbits, 1e-10 m/s.
    """
    at = {"rates": worlds.rates_at, "field": worlds.field_at}[function]
    numbers = at(worlds.Extent(5.0, 30, 1, 1.0), DEFAULT)
    for key, value in numbers.items():
        assert value == pytest.approx(stored(key), rel=1e-3, abs=1e-10), key


def test_worlds_decide_no_claim_twice():
    given = [set(at(TINY, DEFAULT)) for at in (worlds.rates_at, worlds.field_at)]
    assert not given[0] & given[1]
    decided = [
        {c.id for c in claims.ledger(ROOT, "grace-fusion") if c.metrics and g.issuperset(c.metrics)} for g in given
    ]
    assert not decided[0] & decided[1] and min(map(len, decided)) > 5


@pytest.mark.parametrize("choice", [c for c in CHOICES if c.options], ids=lambda c: c.id)
def test_every_option_is_known_and_every_number_finite(choice):
    for option in choice.options:
        world = {**DEFAULT, choice.id: option.id}
        for at in (worlds.rates_at, worlds.field_at):
            assert np.isfinite(list(at(TINY, world).values())).all()


def test_a_choice_changes_what_it_is_about():
    base = worlds.rates_at(TINY, DEFAULT)
    for change in ({"estimate": "filtered"}, {"update": "joint"}, {"noise": "micrometres"}, {"node": 1.0}):
        other = worlds.rates_at(TINY, DEFAULT | change)
        key = "grace-fusion/04-ukf:table1.ukf.std"
        assert other[key] != base[key]
    assert worlds.rates_at(TINY, DEFAULT | {"measure": "median"}) == base


def test_the_nearest_orbit():
    assert worlds.nearest(DEFAULT) == 0
    for k, (a_km, tau, *_) in enumerate(worlds.ORBITS):
        assert worlds.nearest(DEFAULT | {"semi-major-axis": a_km, "lead-time": tau}) == k
    reached = {worlds.nearest(world) for world in multiverse.draw(CHOICES, 104, 1)}
    assert reached == set(range(len(worlds.ORBITS)))
