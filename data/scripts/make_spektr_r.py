"""Make data/spektr_r.json: public two-line elements of Spektr-R for the days of the sessions, and the states they give.

    python data/scripts/make_spektr_r.py 11037a12.tle 11037a13.tle

Both files are those of github.com/Bill-Gray/tles at commit 2e2a0fbc5cb22b3153bf643dc07b469867aea9ce. The set of the day
before the first measurement of a session is kept, and the state at that instant, by SDP4 (sgp4==2.27, with
pyerfa for the frames): TEME, turned by the equation of the equinoxes and by precession and nutation to the GCRS.
Nothing of this runs while computing.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

import erfa
import numpy as np
import vendoring
from sgp4.api import Satrec

REPOSITORY, COMMIT = "github.com/Bill-Gray/tles", "2e2a0fbc5cb22b3153bf643dc07b469867aea9ce"
SHA256 = {
    "11037a12.tle": "c7f05707166a63fb5a3020da90e32b868420a65d783d75075e7fb307503f875e",
    "11037a13.tle": "636f9b54fbb8aa11f1e25ac3c3ca0c5372211186313882057f9e1f01556f5496",
}
FIRST = {"2012-07-21": (56129, 31615.0), "2013-03-12": (56363, 22360.5), "2013-05-07": (56419, 47722.0)}
"""First measurement of each day of tracking: modified Julian date, seconds of UTC."""
TT_MINUS_UTC = 67.184


def sets(text: str) -> list[tuple[str, str, float]]:
    """The sets of a file in their order: both lines, and the largest residual of their fit [km]."""
    lines, found, worst = text.splitlines(), [], float("nan")
    for line, following in zip(lines, lines[1:], strict=False):
        if line.startswith("# Worst residual:"):
            worst = float(line.split(":")[1].split()[0])
        if line.startswith("1 37755U") and following.startswith("2 37755"):
            found.append((line, following, worst))
    return found


def state(line1: str, line2: str, day: int, seconds: float) -> list[float]:
    """GCRS position [m] and velocity [m/s] at an instant of UTC."""
    error, r, v = Satrec.twoline2rv(line1, line2).sgp4(day + 2400000.5, seconds / 86400.0)
    if error:
        raise SystemExit(f"SDP4 gives error {error} for {line1!r}.")
    tt = day + 2400000.5, (seconds + TT_MINUS_UTC) / 86400.0
    turn = erfa.pnm06a(*tt).T @ erfa.rz(-erfa.ee06a(*tt), np.eye(3))
    return [round(1e3 * float(x), digits) for y, digits in ((r, 3), (v, 6)) for x in turn @ np.array(y)]


def epoch(line1: str) -> float:
    """Modified Julian date of a set's epoch."""
    record = Satrec.twoline2rv(line1, "2 37755 074.0816 291.2938 7771622 003.2966 000.3492 00.12291000    00")
    return record.jdsatepoch - 2400000.5 + record.jdsatepochF


def main() -> None:
    every = []
    for name, given in zip(SHA256, sys.argv[1:], strict=True):
        content = Path(given).read_bytes()
        if hashlib.sha256(content).hexdigest() != SHA256[name]:
            raise SystemExit(f"{given} is not {name} of {REPOSITORY} at {COMMIT}.")
        every += sets(content.decode())
    out = {}
    for date, (day, seconds) in FIRST.items():
        line1, line2, worst = [s for s in every if epoch(s[0]) <= day + seconds / 86400.0][-1]
        out[date] = {
            "lines": [line1, line2],
            "worst_residual_km": worst,
            "utc_seconds": seconds,
            "state_gcrs": state(line1, line2, day, seconds),
        }
    (vendoring.DATA / "spektr_r.json").write_text(json.dumps(out, indent=1) + "\n", encoding="utf-8")
    vendoring.register(
        "spektr_r.json",
        source=f"{REPOSITORY} at commit {COMMIT}: {', '.join(SHA256)}; states by sgp4==2.27",
        source_sha256=SHA256["11037a12.tle"],
        licence=(
            "no licence is stated; published for free use in identifying satellites; three sets of orbital elements,"
            " which are facts, are kept, and our conversion of them"
        ),
        citation="W. Gray, Project Pluto: TLEs fitted to Find_Orb ephemerides of Spektr-R (2011-037A), 25 April 2019",
        script="data/scripts/make_spektr_r.py",
    )


if __name__ == "__main__":
    main()
