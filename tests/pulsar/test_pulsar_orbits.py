"""Orbits of satellites: units, layouts, holes, spikes; against two-body orbits, and the day of RXTE."""

import warnings

import numpy as np
import pytest

from geokalman.constants import GM_EARTH
from geokalman.data import data_path
from geokalman.physics.kepler import kepler_to_state
from geokalman.pulsar import photons
from geokalman.pulsar.fits import FitsError, FitsWarning
from geokalman.pulsar.orbits import SatelliteOrbit, read_orbit

HEAD = {"EXTNAME": "ORBIT", "MJDREFI": 49353, "MJDREFF": 0.0, "TIMESYS": "TT"}
T0 = 5.0e8


def kepler(t, a=6.86e6, e=0.001, inc=0.4):
    """States (n, 6) of a two-body orbit at seconds t."""
    n = np.sqrt(GM_EARTH / a**3)
    return np.array([kepler_to_state((a, e, inc, 4.0, 1.0, n * x), GM_EARTH) for x in t])


def xyz(t, state, unit="m", factor=1.0):
    names = ("X", "Y", "Z", "Vx", "Vy", "Vz")
    units = [unit] * 3 + [f"{unit}/s"] * 3
    return [("Time", "D", (T0 + t).astype(">f8"), "s")] + [
        (name, "D", (state[:, k] * factor).astype(">f8"), units[k]) for k, name in enumerate(names)
    ]


def vectors(t, state, names, form="3D", kind=">f8", unit=("km", "km/s"), factor=1e-3):
    position, velocity = (state[:, part] * factor for part in (slice(0, 3), slice(3, 6)))
    columns = [(names[0], "D", (T0 + t).astype(">f8"), "s"), (names[1], form, position.astype(kind), unit[0])]
    return columns + ([(names[2], form, velocity.astype(kind), unit[1])] if len(names) > 2 else [])


@pytest.fixture(scope="module")
def hour():
    """Two-body orbit of an hour: t (61,) [s] from 0, states (61, 6)."""
    t = 60.0 * np.arange(61)
    return t, kepler(t)


@pytest.mark.parametrize(
    ("columns", "tolerance"),
    [
        (lambda t, s: xyz(t, s), 0.0), (lambda t, s: xyz(t, s, "km", 1e-3), 1e-8),
        (lambda t, s: [(c[0], c[1], c[2]) for c in xyz(t, s)], 0.0),
        (lambda t, s: xyz(t, s, "metres"), 0.0), (lambda t, s: xyz(t, s, "KM", 1e-3), 1e-8),
        (lambda t, s: xyz(t, s)[:4] + [(*c[:3], "km s-1") for c in xyz(t, s, factor=1e-3)[4:]], 1e-8),
        (lambda t, s: xyz(t, s)[:4] + [(c[0], c[1], c[2], "m s**-1") for c in xyz(t, s)[4:]], 0.0),
        (lambda t, s: vectors(t, s, ("TIME", "POSITION", "VELOCITY")), 1e-8),
        (lambda t, s: vectors(t, s, ("START", "SC_POSITION", "SC_VELOCITY"), "3E", ">f4", ("m", "m/s"), 1.0), 0.5),
        (lambda t, s: vectors(t, s, ("START", "SC_POSITION"), "3E", ">f4", ("m", ""), 1.0), 0.5),
        (lambda t, s: xyz(t, s)[:4], 1e-3),
    ],
)  # fmt: skip
def test_layouts_and_units(fits_file, hour, columns, tolerance):
    t, state = hour
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        orbit = read_orbit(fits_file((HEAD, columns(t, state))))
    assert orbit.jd == 2400000.5 + 49353 and orbit.t - T0 == pytest.approx(t, abs=1e-6)
    assert np.abs(orbit.r - state[:, :3]).max() <= tolerance
    at = np.arange(10.0, 3590.0, 7.0)
    assert np.abs(orbit.position(T0 + at, orbit.jd) - kepler(at)[:, :3]).max() < 2.0


