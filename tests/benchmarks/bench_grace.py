"""Cost of the GRACE chain: orbits, filters, design rows, normal equations; minima, never a gate.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/bench_grace.py [--book]

Without --book a day of orbit, a day of epochs and a few blocks of rows stand for 30 days; with it the whole paper-scale
chain of the fifth notebook is timed once. The peer of the normal equations is the raw dsyrk on the same block.
"""

from __future__ import annotations

import os
import sys
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from scipy.linalg import blas
from stopwatch import smallest, told, told_machine, told_part

from geokalman.constants import OMEGA_EARTH
from geokalman.grace import assess, estimate, observables, recover, simulate
from geokalman.grace.model import Scenario, Tuning, distance
from geokalman.leastsquares import NormalEquations
from geokalman.physics.frames import to_ecef
from geokalman.physics.partials import column_count, design_block


def bench_orbits() -> None:
    scenario = Scenario(days=1.0)
    gravity = scenario.gravity()
    day = smallest(lambda: simulate.orbit_pair(scenario, gravity), 5)
    told("pair of orbits, degree 70, 30 days", 30 * day, "s", 5.0)


def bench_filters(n: int = 2881) -> None:
    """What an epoch costs: filter and smoother of each method."""
    scenario = Scenario(days=(n - 1) / 2880, n_max=30)
    gravity = scenario.gravity()
    data = simulate.observe(simulate.orbit_pair(scenario, gravity), gravity)
    tuning = Tuning()
    methods = {
        "ekf(), states": lambda: estimate.ekf(data, tuning),
        "ukf(), states": lambda: estimate.ukf(data, tuning),
        "ukf(), states and covariances": lambda: estimate.ukf(data, tuning, covariances=True),
        "ukf(), simultaneous": lambda: estimate.ukf(data, tuning, "simultaneous"),
        "fused_ekf(), states": lambda: estimate.fused_ekf(data, tuning),
    }
    for label, method in methods.items():
        cost = smallest(method, 7)
        told(label, 1e6 * cost / n, "us per epoch", note=f"{86401 * cost / n:.2f} s for 30 days")


def bench_recovery(n_max: int = 70, rows: int = recover.BLOCK, right_sides: int = 11) -> None:
    scenario = Scenario(days=1.0, n_max=n_max)
    gravity = scenario.gravity()
    orbit = simulate.orbit_pair(scenario, gravity)
    r_A, r_B = (to_ecef(orbit.t, state[:, :3], OMEGA_EARTH)[:rows] for state in (orbit.A, orbit.B))
    e = (r_A - r_B) / distance(r_A - r_B)[:, None]
    unknowns = column_count(n_max)
    design, y = np.empty((rows, unknowns)), np.random.default_rng(0).standard_normal((rows, right_sides))
    cost = smallest(lambda: design_block(gravity.gm, gravity.radius, n_max, r_A, r_B, e, design))
    told(f"design row, degree {n_max}", 1e6 * cost / rows, "us", 10.0)
    normals, raw = NormalEquations(unknowns, right_sides), np.zeros((unknowns, unknowns), order="F")
    flop = float(rows) * unknowns**2
    ours, peer = np.inf, np.inf
    for _ in range(4):  # in turns, so that a busy moment hits both
        ours = min(ours, smallest(lambda: normals.add(design, y), 1))
        peer = min(peer, smallest(lambda: blas.dsyrk(1.0, design.T, beta=1.0, c=raw, lower=1, overwrite_c=1), 1))
    note = f"raw dsyrk {flop / peer / 1e9:.1f}: {100 * peer / ours:.0f} % of it, at least 90 wanted"
    told("normal equations", flop / ours / 1e9, "GFLOP/s", note=note)


def bench_chain(days: float, n_max: int) -> None:
    """Everything that the fifth notebook computes: orbits, data, eleven observables, recovery, unsmoothed geoid
    errors."""
    stages: dict[str, float] = {}
    start = time.perf_counter()

    def done(stage: str) -> None:
        stages[stage] = time.perf_counter() - start - sum(stages.values())

    scenario = Scenario(days=days, n_max=n_max)
    gravity = scenario.gravity()
    orbit = simulate.orbit_pair(scenario, gravity)
    done("orbits")
    los = observables.observables(orbit, gravity, simulate.observe(orbit, gravity), Tuning(), Tuning(lambda_q=1500.0))
    done("observables")
    recovery = recover.recover(orbit, gravity, los)
    done("recovery")
    for name in recovery.ids:
        assess.map_statistics(assess.geoid_error(recovery, name, gravity, 1.0, 0.0))
    done("maps")
    parts = ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in stages.items())
    told(f"chain, {days:g} d, degree {n_max}", sum(stages.values()), "s", note=parts)


def main() -> None:
    told_machine()
    bench_orbits()
    bench_filters()
    bench_recovery()
    for _ in range(2):
        bench_chain(5.0, 30)
    if "--book" in sys.argv[1:]:
        bench_chain(30.0, 70)
    told_part("grace-fusion", 3)


if __name__ == "__main__":
    main()
