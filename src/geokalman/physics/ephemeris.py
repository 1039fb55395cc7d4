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

from geokalman.constants import J2000
from geokalman.data import data_path
from geokalman.physics.spk import Segment, SpkError, read_spk

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
    """Chebyshev segments that lead from every body to the barycentre of the solar system.

    Of several segments of one body that cover a time, the last in the file counts.
    """

    name: str
    segments: tuple[Segment, ...]

    def position(self, body: str, jd: ArrayLike, seconds: ArrayLike = 0.0, centre: str = "ssb") -> NDArray[np.float64]:
        """Geometric position of a body relative to a centre, ICRF axes [m].

        jd : Julian date TDB; seconds : added to it, so that a long series keeps its microseconds; they
        broadcast to (...).
        body, centre : names of `BODIES`. Returns (..., 3). Raises ValueError for another name, SpkError for a body
        that the ephemeris does not hold, OutsideEphemeris for a time that is not covered.
        """
        return self._evaluate(body, centre, jd, seconds, False)

    def velocity(self, body: str, jd: ArrayLike, seconds: ArrayLike = 0.0, centre: str = "ssb") -> NDArray[np.float64]:
        """Velocity of a body relative to a centre, ICRF axes [m/s]; arguments and errors as in `position`."""
        return self._evaluate(body, centre, jd, seconds, True)

    def _evaluate(self, body, centre, jd, seconds, derivative):
        jd, seconds = np.broadcast_arrays(np.asarray(jd, dtype=float), np.asarray(seconds, dtype=float))
        time = ((jd - J2000) * DAY + seconds).ravel()
        for name in (body, centre):
            if name not in BODIES:
                raise ValueError(f"body {name!r} is unknown; it must be one of {', '.join(BODIES)}.")
        (near, root), (far, other) = (self._from_root(BODIES[name], time, derivative) for name in (body, centre))
        if (apart := root != other).any():
            missing = max(int(root[apart][0]), int(other[apart][0]))
            held = ", ".join(sorted({_name(s.target) for s in self.segments}))
            raise SpkError(
                f"{self.name} has no segment of {_name(missing)}, which leads from {body} to {centre}; it has {held}."
            )
        return (near - far).reshape(*jd.shape, 3)

    def _from_root(self, number, time, derivative, path=()):
        """Vectors (n, 3) from where the chain of segments ends, and the number of that body (n,), at times (n,)."""
        if number in path:
            raise SpkError(f"{self.name}: the segments of {' and '.join(map(_name, path))} refer to one another only.")
        total, root, left = np.zeros((len(time), 3)), np.full(len(time), number), np.ones(len(time), dtype=bool)
        own = [s for s in self.segments if s.target == number]
        if number == 0 or not own:
            return total, root
        for segment in reversed(own):
            inside = left & (segment.begin <= time) & (time <= segment.end)
            if inside.any():
                before, root[inside] = self._from_root(segment.centre, time[inside], derivative, (*path, number))
                total[inside] = segment.evaluate(time[inside], derivative) + before
                left &= ~inside
        if left.any():
            spans = ", ".join(f"{J2000 + s.begin / DAY:.1f} to {J2000 + s.end / DAY:.1f}" for s in own)
            raise OutsideEphemeris(
                f"JD {J2000 + time[left.argmax()] / DAY:.3f} TDB is outside {self.name}, which covers JD {spans} for"
                f" {_name(number)}; give a date inside, or the path of a longer SPK file (DE421 itself covers"
                " 1899-07-29 to 2053-10-09)."
            )
        return total, root


def _name(number: int) -> str:
    return next((name for name, known in BODIES.items() if known == number), f"body {number}")


def load_ephemeris(path: str | os.PathLike = "") -> Ephemeris:
    """The vendored excerpt of DE421 (empty path), or the SPK file at a path.

    Raises FileNotFoundError, spk.SpkError, or data.CorruptedData where the vendored file fails its checksum.
    """
    if os.fspath(path):
        return Ephemeris(os.path.basename(path), tuple(read_spk(path)))
    return _vendored()


@functools.cache
def _vendored() -> Ephemeris:
    with np.load(data_path(_VENDORED)) as data:
        segments = [
            Segment(int(target), int(centre), float(start), float(length), 1e3 * data[f"{target}"])
            for target, centre, start, length in zip(
                data["target"], data["centre"], data["start"], data["length"], strict=True
            )
        ]
    return Ephemeris("DE421 (vendored excerpt)", tuple(segments))
