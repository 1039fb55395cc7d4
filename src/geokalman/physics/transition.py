"""Transition matrix of position and velocity over a short step, from gravity gradients: Markley's series, and
integrated.

Both need the gradient G = da/dr alone; the motion itself is integrated elsewhere.
"""

from __future__ import annotations

import warnings

import numpy as np
from numba import njit

LONGEST_STEP, FORBIDDEN_STEP = 100.0, 250.0
"""Steps of `markley_step` [s] in a low orbit about Mars above which to warn, and above which to refuse."""


class TransitionWarning(UserWarning):
    """A step of the series that is long for the orbit."""


@njit(cache=True)
def markley_step(G0: np.ndarray, G1: np.ndarray, h: float, Phi: np.ndarray) -> None:
    """Markley's transition matrix of [r, v] over a step, written to Phi (6, 6).

    Phi_rr = I + (2 G0 + G1) h^2/6,  Phi_rv = I h + (G0 + G1) h^3/12,
    Phi_vr = (G0 + G1) h/2,          Phi_vv = I + (G0 + 2 G1) h^2/6.
    G0, G1 : (3, 3) gravity gradients at both ends [s^-2]; h [s].
    Source: Markley (1986), J. Astronaut. Sci. 34(2), 161-169; mars-pulsar (9).
    """
    for i in range(3):
        for j in range(3):
            Phi[i, j] = (2.0 * G0[i, j] + G1[i, j]) * (h * h / 6.0)
            Phi[i, 3 + j] = (G0[i, j] + G1[i, j]) * (h * h * h / 12.0)
            Phi[3 + i, j] = (G0[i, j] + G1[i, j]) * (0.5 * h)
            Phi[3 + i, 3 + j] = (G0[i, j] + 2.0 * G1[i, j]) * (h * h / 6.0)
        Phi[i, i] += 1.0
        Phi[i, 3 + i] += h
        Phi[3 + i, 3 + i] += 1.0


@njit(cache=True)
def variational_step(G0: np.ndarray, G_mid: np.ndarray, G1: np.ndarray, h: float, Phi: np.ndarray) -> None:
    """Transition matrix of [r, v] over a step by one Runge-Kutta step of Phi' = [[0, I], [G, 0]] Phi, written to
    Phi (6, 6).

    G0, G_mid, G1 : (3, 3) gravity gradients at the start, the middle and the end [s^-2]; h [s]. Error O(h^5).
    """
    k = np.zeros((4, 6, 6))
    stage = np.empty((6, 6))
    for s in range(4):
        for i in range(6):
            for j in range(6):
                stage[i, j] = 1.0 if i == j else 0.0
                if s > 0:
                    stage[i, j] += (h if s == 3 else 0.5 * h) * k[s - 1, i, j]
        G = G0 if s == 0 else (G1 if s == 3 else G_mid)
        for j in range(6):
            for i in range(3):
                k[s, i, j] = stage[3 + i, j]
                k[s, 3 + i, j] = G[i, 0] * stage[0, j] + G[i, 1] * stage[1, j] + G[i, 2] * stage[2, j]
    for i in range(6):
        for j in range(6):
            Phi[i, j] = (h / 6.0) * (k[0, i, j] + 2.0 * k[1, i, j] + 2.0 * k[2, i, j] + k[3, i, j])
        Phi[i, i] += 1.0


@njit(cache=True)
def chain_step(Phi: np.ndarray, total: np.ndarray) -> None:
    """Put a step after those before: total = Phi total, in place; both (n, n)."""
    n = Phi.shape[0]
    column = np.empty(n)
    for j in range(n):
        for i in range(n):
            column[i] = 0.0
            for k in range(n):
                column[i] += Phi[i, k] * total[k, j]
        for i in range(n):
            total[i, j] = column[i]


def check_step(h: float, allow_coarse: bool = False) -> None:
    """Judge a step of Markley's series for a low orbit about Mars.

    Its error of Phi_rv over 500 s is 2.4 s with one step, 0.13 s with steps of 100 s, 0.0015 s with steps of 10 s.
    Warns above 100 s; raises ValueError above 250 s unless allow_coarse.
    """
    if h > FORBIDDEN_STEP and not allow_coarse:
        raise ValueError(
            f"a step of {h:g} s is too long for Markley's transition matrix, whose error of position by velocity "
            f"would be seconds; use steps of at most {LONGEST_STEP:g} s, or allow_coarse_substeps to see what happens."
        )
    if h > LONGEST_STEP:
        warnings.warn(
            f"a step of {h:g} s is long for Markley's transition matrix: expect errors of about "
            f"{2.43 * (h / 500.0) ** 2:.2g} s in position by velocity over 500 s",
            TransitionWarning,
            stacklevel=2,
        )
