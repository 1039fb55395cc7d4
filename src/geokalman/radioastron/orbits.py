"""The real orbits of the sessions, from public elements, and the sources that their printed baselines admit.

The elements were fitted by others to optical astrometry; the sets of these days reproduce their own ephemeris to 5 km
(OE), 151 km (ST) and 210 km (BB, BC). They serve as geometry, not as an orbit that a correlator could use.
"""

from __future__ import annotations

import functools
import json
import math
from dataclasses import replace

import numpy as np

from geokalman.constants import GM_EARTH
from geokalman.data import data_path
from geokalman.physics.kepler import state_to_kepler
from geokalman.radioastron.model import (
    EARTH_DIAMETER,
    STATIONS,
    Array,
    Session,
    find_session,
    nominal_state,
    world,
)

REAL, ASSUMED = "real", "assumed"
"""Which orbit: of the public elements of the day, or the one assumed in `model.SESSIONS`."""


@functools.lru_cache(maxsize=1)
def _states() -> dict[str, dict]:
    return json.loads(data_path("spektr_r.json").read_text(encoding="utf-8"))


def real_state(session: Session) -> Array:
    """GCRS state (6,) [m, m/s] of the real spacecraft at the session's first measurement.

    Raises ValueError for a session of a day without elements.
    """
    entry = _states().get(session.date)
    if entry is None or entry["utc_seconds"] != session.first:
        raise ValueError(f"no elements of Spektr-R are at hand for {session.date}; there are {', '.join(_states())}.")
    return np.array(entry["state_gcrs"])


def fit_residual(session: Session) -> float:
    """Largest difference [m] between the elements of the day and the ephemeris that they were fitted to."""
    return 1e3 * _states()[session.date]["worst_residual_km"]


def on_orbit(name: str, orbit: str = REAL) -> Session:
    """A session on its real orbit, or on the assumed one.

    Raises ValueError for an unknown orbit or session.
    """
    session = find_session(name)
    if orbit == ASSUMED:
        return session
    if orbit != REAL:
        raise ValueError(f"orbit {orbit!r} is unknown; give {REAL} or {ASSUMED}.")
    a, e, inc, raan, argp, mean_anomaly = state_to_kepler(real_state(session), GM_EARTH)[:6]
    angles = (math.degrees(x) for x in (inc, raan, argp, mean_anomaly))
    return replace(session, elements=(a, e, *angles), epoch=session.first)


@functools.lru_cache(maxsize=16)
def _baseline(session: Session) -> tuple[float, ...]:
    middle = middle_state(session)[:3]
    station = world(session).gcrs_from_itrs(session.middle) @ np.array(STATIONS[session.telescopes[0]])
    return tuple(middle - station)


def middle_state(session: Session) -> Array:
    """Nominal state (6,) at mid-observation [m, m/s]."""
    dynamics = world(session)
    return dynamics.propagate(nominal_state(session, dynamics), np.array([session.first, session.middle])).y[-1]


def circle(session: Session, angle_deg: float) -> Array:
    """Unit vector (3,) to a source from which the first telescope's baseline has the printed length.

    s = cos(theta) b + sin(theta) (cos(p) n + sin(p) e),  sin(theta) = printed length / |baseline|
    with b along the baseline at mid-observation, n north and e east of it, and p the position angle [deg], from north
    to east. Of the two sources the one on the spacecraft's side of the sky. Raises ValueError where the baseline is
    shorter than the printed one.
    """
    b = np.array(_baseline(session))
    length, printed = float(np.linalg.norm(b)), session.baseline * EARTH_DIAMETER
    if printed > length:
        raise ValueError(
            f"the baseline of {session.name} is {length / 1e6:.1f} Mm long; no source makes it {printed / 1e6:.1f} Mm."
        )
    along = b / length
    east = np.cross([0.0, 0.0, 1.0], along)
    east /= np.linalg.norm(east)
    p, theta = math.radians(angle_deg), math.asin(printed / length)
    across = math.cos(p) * np.cross(along, east) + math.sin(p) * east
    return math.cos(theta) * along + math.sin(theta) * across


def toward_circle(session: Session, angle_deg: float) -> Session:
    """The session with the source of `circle`, as right ascension and declination."""
    x, y, z = circle(session, angle_deg)
    ra, dec = math.degrees(math.atan2(y, x)) % 360.0, math.degrees(math.asin(z))
    return replace(session, source=f"{ra!r}, {dec!r}")
