"""Cost of the orbiter's filters per epoch, of Table 3 with 20 seeds, and of the part as the last build made it.

    python tests/benchmarks/bench_pulsar.py

Limits that the part set itself, one core after compilation: EKF with 50 substeps 100 us per epoch, Table 3 with 20
seeds and six filters 20 s; the whole part 180 s on two cores. Told beside what was measured; never a gate.
"""

from __future__ import annotations

import json
import time

from geokalman.files import project_root
from geokalman.physics import mars
from geokalman.pulsar import ensemble
from geokalman.pulsar.dynamics import rich_force
from geokalman.pulsar.ensemble import Method
from geokalman.pulsar.model import Mission, preset

TABLE_3 = ["ekf", "aekf1_prw", "aekf2", "raekf", "aekf1_pr3", "ekf_tuned"]


def told(label: str, value: float, unit: str, limit: float | None = None) -> None:
    """One line: what was measured, and the limit."""
    print(f"{label:52s} {value:8.1f} {unit}" + (f"   (limit {limit:g})" if limit else ""))


def main() -> None:
    mission, gravity, chosen = Mission(), mars.gravity(), preset("E")
    methods = ensemble.table3_methods(chosen, TABLE_3)
    trial = ensemble.experiment(mission, chosen, gravity, methods | {"ukf": Method("ukf")})
    for name, limit in (("ekf", 100.0), ("aekf1_prw", None), ("aekf2", None), ("raekf", None), ("ukf", None)):
        told(f"{name}, per epoch", ensemble.microseconds(trial, trial.methods[name]), "us", limit)
    field = Method("ekf", force=rich_force(gravity, mission))
    told("ekf with the field to degree 20, per epoch", ensemble.microseconds(trial, field), "us")
    six = ensemble.experiment(mission, chosen, gravity, methods)
    begun = time.process_time()
    ensemble.ensemble(six, 0, 20)
    told("Table 3, 20 seeds, 6 filters", time.process_time() - begun, "s", 20.0)
    pages = sorted((project_root() / "book" / "_build" / "runs" / "mars-pulsar").glob("*/provenance.json"))
    if len(pages) == 12:
        seconds = sum(json.loads(page.read_text(encoding="utf-8"))["seconds"] for page in pages)
        told("pages of the last build, one after another", seconds, "s")
        told("the same two at a time, at best", seconds / 2, "s", 180.0)


if __name__ == "__main__":
    main()
