"""A family of calibrations: who carries the error that both estimates share, when the printed mean is met each time.

The estimates are linear in the drift of the gravimeter and the reference in its own error, so two simulated surveys of
a seed give every member of the family.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from geokalman.airborne.experiment import ensemble
from geokalman.airborne.model import Array, Tuning
from geokalman.airborne.simulate import Scenario

LARGEST_DRIFT = 20.0
"""Drift [mGal] beyond which no member is sought."""


class Member(NamedTuple):
    """One calibration: errors put in [mGal], what the paper's table shows then [mGal], and what it does not show.

    reference, drift : of the reference instrument and of the gravimeter, as a Scenario has them; fb, forward : means
    of D over all lines; gain : forward over fb, standard deviations against the truth; sag, gt : root mean square
    errors of SAGFB and of the reference.
    """

    reference: float
    drift: float
    fb: float
    forward: float
    gain: float
    sag: float
    gt: float

    @property
    def ratio(self) -> float:
        """D of forward and backward filtering over that of the standard filter."""
        return self.fb / self.forward


def family(
    scenario: Scenario, tuning: Tuning, seeds: Sequence[int], references: Sequence[float], printed: float
) -> list[Member]:
    """Members with the given errors of the reference [mGal], the drift chosen so that the mean D of SAGFB is `printed`.

    D^2 of a line is a quadratic form in (1, reference, drift). Where the reference alone gives more than `printed`, the
    drift is zero. Raises ValueError where no drift up to `LARGEST_DRIFT` is enough.
    """
    table, sag, gt, truth = _forms(scenario, tuning, seeds)

    def mean(forms: Array, reference: float, drift: float) -> float:
        x = np.array([1.0, reference, drift])
        return float(np.sqrt(np.einsum("i,kij,j->k", x, forms, x)).mean())

    out = []
    for reference in references:
        if mean(table["fb"], reference, LARGEST_DRIFT) < printed:
            raise ValueError(f"No drift up to {LARGEST_DRIFT:g} mGal gives a mean of {printed:g} mGal.")
        drift = 0.0
        if mean(table["fb"], reference, 0.0) < printed:
            drift = brentq(lambda d, r=reference: mean(table["fb"], r, d) - printed, 0.0, LARGEST_DRIFT)
        numbers = [mean(table[name], reference, drift) for name in ("fb", "forward")]
        gain = mean(truth["forward"], reference, drift) / mean(truth["fb"], reference, drift)
        out.append(Member(reference, drift, *numbers, gain, mean(sag, reference, drift), mean(gt, reference, drift)))
    return out


def _forms(scenario: Scenario, tuning: Tuning, seeds: Sequence[int]) -> tuple[dict, Array, Array, dict]:
    """Quadratic forms (lines, 3, 3) in (1, reference, drift) of all mean squares of `Member`."""
    quiet, unit = (ensemble(replace(scenario, drift=size, reference=size), tuning, seeds) for size in (0.0, 1.0))
    pairs = [pair for runs in zip(quiet, unit, strict=True) for pair in zip(*runs, strict=True)]
    table, truth = {"fb": [], "forward": []}, {"fb": [], "forward": []}
    sag, gt = [], []
    for still, drifting in pairs:
        p = still.proper
        noise = (drifting.reference - still.reference)[p]
        smooth = (still.reference - still.gravity)[p]
        for name in ("fb", "forward"):
            error, by_drift = (still.curves[name] - still.gravity)[p], (drifting.curves[name] - still.curves[name])[p]
            table[name].append(_form(smooth - error, noise, -by_drift))
            truth[name].append(_form(*(x - x.mean() for x in (error, 0.0 * noise, by_drift))))
            if name == "fb":
                sag.append(_form(error, 0.0 * noise, by_drift))
        gt.append(_form(smooth, noise, 0.0 * noise))
    stacked = [{name: np.array(forms) for name, forms in kind.items()} for kind in (table, truth)]
    return stacked[0], np.array(sag), np.array(gt), stacked[1]


def _form(*parts: Array) -> Array:
    rows = np.array(parts)
    return rows @ rows.T / rows.shape[1]
