"""Level-1 files to what the simulation gives: raw sensors in GPS time, orbits and accelerations of a flight."""

from __future__ import annotations

import datetime
import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

from geokalman.attitude import cameras, gyro
from geokalman.attitude.header import NAME, Level1Error, flag_meanings
from geokalman.attitude.level1 import Level1Warning, Table, read
from geokalman.attitude.model import SATELLITES, Array, Telemetry, mounting
from geokalman.attitude.products import QUATERNION
from geokalman.attitude.timetags import clock, flag_bits, seconds
from geokalman.attitude.truth import Recording
from geokalman.attitude.write import gps_second
from geokalman.physics.quaternion import normalise

WORST_CONFIDENCE = 5
REFUSED = re.compile(r"invalid|not valid|\bsun\b|\bmoon\b|non-stellar|false star", re.IGNORECASE)
VALID = re.compile(r"\b1\s*=\s*valid", re.IGNORECASE)
LOWEST, HIGHEST = 6.4e6, 5e7  # m: radii of orbits
LONGEST_GAP = 10.0  # s: accelerations are interpolated over no longer hole
SAME_EPOCH = 1e-3  # s: rows of different cameras so near each other are one exposure


def dates(folder: Path | str) -> list[str]:
    """Dates, YYYY-MM-DD, of the SCA1A files in a folder."""
    return sorted(
        {path.name[6:16] for path in Path(folder).glob("SCA1A_????-??-??_?_??.txt*") if NAME.match(path.name)}
    )


def find(folder: Path | str, product: str, satellite: str, date: str) -> Path:
    """The newest file of a product. Raises Level1Error naming what was looked for."""
    found = versions(folder, product, satellite, date)
    if not found:
        packed = sorted(Path(folder).glob(f"{product}_{date}_{satellite}_??.txt.*"))
        hint = (
            f"unpack {packed[0].name}"
            if packed
            else "the files of both satellites are needed, as the archives of that day have them"
        )
        raise Level1Error(f"{folder}: no file {product}_{date}_{satellite}_04.txt, nor one of another version; {hint}.")
    return found[-1]


def versions(folder: Path | str, product: str, satellite: str, date: str) -> list[Path]:
    """The files of a product of a day, plain or gzipped, oldest version first."""
    found = Path(folder).glob(f"{product}_{date}_{satellite}_??.txt*")
    return sorted(path for path in found if NAME.match(path.name))


def _table(folder: Path | str, product: str, satellite: str, date: str) -> Table:
    return read(find(folder, product, satellite, date), product, satellite, date)


def raw(folder: Path | str, satellite: str, date: str) -> tuple[Telemetry, np.ndarray]:
    """Sensors of one satellite on one day, in GPS time, and which camera epochs stand at an edge of the clock (n,).

    Cameras are taken where sca_confid <= 5 and no flag speaks against them (`refused`); TIM1B and CLK1B of the
    neighbouring days are used where they are in the folder and, where not, the edges are marked. Raises Level1Error as
    the readers do.
    """
    day = datetime.date.fromisoformat(date)
    around = [(day + datetime.timedelta(days=k)).isoformat() for k in (-1, 1)]
    origin = gps_second(date)
    sca, imu = (_table(folder, product, satellite, date) for product in ("SCA1A", "IMU1A"))
    tables: dict[str, list[Table]] = {}
    for product in ("TIM1B", "CLK1B"):
        files = [find(folder, product, satellite, date)]
        files += [p for other in around for p in versions(folder, product, satellite, other)[-1:]]
        tables[product] = [read(path, product, satellite) for path in files]
    time = clock(tables["TIM1B"], tables["CLK1B"], origin)
    q_qsa = qsa(folder, satellite, date)
    sca = sca.where(sca["sca_confid"] <= WORST_CONFIDENCE)
    if not len(sca):
        raise Level1Error(f"{sca.path}: no record with sca_confid <= {WORST_CONFIDENCE} is left.")
    sca = _unflagged(sca, "sca_mode", "qualflg")
    imu = _unflagged(imu, "qualflg")
    t, edge = time.gps(seconds(sca["rcvtime_intg"], sca["rcvtime_frac"], 10**6, origin))
    t_camera, q_camera, first = _by_camera(t, sca["sca_id"], sca.stacked(*QUATERNION))
    t_all, _ = time.gps(seconds(imu["time_intg"], imu["time_frac"], 10**6, origin))
    t_gyro, angle = _by_axis(t_all, imu["gyro_id"], imu["FiltAng"], imu.path)
    return Telemetry(satellite, origin, t_camera, q_camera, q_qsa, t_gyro, angle), edge[first]


