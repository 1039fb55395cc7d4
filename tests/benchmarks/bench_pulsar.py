"""Cost of the orbiter's filters per epoch, of Table 3 with 20 seeds, and of the part as the last build made it.

    python tests/benchmarks/bench_pulsar.py

Limits that the part set itself, one core after compilation: EKF with 50 substeps 100 us per epoch, Table 3 with 20
seeds and six filters 20 s; the whole part 180 s on two cores. Told beside what was measured; never a gate.
"""

from __future__ import annotations

import time

from stopwatch import told, told_machine, told_part

from geokalman.physics import mars
from geokalman.pulsar import experiment
from geokalman.pulsar.dynamics import rich_force
from geokalman.pulsar.experiment import Method
from geokalman.pulsar.model import Mission, preset

TABLE_3 = ["ekf", "aekf1_prw", "aekf2", "raekf", "aekf1_pr3", "ekf_tuned"]


def main() -> None:
    told_machine()
    mission, gravity, chosen = Mission(), mars.gravity(), preset("E")
    methods = experiment.table3_methods(chosen, TABLE_3)
    trial = experiment.prepare(mission, chosen, gravity, methods | {"ukf": Method("ukf")})
    for name, limit in (("ekf", 100.0), ("aekf1_prw", None), ("aekf2", None), ("raekf", None), ("ukf", None)):
        told(f"{name}, per epoch", experiment.microseconds(trial, trial.methods[name]), "us", limit)
    field = Method("ekf", force=rich_force(gravity, mission))
    told("ekf with the field to degree 20, per epoch", experiment.microseconds(trial, field), "us")
    six = experiment.prepare(mission, chosen, gravity, methods)
    begun = time.process_time()
    experiment.ensemble(six, 0, 20)
    told("Table 3, 20 seeds, 6 filters", time.process_time() - begun, "s", 20.0)
    told_part("mars-pulsar", 3)


if __name__ == "__main__":
    main()
