"""What could move two attitude products, or two combinations of cameras, apart: predicted signatures, axis by axis.

Every hypothesis turns the attitude of each camera by a small rotation vector in the satellite's axes. What it does to
the combinations follows from their weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from geokalman.attitude import assess, cameras
from geokalman.attitude.model import PHASE_CENTRE, SUN, Array, Telemetry, Tuning, camera_information
from geokalman.constants import C_LIGHT
from geokalman.physics.quaternion import conjugate, difference, matrix, rotate

USES = ((1, 2), (1, 3), (2, 3), (1, 2, 3))
OBLIQUITY = np.radians(23.439)
EARTH_SPEED = 30.29e3
"""Speed of the Earth about the Sun on 1 January [m/s]."""


def late(raw: Telemetry, which: Sequence[int], samples: int = 1) -> Telemetry:
    """The same with the quaternions of some cameras so many samples (0.5 s each) late: tag k has those of k - samples.

    The first samples of these cameras are lost (NaN).
    """
    q = raw.q_camera.copy()
    for camera in which:
        q[camera - 1] = np.roll(q[camera - 1], samples, axis=0)
        q[camera - 1, :samples] = np.nan
    return replace(raw, q_camera=q)


def means(raw: Telemetry, tuning: Tuning) -> Array:
    """Mean rotation vectors (4, 3) [rad] from the combination of all cameras to those of `USES`, all three seeing."""
    q = cameras.in_satellite_axes(raw)
    keep = np.isfinite(q).all(axis=(0, 2))
    whole = cameras.combination(raw, tuning).q[keep]
    return np.array([difference(whole, cameras.combination(raw, tuning, use).q[keep]).mean(axis=0) for use in USES])


def spread(raw: Telemetry, tuning: Tuning) -> Array:
    """Largest minus smallest mean of the combinations (3,) [rad]: what the paper's Figure 2 shows."""
    return np.ptp(means(raw, tuning), axis=0)


def combined(turns: Array, q_qsa: Array, tuning: Tuning) -> Array:
    """Rotation vectors (4, 3) [rad] of the combinations of `USES` when the cameras are turned by (3, 3) [rad].

    delta = (sum L_i)^-1 sum L_i delta_i, the weights of `cameras.combine`.
    """
    L = camera_information(q_qsa, tuning.sigma, tuning.k_aniso)
    out = []
    for use in USES:
        pick = [camera - 1 for camera in use]
        out.append(np.linalg.solve(L[pick].sum(axis=0), np.einsum("cij,cj->i", L[pick], turns[pick])))
    return np.array(out)


def antenna_offset(satellite: str) -> Array:
    """Angles (3,) [rad] by which the antenna's direction stands off the x axis: (0, -z/x, y/x).

    A product whose antenna frame is missing differs by these from one that has it; by twice, where its sign is wrong.
    """
    x, y, z = PHASE_CENTRE[satellite]
    return np.array([0.0, -z / x, y / x])


def earth_velocity() -> Array:
    """Velocity (3,) [m/s] of the Earth about the Sun on the paper's day, in the ICRF."""
    pole = np.array([0.0, -np.sin(OBLIQUITY), np.cos(OBLIQUITY)])
    ahead = np.cross(pole, -SUN)
    return EARTH_SPEED * ahead / np.linalg.norm(ahead)


def aberration(q: Array, v: Array, q_qsa: Array) -> Array:
    """Turns (n, 3 cameras, 3) [rad] of cameras whose star positions are not corrected for the velocity v (n, 3) [m/s].

    A star at the boresight b stands where its catalogue has b - v'/c, v' the part of v across b, so that the camera
    reports an attitude turned by -b x v/c. q : (n, 4), SRF to ICRF.
    """
    v_srf = rotate(conjugate(q), np.broadcast_to(v, (len(q), 3)))
    b = matrix(q_qsa)[:, 2]
    return -np.cross(b[None], v_srf[:, None]) / C_LIGHT


def once_per_revolution(t: Array, series: Array, period: float) -> tuple[Array, Array]:
    """Mean (k,) and amplitude (k,) at one cycle per revolution of a series (n, k), by least squares."""
    w = 2 * np.pi / period
    A = np.column_stack([np.ones_like(t), np.cos(w * t), np.sin(w * t)])
    x = np.linalg.lstsq(A, series, rcond=None)[0]
    return x[0], np.hypot(x[1], x[2])


