"""Sessions, stations and sources as the specification has them; what is refused."""

import numpy as np
import pytest

from geokalman.radioastron import formal, simulate, visibility
from geokalman.radioastron.data import Scenario
from geokalman.radioastron.model import (
    EARTH_DIAMETER,
    SESSIONS,
    SOURCES,
    STATIONS,
    check_leap_seconds,
    check_orbit,
    direction,
    find_session,
    find_source,
    find_station,
    find_stations,
    nominal_state,
    toward,
    world,
)

STATES = {
    "ST": (41951158.376, -22625101.610, 75256563.750, 21.28105446, 1821.27365598, 1871.60067831),
    "OE": (36137365.649, -34759278.142, 71711182.302, -83.29781345, 1521.90979703, 2138.85436874),
    "BB": (63433321.363, -38829348.348, 102590324.194, 25.75296078, 1048.77468777, 1773.23821021),
}
OBSERVED = {"ST": (86058023.32, 1089.730401), "OE": (83514642.53, 1207.268582), "BB": (124855108.64, 935.129571)}


@pytest.mark.parametrize("name", ["ST", "OE", "BB", "BC"])
def test_nominal_state_and_observables(name):
    """Section 3: another implementation agreed to 1.2 mm and 1.2e-7 m/s, range to 8 mm, rate to 5e-7 m/s."""
    key, session = ("BB" if name == "BC" else name), find_session(name)
    y = nominal_state(session, world(session))
    np.testing.assert_allclose(y[:3], STATES[key][:3], rtol=0, atol=5e-3)
    np.testing.assert_allclose(y[3:], STATES[key][3:], rtol=0, atol=1e-6)
    z = simulate.observe(world(session), np.array([session.first]), y[None], np.array([0]), (session.station,))[0]
    assert z[0] == pytest.approx(OBSERVED[key][0], abs=0.02) and z[1] == pytest.approx(OBSERVED[key][1], abs=2e-6)


@pytest.mark.parametrize(("name", "epochs", "baseline", "angle", "first", "last"), [
    ("ST", (85, 85), 2.37, 13.9, 26.7, 29.7), ("OE", (90, 90), 1.92, 12.7, 37.2, 33.1),
    ("BB", (87, 83), 1.87, 7.4, 15.7, 24.8), ("BC", (87, 83), 3.17, 14.1, 15.7, 24.8),
])  # fmt: skip
def test_geometry(name, epochs, baseline, angle, first, last):
    session, dynamics = find_session(name), world(find_session(name))
    arc = session.pass_numbers(session.epochs())
    assert (np.sum(arc == 0), np.sum(arc == 1)) == epochs
    g = formal.linearise(session, dynamics, (session.station,))
    source = find_source("", session)
    assert formal.projected_baseline(
        dynamics, session.middle, g.middle, session.telescopes[0], source
    ) / EARTH_DIAMETER == pytest.approx(baseline, abs=0.01)
    assert np.degrees(formal.angle_to_source(g.middle, source)) == pytest.approx(angle, abs=0.06)
    ends = session.epochs()[[0, -1]]
    heights = np.degrees(visibility.elevations(dynamics, ends, dynamics.propagate(g.start, ends).y, session.station))
    np.testing.assert_allclose(heights, [first, last], atol=0.1)


def test_names_are_found_in_every_spelling():
    assert find_session("raes03st") is find_session("ST") is SESSIONS["ST"]
    assert find_station("bear-lakes") == find_station("Bear Lakes") == "Bear Lakes"
    assert find_station("Ussuriysk RT-70") == "Ussuriysk"
    assert find_stations([], SESSIONS["OE"]) == ("Ussuriysk",)
    assert find_session("OE", station="Bear Lakes").station == "Bear Lakes"
    np.testing.assert_array_equal(find_source("4.2853121, 81.5855935", SESSIONS["ST"]), find_source("", SESSIONS["ST"]))
    assert all(np.linalg.norm(direction(*d)) == pytest.approx(1.0) for d in SOURCES.values())


