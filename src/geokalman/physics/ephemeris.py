"""Positions of the Sun, the Moon and the planets: the JPL ephemeris DE421, vendored for 2011 to 2019, or any SPK file.

Folkner, Williams & Boggs (2009), IPN Progress Report 42-178. Axes are those of the ICRF, time is TDB. A planet with
moons
stands for its barycentre, except the Earth; in DE421 the centre of Mars is the barycentre of its system.
"""

from __future__ import annotations

import functools
import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geokalman import files
from geokalman.constants import J2000
from geokalman.physics.spk import Segment, read_spk

DAY = 86400.0
BODIES = {
    "ssb": 0, "mercury": 1, "venus": 2, "emb": 3, "mars": 4, "jupiter": 5, "saturn": 6, "uranus": 7, "neptune": 8,
    "pluto": 9, "sun": 10, "moon": 301, "earth": 399,
}  # fmt: skip
"""Names of bodies and their NAIF numbers; `ssb` is the solar-system barycentre, `emb` that of Earth and Moon."""
_VENDORED = "de421.npz"


class OutsideEphemeris(ValueError):
    """A time that the ephemeris does not cover."""


@dataclass(frozen=True, eq=False)
class Ephemeris:
    """Chebyshev segments that lead from every body to the barycentre of the solar system."""

    name: str
    segments: tuple[Segment, ...]

    @property
    def first(self) -> float:
        """First Julian date (TDB) that every segment covers."""
        return J2000 + max(s.start for s in self.segments) / DAY

    @property
    def last(self) -> float:
        """Last Julian date (TDB) that every segment covers."""
        return J2000 + min(s.end for s in self.segments) / DAY

    def position(self, body: str, jd: ArrayLike, seconds: ArrayLike = 0.0, centre: str = "ssb") -> NDArray[np.float64]:
        """Geometric position of a body relative to a centre, ICRF axes [m].

        jd : Julian date TDB; seconds : added to it, so that a long series keeps its microseconds; they
        broadcast to (...).
        body, centre : names of `BODIES`. Returns (..., 3). Raises KeyError for another name, OutsideEphemeris
        for a time
        that is not covered.
        """
        return self._evaluate(body, centre, jd, seconds, False)

    def velocity(self, body: str, jd: ArrayLike, seconds: ArrayLike = 0.0, centre: str = "ssb") -> NDArray[np.float64]:
        """Velocity of a body relative to a centre, ICRF axes [m/s]; arguments and errors as in `position`."""
        return self._evaluate(body, centre, jd, seconds, True)

    def _evaluate(self, body, centre, jd, seconds, derivative):
        jd, seconds = np.broadcast_arrays(np.asarray(jd, dtype=float), np.asarray(seconds, dtype=float))
        time = ((jd - J2000) * DAY + seconds).ravel()
        low, high = (self.first - J2000) * DAY, (self.last - J2000) * DAY
        bad = ~((time >= low) & (time <= high))
        if bad.any():
            at = J2000 + time[bad.argmax()] / DAY
            raise OutsideEphemeris(
                f"JD {at:.3f} TDB is outside {self.name}, which covers JD {self.first:.1f} to {self.last:.1f}; give a date inside, "
                "or the path of a longer SPK file (DE421 itself covers 1899-07-29 to 2053-10-09)."
            )
        total = self._from_ssb(body, time, derivative) - self._from_ssb(centre, time, derivative)
        return total.reshape(*jd.shape, 3)

    def _from_ssb(self, body, time, derivative):
        if body not in BODIES:
            raise KeyError(f"body {body!r} is unknown; known are {', '.join(BODIES)}.")
        number, total = BODIES[body], np.zeros((len(time), 3))
        while number != 0:
            segment = next((s for s in self.segments if s.target == number), None)
            if segment is None:
                raise KeyError(f"{self.name} has no segment for body {number}, which {body} needs.")
            total += segment.evaluate(time, derivative)
            number = segment.centre
        return total


def load_ephemeris(path: str | os.PathLike = "") -> Ephemeris:
    """The vendored excerpt of DE421 (empty path), or the SPK file at a path.

    Raises FileNotFoundError, spk.SpkError, or files.CorruptedData where the vendored file fails its checksum.
    """
    if os.fspath(path):
        return Ephemeris(os.path.basename(path), tuple(read_spk(path)))
    return _vendored()


@functools.cache
def _vendored() -> Ephemeris:
    with np.load(files.data_path(_VENDORED)) as data:
        segments = [
            Segment(int(target), int(centre), float(start), float(length), 1e3 * data[f"{target}"])
            for target, centre, start, length in zip(
                data["target"], data["centre"], data["start"], data["length"], strict=True
            )
        ]
    return Ephemeris("DE421 (vendored excerpt)", tuple(segments))
