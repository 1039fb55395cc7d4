"""How strong each force on the orbiter is along its orbit."""

from __future__ import annotations

import numpy as np

from geokalman.pulsar.dynamics import J2, LAMBDA, SUN_GM, SUNLIGHT, Force, force_point
from geokalman.pulsar.model import Array
from geokalman.pulsar.simulate import Truth


def strengths(flight: Truth, rich: Force) -> dict[str, float]:
    """Give the root mean square of each acceleration along the flight [m s^-2].

    point : of the point mass; j2; field : of the field beyond J2; sun : as third body; light : of the Sun; rest : all
    but point mass and J2. rich : the whole force, with lambda = 1.
    """
    without = {"point": (J2, LAMBDA), "j2": (LAMBDA,), "field": (SUN_GM, SUNLIGHT), "sun": (SUNLIGHT,), "rest": ()}
    total = {name: _accelerations(flight, rich, zeros) for name, zeros in without.items()}
    parts = {
        "point": total["point"], "j2": total["j2"] - total["point"], "field": total["field"] - total["j2"],
        "sun": total["sun"] - total["field"], "light": total["rest"] - total["sun"],
        "rest": total["rest"] - total["j2"],
    }  # fmt: skip
    return {name: float(np.sqrt((a**2).sum(axis=1).mean())) for name, a in parts.items()}


def _accelerations(flight: Truth, force: Force, zeros: tuple[int, ...]) -> Array:
    """Give accelerations (n, 3) with some constants of the force set to zero."""
    head, out = force.head.copy(), np.empty((len(flight.t), 3))
    head[list(zeros)] = 0.0
    for t, x, a in zip(flight.t, flight.x, out, strict=True):
        force_point(t, np.ascontiguousarray(x[:3]), head, force.field, force.sun, a)
    return out
