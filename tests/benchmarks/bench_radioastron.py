"""Times of the radioastron part: a day of orbit, a session study of 60 seeds, a scan at the correlator.

    python tests/benchmarks/bench_radioastron.py

Limits of the project, one core: 10 ms for the day, 20 s for the study; the whole part at most 4 minutes on two cores, for
which the last build's own times stand (their sum on one core, half of it on two). The load of the machine is printed, for on
a busy one all of this is slower. Never a gate.
"""

from __future__ import annotations

import json
import os
import time

import numpy as np

from geokalman.files import project_root

from geokalman.radioastron import study
from geokalman.radioastron.correlator import Setup, coherence
from geokalman.radioastron.data import Levels
from geokalman.radioastron.model import find_session, nominal_state, world


def told(label: str, seconds: float, limit: float | None) -> None:
    """Print a time, and the limit with what came of it."""
    verdict = "" if limit is None else f"   limit {limit * 1e3:9.0f} ms, {'met' if seconds <= limit else 'NOT MET'}"
    print(f"{label:48s} {seconds * 1e3:10.2f} ms{verdict}")


def timed(label: str, call, repeat: int = 3, limit: float | None = None) -> None:
    """Print the best of some calls, the first one (compilation, tables) not counted."""
    call()
    best = np.inf
    for _ in range(repeat):
        start = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - start)
    told(label, best, limit)


def main() -> None:
    session = find_session("ST")
    dynamics = world(session, days=1.0)
    state = nominal_state(session, dynamics)
    day = session.first + np.array([0.0, 86400.0])
    print(f"load of the machine {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    timed("propagation of one day", lambda: dynamics.propagate(state, day), limit=0.010)
    timed("one day with transition matrix", lambda: dynamics.transition(state, *day))
    timed("session study, 60 seeds, three estimators", lambda: study.standard(session, Levels(), 1000, 60), 1, 20.0)
    timed("coherence, 256 channels, padding 4", lambda: coherence(Setup(), 1.8e-10, 0.0))
    runs = (project_root() / "book" / "_build" / "runs" / "radioastron-orbit").glob("*/provenance.json")
    seconds = [json.loads(path.read_text(encoding="utf-8"))["seconds"] for path in runs]
    if seconds:
        told(f"the part's {len(seconds)} notebooks in the last build, halved", 0.5 * sum(seconds), 240.0)


if __name__ == "__main__":
    main()
