"""Frames: the Earth-fixed one turning uniformly in the inertial one, and the local (east, north, up) one.

``R_ab`` takes components from frame b to frame a. The Earth-fixed frame is ECEF = Rz(omega t) ECI: both coincide at t
= 0, no precession, nutation or polar motion.
"""

from __future__ import annotations

import numpy as np


def rotation_z(angle: np.ndarray | float) -> np.ndarray:
    """Rotation of the axes about z, Rz(angle) = [[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]].

    angle : (...) [rad]
    Returns (..., 3, 3): the matrix R_ab of a frame a turned by `angle` about the z axis of frame b.
    """
    angle = np.asarray(angle, dtype=float)
    c, s = np.cos(angle), np.sin(angle)
    R = np.zeros((*angle.shape, 3, 3))
    R[..., 0, 0] = R[..., 1, 1] = c
    R[..., 0, 1] = s
    R[..., 1, 0] = -s
    R[..., 2, 2] = 1.0
    return R


def ecef_from_eci(t: np.ndarray | float, omega: float) -> np.ndarray:
    """R_ecef_eci at times t (...) [s] for the rotation rate omega [rad s^-1]: (..., 3, 3)."""
    return rotation_z(np.multiply(omega, t))


def to_ecef(t: np.ndarray | float, v_eci: np.ndarray, omega: float) -> np.ndarray:
    """Earth-fixed components of vectors given in inertial ones: v_ecef = Rz(omega t) v_eci.

    t : (n,) or scalar [s]
    v_eci : (n, ..., 3), time on the first axis; (..., 3) for a scalar time
    omega : rotation rate [rad s^-1]
    Returns an array of the shape of v_eci. Raises ValueError when the times do not fit.
    """
    return _turn(t, v_eci, omega)


def to_eci(t: np.ndarray | float, v_ecef: np.ndarray, omega: float) -> np.ndarray:
    """Inertial components of vectors given in Earth-fixed ones, the inverse of `to_ecef`."""
    return _turn(t, v_ecef, -omega)


def _turn(t: np.ndarray | float, v: np.ndarray, rate: float) -> np.ndarray:
    t, v = np.asarray(t, dtype=float), np.asarray(v, dtype=float)
    if v.ndim == 0 or v.shape[-1] != 3:
        raise ValueError(f"vectors have shape {v.shape}, their last axis must be x, y, z.")
    if t.ndim > 1 or (t.ndim == 1 and v.shape[0] != t.shape[0]):
        raise ValueError(
            f"times of shape {t.shape} do not fit vectors of shape {v.shape}: time goes on the first axis."
        )
    angle = (rate * t).reshape(t.shape + (1,) * (v.ndim - 1 - t.ndim))
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * v[..., 0] + s * v[..., 1], c * v[..., 1] - s * v[..., 0], v[..., 2]], axis=-1)


def velocity_to_ecef(t: np.ndarray | float, r_eci: np.ndarray, v_eci: np.ndarray, omega: float) -> np.ndarray:
    """Velocity as seen from the turning Earth, v_ecef = Rz(omega t) (v_eci - omega x r_eci); shapes as in `to_ecef`."""
    r_eci = np.asarray(r_eci, dtype=float)
    turning = np.stack([-omega * r_eci[..., 1], omega * r_eci[..., 0], np.zeros_like(r_eci[..., 2])], axis=-1)
    return to_ecef(t, v_eci - turning, omega)


def spherical(r: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radius [m], geocentric latitude and longitude [rad] of positions r (..., 3) [m]; longitude in (-pi, pi]."""
    r = np.asarray(r, dtype=float)
    across = np.hypot(r[..., 0], r[..., 1])
    return np.hypot(across, r[..., 2]), np.arctan2(r[..., 2], across), np.arctan2(r[..., 1], r[..., 0])


def enu_from_ecef(r_ecef: np.ndarray) -> np.ndarray:
    """R_enu_ecef at positions r_ecef (..., 3): rows are the unit vectors (east, north, up) of the sphere.

    Returns (..., 3, 3). On the axis of the Earth east is taken at longitude 0.
    """
    _, phi, lam = spherical(r_ecef)
    cp, sp, cl, sl = np.cos(phi), np.sin(phi), np.cos(lam), np.sin(lam)
    east = np.stack([-sl, cl, np.zeros_like(sl)], axis=-1)
    north = np.stack([-sp * cl, -sp * sl, cp], axis=-1)
    up = np.stack([cp * cl, cp * sl, sp], axis=-1)
    return np.stack([east, north, up], axis=-2)
