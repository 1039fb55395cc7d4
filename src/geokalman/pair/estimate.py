"""The filters of the chapters, given what they may see: models and sensors for `geokalman.kalman.run`."""

from __future__ import annotations

from collections.abc import Sequence

from geokalman.kalman.discretise import van_loan, white_jerk
from geokalman.kalman.model import Model, Sensor
from geokalman.pair.model import Observations, Tuning, along_the_line


def dynamic(tuning: Tuning) -> Model:
    """Model of [s, v, a] that knows the breathing and takes the acceleration for a Gauss-Markov process."""
    F, W = along_the_line(tuning.n, tuning.sigma_a, tuning.tau)
    return Model(F=lambda h: van_loan(F, W, h))


def kinematic(tuning: Tuning) -> Model:
    """Model of [s, v, s''] that knows no dynamics: white jerk. Its third state is the whole acceleration."""
    return Model(F=lambda h: white_jerk(h, tuning.q, axes=1))


def sensors(data: Observations, tuning: Tuning, which: Sequence[str] = ("gnss", "rate")) -> list[Sensor]:
    """Linear sensors of a state [s, v, a] on the line; which : of gnss, rate, range.

    >>> import numpy as np
    >>> from geokalman.pair import simulate
    >>> from geokalman.pair.model import Scenario
    >>> rng, scenario = np.random.default_rng(1), Scenario(duration=60.0)
    >>> data = simulate.observe(simulate.on_the_line(scenario, rng), scenario, rng)
    >>> [sensor.H for sensor in sensors(data, Tuning())]
    [[[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]]
    """
    position, rate = [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]
    known = {
        "gnss": Sensor(data.gnss, [[tuning.sigma_gnss**2]], H=position),
        "rate": Sensor(data.rate, [[tuning.sigma_rate**2]], H=rate),
        "range": Sensor(data.range, [[tuning.sigma_range**2]], H=position),
    }
    unknown = [name for name in which if name not in known]
    if unknown:
        raise ValueError(f"{unknown[0]!r} is no instrument; give some of {', '.join(known)}.")
    return [known[name] for name in which]
