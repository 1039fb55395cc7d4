"""Times of the attitude part: filters per epoch, a simulated day, a day through files; never a gate.

    python tests/benchmarks/bench_attitude.py

Limits of the project, one core: 40 us per 1 Hz epoch of the filter on pre-integrated increments, 15 s a simulated day
(both satellites); the whole part at most 6 minutes on two cores.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable

import numpy as np

from geokalman.attitude import estimate, flight, gyro, write
from geokalman.attitude.model import GYRO_HZ, SATELLITES, Scenario, Tuning


def timed(label: str, call: Callable[[], object], per: float = 1.0, unit: str = "s", repeat: int = 3) -> None:
    """Print the best of some calls over `per`, the first one (compilation) not counted; wall and processor time."""
    call()
    wall, cpu = np.inf, np.inf
    for _ in range(repeat):
        start, begun = time.perf_counter(), time.process_time()
        call()
        wall, cpu = min(wall, time.perf_counter() - start), min(cpu, time.process_time() - begun)
    print(f"{label:58s} {wall / per:9.3f} {unit} ({cpu / per:.3f} of one processor)")


def through_files(trip: flight.Flight, scenario: Scenario) -> flight.Flight:
    """Write a flight to Level-1 files and read it back."""
    with tempfile.TemporaryDirectory() as folder:
        for s in SATELLITES:
            write.write_raw(folder, trip.raw[s])
            write.write_orbit(folder, s, trip.t, trip.r[s], trip.v[s])
        return flight.flight(scenario, 0, folder)


def main() -> None:
    scenario, tuning = Scenario(duration_s=86400.0), Tuning()
    timed("a simulated day, both satellites", lambda: flight.flight(scenario, 1))
    trip = flight.flight(scenario, 1)
    result = flight.solve(trip, "C", tuning, ("mekf",))
    m, raw = result.measured, trip.raw["C"]
    epochs = len(m.z) * 1e-6
    at_8_hz = m._replace(d=result.increments.d)
    timed("MEKF on 1 s increments, per 1 Hz epoch", lambda: estimate.mekf(m, tuning), epochs, "us")
    timed(
        "pre-integration and MEKF, per 1 Hz epoch",
        lambda: estimate.mekf(m._replace(d=gyro.preintegrate(result.increments, 1).d), tuning),
        epochs,
        "us",
    )
    timed("MEKF and RTS, per 1 Hz epoch", lambda: estimate.mekf(m, tuning, smooth=True), epochs, "us")
    timed("AKF7, 8 Hz prediction, per 1 Hz epoch", lambda: estimate.akf7(at_8_hz, tuning, stride=GYRO_HZ), epochs, "us")
    timed("combination of a day of cameras", lambda: flight.combination(raw, tuning))
    timed("gyro chain of a day", lambda: gyro.reduced(raw, tuning))
    timed("a day through Level-1 files, written and read", lambda: through_files(trip, scenario), repeat=1)


if __name__ == "__main__":
    main()
