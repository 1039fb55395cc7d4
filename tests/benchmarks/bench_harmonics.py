"""Benchmark of grid synthesis and normal equations; minima, with peers in the same run, never a gate.

python tests/benchmarks/bench_harmonics.py [--big]
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.linalg import blas

from geokalman.leastsquares import NormalEquations
from geokalman.physics.harmonics import cell_centred_grid, load_field, synthesis


def best(*works: Callable[[], object], seconds: float = 4.0) -> list[float]:
    """Least time [s] of each of several works, called in turns over a short window, after one call that warms each."""
    least = [np.inf] * len(works)
    for work in works:
        work()
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        for k, work in enumerate(works):
            start = time.perf_counter()
            work()
            least[k] = min(least[k], time.perf_counter() - start)
    return least


def bench_synthesis(n_max: int) -> None:
    field = load_field("EGM96", n_max)
    lat, lon = cell_centred_grid(0.5)
    works = [lambda: synthesis(field.C, field.S, lat, lon)]
    try:
        import pyharm
    except ImportError:
        print("pyharm is not installed")
    else:
        m, n = np.triu_indices(n_max + 1)
        coefficients = pyharm.shc.Shc.from_arrays(n_max, field.C[n, m], field.S[n, m], 1.0, 1.0)
        grid = pyharm.crd.PointGrid.from_arrays(lat, lon, np.ones(lat.size))
        works.append(lambda: pyharm.shs.point(grid, coefficients, n_max))
    times = "   ".join(
        f"{name} {1e3 * t:.2f} ms" for name, t in zip(("geokalman", "pyharm"), best(*works), strict=False)
    )
    print(f"synthesis 0.5 deg, degree {n_max}: {times}")


def bench_normals(unknowns: int, rows: int, right_sides: int) -> None:
    rng = np.random.default_rng(0)
    A, y = rng.standard_normal((rows, unknowns)), rng.standard_normal((rows, right_sides))
    normals, raw = NormalEquations(unknowns, right_sides), np.zeros((unknowns, unknowns), order="F")
    flop = float(rows) * unknowns**2  # one triangle: a multiplication and an addition are two
    times = best(
        lambda: normals.add(A, y),
        lambda: blas.dsyrk(1.0, A.T, beta=1.0, c=raw, lower=1, overwrite_c=1),
        seconds=6.0,
    )
    ours, peer = (flop / t / 1e9 for t in times)
    print(f"normals {rows} x {unknowns}, {right_sides} right sides: {ours:.1f} GFLOP/s, dsyrk alone {peer:.1f} GFLOP/s")
    normals.regularise(float(rows))
    start = time.perf_counter()
    solution = normals.factor()
    factored = time.perf_counter()
    condition = solution.condition()
    print(f"  factor {factored - start:.2f} s, condition {condition:.3g} in {time.perf_counter() - factored:.2f} s")


def main() -> None:
    print(f"load {os.getloadavg()[0]:.2f}, OPENBLAS_NUM_THREADS {os.environ['OPENBLAS_NUM_THREADS']}")
    for n_max in (70, 360):
        bench_synthesis(n_max)
    bench_normals(957, 2048, 9)
    if "--big" in sys.argv[1:]:
        bench_normals(5037, 2048, 9)


if __name__ == "__main__":
    main()
