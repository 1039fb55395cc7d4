"""SPK ephemerides written for tests."""

import struct

import numpy as np


def write_spk(path, segments, kind=2, frame=1, order="<", stamp=b"DAF/SPK ", form=None, cut=None, **poke):
    """A minimal SPK file: file record, one summary record, one name record, the segments.

    Of a segment's `valid` comes the interval in its summary; `poke` changes bytes: {"at_<offset>": bytes}.
    """
    words, summaries, place = [], [], 3 * 128 + 1
    for s in segments:
        n, _, k = s.coefficients.shape
        mid = s.start + s.length * (np.arange(n) + 0.5)
        parts = [s.coefficients] if s.velocities is None else [s.coefficients, s.velocities]
        rows = np.column_stack([mid, np.full(n, s.length / 2), *((part / 1e3).reshape(n, 3 * k) for part in parts)])
        body = np.concatenate([rows.ravel(), [s.start, s.length, rows.shape[1], n]])
        begin, end = s.valid or (s.start, s.start + n * s.length)
        numbers = (s.target, s.centre, frame, kind, place, place + len(body) - 1)
        summaries.append(struct.pack(order + "2d6i", begin, end, *numbers))
        words.append(body)
        place += len(body)
    form = {"<": b"LTL-IEEE", ">": b"BIG-IEEE"}[order] if form is None else form
    head = stamp + struct.pack(order + "2i", 2, 6) + b" " * 60 + struct.pack(order + "3i", 2, 2, place) + form
    head = head.ljust(699, b"\0") + b"FTPSTR:\r:\n:\r\n:\r\x00:\x81:\x10\xce:ENDFTP"
    page = struct.pack(order + "3d", 0, 0, len(segments)) + b"".join(summaries)
    data = bytearray(head.ljust(1024, b"\0") + page.ljust(1024, b"\0") + b" " * 1024)
    data += np.concatenate([np.empty(0), *words]).astype(order + "f8").tobytes()
    for key, value in poke.items():
        data[int(key[3:]) : int(key[3:]) + len(value)] = value
    path.write_bytes(data[:cut])
    return path
