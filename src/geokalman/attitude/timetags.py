"""Time tags: on-board to receiver time by TIM1B, receiver to GPS time by CLK1B."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geokalman.attitude.header import Level1Error
from geokalman.attitude.level1 import Table
from geokalman.attitude.model import Array


def flag_bits(flags: np.ndarray) -> np.ndarray:
    """Quality flags, strings of 0 and 1 with bit 0 last, as integers (n,)."""
    return np.array([int(text, 2) if text else 0 for text in flags], dtype=np.int64)


def seconds(whole: np.ndarray, fraction: np.ndarray, per_second: int, origin: int) -> Array:
    """Seconds after an integer origin, exact to 1e-11 s: large integers are subtracted first."""
    return (np.asarray(whole, dtype=np.int64) - origin).astype(float) + np.asarray(
        fraction, dtype=np.int64
    ) / per_second


@dataclass(frozen=True)
class Clock:
    """Offsets of GPS time from on-board time: both tables as (x, y) with x the time before, y what is to be added [s].

    obc (n,), to_receiver (n,) : from TIM1B; receiver (m,), to_gps (m,) : from CLK1B; origin : integer GPS second of
    zero; no_before, no_after (m,) : CLK1B flags: do not extrapolate before, after this point.
    """

    origin: int
    obc: Array
    to_receiver: Array
    receiver: Array
    to_gps: Array
    no_before: np.ndarray
    no_after: np.ndarray

    def gps(self, obc: Array) -> tuple[Array, np.ndarray]:
        """GPS times [s after the origin] of on-board times, and which of them stand at an edge.

        An edge is beyond the tables, or in a segment of the clock that must not be bridged; it is carried by the
        nearest offset.
        """
        receiver = obc + np.interp(obc, self.obc, self.to_receiver)
        edge = (obc < self.obc[0]) | (obc > self.obc[-1])
        gps = receiver + np.interp(receiver, self.receiver, self.to_gps)
        k = np.searchsorted(self.receiver, receiver, side="right")
        edge |= (k == 0) | (receiver > self.receiver[-1])
        inner = np.clip(k, 1, max(len(self.receiver) - 1, 1))
        if len(self.receiver) > 1:
            broken = self.no_after[inner - 1] & self.no_before[inner]
            between = (receiver > self.receiver[inner - 1]) & (receiver < self.receiver[inner])
            edge |= broken & between
        return gps, edge


def clock(tim: list[Table], clk: list[Table], origin: int) -> Clock:
    """The clock of one satellite from its TIM1B and CLK1B files of the day and its neighbours.

    Undefined pairs (gpstime_intg = 0) and those with a flag of bit 3 or above are left out. Raises Level1Error where
    nothing is left.
    """
    obc, receiver = [], []
    for table in tim:
        good = (table["gpstime_intg"] != 0) & (flag_bits(table["qualflg"]) & 0b11111000 == 0)
        obc.append((table["obdh_time"][good] - origin).astype(float))
        receiver.append(seconds(table["gpstime_intg"][good], table["gpstime_frac"][good], 10**9, origin))
    x, index = np.unique(np.concatenate(obc), return_index=True)
    if not len(x):
        raise Level1Error(f"{tim[0].path}: no usable pair of on-board and receiver time is left.")
    y = np.concatenate(receiver)[index] - x
    rcv = np.concatenate([table["rcv_time"] for table in clk])
    u, index = np.unique((rcv - origin).astype(float), return_index=True)
    if not len(u):
        raise Level1Error(f"{clk[0].path}: no clock offset is left.")
    eps = np.concatenate([table["eps_time"] for table in clk])[index]
    bits = np.concatenate([flag_bits(table["qualflg"]) for table in clk])[index]
    return Clock(origin, x, y, u, eps, bits & 0b10 != 0, bits & 0b01 != 0)
