"""Recovery of a gravity field from line-of-sight gravity differences: the acceleration approach, equations (47) to (49).

Every epoch gives one equation, e . (g_A - g_B) = observed, linear in the coefficients of degree 2 and above; degrees 0
and 1 are held. All methods are right-hand sides of one normal matrix. Positions in the design matrix are the true ones:
the smoothed ones differ by micrometres, which does not show.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from geokalman.grace.model import Array, distance, earth_rotation, los_acceleration
from geokalman.grace.simulate import OrbitPair
from geokalman.leastsquares import NormalEquations
from geokalman.physics.frames import eci_to_ecef
from geokalman.physics.gravity import column_names, design_block
from geokalman.physics.harmonics import GravityField

BLOCK = 2048  # rows accumulated at a time: 83 MB of design matrix at degree 70
ARC = 16384  # rows one worker sums up before its normal matrix is added to the others


@dataclass(frozen=True)
class Recovery:
    """Estimated coefficients of each observable, (N+1, N+1) arrays C and S, and how the normal matrix stood.

    `formal` is the standard deviation of each coefficient for unit weight, as C and S arrays; multiply by the standard
    deviation of an observable [m/s^2].
    """

    n_max: int
    radius: float
    ids: tuple[str, ...]
    C: Array  # (ids, N+1, N+1)
    S: Array
    condition: float
    equations: int
    unknowns: int

    def coefficients(self, observable: str) -> tuple[Array, Array]:
        """C and S (N+1, N+1) recovered from the observable. Raises KeyError with the ids at hand."""
        if observable not in self.ids:
            raise KeyError(f"observable {observable!r} was not recovered; at hand are {', '.join(self.ids)}.")
        k = self.ids.index(observable)
        return self.C[k], self.S[k]
