"""Times of the attitude part: filters per epoch, a simulated day, a day through files; never a gate.

    python tests/benchmarks/bench_attitude.py

Limits of the project, one core: 40 us per 1 Hz epoch of the filter on pre-integrated increments, 15 s a simulated day
(both satellites); the whole part at most 6 minutes on two cores.
"""

from __future__ import annotations

import tempfile

from stopwatch import smallest, told, told_machine, told_part

from geokalman.attitude import cameras, estimate, experiment, gyro, write
from geokalman.attitude.model import GYRO_HZ, SATELLITES, Scenario, Tuning
from geokalman.attitude.truth import Recording


def through_files(recording: Recording, scenario: Scenario) -> Recording:
    """Write a flight to Level-1 files and read it back."""
    with tempfile.TemporaryDirectory() as folder:
        for s in SATELLITES:
            write.write_raw(folder, recording.raw[s])
            write.write_orbit(folder, s, recording.t, recording.r[s], recording.v[s])
        return experiment.flight(scenario, 0, folder)


def main() -> None:
    told_machine()
    scenario, tuning = Scenario(duration_s=86400.0), Tuning()
    told("a simulated day, both satellites", smallest(lambda: experiment.flight(scenario, 1), 3), "s", 15.0)
    recording = experiment.flight(scenario, 1)
    result = experiment.solve(recording, "C", tuning, ("mekf",))
    m, raw = result.measured, recording.raw["C"]
    at_8_hz = m._replace(d=result.increments.d)

    def together() -> None:
        estimate.mekf(m._replace(d=gyro.preintegrate(result.increments, 1).d), tuning)

    for label, work, limit in (
        ("MEKF on 1 s increments", lambda: estimate.mekf(m, tuning), 40.0),
        ("pre-integration and MEKF", together, None),
        ("MEKF and RTS", lambda: estimate.mekf(m, tuning, smooth=True), None),
        ("AKF7, 8 Hz prediction", lambda: estimate.akf7(at_8_hz, tuning, stride=GYRO_HZ), None),
    ):
        told(label, 1e6 * smallest(work, 3) / len(m.z), "us per 1 Hz epoch", limit)
    told("combination of a day of cameras", smallest(lambda: cameras.combination(raw, tuning), 3), "s")
    told("gyro chain of a day", smallest(lambda: gyro.reduced(raw, tuning), 3), "s")
    told("a day through Level-1 files, written and read", smallest(lambda: through_files(recording, scenario), 1), "s")
    told_part("gracefo-attitude", 6)


if __name__ == "__main__":
    main()
