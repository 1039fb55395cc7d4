"""Layouts of the Level-1 files: columns of each product, in GRACE-FO's order and in the older GRACE layout."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

Kind = Literal["int", "float", "text", "flags"]


class Column(NamedTuple):
    """One column: name, kind (flags: 0 and 1, bit 0 last), unit, limits, and how the file has it.

    factor : the file's unit in ours; fill : values that mark a missing one.
    """

    name: str
    kind: Kind
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    factor: float = 1.0
    fill: tuple[float, ...] = ()


def _columns(text: str) -> tuple[Column, ...]:
    """Columns from `name:kind:unit` words; kinds are i, f, t, b (flags)."""
    kinds: dict[str, Kind] = {"i": "int", "f": "float", "t": "text", "b": "flags"}
    parts = (word.split(":") for word in text.split())
    return tuple(
        Column(name, kinds[kind], unit[0] if unit else "", *LIMITS.get(name, (-math.inf, math.inf)))
        for name, kind, *unit in parts
    )


SECOND_FRACTIONS = {"rcvtime_frac": 10**6, "time_frac": 10**6, "gpstime_frac": 10**9}
"""Fractions of a second and how many make one."""
LIMITS: dict[str, tuple[float, float]] = {
    **{name: (0, most - 1) for name, most in SECOND_FRACTIONS.items()},
    "FiltAng": (-5759.0, 5759.0),  # deg: gyro angles wrap at 5758; beyond is no angle
    "gyro_id": (1, 4),
    **dict.fromkeys(("xpos", "ypos", "zpos"), (-100000000.0, 100000000.0)),
    **dict.fromkeys(("xvel", "yvel", "zvel"), (-12000.0, 12000.0)),
    **{f"lin_accl_{axis}": (-0.1, 0.1) for axis in "xyz"},
}
"""What values of a column lie between: beyond, a record is bad."""


QUATERNION = ("quatangle", "quaticoeff", "quatjcoeff", "quatkcoeff")
_QUATERNION = " ".join(f"{name}:f" for name in QUATERNION)
_STATE = (
    "gps_time:i:s GRACEFO_id:t coord_ref:t xpos:f:m ypos:f:m zpos:f:m xpos_err:f:m ypos_err:f:m zpos_err:f:m "
    "xvel:f:m/s yvel:f:m/s zvel:f:m/s xvel_err:f:m/s yvel_err:f:m/s zvel_err:f:m/s qualflg:b"
)
_IMU = "time_intg:i:s time_frac:i:us time_ref:t GRACEFO_id:t gyro_id:i FiltAng:f:deg qualflg:b"
_SCA1B = f"gps_time:i:s GRACEFO_id:t sca_id:i {_QUATERNION} qual_rss:f qualflg:b"
_LAYOUTS = {
    "SCA1A": f"rcvtime_intg:i:s rcvtime_frac:i:us GRACEFO_id:t sca_id:i sca_desig:t {_QUATERNION} nlocks:i nstars:i "
    "sca_confid:i sca_null1:i sca_null2:i sca_mode:t qualflg:b",
    "SCA1B": _SCA1B,
    "QSA1B": _SCA1B,
    "IMU1A": _IMU,
    "IMU1B": _IMU,
    "TIM1B": "obdh_time:i:s GRACEFO_id:t TS_suppid:i gpstime_intg:i:s gpstime_frac:i:ns first_icu_blknr:i "
    "final_icu_blknr:i qualflg:b",
    "CLK1B": "rcv_time:i:s GRACEFO_id:t clock_id:i eps_time:f:s eps_err:f:s eps_drift:f drift_err:f qualflg:b",
    "ACT1B": "gps_time:i:s GRACEFO_id:t lin_accl_x:f:m/s2 lin_accl_y:f:m/s2 lin_accl_z:f:m/s2 ang_accl_x:f:rad/s2 "
    "ang_accl_y:f:rad/s2 ang_accl_z:f:rad/s2 acl_x_res:f:m/s2 acl_y_res:f:m/s2 acl_z_res:f:m/s2 qualflg:b",
    "GNI1B": _STATE,
    "GNV1B": _STATE,
    "KBR1B": "gps_time:i:s biased_range:f:m range_rate:f:m/s range_accl:f:m/s2 iono_corr:f:m lighttime_corr:f:m "
    "lighttime_rate:f:m/s lighttime_accl:f:m/s2 ant_centr_corr:f:m ant_centr_rate:f:m/s ant_centr_accl:f:m/s2 "
    "K_A_SNR:i Ka_A_SNR:i K_B_SNR:i Ka_B_SNR:i qualflg:b",
    "VKB1B": "gps_time:i:s GRACEFO_id:t magnitude:f:m cosx:f cosy:f cosz:f qualflg:b",
}
GRACE_FO: dict[str, tuple[Column, ...]] = {product: _columns(text) for product, text in _LAYOUTS.items()}
"""GRACE-FO, section 4: ASCII with a YAML header."""

_THR_COUNTS = " ".join(f"{what}_{k}:i" for what in ("thrust_count", "on_time", "accum_dur") for k in range(1, 15))
GRACE: dict[str, tuple[Column, ...]] = {
    "SCA1B": GRACE_FO["SCA1B"], "QSA1B": GRACE_FO["SCA1B"], "QKS1B": GRACE_FO["SCA1B"], "CLK1B": GRACE_FO["CLK1B"],
    "TIM1B": GRACE_FO["TIM1B"], "ACC1B": GRACE_FO["ACT1B"], "GNV1B": GRACE_FO["GNV1B"], "KBR1B": GRACE_FO["KBR1B"],
    "VKB1B": GRACE_FO["VKB1B"],
    "THR1B": _columns(f"time_intg:i:s time_frac:i:us time_ref:t GRACE_id:t {_THR_COUNTS} qualflg:b"),
}  # fmt: skip
"""GRACE, Level-1B release 00 in ASCII: header lines "KEY : value" up to END OF HEADER, the same columns."""

KEYS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("SCA1B", "ACC1B", "ACT1B", "GNI1B", "GNV1B", "KBR1B"), ("gps_time",)),
    **dict.fromkeys(("IMU1A", "IMU1B"), ("time_intg", "time_frac", "gyro_id")),
    "SCA1A": ("rcvtime_intg", "rcvtime_frac", "sca_id"), "THR1B": ("time_intg", "time_frac"),
    "CLK1B": ("rcv_time",), "TIM1B": ("obdh_time",),
}  # fmt: skip
"""Time tags, coarse first, and what tells rows of one epoch apart; mounting files have none to be unique in."""
