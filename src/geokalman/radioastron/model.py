"""The sessions of the paper, its stations and sources, and the orbits that are assumed for them.

Source throughout: Zhamkov & Zharov (2016), sections 1.6 and 1.7 as read in the book's errata; elements and sources are
assumptions, stated on the part's first page. Times are seconds since 0h UTC of the session's date.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geokalman.constants import GM_EARTH, R_EARTH
from geokalman.physics.kepler import kepler_to_state
from geokalman.physics.satellite import Dynamics, ForceModel, dynamics
from geokalman.physics.timescales import iso_utc, parse_utc, tt_minus_utc

Array = NDArray[np.float64]

STATIONS: dict[str, tuple[float, float, float]] = {
    "Bear Lakes": (2828557.2, 2206081.9, 5256359.9),
    "Ussuriysk": (-3059725.324, 3427256.783, 4409485.741),
    "Pushchino": (2916948.844, 2248648.286, 5190099.828),
    "Evpatoria": (3768313.352, 2464733.385, 4502224.502),
    "Effelsberg": (4033947.477, 486990.521, 4900430.815),
    "Yebes": (4848761.965, -261484.497, 4123084.827),
    "Medicina": (4461369.985, 919596.819, 4449559.208),
    "Robledo": (4849092.611, -360180.531, 4115109.189),
}
"""Earth-fixed coordinates of the stations [m]; truth and estimators share them, so that errors of 100 m do no harm."""
SOURCES: dict[str, tuple[float, float]] = {
    "0014+813": (4.2853121, 81.5855935),
    "0016+731": (4.9407765, 73.4583382),
    "2229+695": (337.6519573, 69.7744658),
    "0212+735": (34.3783891, 73.8257283),
}
"""Right ascension, declination (J2000) of the assumed sources [deg]: near the printed baseline of each session."""
BANDS = {"L": 1.668e9, "C": 4.836e9, "K": 22.0e9}
"""Lower edge of the observing band [Hz]: 18, 6.2 and 1.4 cm; of K, which the paper names only, a round number."""
EARTH_DIAMETER = 12742e3
"""Diameter of the Earth that stands for the paper's unit of baselines [m]."""
TT_MINUS_UTC = 67.184


@dataclass(frozen=True)
class Session:
    """One observing session: when, by whom, and the orbit that is assumed for it.

    elements: (a [m], e, i, node, argument of perigee, mean anomaly [deg]) at `epoch` [s], osculating in GCRS axes;
    passes: (begin, end) of each tracking pass [s]; observation: (begin, end) [s]; scans of 600 s.
    """

    name: str
    date: str
    observation: tuple[float, float]
    telescopes: tuple[str, ...]
    band: str
    baseline: float
    station: str
    passes: tuple[tuple[float, float], ...]
    scans: int
    elements: tuple[float, float, float, float, float, float]
    epoch: float
    source: str

    @property
    def day(self) -> int:
        """Modified Julian date of the session."""
        return parse_utc(self.date)[0]

    @property
    def middle(self) -> float:
        """Mid-observation [s], where errors before and after the estimate are compared."""
        return 0.5 * (self.observation[0] + self.observation[1])

    @property
    def first(self) -> float:
        """Time of the first measurement [s]."""
        return self.passes[0][0]

    def scan_middles(self) -> Array:
        """Middles of the scans, spread evenly over the observation [s]."""
        begin, end = self.observation
        return begin + (np.arange(self.scans) + 0.5) * (end - begin) / self.scans

    def epochs(self, interval: float = 10.0) -> Array:
        """Times of the measurements [s], every `interval` from the start of each pass."""
        counts = [math.floor((end - begin) / interval + 1e-9) + 1 for begin, end in self.passes]
        return np.concatenate([p[0] + interval * np.arange(n) for p, n in zip(self.passes, counts, strict=True)])

    def pass_numbers(self, t: Array) -> NDArray[np.int64]:
        """Number of the pass to which each time (n,) belongs."""
        return np.searchsorted([begin for begin, _ in self.passes[1:]], t, side="right")


def _s(hours: float, minutes: float, seconds: float = 0.0) -> float:
    return 3600.0 * hours + 60.0 * minutes + seconds


