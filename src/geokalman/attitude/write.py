"""Writer of Level-1 files from a simulation: the same names, headers and columns that `read` takes."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from geokalman.attitude.header import END, EPOCH
from geokalman.attitude.model import EPOCH_2019, Array, Raw
from geokalman.attitude.products import GRACE_FO

OBC_OFFSET, OBC_DRIFT = 0.317, 3e-6  # s, s/s: receiver minus on-board time of the simulated computer
CLOCK_OFFSET, CLOCK_DRIFT = -0.0797, -2.5e-7  # s, s/s: GPS minus receiver time, as large as in GRACE's files


def write(folder: Path | str, product: str, satellite: str, date: str, columns: Mapping[str, np.ndarray]) -> Path:
    """Write one GRACE-FO file; floats by their shortest text that reads back the same, so nothing is lost.

    columns : name -> (n,), all of the product's. Returns the path. Raises KeyError for a column that is missing.
    """
    schema = GRACE_FO[product]
    texts = []
    for column in schema:
        values = np.asarray(columns[column.name])
        if column.kind == "float":
            texts.append([repr(value) for value in values.astype(float).tolist()])
        else:
            texts.append([str(value) for value in values.tolist()])
    path = Path(folder) / f"{product}_{date}_{satellite}_04.txt"
    with open(path, "w", encoding="utf-8") as stream:
        stream.write(_header(product, satellite, date, len(texts[0])))
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


def write_raw(folder: Path | str, raw: Raw) -> list[Path]:
    """SCA1A, IMU1A, QSA1B, TIM1B and CLK1B of one satellite, tagged by a computer and a clock that run wrong.

    Camera rows of one epoch come in changing order and only where the camera sees, as in real files.
    """
    Path(folder).mkdir(parents=True, exist_ok=True)
    s, origin, date = raw.satellite, raw.t0, date_of(raw.t0)
    paths = []
    n = len(raw.t_camera)
    order = np.random.default_rng(0).permuted(np.tile(np.arange(3), (n, 1)), axis=1).ravel()
    epoch = np.repeat(np.arange(n), 3)
    there = np.isfinite(raw.q_camera[order, epoch, 0])
    order, epoch = order[there], epoch[there]
    whole, fraction = _tags(obc_time(raw.t_camera[epoch]), origin)
    k = len(order)
    zeros = np.zeros(k, int)
    flags = np.full(k, "00000000")
    quaternion = dict(
        zip(("quatangle", "quaticoeff", "quatjcoeff", "quatkcoeff"), raw.q_camera[order, epoch].T, strict=True)
    )
    columns = {
        "rcvtime_intg": whole, "rcvtime_frac": fraction, "GRACEFO_id": np.full(k, s), "sca_id": order + 1,
        "sca_desig": np.where(order == 0, "P", "S"), **quaternion, "nlocks": zeros + 20, "nstars": zeros + 30,
        "sca_confid": zeros + 1,
        "sca_null1": zeros, "sca_null2": zeros, "sca_mode": flags, "qualflg": flags,
    }  # fmt: skip
    paths.append(write(folder, "SCA1A", s, date, columns))
    there = np.isfinite(raw.t_gyro.T) & np.isfinite(raw.gyro.T)  # axes have unequal counts, padded with NaN
    order = np.argsort(raw.t_gyro.T[there], kind="stable")
    whole, fraction = _tags(obc_time(raw.t_gyro.T[there][order]), origin)
    k = len(whole)
    columns = {
        "time_intg": whole, "time_frac": fraction, "time_ref": np.full(k, "O"), "GRACEFO_id": np.full(k, s),
        "gyro_id": np.nonzero(there)[1][order] + 1, "FiltAng": raw.gyro.T[there][order], "qualflg": np.full(k,
        "00000000"),
    }  # fmt: skip
    paths.append(write(folder, "IMU1A", s, date, columns))
    q = raw.q_qsa
    columns = {
        "gps_time": np.zeros(3, int), "GRACEFO_id": np.full(3, s), "sca_id": np.array([1, 2, 4]), "quatangle": q[:, 0],
        "quaticoeff": q[:, 1],
        "quatjcoeff": q[:, 2], "quatkcoeff": q[:, 3], "qual_rss": np.zeros(3), "qualflg": np.full(3, "00000000"),
    }  # fmt: skip
    paths.append(write(folder, "QSA1B", s, date, columns))
    first, last = np.nanmin(raw.t_gyro), np.nanmax(raw.t_gyro)
    obc = np.arange(np.floor(first) - 1, np.ceil(last) + 2)
    nano = np.round((obc * (1.0 + OBC_DRIFT) + OBC_OFFSET) * 1e9).astype(np.int64)
    k = len(obc)
    columns = {
        "obdh_time": origin + obc.astype(np.int64), "GRACEFO_id": np.full(k, s), "TS_suppid": np.full(k, 3),
        "gpstime_intg": origin + nano // 10**9, "gpstime_frac": nano % 10**9, "first_icu_blknr": np.arange(k),
        "final_icu_blknr": np.arange(k), "qualflg": np.full(k, "00000000"),
    }  # fmt: skip
    paths.append(write(folder, "TIM1B", s, date, columns))
    rcv = np.arange(np.floor(first / 10) - 1, np.ceil(last / 10) + 2) * 10
    k = len(rcv)
    columns = {
        "rcv_time": origin + rcv.astype(np.int64), "GRACEFO_id": np.full(k, s), "clock_id": np.ones(k, int),
        "eps_time": CLOCK_OFFSET + CLOCK_DRIFT * rcv, "eps_err": np.full(k, 1.4e-10), "eps_drift": np.full(k,
        CLOCK_DRIFT),
        "drift_err": np.full(k, 2.6e-11), "qualflg": np.full(k, "00000000"),
    }  # fmt: skip
    paths.append(write(folder, "CLK1B", s, date, columns))
    return paths


def write_orbit(folder: Path | str, satellite: str, t: Array, r: Array, v: Array, origin: int = EPOCH_2019) -> Path:
    """GNI1B of one satellite: t (n,) whole seconds after the origin, r (n, 3) [m], v (n, 3) [m/s] in the ICRF."""
    n = len(t)
    names = ("xpos", "ypos", "zpos"), ("xvel", "yvel", "zvel")
    columns: dict[str, np.ndarray] = {
        "gps_time": origin + np.round(t).astype(np.int64),
        "GRACEFO_id": np.full(n, satellite),
        "coord_ref": np.full(n, "I"),
    }
    for group, values in zip(names, (r, v), strict=True):
        for i, name in enumerate(group):
            columns[name], columns[f"{name}_err"] = values[:, i], np.zeros(n)
    columns["qualflg"] = np.full(n, "00000000")
    return write(folder, "GNI1B", satellite, date_of(origin), columns)


def write_accelerations(folder: Path | str, satellite: str, t: Array, a_srf: Array, origin: int = EPOCH_2019) -> Path:
    """ACT1B of one satellite: linear accelerations a_srf (n, 3) [m/s^2] in the SRF at whole seconds after the
    origin.
    """
    n = len(t)
    columns: dict[str, np.ndarray] = {
        "gps_time": origin + np.round(t).astype(np.int64),
        "GRACEFO_id": np.full(n, satellite),
        "qualflg": np.full(n, "00000000"),
    }
    for i, axis in enumerate("xyz"):
        columns |= {f"lin_accl_{axis}": a_srf[:, i], f"ang_accl_{axis}": np.zeros(n), f"acl_{axis}_res": np.zeros(n)}
    return write(folder, "ACT1B", satellite, date_of(origin), columns)


def write_attitude(
    folder: Path | str, satellite: str, t: Array, q: Array, used: np.ndarray, sigma: Array, origin: int = EPOCH_2019
) -> Path:
    """SCA1B of one satellite: attitudes q (n, 4), SRF to ICRF; used : bit mask of the cameras (16 is added for the
    gyros).
    """
    n = len(t)
    quaternion = dict(zip(("quatangle", "quaticoeff", "quatjcoeff", "quatkcoeff"), q.T, strict=True))
    columns = {
        "gps_time": origin + np.round(t).astype(np.int64), "GRACEFO_id": np.full(n, satellite),
        "sca_id": np.asarray(used) + 16, **quaternion,
        "qual_rss": sigma, "qualflg": np.full(n, "00000000"),
    }  # fmt: skip
    return write(folder, "SCA1B", satellite, date_of(origin), columns)
