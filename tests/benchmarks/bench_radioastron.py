"""Times of the radioastron part: a day of orbit, a session study of 60 seeds, a scan at the correlator.

    python tests/benchmarks/bench_radioastron.py

Limits of the project, one core: 10 ms, 20 s; the whole part at most 4 minutes on two.
"""

from __future__ import annotations

import time

import numpy as np

from geokalman.radioastron import study
from geokalman.radioastron.correlator import Setup, coherence
from geokalman.radioastron.data import Levels
from geokalman.radioastron.model import find_session, nominal_state, world


def timed(label: str, call, repeat: int = 3) -> None:
    """Print the best of some calls, the first one (compilation, tables) not counted."""
    call()
    best = np.inf
    for _ in range(repeat):
        start = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - start)
    print(f"{label:48s} {best * 1e3:10.2f} ms")


def main() -> None:
    session = find_session("ST")
    dynamics = world(session, days=1.0)
    state = nominal_state(session, dynamics)
    day = session.first + np.array([0.0, 86400.0])
    timed("propagation of one day", lambda: dynamics.propagate(state, day))
    timed("one day with transition matrix", lambda: dynamics.transition(state, *day))
    timed("session study, 60 seeds, three estimators", lambda: study.standard(session, Levels(), 1000, 60), 1)
    timed("coherence, 256 channels, padding 4", lambda: coherence(Setup(), 1.8e-10, 0.0))


if __name__ == "__main__":
    main()
