"""Cost of gravity at a point, of a recovery row and of an orbit pair; run it as a script on an idle machine.

Prints the smallest of several runs, one thread, with pyharm's synthesis of the same accelerations in the same minute.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before pyharm loads OpenMP

import numpy as np
from stopwatch import smallest, told, told_machine

from geokalman.constants import GM_EARTH, OMEGA_EARTH
from geokalman.physics.forces import gravity_force, gravity_params
from geokalman.physics.frames import spherical
from geokalman.physics.gradient import gradient_tensor
from geokalman.physics.gravity import acceleration
from geokalman.physics.harmonics import load_field
from geokalman.physics.kepler import kepler_to_state
from geokalman.physics.orbit import integrate
from geokalman.physics.partials import column_count, design_block

N_MAX, POINTS = 70, 2000


def main() -> None:
    field = load_field("EGM96", N_MAX)
    B = kepler_to_state((6834e3, 0.0018, np.radians(89.0), 0.3, 0.5, 0.1), GM_EARTH)
    params = gravity_params(field, OMEGA_EARTH)
    A = integrate(gravity_force, params, B, (28.9, 1), "dop853").y[-1]
    y0 = np.concatenate([A, B])
    pair = integrate(gravity_force, params, y0, (30.0, POINTS - 1))
    rA, rB = (np.ascontiguousarray(pair.r[:, i]) for i in (0, 1))  # the cost does not know the frame
    e = (rA - rB) / np.linalg.norm(rA - rB, axis=1)[:, None]
    rows = np.empty((POINTS, column_count(N_MAX)))

    told_machine()
    print(f"EGM96 to degree and order {N_MAX}, one thread")
    told("acceleration", 1e6 * smallest(lambda: acceleration(field, rA), 15) / POINTS, "us per point", 5.0)
    told("gradient tensor", 1e6 * smallest(lambda: gradient_tensor(field, rA), 5) / POINTS, "us per point")
    block = smallest(lambda: design_block(field.gm, field.radius, N_MAX, rA, rB, e, rows), 15)
    told("design row", 1e6 * block / POINTS, "us per pair", 10.0)
    for method, h in (("gj", 10.0), ("gj", 5.0), ("dop853", 30.0), ("dop853", 15.0)):
        day = smallest(lambda m=method, s=h: integrate(gravity_force, params, y0, (30.0, 2880), m, s), 5)
        told(f"pair, {method}, h = {h:g} s", day, "s per day")

    try:
        import pyharm
    except ImportError:
        print("pyharm is not installed: no peer to compare with")
        return
    c, s = (np.concatenate([f[m:, m] for m in range(N_MAX + 1)]) for f in (field.C, field.S))
    theirs = pyharm.shc.Shc.from_arrays(N_MAX, c, s, mu=field.gm, r=field.radius)
    radius, latitude, longitude = spherical(rA)
    scattered = pyharm.crd.PointSctr.from_arrays(latitude, longitude, radius)
    peer = smallest(lambda: pyharm.shs.point_grad1(scattered, theirs, N_MAX), 15)
    told("pyharm point_grad1", 1e6 * peer / POINTS, "us per point")


if __name__ == "__main__":
    main()
