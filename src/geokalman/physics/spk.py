"""Reading JPL ephemerides in the SPK format: segments of Chebyshev polynomials (data types 2 and 3).

Source: NAIF, SPK Required Reading and DAF Required Reading.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from geokalman.reading import InputError, Place, read_bytes

_RECORD = 1024  # bytes of a DAF record
_J2000_FRAME = 1  # the ICRF, in NAIF's numbering
_SHAPE = (2, 6)  # doubles and integers of a summary
_SUMMARY = struct.calcsize("2d6i")
_SEAM = 1e-4  # of the distance, to which the ends of neighbouring records agree
_UNHARMED = b"FTPSTR:\r:\n:\r\n:\r\x00:\x81:\x10\xce:ENDFTP"  # a transfer as text changes it
_PLANETS = dict.fromkeys(range(1, 10), (30000000000.0, 10000000000000.0))
_DISTANCES = {0: _PLANETS, 10: _PLANETS, 3: {301: (3e8, 4.5e8)}, 399: {301: (3e8, 4.5e8)}}  # centre, target -> m


class SpkError(InputError):
    """A file that is no SPK ephemeris which can be read here; the message names file and place."""


@dataclass(frozen=True, eq=False)
class Segment:
    """Chebyshev positions of one body relative to another in ICRF axes.

    target, centre : NAIF numbers; start : of the first record [s TDB since J2000]; length : of each record [s];
    coefficients : (records, 3, degree + 1) [m], of the velocities too where the file holds them [m/s];
    valid : first and last time that the file vouches for, None where that is all of the records;
    unread : why the segment cannot be evaluated, e.g. its data type; empty where it can.
    """

    target: int
    centre: int
    start: float
    length: float
    coefficients: NDArray[np.float64]
    velocities: NDArray[np.float64] | None = None
    valid: tuple[float, float] | None = None
    unread: str = ""

    @property
    def begin(self) -> float:
        """First time covered [s TDB since J2000]."""
        return self.start if self.valid is None else max(self.start, self.valid[0])

    @property
    def end(self) -> float:
        """Last time covered [s TDB since J2000]."""
        end = self.start + self.length * len(self.coefficients)
        return end if self.valid is None else min(end, self.valid[1])

    def excerpt(self, begin: float, end: float) -> Segment:
        """The records that cover begin to end [s TDB since J2000]; raises ValueError where the segment does not
        reach."""
        if begin < self.begin or end > self.end or not begin < end:
            raise ValueError(
                f"{begin} to {end} s is not inside the segment of body {self.target}, {self.begin} to {self.end} s."
            )
        first = int((begin - self.start) // self.length)
        last = min(int(np.ceil((end - self.start) / self.length)), len(self.coefficients))
        velocities = None if self.velocities is None else self.velocities[first:last]
        start = self.start + first * self.length
        return Segment(
            self.target, self.centre, start, self.length, self.coefficients[first:last], velocities, self.valid
        )

    def evaluate(self, seconds: NDArray[np.float64], derivative: bool = False) -> NDArray[np.float64]:
        """Position [m], or velocity [m/s], at (n,) times [s TDB since J2000] inside the segment: (n, 3).

        Raises SpkError for a segment that was not read.
        """
        if self.unread:
            raise SpkError(self.unread)
        record = np.clip(((seconds - self.start) // self.length).astype(int), 0, len(self.coefficients) - 1)
        x = 2.0 * (seconds - self.start - record * self.length) / self.length - 1.0
        own = derivative and self.velocities is not None
        c = np.moveaxis((self.velocities if own else self.coefficients)[record], -1, 0)  # (degree + 1, n, 3)
        if derivative and not own:
            c = chebyshev.chebder(c) * (2.0 / self.length)
        return chebyshev.chebval(x[:, None], c, tensor=False)


def read_spk(path: str | os.PathLike) -> list[Segment]:
    """The segments of an SPK file (.bsp), in the order of the file, kilometres turned into metres.

    A segment of another data type than 2 and 3, or in other axes than those of the ICRF, is kept unread: it is refused
    where it is needed.
    Raises FileNotFoundError, and SpkError for another format, a truncated or damaged file, and one with nothing to
    read.
    """
    path = Path(path)
    place = Place(path, kind=SpkError)
    data = read_bytes(path, "SPK ephemeris", SpkError)
    order = _byte_order(data, place)
    segments = [_segment(data, order, summary, place) for summary in _summaries(data, order, place)]
    if not segments:
        raise place.error("this ephemeris holds no segment.")
    if all(segment.unread for segment in segments):
        raise SpkError(segments[0].unread)
    return segments


def _byte_order(data: bytes, place: Place) -> str:
    """`<` or `>`, after checking that the file record is that of an SPK file."""
    if data[:6] == b"DAFETF":
        raise place.error("this is an SPK in transfer format; make a binary one of it (tobin or spacit of NAIF).")
    if data[:4] == b"DAF/" and data[4:7] != b"SPK":
        raise place.error(f"this is a DAF file of kind {data[4:8].decode('latin-1').strip()}, not an ephemeris (SPK).")
    if data[:7] != b"DAF/SPK" and data[:8] != b"NAIF/DAF":
        raise place.error("it does not begin with DAF/SPK; it is no SPK ephemeris.")
    if len(data) < 2 * _RECORD:
        raise place.error("the file is truncated: its summaries are missing.")
    name = data[88:96].strip(b"\0 ")
    order = {b"LTL-IEEE": "<", b"BIG-IEEE": ">"}.get(name)
    if not name:  # files of before 1998 do not say
        order = next((o for o in "<>" if struct.unpack(o + "2i", data[8:16]) == _SHAPE), None)
    if order is None:
        raise place.error(
            f"the number format {name.decode('latin-1')!r} is unknown; LTL-IEEE and BIG-IEEE can be read."
        )
    if b"FTPSTR" in data[:_RECORD] and _UNHARMED not in data[:_RECORD]:
        raise place.error("a transfer as text has damaged the file; fetch it again as binary.")
    if struct.unpack(order + "2i", data[8:16]) != _SHAPE:
        nd, ni = struct.unpack(order + "2i", data[8:16])
        raise place.error(
            f"summaries of {nd} doubles and {ni} integers are not those of an SPK file, which has 2 and 6."
        )
    return order


def _summaries(data: bytes, order: str, place: Place) -> Iterator[tuple]:
    """(begin, end, target, centre, frame, type, first and last word) of every segment."""
    record = struct.unpack(order + "i", data[76:80])[0]
    seen: set[int] = set()
    while record:
        if record in seen:
            raise place.error(f"its summary records lead back to record {record}; the file is damaged.")
        seen.add(record)
        page = data[(record - 1) * _RECORD : record * _RECORD] if record > 1 else b""
        if len(page) < _RECORD:
            raise place.error(
                f"summary record {record} is none of the records 2 to {len(data) // _RECORD}; the file is truncated or "
                "damaged."
            )
        following, _, count = struct.unpack(order + "3d", page[:24])
        if not (
            0 <= count <= (_RECORD - 24) // _SUMMARY and 0 <= following < 2**31 and count % 1 == following % 1 == 0
        ):
            raise place.error(
                f"summary record {record} is damaged: it has {count:g} summaries, and record {following:g} follows."
            )
        for k in range(int(count)):
            yield struct.unpack(order + "2d6i", page[24 + k * _SUMMARY : 24 + (k + 1) * _SUMMARY])
        record = int(following)


def _segment(data: bytes, order: str, summary: tuple, place: Place) -> Segment:
    begin, end, target, centre, frame, kind, first, last = summary
    what = f"the segment of body {target} relative to {centre}"
    if kind not in (2, 3) or frame != _J2000_FRAME:
        unread = (
            f"{place.path}: {what} has data type {kind} in frame {frame}; types 2 and 3 in frame 1 (ICRF) are read."
        )
        return Segment(target, centre, begin, end - begin, np.empty((1, 3, 0)), unread=unread)
    if not -np.inf < begin < end < np.inf:
        said = f"{what} covers {begin:.10g} to {end:.10g} s since J2000: its end must come after its begin."
        if begin != end:
            raise place.error(said)
        unread = f"{place.path}: {said}"  # of no length, and in nobody's way
        return Segment(target, centre, begin, 1.0, np.empty((1, 3, 0)), valid=(begin, end), unread=unread)
    if not 1 <= first < last - 3 or 8 * last > len(data):
        raise place.error(
            f"{what} has words {first} to {last}, and the file ends at {len(data) // 8}: it is truncated or damaged."
        )
    words = np.frombuffer(data, order + "f8", last - first + 1, 8 * (first - 1))
    start, length, size, records = map(float, words[-4:])
    parts = 3 * (kind - 1)  # positions, or positions and velocities
    degrees = (size - 2) / parts
    if not (
        0 < length < np.inf and degrees >= 1 and degrees % 1 == 0 and records >= 1 and size * records + 4 == words.size
    ):
        raise place.error(
            f"{what} is damaged: {words.size} words hold no {records:g} records of {size:g} words over {length:g} s."
        )
    rows = words[:-4].reshape(int(records), int(size))
    sound = (np.abs(rows) < 1e20).all(axis=1)
    if not sound.all():
        raise place.error(f"{what} is damaged: record {int(np.argmin(sound)) + 1} has a number that is not below 1e20.")
    middle = start + length * (np.arange(len(rows)) + 0.5)
    if not np.allclose(
        rows[:, :2], np.column_stack([middle, np.full(len(rows), length / 2)]), rtol=0, atol=1e-3 * length
    ):
        raise place.error(f"{what} is damaged: the times of its records do not follow one another by {length:g} s.")
    body = 1e3 * rows[:, 2:].reshape(len(rows), parts, -1).astype(float)
    out = Segment(target, centre, start, length, body[:, :3], body[:, 3:] if kind == 3 else None, (begin, end))
    if not out.begin < out.end:
        raise place.error(f"{what} is damaged: it claims {begin:g} to {end:g} s since J2000, where it has no records.")
    low, high = _DISTANCES.get(centre, {}).get(target, (0.0, np.inf))
    distance = np.linalg.norm(out.evaluate(middle), axis=1)
    if (wrong := ~((low < distance) & (distance < high))).any():
        k = int(wrong.argmax())
        raise place.error(
            f"{what} is in its record {k + 1} {distance[k]:.3g} m away, where {low:g} to {high:g} m are right; SPK "
            "files are in kilometres."
        )
    sign = (-1.0) ** np.arange(out.coefficients.shape[-1])
    jump = np.linalg.norm(out.coefficients[:-1].sum(axis=-1) - (out.coefficients[1:] * sign).sum(axis=-1), axis=1)
    if high < np.inf and jump.size and jump.max() > _SEAM * distance.max():
        raise place.error(
            f"{what} is damaged: it jumps by {jump.max():.3g} m between records {jump.argmax() + 1} and "
            f"{jump.argmax() + 2}."
        )
    return out