def common_frame(raw: Telemetry, pair: Sequence[int]) -> Array:
    """Attitudes R (n, 3, 3), SRF to ICRF, of two cameras by the common frame of their boresights.

    The half sum and the half difference of both boresights are two axes that are known in the satellite and seen in
    inertial space; the rotations about the boresights are not used at all. Source: Mandea et al. (2010). NaN where a
    camera does not see.
    """
    i, k = (camera - 1 for camera in pair)
    seen = [matrix(raw.q_camera[c])[:, :, 2] for c in (i, k)]
    known = matrix(raw.q_qsa)[[i, k], 2]

    def frame(first: Array, second: Array) -> Array:
        x = first + second
        y = first - second
        x, y = (w / np.linalg.norm(w, axis=-1, keepdims=True) for w in (x, y))
        return np.stack([x, y, np.cross(x, y)], axis=-1)

    return frame(*seen) @ frame(*known).T


def common_frame_errors(raw: Telemetry, q_reference: Array, tuning: Tuning, keep: Array) -> dict[str, Array]:
    """Rms error (3,) [rad] of each pair of cameras by the common frame over that by weights, at the epochs keep (n,).

    q_reference : (n, 4) at the epochs of the cameras.
    """
    R = matrix(q_reference[keep])
    out = {}
    for pair in combinations((1, 2, 3), 2):
        E = np.einsum("nij,nik->njk", common_frame(raw, pair)[keep], R)  # R_estimate' R_true
        e = 0.5 * np.stack([E[:, 2, 1] - E[:, 1, 2], E[:, 0, 2] - E[:, 2, 0], E[:, 1, 0] - E[:, 0, 1]], axis=1)
        weighted = difference(cameras.combination(raw, tuning, pair).q[keep], q_reference[keep])
        out["".join(map(str, pair))] = assess.rms(e) / assess.rms(weighted)
    return out


class Signature(NamedTuple):
    """What a hypothesis does: offset (3,) [rad] of the combination of all cameras, spread (3,) [rad] of the four."""

    offset: Array
    spread: Array


def mounted(q_qsa: Array, tuning: Tuning, sigma: float, draws: int = 4000) -> Signature:
    """Rms offset and mean spread with mounting errors N(0, sigma^2) [rad] per axis and camera, over draws."""
    rng = np.random.default_rng(1)
    all_ = np.array([combined(turns, q_qsa, tuning) for turns in sigma * rng.standard_normal((draws, 3, 3))])
    return Signature(assess.rms(all_[:, 3]), np.ptp(all_, axis=1).mean(axis=0))


def signatures(
    raw: Telemetry, q: Array, v: Array, tuning: Tuning, mount_err_rad: float = 1.5e-4
) -> dict[str, Signature]:
    """Signatures on one satellite, by hypothesis.

    late1, late2, late3, late123 : these cameras report one sample late; antenna, antenna_twice : the antenna's frame is
    missing in one product, or has the wrong sign; orbital, annual : aberration by the satellite's and by the Earth's
    velocity is not corrected; mounting : errors of that size. q (n, 4), v (n, 3) [m/s] : attitudes and velocities.
    """
    out = {}
    whole = cameras.combination(raw, tuning).q
    for which in ((1,), (2,), (3,), (1, 2, 3)):
        moved = late(raw, which)
        change = difference(whole, cameras.combination(moved, tuning).q)
        offset = np.nanmean(change[np.isfinite(in_all(moved))], axis=0)
        out["late" + "".join(map(str, which))] = Signature(offset, spread(moved, tuning))
    for name, factor in (("antenna", 1.0), ("antenna_twice", 2.0)):
        out[name] = Signature(factor * antenna_offset(raw.satellite), np.zeros(3))
    for name, velocity in (("orbital", v), ("annual", earth_velocity())):
        turns = combined(np.nanmean(aberration(q, velocity, raw.q_qsa), axis=0), raw.q_qsa, tuning)
        out[name] = Signature(turns[3], np.ptp(turns, axis=0))
    return out | {"mounting": mounted(raw.q_qsa, tuning, mount_err_rad)}


def in_all(raw: Telemetry) -> Array:
    """One number per camera epoch (n,), NaN where some camera does not see."""
    return raw.q_camera.sum(axis=(0, 2))
