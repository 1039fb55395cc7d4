"""Reading JPL ephemerides in the SPK format: position segments of Chebyshev polynomials (data type 2).

Source: NAIF, SPK Required Reading and DAF Required Reading.
"""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

_RECORD = 1024  # bytes of a DAF record
_J2000_FRAME = 1  # the ICRF, in NAIF's numbering


class SpkError(ValueError):
    """A file that is no SPK ephemeris which can be read here; the message names file and place."""


@dataclass(frozen=True, eq=False)
class Segment:
    """Chebyshev positions of one body relative to another in ICRF axes.

    target, centre : NAIF numbers; start : first time covered [s TDB since J2000]; length : of each record [s];
    coefficients : (records, 3, degree + 1) [m].
    """

    target: int
    centre: int
    start: float
    length: float
    coefficients: NDArray[np.float64]

    @property
    def end(self) -> float:
        """Last time covered [s TDB since J2000]."""
        return self.start + self.length * len(self.coefficients)

    def excerpt(self, begin: float, end: float) -> Segment:
        """The records that cover begin to end [s TDB since J2000]; raises ValueError where the segment does not
        reach."""
        if begin < self.start or end > self.end or not begin < end:
            raise ValueError(
                f"{begin} to {end} s is not inside the segment of body {self.target}, {self.start} to {self.end} s."
            )
        first = int((begin - self.start) // self.length)
        last = min(int(np.ceil((end - self.start) / self.length)), len(self.coefficients))
        return Segment(
            self.target, self.centre, self.start + first * self.length, self.length, self.coefficients[first:last]
        )

    def evaluate(self, seconds: NDArray[np.float64], derivative: bool = False) -> NDArray[np.float64]:
        """Position [m], or velocity [m/s], at (n,) times [s TDB since J2000] inside the segment: (n, 3)."""
        record = np.clip(((seconds - self.start) // self.length).astype(int), 0, len(self.coefficients) - 1)
        x = 2.0 * (seconds - self.start - record * self.length) / self.length - 1.0
        c = np.moveaxis(self.coefficients[record], -1, 0)  # (degree + 1, n, 3)
        if derivative:
            c = chebyshev.chebder(c) * (2.0 / self.length)
        return chebyshev.chebval(x[:, None], c, tensor=False)


def read_spk(path: str | os.PathLike) -> list[Segment]:
    """The position segments of an SPK file (.bsp), in the order of the file, kilometres turned into metres.

    Raises FileNotFoundError, and SpkError for another format, another data type than 2, or a truncated file.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"No ephemeris at {path}; give the path of an SPK file such as de421.bsp.")
    data = path.read_bytes()
    if data[:7] != b"DAF/SPK" or len(data) < 2 * _RECORD:
        raise SpkError(f"{path} does not begin with DAF/SPK; it is no SPK ephemeris.")
    order = {b"LTL-IEEE": "<", b"BIG-IEEE": ">"}.get(data[88:96])
    if order is None:
        raise SpkError(f"{path}: the number format {data[88:96]!r} is unknown; LTL-IEEE and BIG-IEEE can be read.")
    nd, ni = struct.unpack(order + "2i", data[8:16])
    record = struct.unpack(order + "i", data[76:80])[0]
    width = 8 * (nd + (ni + 1) // 2)
    segments = []
    while record:
        page = data[(record - 1) * _RECORD : record * _RECORD]
        following, _, count = struct.unpack(order + "3d", page[:24])
        for k in range(int(count)):
            summary = page[24 + k * width : 24 + (k + 1) * width]
            target, centre, frame, kind, first, last = struct.unpack(order + "6i", summary[8 * nd : 8 * nd + 24])
            if kind != 2 or frame != _J2000_FRAME:
                raise SpkError(
                    f"{path}: the segment of body {target} has type {kind} in frame {frame}; type 2 in frame 1 is read."
                )
            words = (
                np.frombuffer(data, order + "f8", last - first + 1, 8 * (first - 1)) if 8 * last <= len(data) else None
            )
            if words is None:
                raise SpkError(f"{path} is truncated: the segment of body {target} ends beyond the file.")
            start, length, size, records = words[-4:]
            body = words[:-4].reshape(int(records), int(size))[:, 2:].reshape(int(records), 3, -1)
            segments.append(Segment(target, centre, float(start), float(length), 1e3 * body.astype(float)))
        record = int(following)
    return segments