def refused(table: Table, name: str) -> np.ndarray:
    """Records (n,) whose flags `name` say, by the header's own words, that they are no good.

    A bit refuses a record where its meaning speaks of invalid data, the Sun, the Moon or objects that are no stars;
    "1=valid" refuses where the bit is not set. Bits that are set and not explained are warned of, and the records used:
    a bit has other meanings in GRACE and GRACE-FO.
    """
    texts = table[name]
    if any(text.strip("01") for text in np.unique(texts)):
        text = f"{name} is {str(texts[0])!r}, not a string of 0 and 1; it was not used."
        warnings.warn(f"{table.path}: {text}", Level1Warning, stacklevel=4)
        return np.zeros(len(texts), bool)
    bits, meanings = flag_bits(texts), flag_meanings(table.header, name)
    valid = sum(1 << bit for bit, text in meanings.items() if VALID.search(text))
    bad = sum(1 << bit for bit, text in meanings.items() if REFUSED.search(text) and not VALID.search(text))
    dark = (bits & ~sum(1 << bit for bit in meanings)) != 0
    if dark.any():
        warnings.warn(
            f"{table.path}: {name} of {int(dark.sum())} of {len(dark)} records has bits set that the header does not "
            f"explain, as {texts[int(np.argmax(dark))]}; the records were used.", Level1Warning, stacklevel=4,
        )  # fmt: skip
    return (bits & bad != 0) | (bits & valid != valid)


def _unflagged(table: Table, *names: str) -> Table:
    """The records that no flag refuses, with a warning. Raises Level1Error where nothing is left."""
    bad = np.any([refused(table, name) for name in names], axis=0)
    if bad.all():
        raise Level1Error(f"{table.path}: the flags {' and '.join(names)} refuse all {len(bad)} records.")
    if bad.any():
        left_out = f"{int(bad.sum())} of {len(bad)} records left out by their flags {' and '.join(names)}"
        warnings.warn(f"{table.path}: {left_out}.", Level1Warning, stacklevel=3)
    return table.where(~bad)


def qsa(folder: Path | str, satellite: str, date: str) -> Array:
    """Mounting quaternions (3, 4) from the last rows of QSA1B, or with a warning those of the model."""
    try:
        table = read(find(folder, "QSA1B", satellite, date), "QSA1B", satellite)
    except Level1Error as error:
        warnings.warn(f"{error} The mounting of GRACE-C that the book holds is used.", Level1Warning, stacklevel=2)
        return mounting()
    out = np.empty((3, 4))
    for camera, mask in enumerate((1, 2, 4)):
        rows = np.flatnonzero(table["sca_id"] == mask)
        if not len(rows):
            rows = np.flatnonzero(table["sca_id"] == camera + 1)  # some files number the cameras instead
        if not len(rows):
            raise Level1Error(f"{table.path}: camera {camera + 1} is missing.")
        out[camera] = table.stacked(*QUATERNION)[rows[-1]]
    return normalise(out)


def _by_camera(t: Array, camera: np.ndarray, q: Array) -> tuple[Array, Array, np.ndarray]:
    """Rows of interleaved cameras to (n,) epochs and (3, n, 4) quaternions, and the first row of each epoch."""
    order = np.argsort(t, kind="stable")
    t, camera, q = t[order], camera[order], q[order]
    new = np.concatenate([[True], np.diff(t) > SAME_EPOCH])
    epoch = np.cumsum(new) - 1
    out = np.full((3, int(epoch[-1]) + 1, 4), np.nan)
    for i in range(3):
        mine = camera == i + 1
        out[i, epoch[mine]] = q[mine]
    return t[new], out, order[new]


