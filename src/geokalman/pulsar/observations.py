"""What a filter may see: ranges along the lines to pulsars, and how good they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geokalman.kalman.checks import epochs, plain
from geokalman.pulsar.catalogue import require_distinct
from geokalman.pulsar.model import Array


@dataclass(frozen=True)
class Observations:
    """Ranges to m pulsars at n epochs.

    t (n,) [s] after the initial state; z (n, m) [m], NaN where missing; H : directions (m, 3); variance (m,) [m^2].
    Raises ValueError for shapes that do not fit, epochs that do not increase or do not come after the initial state,
    an infinite range, directions that are no distinct unit vectors, and variances that are not positive.
    """

    t: Array
    z: Array
    H: Array
    variance: Array

    def __post_init__(self) -> None:
        t = epochs(self.t)
        if t[0] <= 0.0:
            raise ValueError(
                f"the first observation stands at t = {t[0]:g} s; "
                "the initial state is at 0 and observations come after it."
            )
        object.__setattr__(self, "z", plain("z", self.z, missing=True))
        object.__setattr__(self, "variance", plain("variance", self.variance))
        m = len(require_distinct(self.H))
        if self.z.shape != (len(t), m) or self.variance.shape != (m,):
            raise ValueError(
                f"ranges of shape {self.z.shape} and variances of shape {self.variance.shape} "
                f"do not fit {len(t)} epochs of {m} pulsars."
            )
        bad = np.isinf(self.z).any(axis=1)
        if bad.any():
            raise ValueError(f"a range at epoch k = {int(bad.argmax()) + 1} is infinite; a missing one is NaN.")
        if not (self.variance > 0.0).all() or not np.isfinite(self.variance).all():
            raise ValueError(f"variances {self.variance.tolist()} m^2: each must be positive and finite.")

    def masked(self, mask: Array) -> Observations:
        """Leave out those where mask (n, m) is true, e.g. of pulsars near the Sun."""
        return Observations(self.t, np.where(mask, np.nan, self.z), self.H, self.variance)