@pytest.mark.parametrize(
    ("t", "a", "e"),
    [(10.0, 6.78e6, 0.0005), (30.0, 6.9e6, 0.01), (300.0, 8.0e7, 0.8), (600.0, 1.4e8, 0.2), (1.0, 6.7e6, 0.001)],
)  # fmt: skip
def test_orbits_of_other_missions_pass(fits_file, t, a, e):
    """Space station, Fermi, a Chandra-like ellipse (perigee left out, where five minutes are long), a high circle."""
    t = t * np.arange(40) + 20000.0 * (e > 0.5)
    assert len(read_orbit(fits_file((HEAD, xyz(t, kepler(t, a, e, 1.0))))).t) == 40


def test_two_records_are_enough_and_one_is_not(fits_file, hour):
    t, state = hour
    orbit = read_orbit(fits_file((HEAD, xyz(t[:2], state[:2]))))
    assert orbit.position(np.array([T0 + 30.0]), orbit.jd)[0] == pytest.approx(kepler([30.0])[0, :3], abs=2.0)
    for n, count in enumerate(("0 records", "1 record")):
        with pytest.raises(FitsError, match=f"the orbit has {count}; two are needed"):
            read_orbit(fits_file((HEAD, xyz(t[:n], state[:n]))))


def altered(row, column, change):
    def columns(t, state):
        state = state.copy()
        state[row, column] = change(state[row, column])
        return xyz(t, state)

    return columns


@pytest.mark.parametrize(
    ("columns", "match"),
    [
        (altered(55, 0, lambda x: np.nan), "column X is null or not finite in row 56;"),
        (altered([7, 9], 4, lambda x: np.inf), "column VY is null or not finite in row 8, as are 1 other"),
        (altered(16, slice(0, 3), lambda x: 0.0), "position in row 17 is 0 km from the Earth"),
        (altered(16, 4, lambda x: 1e300), "velocity in row 17 is inf m/s"),
        (altered(16, slice(0, 3), lambda x: 1e30), "position in row 17 is 1.73205e.27 km"),
        (lambda t, s: xyz(t, s, factor=1e-3), "position in row 1 is 6.85.* km .* check X, Y, Z and their units"),
        (lambda t, s: xyz(t, s, "km"), "position in row 1 is 6.85.*e.06 km"),
        (lambda t, s: xyz(t, s, "m", 0.5), "is 342.* km from"),
        (lambda t, s: xyz(t, s, "AU"), "column X is in 'AU'; m or km"),
        (lambda t, s: xyz(t, s, "ft"), "column X is in 'ft'"),
        (lambda t, s: xyz(t, s)[:4] + [(*c[:3], "m") for c in xyz(t, s)[4:]], "column VX is in 'm'"),
        (lambda t, s: xyz(t, s)[:4] + [(*c[:3], "km/s") for c in xyz(t, s)[4:]],
         "velocity in row 1 is 7.*e.06 m/s, above 12000 m/s; check VX, VY, VZ"),
        (lambda t, s: xyz(t, s)[:4] + [c[:3] for c in xyz(t, s, factor=1e-3)[4:]],
         "velocities are 7.6.* m/s, but .* by 7"),
        (lambda t, s: xyz(t, s * [1, 1, 1, -1, -1, -1]), "velocities are .* but the positions move otherwise"),
        (lambda t, s: xyz(t / 60.0, s), "velocities are .* but the positions move otherwise"),
        (lambda t, s: xyz(t / 60.0, s)[:4], "acceleration differs by .* from the Earth's gravity"),
        (lambda t, s: [*xyz(t, s)[:1], ("POSITION", "2D", s[:, :2].astype(">f8"), "m")], "have 2 elements"),
        (lambda t, s: xyz(t, np.ones_like(s) * [7e6, 0, 0, 0, 0, 0]), "acceleration differs by 100%"),
    ],
)  # fmt: skip
def test_what_is_no_orbit_is_refused_as_it_is_read(fits_file, hour, columns, match):
    with pytest.raises(FitsError, match=match) as caught:
        read_orbit(fits_file((HEAD, columns(*hour))))
    assert "extension 1 (ORBIT): " in str(caught.value)