def _by_axis(t: Array, axis: np.ndarray, angle: Array, path: Path) -> tuple[Array, Array]:
    """Rows of interleaved axes to (4, m) times and angles, padded with NaN; an axis without a row is all NaN."""
    groups = [np.flatnonzero(axis == k) for k in (1, 2, 3, 4)]
    m = max(len(group) for group in groups)
    there = [k for k, group in enumerate(groups, 1) if len(group)]
    if len(there) < 3:
        raise Level1Error(f"{path}: records of gyro axes {there} only, of 1 to 4 at least three are needed.")
    times, angles = np.full((4, m), np.nan), np.full((4, m), np.nan)
    for k, group in enumerate(groups):
        group = group[np.argsort(t[group], kind="stable")]
        times[k, : len(group)], angles[k, : len(group)] = t[group], angle[group]
    return times, angles


def orbit(folder: Path | str, satellite: str, date: str, product: str = "GNI1B") -> tuple[Array, Array, Array]:
    """Times (n,) [s after the day's start], positions and velocities (n, 3) in the ICRF, from GNI1B.

    Raises Level1Error for Earth-fixed states (coord_ref E, as GNV1B gives): they would need the Earth's rotation first.
    """
    table = _table(folder, product, satellite, date)
    if (table["coord_ref"] != "I").any():
        k = int(np.argmax(table["coord_ref"] != "I"))
        raise Level1Error(
            f"{table.path}: coord_ref is {table['coord_ref'][k]} at {table['gps_time'][k]} s, inertial states (I) are "
            "needed; "
            "give GNI1B, or turn GNV1B into the ICRF first."
        )
    t = (table["gps_time"] - gps_second(date)).astype(float)
    r, v = table.stacked("xpos", "ypos", "zpos"), table.stacked("xvel", "yvel", "zvel")
    _in_orbit(table, t, r, v)
    return t, r, v


def _in_orbit(table: Table, t: Array, r: Array, v: Array) -> None:
    """Refuse positions that are no orbit's, and states that disagree with their neighbours."""
    radius = np.linalg.norm(r, axis=1)
    off = (radius < LOWEST) | (radius > HIGHEST)
    if off.any():
        k = int(np.argmax(off))
        raise Level1Error(
            f"{table.path}: the state at gps_time {table['gps_time'][k]} is {1e-3 * radius[k]:.6g} km from the Earth's "
            f"centre, as are {int(off.sum())} of {len(t)}; positions in metres, in orbit, are needed."
        )
    step = np.diff(t)
    miss = np.linalg.norm(np.diff(r, axis=0) - 0.5 * step[:, None] * (v[1:] + v[:-1]), axis=1)
    off = (miss > 10.0 + 2e-3 * step**3) & (step <= 60.0)  # the trapezoid's own error is below 1.1e-3 step^3
    if off.any():
        k = int(np.argmax(off))
        k += k + 1 < len(off) and bool(off[k + 1])  # a spike spoils the steps on both sides of it
        raise Level1Error(
            f"{table.path}: the state at gps_time {table['gps_time'][k]} disagrees with its neighbours by "
            f"{miss[k]:.6g} m ({int(off.sum())} such steps); correct or remove it."
        )


def accelerations(folder: Path | str, satellite: str, date: str) -> tuple[Array, Array]:
    """Times (n,) [s after the day's start] and linear accelerations (n, 3) [m/s^2] in the SRF, from ACT1B."""
    table = _table(folder, "ACT1B", satellite, date)
    t = (table["gps_time"] - gps_second(date)).astype(float)
    return t, table.stacked("lin_accl_x", "lin_accl_y", "lin_accl_z")


