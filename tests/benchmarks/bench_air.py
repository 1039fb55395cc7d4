"""Cost of the airborne part: filter, smoothers and the joint estimate; minima, never a gate.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/bench_air.py [--joint]

The filters run on the six Kauring lines, nine states. What is asked for is 15 us per epoch, forward and RTS together.
"""

from __future__ import annotations

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from stopwatch import smallest, told, told_machine, told_part

from geokalman.airborne import joint, read
from geokalman.airborne.estimate import run_filter, run_smoother
from geokalman.airborne.model import Tuning, build


def bench_filters() -> None:
    survey = read.load("kauring")
    lines = [flight.line for flight in survey.select([104000, 104100, 104200, 104300, 104400, 104500])]
    epochs = sum(len(line.t) for line in lines)
    tuning = Tuning.preset("kauring")
    work = []
    for line in lines:
        model = build(line, tuning)
        course = run_filter(line, model)
        work.append((line, model, course))
    total = 0.0
    for label, call in (
        ("forward", lambda line, model, course: run_filter(line, model)),
        ("RTS", lambda line, model, course: run_smoother(line, model, course, "rts")),
        ("two-filter", lambda line, model, course: run_smoother(line, model, course, "two-filter")),
        ("building the model", lambda line, model, course: build(line, tuning)),
    ):
        cost = 1e6 * smallest(lambda call=call: [call(*one) for one in work]) / epochs
        total += cost if label in ("forward", "RTS") else 0.0
        told(f"{label}, {len(model.names)} states", cost, "us per epoch")
    told("forward + RTS", total, "us per epoch", 15.0)


def bench_joint() -> None:
    survey = read.load("kauring", 60.0)
    cost = smallest(lambda: joint.joint_field(survey.flights), 2)
    told(f"joint, whole survey, {joint.Waves().count} unknowns, two solves", cost, "s")


if __name__ == "__main__":
    told_machine()
    bench_filters()
    told_part("airborne-gravity", 3)
    if "--joint" in sys.argv:
        bench_joint()