@pytest.mark.parametrize("row", [0, 1, 2, 30, 58, 59, 60])
@pytest.mark.parametrize(
    ("column", "size"), [(0, 5e3), (2, -4e5), (1, 3e6), (4, 200.0), (5, -6e3)], ids=["x", "z", "far", "vy", "vz"]
)  # fmt: skip
def test_a_spike_is_named_by_its_row(fits_file, hour, row, column, size):
    columns = altered(row, column, lambda x: x + size)
    path = fits_file((HEAD, columns(*hour)))
    with pytest.raises(
        FitsError, match=rf"the record in row {row + 1} is off the orbit|row {row + 1} is .* km from the Earth"
    ):
        read_orbit(path)


@pytest.mark.parametrize("row", [2, 30, 58])
def test_a_spike_among_positions_alone_is_named_too(fits_file, hour, row):
    t, state = hour
    state = state.copy()
    state[row, 1] += 2e4
    with pytest.raises(FitsError, match=f"the record in row {row + 1} is off the orbit"):
        read_orbit(fits_file((HEAD, xyz(t, state)[:4])))


def test_a_jump_between_two_orbits_is_named_by_both_rows(fits_file, hour):
    t, state = hour
    state = np.vstack([state[:30], kepler(t[30:], e=0.004)])
    with pytest.raises(FitsError, match="records in rows 30 and 31 do not belong to one orbit"):
        read_orbit(fits_file((HEAD, xyz(t, state))))


def test_axes_that_turn_with_the_earth_are_refused(fits_file, hour):
    t, state = hour
    turn, spin = 7.292115e-5 * t + 1.0, np.array([0.0, 0.0, 7.292115e-5])
    c, s, o = np.cos(turn), np.sin(turn), np.zeros_like(turn)
    fixed = np.array([[c, s, o], [-s, c, o], [o, o, o + 1.0]])
    r = np.einsum("ijn,nj->ni", fixed, state[:, :3])
    v = np.einsum("ijn,nj->ni", fixed, state[:, 3:]) - np.cross(spin, r)
    for columns in (xyz(t, np.hstack([r, v])), xyz(t, np.hstack([r, v]))[:4]):
        with pytest.raises(
            FitsError, match="acceleration differs by 1.% from the Earth's gravity; are the axes Earth-fixed"
        ):
            read_orbit(fits_file((HEAD, columns)))


@pytest.mark.parametrize(
    ("header", "match"),
    [
        ({"RADECSYS": "FK4"}, "RADECSYS = FK4; axes of the ICRF"), ({"EQUINOX": 1950.0}, "EQUINOX = 1950.0"),
        ({"RADESYS": "ITRF"}, "RADESYS = ITRF"), ({"COORDSYS": "ECEF"}, "COORDSYS = ECEF"),
        ({"FRAME": "TEME"}, "FRAME = TEME"),
        ({"TIMEREF": "SOLARSYSTEM"}, "times are those at the barycentre"),
        ({"TIMEREF": "GEOCENTRIC"}, "TIMEREF = GEOCENTRIC"),
        ({"TIMESYS": "UTC"}, "TIMESYS = UTC"), ({"TIMEUNIT": "d"}, "TUNIT1 = s contradicts TIMEUNIT = d"),
        ({"MJDREFI": None}, "lacks MJDREF"),
        ({"TUNIT1": "m"}, "TUNIT1 = m"), ({"TTYPE4": "W"}, "no table with Time, X, Y, Z, Vx, Vy, Vz"),
        ({"TSCAL2": "x"}, "TSCAL2 = 'x'"),
    ],
)  # fmt: skip
def test_headers_of_orbits(fits_file, hour, header, match):
    with pytest.raises(FitsError, match=match):
        read_orbit(fits_file((HEAD | header, xyz(*hour))))
    for right in (
        {"RADECSYS": "FK5", "EQUINOX": 2000.0},
        {"RADESYS": "ICRS"},
        {"EQUINOX": "J2000", "TIMEREF": "LOCAL"},
        {"COORDSYS": "ECI"},
    ):
        assert len(read_orbit(fits_file((HEAD | right, xyz(*hour)))).t) == 61


