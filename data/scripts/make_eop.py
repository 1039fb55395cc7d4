"""Make data/eop_c04.npz: IERS EOP 20 C04 from 2011-01-01 to 2020-01-01, from the wheel of astropy-iers-data.

    python data/scripts/make_eop.py [astropy_iers_data-0.2026.11.2.0.34.55-py3-none-any.whl]

Without an argument pip downloads the wheel (2 MB) into a temporary folder. Nothing of this runs while computing.
"""

from __future__ import annotations

import sys

import numpy as np
import vendoring
from make_egm96 import save

PACKAGE, VERSION = "astropy-iers-data", "0.2026.11.2.0.34.55"
WHEEL_SHA256 = "785cd5bc193d9206316bd7c786fe0647e212ebf017cd861beabedd91cbe585bf"
INNER, INNER_SHA256 = (
    "astropy_iers_data/data/eopc04.1962-now",
    "1e87541594a93151182f59ba2af075037b97cb3e68a36557b1a997594ed55c23",
)
FIRST, LAST = 55562, 58849  # MJD


def pack(text: str) -> bytes:
    """A compressed npz of the daily values: MJD, pole x, y [arcsec], UT1 - UTC [s]."""
    rows = np.array([line.split()[4:8] for line in text.splitlines() if line and line[0] != "#"], dtype=float)
    rows = rows[(rows[:, 0] >= FIRST) & (rows[:, 0] <= LAST)]
    return save({"mjd": rows[:, 0], "x": rows[:, 1], "y": rows[:, 2], "ut1_utc": rows[:, 3]})


def main() -> None:
    archive = vendoring.wheel(PACKAGE, VERSION, WHEEL_SHA256, *sys.argv[1:2])
    text = vendoring.extract(archive, INNER, INNER_SHA256).decode()
    (vendoring.DATA / "eop_c04.npz").write_bytes(pack(text))
    vendoring.register(
        "eop_c04.npz",
        source=f"{PACKAGE}=={VERSION}: {INNER}",
        source_sha256=INNER_SHA256,
        licence=(
            "IERS Earth orientation data, freely distributed; cite the IERS; the package astropy-iers-data is"
            " BSD-3-Clause"
        ),
        citation=(
            "Bizouard et al. 2019, The IERS EOP 14C04 solution for Earth orientation parameters consistent with ITRF"
            " 2014, J. Geod. 93, 621-633; series EOP 20 C04, IERS Earth Orientation Center"
        ),
        script="data/scripts/make_eop.py",
    )


if __name__ == "__main__":
    main()
