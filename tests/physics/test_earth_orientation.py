"""Earth orientation against ERFA's own chain and against skyfield's implementation of IAU 2000A."""

import erfa
import numpy as np
import pytest

from geokalman.physics.earth_orientation import OutsideOrientation, load_orientation
from geokalman.physics.timescales import MJD_ZERO, mjd_of_date, tt_minus_utc

DAYS = [mjd_of_date(2012, 7, 21), mjd_of_date(2013, 3, 12), mjd_of_date(2013, 5, 7)]


@pytest.mark.parametrize("day", DAYS)
@pytest.mark.parametrize("t", [0.0, 31222.5, 86000.0])
def test_matrix_is_that_of_erfa(day, t):
    """Rounding alone: 2e-11 rad in ERA from one double for the Julian date, 0.1 mm on the ground."""
    series = load_orientation()
    row = series.table(day, [t])[0]
    tt, ut1 = day + (t + tt_minus_utc(day)) / 86400.0, day + (t + row[3]) / 86400.0
    expected = erfa.c2t06a(MJD_ZERO, tt, MJD_ZERO, ut1, row[4], row[5]).T
    np.testing.assert_allclose(series.gcrs_from_itrs(day, t)[0], expected, rtol=0, atol=5e-11)


@pytest.mark.parametrize("day", DAYS)
def test_matrix_is_that_of_skyfield(day):
    """Another code, another route (equinox instead of CIO). It lacks the polar motion, which is set here from our
    table; its UT1 comes from our UT1 - UTC. Tolerance 2e-9 rad: both models agree to a milliarcsecond (5e-9) and
    better."""
    api = pytest.importorskip("skyfield.api")
    framelib = pytest.importorskip("skyfield.framelib")
    from skyfield.timelib import Timescale

    builtin = api.load.timescale(builtin=True)
    series, t = load_orientation(), 50000.0
    row = series.table(day, [t])[0]
    tt = day + MJD_ZERO + (t + tt_minus_utc(day)) / 86400.0
    scale = Timescale(lambda _: tt_minus_utc(day) - row[3], builtin.leap_dates, builtin.leap_offsets)
    scale.polar_motion_table = (np.array([tt - 1, tt + 1]), *(np.full(2, np.degrees(a) * 3600.0) for a in row[4:6]))
    R = framelib.itrs.rotation_at(scale.tt_jd(tt)).T
    np.testing.assert_allclose(series.gcrs_from_itrs(day, t)[0], R, rtol=0, atol=1e-8)


def test_matrix_is_a_rotation():
    R = load_orientation().gcrs_from_itrs(DAYS[0], np.linspace(0.0, 86400.0, 7))
    np.testing.assert_allclose(R @ np.swapaxes(R, 1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-14)


def test_ut1_passes_a_leap_second_without_a_step():
    """UT1 - UTC steps by one second at the end of 2012-06-30, the angle of the Earth does not."""
    series, day = load_orientation(), mjd_of_date(2012, 6, 30)
    before, after = series.table(day, [86400.9, 86401.1])[:, 3]
    assert after - before == pytest.approx(0.0, abs=1e-6)
    assert series.table(day + 1, [0.0])[0, 3] - series.table(day, [86400.0])[0, 3] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("day", [mjd_of_date(2010, 12, 31), mjd_of_date(2020, 1, 2)])
def test_outside_the_series_there_is_no_answer(day):
    with pytest.raises(OutsideOrientation, match="2011-01-01 to 2020-01-01"):
        load_orientation().table(day, [0.0])
