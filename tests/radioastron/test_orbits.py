"""Real orbits of the sessions: against another library's SDP4 and frames, and against a real correlation."""

import json

import numpy as np
import pytest

from geokalman.constants import C_LIGHT
from geokalman.data import data_path
from geokalman.radioastron import formal, orbits
from geokalman.radioastron.model import EARTH_DIAMETER, SESSIONS, find_session, nominal_state, toward, world

OCTOBER = (
    "1 37755U 11037A   12290.49922241  .00000000  00000-0  00000-0 0  4801",
    "2 37755 078.4491 295.5353 5888721 345.5473 107.9916 00.11472981    00",
)
"""The set of the same series for 2012-10-16."""


@pytest.fixture(scope="module")
def sky():
    """Skyfield's satellites and its time scale."""
    api = pytest.importorskip("skyfield.api")
    return api, api.load.timescale(builtin=True)


@pytest.mark.parametrize("date", ["2012-07-21", "2013-03-12", "2013-05-07"])
def test_vendored_states_are_those_of_the_elements(sky, date):
    """Skyfield's own way from TEME to the GCRS: its nutation series and UT1 differ by metres at 3e8 m."""
    api, scale = sky
    entry = json.loads(data_path("spektr_r.json").read_text())[date]
    year, month, day = map(int, date.split("-"))
    at = api.EarthSatellite(*entry["lines"], "Spektr-R", scale).at(
        scale.utc(year, month, day, 0, 0, entry["utc_seconds"])
    )
    np.testing.assert_allclose(entry["state_gcrs"][:3], at.position.m, rtol=0, atol=100.0)
    np.testing.assert_allclose(entry["state_gcrs"][3:], at.velocity.m_per_s, rtol=0, atol=1e-3)


def test_the_elements_give_the_baseline_of_a_real_correlation(sky):
    """RadioAstron with Zelenchukskaya on 0529+483, 2012-10-16 10:05:20: u, v of the fringe file raes03eo_l of pypima.

    The file gives -3.5076e8 and 1.6783e8 wavelengths at 1.64425 GHz; the elements have to agree to 1 %.
    """
    api, scale = sky
    from skyfield.toposlib import ITRSPosition
    from skyfield.units import Distance

    t = scale.utc(2012, 10, 16, 10, 5, 20.5)
    station = ITRSPosition(Distance(m=[3451207.8, 3060375.2, 4391914.9])).at(t).position.m
    b = station - api.EarthSatellite(*OCTOBER, "Spektr-R", scale).at(t).position.m
    ra, dec = np.radians([83.316108, 48.381336])
    s = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
    east = np.array([-np.sin(ra), np.cos(ra), 0.0])
    found = np.array([b @ east, b @ np.cross(s, east)]) * 1.64425e9 / C_LIGHT
    assert np.linalg.norm(found - [-3.5076188e8, 1.6782500e8]) < 0.01 * np.linalg.norm(found)


@pytest.mark.parametrize("name", list(SESSIONS))
def test_a_session_starts_on_its_real_orbit(name):
    session = orbits.on_orbit(name)
    assert session.epoch == session.first and session.name == SESSIONS[name].name
    start = nominal_state(session, world(session))
    np.testing.assert_allclose(start, orbits.real_state(session), rtol=1e-12)
    assert orbits.on_orbit(name, "assumed") is SESSIONS[name]


def test_distances_of_a_second_reader():
    """Mm at the first pass and at mid-observation, computed by others from the same elements."""
    for name, first, middle in (("ST", 49.0, 74.0), ("OE", 296.0, 302.0), ("BC", 89.0, 124.0)):
        session = orbits.on_orbit(name)
        assert np.linalg.norm(orbits.real_state(session)[:3]) == pytest.approx(first * 1e6, abs=0.5e6)
        assert np.linalg.norm(orbits.middle_state(session)[:3]) == pytest.approx(middle * 1e6, abs=0.5e6)


@pytest.mark.parametrize("name", ["ST", "OE", "BC"])
def test_the_circle_has_the_printed_baseline(name):
    """Every source of the circle, by the projection of the formal page; angles count from north to east."""
    session = orbits.on_orbit(name)
    for angle in (0.0, 90.0, 200.0):
        placed = orbits.toward_circle(session, angle)
        middle, dynamics = orbits.middle_state(placed), world(placed)
        length = formal.projected_baseline(dynamics, placed.middle, middle, placed.telescopes[0], toward(placed))
        assert length == pytest.approx(placed.baseline * EARTH_DIAMETER, rel=1e-9)
        assert formal.angle_to_source(middle, toward(placed)) < np.radians(30.0)
    north, south = (orbits.circle(session, a)[2] for a in (0.0, 180.0))
    assert north > south


def test_the_source_of_oe_is_near_the_equator():
    session = orbits.on_orbit("OE")
    decs = [np.degrees(np.arcsin(orbits.circle(session, a)[2])) for a in range(0, 360, 10)]
    assert min(decs) == pytest.approx(-4.0, abs=0.5) and max(decs) == pytest.approx(6.0, abs=0.5)


def test_what_is_refused():
    from dataclasses import replace

    with pytest.raises(ValueError, match="orbit 'best' is unknown"):
        orbits.on_orbit("ST", "best")
    with pytest.raises(ValueError, match="no elements of Spektr-R"):
        orbits.real_state(replace(find_session("ST"), date="2014-01-01"))
    with pytest.raises(ValueError, match="no source makes it"):
        orbits.circle(replace(orbits.on_orbit("ST"), baseline=20.0), 0.0)
    assert orbits.fit_residual(find_session("OE")) == pytest.approx(4950.0)
