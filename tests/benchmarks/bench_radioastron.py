"""Times of the radioastron part: a day of orbit, a session study of 60 seeds, a scan at the correlator.

    python tests/benchmarks/bench_radioastron.py

Limits of the project, one core: 10 ms for the day, 20 s for the study; the whole part at most 4 minutes on two cores,
for which the last build's own times stand (their sum on one core, half of it on two). The load of the machine is
printed, for on a busy one all of this is slower. Never a gate.
"""

from __future__ import annotations

import numpy as np
from stopwatch import smallest, told, told_machine, told_part

from geokalman.radioastron import experiment
from geokalman.radioastron.correlator import Setup, coherence
from geokalman.radioastron.data import Scenario
from geokalman.radioastron.model import find_session, nominal_state, world


def main() -> None:
    session = find_session("ST")
    dynamics = world(session, days=1.0)
    state = nominal_state(session, dynamics)
    day = session.first + np.array([0.0, 86400.0])
    told_machine()
    told("propagation of one day", 1e3 * smallest(lambda: dynamics.propagate(state, day)), "ms", 10.0)
    told("one day with transition matrix", 1e3 * smallest(lambda: dynamics.transition(state, *day)), "ms")
    sixty = smallest(lambda: experiment.standard(session, Scenario(), 1000, 60), 1)
    told("session study, 60 seeds, three estimators", sixty, "s", 20.0)
    told("coherence, 256 channels, padding 4", 1e3 * smallest(lambda: coherence(Setup(), 1.8e-10, 0.0)), "ms")
    told_part("radioastron-orbit", 4)


if __name__ == "__main__":
    main()
