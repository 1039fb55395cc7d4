"""What attitudes are used for: pointing angles, angular rates, accelerations in the ICRF, antenna offset correction."""

from __future__ import annotations

import numpy as np
from scipy.signal import welch

from geokalman.attitude.model import PHASE_CENTRE, Array, los_frame
from geokalman.physics.quaternion import difference, matrix, rotate


def antenna_frame(satellite: str) -> Array:
    """C_SRF->K (3, 3): x to the antenna's phase centre, y across it and the SRF's z, z nearest to z."""
    x = PHASE_CENTRE[satellite] / np.linalg.norm(PHASE_CENTRE[satellite])
    y = np.cross([0.0, 0.0, 1.0], x)
    y /= np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)])


def angles(q: Array, r_self: Array, r_other: Array, frame: Array | None = None) -> Array:
    """Pointing angles (n, 3) [rad], (roll, pitch, yaw), of the SRF against the line of sight. Equations (27), (28).

    M = C_LOS->SRF = R(q)' C_LOS->ICRF; roll = atan2(M23, M33), pitch = -asin(M13), yaw = atan2(M12, M11).
    frame : (3, 3), rows are the axes to point in the SRF's place, as `antenna_frame` gives; the paper points the
    antenna, which adds the constants -z/x of the phase centre to the pitch and y/x to the yaw (section 3.8).
    """
    M = np.einsum("kji,kjl->kil", matrix(q), los_frame(r_self, r_other))
    M = M if frame is None else frame @ M
    return np.stack(
        [np.arctan2(M[:, 1, 2], M[:, 2, 2]), -np.arcsin(M[:, 0, 2]), np.arctan2(M[:, 0, 1], M[:, 0, 0])], axis=1
    )


def rates(q: Array, dt: float = 1.0) -> Array:
    """Angular rates (n - 2, 3) [rad/s] in SRF axes by central differences: Log(q_k-1* q_k+1) / (2 dt)."""
    return difference(q[:-2], q[2:]) / (2 * dt)


def acceleration_difference(q_one: Array, q_other: Array, a_srf: Array) -> Array:
    """(R(q_one) - R(q_other)) a_SRF (n, 3) [m/s^2]: what two attitudes make of one accelerometer, in the ICRF."""
    return rotate(q_one, a_srf) - rotate(q_other, a_srf)


def antenna_correction(q_C: Array, q_D: Array, r_C: Array, r_D: Array) -> Array:
    """K-band antenna offset correction (n,) [m], added to the biased range.

    e . R(q_C) p_C - e . R(q_D) p_D with e from C to D.
    """
    e = r_D - r_C
    e = e / np.linalg.norm(e, axis=1, keepdims=True)
    p_C, p_D = rotate(q_C, PHASE_CENTRE["C"]), rotate(q_D, PHASE_CENTRE["D"])
    return np.einsum("ki,ki->k", e, p_C - p_D)


def central_rate(series: Array, dt: float = 1.0) -> Array:
    """Central difference (n - 2, ...) of a series: (s_k+1 - s_k-1) / (2 dt)."""
    return (series[2:] - series[:-2]) / (2 * dt)


def asd(series: Array, dt: float, segment_s: float = 2048.0) -> tuple[Array, Array]:
    """Frequencies (m,) [Hz] and one-sided amplitude spectral density (m, ...), Welch with Hann windows."""
    segment = min(len(series), int(round(segment_s / dt)))
    f, psd = welch(series, 1.0 / dt, window="hann", nperseg=segment, axis=0)
    return f[1:], np.sqrt(psd[1:])


def band(series: Array, dt: float, low: float, high: float) -> Array:
    """Square root of the mean power spectral density in the band [low, high] Hz, per component."""
    f, density = asd(series, dt)
    inside = (f >= low) & (f <= high)
    if not inside.any():
        raise ValueError(
            f"the band {low:g} to {high:g} Hz holds no frequency of a series of {len(series)} samples every {dt:g} s."
        )
    return np.sqrt(np.mean(density[inside] ** 2, axis=0))
