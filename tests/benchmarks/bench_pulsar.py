"""Cost of the orbiter's filters per epoch, and of Table 3 with 20 seeds; never a gate."""

import time

import numpy as np
import pytest

from geokalman.physics import mars
from geokalman.pulsar import ensemble, estimate, simulate
from geokalman.pulsar.dynamics import j2_force, rich_force
from geokalman.pulsar.model import Mission, preset


def cpu(call):
    """Least processor time of three calls [s]."""
    times = []
    for _ in range(3):
        begun = time.process_time()
        call()
        times.append(time.process_time() - begun)
    return min(times)


@pytest.mark.parametrize("kind", ["ekf", "aekf1_prw", "raekf", "ukf"])
def test_microseconds_per_epoch(kind):
    mission, gravity, chosen = Mission(), mars.gravity(), preset("E")
    flight = simulate.fly(mission, gravity, 1.0)
    data = simulate.observe(flight, mission, chosen, np.random.default_rng(0))
    run = lambda: estimate.run(kind, data, flight.x0, chosen, j2_force(gravity))
    run()
    print(f"{kind}: {cpu(run) / mission.epochs * 1e6:.0f} us per epoch")


def test_microseconds_per_epoch_at_degree_20():
    mission, gravity, chosen = Mission(days=1.0), mars.gravity(), preset("C")
    flight, force = simulate.fly(mission, gravity, 1.0), rich_force(gravity, mission)
    data = simulate.observe(flight, mission, chosen, np.random.default_rng(0))
    run = lambda: estimate.run("ekf", data, flight.x0, chosen, force)
    run()
    print(f"ekf, degree 20: {cpu(run) / mission.epochs * 1e6:.0f} us per epoch")


def test_seconds_of_table_3():
    mission, chosen = Mission(), preset("E")
    methods = ensemble.table3_methods(chosen, ["ekf", "aekf1_prw", "aekf2", "raekf", "aekf1_pr3", "ekf_tuned"])
    trial = ensemble.experiment(mission, chosen, mars.gravity(), methods)
    ensemble.ensemble(trial, 0, 1)
    print(f"20 seeds, 6 filters: {cpu(lambda: ensemble.ensemble(trial, 0, 20)):.1f} s")