def test_a_source_to_the_east():
    position = np.array([3e7, 1e7, 9e7])
    s = find_source("east 15", SESSIONS["ST"], position)
    assert np.degrees(np.arccos(s @ position / np.linalg.norm(position))) == pytest.approx(15.0)
    assert (s @ np.cross([0, 0, 1], position)) > 0


def test_a_source_to_the_east_of_the_nominal_spacecraft():
    """`toward` counts from the spacecraft at mid-observation, which `find_source` alone does not know."""
    session = find_session("BC")
    forces = world(session)
    middle = forces.propagate(nominal_state(session, forces), np.array([session.first, session.middle])).r[-1, 0]
    assert np.degrees(np.arccos(toward(session, "east 15") @ middle / np.linalg.norm(middle))) == pytest.approx(15.0)
    np.testing.assert_array_equal(toward(session), direction(*SOURCES["0212+735"]))
    with pytest.raises(ValueError, match="unknown"):
        find_source("east 15", session)


def test_ends_of_passes_of_each_station(st, state):
    """Two stations that track in turns: each is held against its own ends."""
    t = np.array([0.0, 10.0, 20.0, 4000.0, 4010.0]) + st[0].first
    seen = np.array([0, 0, 0, 1, 1])
    visibility.check_passes(st[1], t, seen, state, ("Bear Lakes", "Ussuriysk"))
    sunk = {**STATIONS, "Antipode": tuple(-x for x in STATIONS["Bear Lakes"])}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(visibility, "STATIONS", sunk)
        with pytest.raises(ValueError, match="above the horizon of Antipode at 517[23]2 s"):
            visibility.check_passes(st[1], t, seen, state, ("Bear Lakes", "Antipode"))


def test_another_place_on_the_orbit():
    one = find_session("ST", 90.0)
    assert np.linalg.norm(nominal_state(one, world(one))[:3]) == pytest.approx(241e6, rel=5e-3)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: find_session("XY"), "session 'XY' is unknown"),
    (lambda: find_session("ST", float("nan")), "not finite"),
    (lambda: find_station("Goldstone"), "station 'Goldstone' is unknown"),
    (lambda: find_stations(["Bear Lakes", "bear lakes"], SESSIONS["ST"]), "twice"),
    (lambda: direction(10.0, 91.0), "beyond the pole"),
    (lambda: direction(361.0, 10.0), "right ascension"),
    (lambda: find_source("0h17m, 81.6", SESSIONS["ST"]), "in hours"),
    (lambda: find_source("00:17:08, 81.6", SESSIONS["ST"]), "in hours"),
    (lambda: find_source("3C 273", SESSIONS["ST"]), "unknown"),
    (lambda: check_orbit((1e8, 1.0)), "ellipse"),
    (lambda: check_orbit((1e7, 0.5)), "inside the Earth"),
    (lambda: check_leap_seconds(SESSIONS["BB"].day, 66.184), "leap second of 2012-06-30"),
])  # fmt: skip
def test_what_is_refused(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_a_spacecraft_below_the_horizon_is_refused(st, state):
    below = np.concatenate([-state[:3], state[3:]])
    with pytest.raises(ValueError, match="above the horizon of Bear Lakes"):
        visibility.check_visible(st[1], np.array([st[0].first]), below[None], ("Bear Lakes",))
    visibility.check_visible(st[1], np.array([st[0].first]), state[None], tuple(STATIONS))
    beneath = find_session("ST", 340.0)
    with pytest.raises(ValueError, match="choose another station, pass or mean anomaly"):
        formal.linearise(beneath, world(beneath), ("Bear Lakes",))
    with pytest.raises(ValueError, match="choose another station, pass or mean anomaly"):
        simulate.draw(beneath, world(beneath), Scenario(), ("Bear Lakes",), np.random.default_rng(1))