_JULY = ((_s(8, 46, 55), _s(9, 1, 15)), (_s(9, 54, 51), _s(10, 8, 35)))
_JULY_ELEMENTS = (194.71e6, 0.6203, 72.0, 301.9, 323.3, 32.0)
SESSIONS: dict[str, Session] = {
    "ST": Session(
        "RAES03ST", "2013-05-07", (_s(17, 0), _s(17, 40)), ("Evpatoria",), "L", 2.3, "Bear Lakes",
        ((_s(13, 15, 22), _s(13, 29, 22)), (_s(14, 59, 7), _s(15, 13, 7))), 4,
        (187.24e6, 0.6405, 68.5, 293.2, 357.2, 20.0), _s(17, 0), "0014+813",
    ),
    "OE": Session(
        "RAES03OE", "2013-03-12", (_s(16, 30), _s(17, 10)), ("Evpatoria",), "C", 2.0, "Ussuriysk",
        ((_s(6, 12, 40.5), _s(6, 27, 37.5)), (_s(7, 20, 9.5), _s(7, 35, 8.5))), 4,
        (180.00e6, 0.6296, 75.5, 294.4, 350.4, 32.0), _s(16, 30), "0016+731",
    ),
    "BB": Session(
        "RAES03BB", "2012-07-21", (_s(12, 30), _s(13, 30)), ("Yebes", "Medicina", "Robledo"), "L", 2.0, "Ussuriysk",
        _JULY, 6, _JULY_ELEMENTS, _s(12, 30), "2229+695",
    ),
    "BC": Session(
        "RAES03BC", "2012-07-21", (_s(16, 30), _s(17, 30)), ("Effelsberg",), "L", 3.0, "Ussuriysk",
        _JULY, 6, _JULY_ELEMENTS, _s(12, 30), "0212+735",
    ),
}  # fmt: skip
"""The four sessions by the last letters of their codes."""


def find_session(name: str, mean_anomaly_deg: float | None = None, station: str | None = None) -> Session:
    """The session of a name (`ST`, or the whole code `RAES03ST`), perhaps elsewhere on its orbit.

    A zero for the letter O, as the paper's text writes RAES030E, is taken for the letter (erratum E8).
    mean_anomaly_deg replaces the assumed place on the orbit at the session's epoch, station the assumed one.
    Raises ValueError for an unknown session or station, and an anomaly that is not finite.
    """
    key = name.strip().upper().removeprefix("RAES03").replace("0", "O")
    if key not in SESSIONS:
        raise ValueError(f"session {name!r} is unknown; give one of {', '.join(SESSIONS)} (RAES03ST, ...).")
    session = SESSIONS[key]
    if mean_anomaly_deg is not None:
        if not math.isfinite(mean_anomaly_deg):
            raise ValueError(f"mean_anomaly_deg = {mean_anomaly_deg} is not finite.")
        session = replace(session, elements=(*session.elements[:5], float(mean_anomaly_deg)))
    if station:
        session = replace(session, station=find_station(station))
    return session


def check_leap_seconds(day: int, assumed: float) -> None:
    """Raise ValueError where TT - UTC = `assumed` [s] is not that of the day: a leap second too few or too many."""
    if abs(tt_minus_utc(day) - assumed) > 1e-9:
        raise ValueError(
            f"TT - UTC = {assumed:g} s is wrong on {iso_utc(day, 0.0)[:10]}: it is {tt_minus_utc(day):g} s there; "
            "mind the leap second of 2012-06-30."
        )


def find_station(name: str) -> str:
    """The name of a station as in `STATIONS`, whatever its case and hyphens. Raises ValueError for an unknown one."""
    first = name.strip().lower().replace("-", " ").replace("_", " ").split(" ")[0]
    for known in STATIONS:
        if first == known.lower().split(" ")[0]:
            return known
    raise ValueError(f"station {name!r} is unknown; give some of {', '.join(STATIONS)}.")


def find_stations(names: list[str] | tuple[str, ...], session: Session) -> tuple[str, ...]:
    """The stations of some names, the session's own for none. Raises ValueError for doubles and unknown ones."""
    found = tuple(find_station(name) for name in names) or (session.station,)
    if len(set(found)) < len(found):
        raise ValueError(f"stations {', '.join(found)}: one of them is given twice; name each once.")
    return found