def flight(folder: Path | str, date: str = "") -> Recording:
    """Both satellites on the first day (or `date`) in a folder, at the whole seconds that all sensors have in common.

    Raises Level1Error where files are missing, too short or have gaps in the orbit.
    """
    days = dates(folder)
    if not days:
        raise Level1Error(
            f"{folder}: no SCA1A_YYYY-MM-DD_S_VV.txt; give the folder of GRACE-FO Level-1A and 1B files of one day."
        )
    if not date and len(days) > 1:
        warnings.warn(
            f"{folder}: files of {len(days)} days; the first, {days[0]}, is taken.", Level1Warning, stacklevel=3
        )
    date = date or days[0]
    sensors, edges = {}, {}
    for s in SATELLITES:
        sensors[s], edges[s] = raw(folder, s, date)
    orbits = {s: orbit(folder, s, date) for s in SATELLITES}
    reach = [_reach(sensors[s]) for s in SATELLITES]
    first = max(*(r[0] for r in reach), *(o[0][0] for o in orbits.values()))
    last = min(*(r[1] for r in reach), *(o[0][-1] for o in orbits.values()))
    t = np.arange(np.ceil(first - cameras.SNAP), np.floor(last + cameras.SNAP) + 0.5)
    if len(t) < 60:
        raise Level1Error(f"{folder}: sensors and orbits of {date} have only {len(t)} seconds in common.")
    r, v, linear, edge = {}, {}, {}, {}
    for s in SATELLITES:
        edge[s] = t[edges[s][_nearest(sensors[s].t_camera, t)]]
        if len(edge[s]):
            warnings.warn(
                f"{folder}: {len(edge[s])} seconds of GRACE-{s} from {edge[s][0]:g} s on stand at an edge of its clock "
                "(TIM1B, CLK1B; the files of the neighbouring days are needed); they are filtered and left out of the "
                "statistics.",
                Level1Warning, stacklevel=3,
            )  # fmt: skip
        seconds, position, velocity = orbits[s]
        pick = np.searchsorted(seconds, t)
        if not (np.abs(seconds[np.minimum(pick, len(seconds) - 1)] - t) < 1e-6).all():
            raise Level1Error(
                f"{folder}: GNI1B of {s} has gaps between {t[0]:g} and {t[-1]:g} s; a whole arc at 1 Hz is needed."
            )
        r[s], v[s] = position[pick], velocity[pick]
        if versions(folder, "ACT1B", s, date):
            linear |= _accelerations(folder, s, date, t)
        sensors[s] = _trim(sensors[s], t[0], t[-1])
    return Recording(t, sensors, r, v, {}, linear, edge)


def _accelerations(folder: Path, satellite: str, date: str, t: Array) -> dict[str, Array]:
    """Linear accelerations (n, 3) at t, under the satellite's letter; none, with a warning, where they have a hole."""
    seconds, a = accelerations(folder, satellite, date)
    gap = max(np.diff(seconds, prepend=t[0], append=t[-1]), default=np.inf)
    if gap > LONGEST_GAP:
        warnings.warn(
            f"{folder}: ACT1B of {satellite} has a hole of {gap:g} s; the accelerations are left out.",
            Level1Warning, stacklevel=4,
        )  # fmt: skip
        return {}
    return {satellite: np.stack([np.interp(t, seconds, a[:, i]) for i in range(3)], axis=1)}


def _nearest(grid: Array, t: Array) -> np.ndarray:
    """Index of the nearest of increasing epochs (m,) to each of t (n,)."""
    right = np.clip(np.searchsorted(grid, t), 1, len(grid) - 1)
    return right - (t - grid[right - 1] < grid[right] - t)


def _reach(telemetry: Telemetry) -> tuple[float, float]:
    """First and last time [s] at which all sensors have data, a second for interpolation left at either end."""
    t = telemetry.t_gyro[[axis - 1 for axis in gyro.present(telemetry)]]
    cameras = telemetry.t_camera
    return max(cameras[0], np.nanmin(t, axis=1).max() + 1), min(cameras[-1], np.nanmax(t, axis=1).min() - 1)


def _trim(telemetry: Telemetry, first: float, last: float) -> Telemetry:
    keep = (telemetry.t_camera > first - 0.75) & (telemetry.t_camera < last + 0.75)
    return replace(telemetry, t_camera=telemetry.t_camera[keep], q_camera=telemetry.q_camera[:, keep])