def test_records_out_of_order_are_sorted_and_doubled_ones_taken_once(fits_file, hour):
    t, state = hour
    order = np.r_[30:61, 0:40]  # two files appended, ten minutes of them the same
    late = state[order] + np.where(np.arange(71) < 31, 0.0, 5.0)[:, None] * [1, 0, 0, 0, 0, 0]  # 5 m apart
    with pytest.warns(FitsWarning) as told:
        orbit = read_orbit(fits_file((HEAD, xyz(t[order], late))))
    assert orbit.t.tolist() == (T0 + t).tolist() and np.abs(orbit.r - state[:, :3]).max() <= 5.0
    text = "\n".join(str(w.message) for w in told)
    assert "not in the order of time" in text and "10 of 71 records have the time of another" in text
    late[45, 1] += 3e3
    with pytest.raises(FitsError, match="rows 16 and 46 have the same time, but positions .* km apart") as caught:
        read_orbit(fits_file((HEAD, xyz(np.r_[t[order][:45], t[45], t[order][46:]], late))))
    assert "positions" in str(caught.value)


@pytest.mark.parametrize("lost", [slice(4, 57), slice(20, 30), slice(20, 27)])
def test_events_in_a_hole_of_the_orbit_are_refused(fits_file, hour, lost):
    t, state = (np.delete(x, lost, axis=0) for x in hour)
    orbit = read_orbit(fits_file((HEAD, xyz(t, state))))
    start, stop = 60.0 * (lost.start - 1), 60.0 * lost.stop
    hole = f"no record for {stop - start:.0f} s, from {T0 + start:.0f} to {T0 + stop:.0f} s, where 2 of 3"
    with pytest.raises(ValueError, match=rf"given.fits, extension 1 \(ORBIT\): {hole}"):
        orbit.position(T0 + np.array([10.0, start + 1.0, stop - 1.0]), orbit.jd)
    at = np.array([10.0, start, stop, 3599.0])  # beside the hole
    assert np.abs(orbit.position(T0 + at, orbit.jd) - kepler(at)[:, :3]).max() < 2.0


def test_short_holes_and_long_steps_where_interpolation_holds(fits_file, hour):
    t, state = (np.delete(x, slice(20, 23), axis=0) for x in hour)  # 240 s
    at = np.array([1230.0, 1260.0, 1290.0])
    orbit = read_orbit(fits_file((HEAD, xyz(t, state))))
    assert np.abs(orbit.position(T0 + at, orbit.jd) - kepler(at)[:, :3]).max() < 1e3
    for step, kept in ((400.0, True), (900.0, False)):  # regular, but too far apart at this height
        t = step * np.arange(8)
        orbit = read_orbit(fits_file((HEAD, xyz(t, kepler(t)))))
        if kept:
            assert np.abs(orbit.position(T0 + at, orbit.jd) - kepler(at)[:, :3]).max() < 1e3
        else:
            with pytest.raises(ValueError, match="no record for 900 s"):
                orbit.position(T0 + at, orbit.jd)


def test_the_hole_named_in_a_report_is_refused():
    """No record of RXTE between 200 s after the first and 200 s before the last photon: wrong by 2265 km before."""
    rxte, orbit = (
        read(data_path(f"photons/{name}.fits.gz"))
        for read, name in ((photons.read_events, "b1509_rxte"), (photons.read_orbit, "rxte_orbit"))
    )
    kept = (orbit.t < rxte.t[0] + 200.0) | (orbit.t > rxte.t[-1] - 200.0)
    cut = SatelliteOrbit(orbit.t[kept], orbit.jd, orbit.r[kept], orbit.v[kept])
    with pytest.raises(ValueError, match="the orbit: no record for 3180 s"):
        cut.position(rxte.t, rxte.jd)


def test_an_orbit_of_another_day_names_both_days(hour):
    t, state = hour
    orbit = SatelliteOrbit(T0 + t, 2449353.5, state[:, :3], state[:, 3:])
    for at in (T0 - 86400.0, T0 + 3600.001):
        match = (
            "the orbit: the records cover MJD 55140.03704 to 55140.07870, the events MJD 551.* orbit file of their day"
        )
        with pytest.raises(ValueError, match=match):
            orbit.position(np.array([at]), orbit.jd)


@pytest.mark.parametrize("null", [0.0, -9999.0])
def test_a_time_that_is_null_is_refused_by_row(fits_file, hour, null):
    columns = xyz(*hour)
    columns[0][2][5] = null
    with pytest.raises(FitsError, match=f"column (Time|TIME) has {null:g} s in row 6, a null value"):
        read_orbit(fits_file((HEAD, columns)))