def direction(ra_deg: float, dec_deg: float) -> Array:
    """Unit vector (3,) to right ascension and declination [deg].

    Raises ValueError for a declination beyond 90 degrees or a right ascension outside [0, 360).
    """
    if not -90.0 <= dec_deg <= 90.0:
        raise ValueError(f"declination {dec_deg:g} deg is beyond the pole; it must be in [-90, 90].")
    if not 0.0 <= ra_deg < 360.0:
        raise ValueError(f"right ascension {ra_deg:g} deg must be in [0, 360).")
    ra, dec = math.radians(ra_deg), math.radians(dec_deg)
    return np.array([math.cos(dec) * math.cos(ra), math.cos(dec) * math.sin(ra), math.sin(dec)])


def find_source(text: str, session: Session, position: Array | None = None) -> Array:
    """Unit vector (3,) to a source: a name of `SOURCES`, `RA, Dec` in degrees, `east N`; empty: the session's own.

    `east 15` lies 15 degrees from the direction of the spacecraft (position (3,)), east along z x r.
    Raises ValueError for anything else; a right ascension in hours (12h30m, 12:30:00) is refused.
    """
    text = text.strip() or session.source
    if text in SOURCES:
        return direction(*SOURCES[text])
    if text.startswith("east") and position is not None:
        angle = math.radians(float(text.removeprefix("east")))
        up = position / np.linalg.norm(position)
        east = np.cross([0.0, 0.0, 1.0], up)
        return math.cos(angle) * up + math.sin(angle) * east / np.linalg.norm(east)
    if "h" in text or ":" in text:
        raise ValueError(f"source {text!r} gives its right ascension in hours; write degrees, as in 4.285, 81.586.")
    try:
        ra, dec = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(
            f"source {text!r} is unknown; give one of {', '.join(SOURCES)}, or right ascension, declination in degrees."
        ) from None
    return direction(ra, dec)


def check_orbit(elements: tuple[float, ...]) -> None:
    """Raise ValueError for elements (a [m], e, ...) that are no ellipse or meet the Earth."""
    a, e = elements[:2]
    if not 0.0 <= e < 1.0:
        raise ValueError(f"e = {e:g} is not the eccentricity of an ellipse; give 0 <= e < 1.")
    if a * (1.0 - e) < R_EARTH:
        perigee, radius = a * (1.0 - e) / 1e3, R_EARTH / 1e3
        raise ValueError(
            f"a = {a / 1e3:g} km with e = {e:g}: the orbit meets the Earth, its perigee is inside the Earth "
            f"({perigee:.1f} km from the geocentre, radius {radius:.1f} km); give a larger a or a smaller e."
        )


@functools.lru_cache(maxsize=32)
def world(session: Session, model: ForceModel | None = None, days: float = 0.0) -> Dynamics:
    """The dynamics of a session from its first measurement or epoch to its end, or `days` after that measurement."""
    check_leap_seconds(session.day, TT_MINUS_UTC)
    first = min(session.first, session.epoch) - 3600.0
    last = max(session.observation[1], session.epoch, session.first + 86400.0 * days) + 3600.0
    return dynamics(session.day, first, last, model)


def nominal_state(session: Session, world: Dynamics) -> Array:
    """Nominal GCRS state (6,) at the first measurement [m, m/s]: the assumed elements, integrated there."""
    check_orbit(session.elements)
    a, e, *angles = session.elements
    state = kepler_to_state((a, e, *np.radians(angles)), GM_EARTH)
    if session.epoch == session.first:
        return state
    return world.propagate(state, np.array([session.epoch, session.first])).y[-1]


@functools.lru_cache(maxsize=32)
def _middle(session: Session) -> tuple[float, ...]:
    dynamics = world(session)
    span = np.array([session.first, session.middle])
    return tuple(dynamics.propagate(nominal_state(session, dynamics), span).y[-1])


def toward(session: Session, text: str = "") -> Array:
    """Unit vector (3,) to the source of `find_source`, `east N` counted from the nominal orbit at mid-observation."""
    return find_source(text, session, np.array(_middle(session)[:3]))
