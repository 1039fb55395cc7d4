"""Writer of Level-1 files from a simulation: the same names, headers and columns that `read` takes."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from geokalman.attitude.header import END, EPOCH
from geokalman.attitude.model import EPOCH_2019, Array, Telemetry
from geokalman.attitude.products import GRACE_FO, QUATERNION

FLAGS = "00000000"
OBC_OFFSET, OBC_DRIFT = 0.317, 3e-6  # s, s/s: receiver minus on-board time of the simulated computer
CLOCK_OFFSET, CLOCK_DRIFT = -0.0797, -2.5e-7  # s, s/s: GPS minus receiver time, as large as in GRACE's files


def write(folder: Path | str, product: str, satellite: str, date: str, columns: Mapping[str, Any]) -> Path:
    """Write one GRACE-FO file; floats by their shortest text that reads back the same, so nothing is lost.

    columns : name -> (n,), or one value for all records; the satellite, the flags and errors of 0 need not be given.
    Returns the path. Raises KeyError for a column that is missing.
    """
    n = next(len(values) for values in columns.values() if np.ndim(values))
    given = {"GRACEFO_id": satellite, "qualflg": FLAGS, **columns}
    texts = []
    for column in GRACE_FO[product]:
        default = {column.name: 0.0} if column.name.endswith("_err") else {}
        values = np.broadcast_to((default | given)[column.name], (n,))
        texts.append(
            [repr(x) for x in values.astype(float).tolist()] if column.kind == "float" else map(str, values.tolist())
        )
    path = Path(folder) / f"{product}_{date}_{satellite}_04.txt"
    with open(path, "w", encoding="utf-8") as stream:
        stream.write(_header(product, satellite, date, n))
        stream.writelines(" ".join(row) + "\n" for row in zip(*texts, strict=True))
    return path


def _header(product: str, satellite: str, date: str, count: int) -> str:
    platform = "GRACE-C+D" if satellite == "Y" else f"GRACE-{satellite}"
    start = gps_second(date)
    ordinals = {1: "st", 2: "nd", 3: "rd"}
    lines = [
        "header:", "  dimensions:", f"    num_records: {count}", "  global_attributes:", f"    id: {product}_simulated",
        f"    title: GRACE-FO Level-1 {product}, simulated by geokalman", '    product_version: "04"',
        f"    platform: {platform}",
        f"    time_coverage_start: {date}T00:00:00.00", f"    time_coverage_stop: {date}T23:59:59.99",
        "    history:", "    - simulated; not a measurement", "  non-standard_attributes:",
        "    epoch_time: 2000-01-01T12:00:00.00",
        "    software_version: geokalman", f"    start_time_epoch_secs: {start}",
        f"    stop_time_epoch_secs: {start + 86400}", "  variables:",
    ]  # fmt: skip
    for k, column in enumerate(GRACE_FO[product], 1):
        suffix = "th" if k in (11, 12, 13) else ordinals.get(k % 10, "th")
        lines += [f"  - name: {column.name}", f'    comment: "{k}{suffix} column"', f"    long_name: {column.name}"]
        lines += [f"    units: {column.unit}"] if column.unit else []
    return "\n".join([*lines, END, ""])


def gps_second(date: str) -> int:
    """GPS second past 2000-01-01 12:00:00 at the start of a date, YYYY-MM-DD."""
    return int((datetime.datetime.fromisoformat(date) - EPOCH).total_seconds())


def date_of(second: int) -> str:
    """The date, YYYY-MM-DD, that a GPS second past 2000-01-01 12:00:00 lies in."""
    return (EPOCH + datetime.timedelta(seconds=int(second))).date().isoformat()


def receiver_time(gps: Array) -> Array:
    """Receiver time of GPS time [s after the origin]: receiver + offset + drift receiver = GPS."""
    return (gps - CLOCK_OFFSET) / (1.0 + CLOCK_DRIFT)


def obc_time(gps: Array) -> Array:
    """On-board time of GPS time [s after the origin]."""
    return (receiver_time(gps) - OBC_OFFSET) / (1.0 + OBC_DRIFT)


def _tags(t: Array, origin: int) -> tuple[np.ndarray, np.ndarray]:
    """Integer seconds and microseconds of times after the origin."""
    micro = np.round(t * 1e6).astype(np.int64)
    return origin + micro // 1_000_000, micro % 1_000_000


def write_raw(folder: Path | str, raw: Telemetry) -> list[Path]:
    """SCA1A, IMU1A, QSA1B, TIM1B and CLK1B of one satellite, tagged by a computer and a clock that run wrong.

    Camera rows of one epoch come in changing order and only where the camera sees, as in real files.
    """
    Path(folder).mkdir(parents=True, exist_ok=True)
    origin, n = raw.t0, len(raw.t_camera)
    order = np.random.default_rng(0).permuted(np.tile(np.arange(3), (n, 1)), axis=1).ravel()
    epoch = np.repeat(np.arange(n), 3)
    there = np.isfinite(raw.q_camera[order, epoch, 0])
    order, epoch = order[there], epoch[there]
    whole, fraction = _tags(obc_time(raw.t_camera[epoch]), origin)
    cameras = {
        "rcvtime_intg": whole, "rcvtime_frac": fraction, "sca_id": order + 1,
        "sca_desig": np.where(order == 0, "P", "S"), **_quaternion(raw.q_camera[order, epoch]),
        "nlocks": 20, "nstars": 30, "sca_confid": 1, "sca_null1": 0,
        "sca_null2": 0, "sca_mode": FLAGS,
    }  # fmt: skip
    there = np.isfinite(raw.t_gyro.T) & np.isfinite(raw.gyro.T)  # axes have unequal counts, padded with NaN
    order = np.argsort(raw.t_gyro.T[there], kind="stable")
    whole, fraction = _tags(obc_time(raw.t_gyro.T[there][order]), origin)
    gyros = {
        "time_intg": whole, "time_frac": fraction, "time_ref": "O", "gyro_id": np.nonzero(there)[1][order] + 1,
        "FiltAng": raw.gyro.T[there][order],
    }  # fmt: skip
    mounting = {"gps_time": 0, "sca_id": np.array([1, 2, 4]), **_quaternion(raw.q_qsa), "qual_rss": 0.0}
    first, last = np.nanmin(raw.t_gyro), np.nanmax(raw.t_gyro)
    obc = np.arange(np.floor(first) - 1, np.ceil(last) + 2)
    nano = np.round((obc * (1.0 + OBC_DRIFT) + OBC_OFFSET) * 1e9).astype(np.int64)
    block = np.arange(len(obc))
    pairs = {
        "obdh_time": origin + obc.astype(np.int64), "TS_suppid": 3, "gpstime_intg": origin + nano // 10**9,
        "gpstime_frac": nano % 10**9, "first_icu_blknr": block, "final_icu_blknr": block,
    }  # fmt: skip
    rcv = np.arange(np.floor(first / 10) - 1, np.ceil(last / 10) + 2) * 10
    clock = {
        "rcv_time": origin + rcv.astype(np.int64), "clock_id": 1, "eps_time": CLOCK_OFFSET + CLOCK_DRIFT * rcv,
        "eps_err": 1.4e-10, "eps_drift": CLOCK_DRIFT, "drift_err": 2.6e-11,
    }  # fmt: skip
    files = {"SCA1A": cameras, "IMU1A": gyros, "QSA1B": mounting, "TIM1B": pairs, "CLK1B": clock}
    return [write(folder, product, raw.satellite, date_of(origin), columns) for product, columns in files.items()]


def _quaternion(q: Array) -> dict[str, Array]:
    return dict(zip(QUATERNION, q.T, strict=True))


def _by_second(folder: Path | str, product: str, satellite: str, t: Array, origin: int, columns: Mapping) -> Path:
    times = {"gps_time": origin + np.round(t).astype(np.int64)}
    return write(folder, product, satellite, date_of(origin), {**times, **columns})


def write_orbit(folder: Path | str, satellite: str, t: Array, r: Array, v: Array, origin: int = EPOCH_2019) -> Path:
    """GNI1B of one satellite: t (n,) whole seconds after the origin, r (n, 3) [m], v (n, 3) [m/s] in the ICRF."""
    names = ("xpos", "ypos", "zpos", "xvel", "yvel", "zvel")
    states = dict(zip(names, np.hstack([r, v]).T, strict=True))
    return _by_second(folder, "GNI1B", satellite, t, origin, {"coord_ref": "I", **states})


def write_accelerations(folder: Path | str, satellite: str, t: Array, a_srf: Array, origin: int = EPOCH_2019) -> Path:
    """ACT1B of one satellite: accelerations a_srf (n, 3) [m/s^2] at whole seconds after the origin."""
    columns: dict[str, Any] = {}
    for axis, a in zip("xyz", a_srf.T, strict=True):
        columns |= {f"lin_accl_{axis}": a, f"ang_accl_{axis}": 0.0, f"acl_{axis}_res": 0.0}
    return _by_second(folder, "ACT1B", satellite, t, origin, columns)


def write_attitude(
    folder: Path | str, satellite: str, t: Array, q: Array, used: np.ndarray, sigma: Array, origin: int = EPOCH_2019
) -> Path:
    """SCA1B of one satellite: attitudes q (n, 4), SRF to ICRF; used : cameras (16 is added for gyros)."""
    columns = {"sca_id": np.asarray(used) + 16, **_quaternion(q), "qual_rss": sigma}
    return _by_second(folder, "SCA1B", satellite, t, origin, columns)
