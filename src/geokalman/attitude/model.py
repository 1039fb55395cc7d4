"""The two satellites as the paper has them: hardware, frames, the scenario that is flown and the tuning of the filters.

Conventions. Quaternions are scalar first; R(q) of an attitude maps SRF components to ICRF ones. The attitude error is
the rotation vector Log(q_estimate* q_true) in SRF axes: (roll, pitch, yaw). Time is GPS seconds past 2000-01-01
12:00:00. SRF: x along the K-band antenna to the other satellite, z to nadir. SCF: camera, z is the boresight.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from geokalman import memory
from geokalman.physics.quaternion import matrix, normalise

Array = NDArray[np.float64]

SATELLITES = ("C", "D")
AXES = ("roll", "pitch", "yaw")
EPOCH_2019 = 599572800
"""2019-01-01 00:00:00 in GPS seconds past 2000-01-01 12:00:00, the day that the paper processes."""

QSA = normalise([
    [-0.184652303391424, 0.687786333034212, 0.676514247097443, 0.187568548583640],
    [0.248295501861880, -0.040073114970771, 0.851615998360150, 0.459884420858917],
    [-0.462754561284398, 0.853119868151750, -0.042736767693831, -0.237103933460220],
])  # fmt: skip
"""SRF to SCF of the cameras of GRACE-C (QSA1B, by way of public readers); for D too, whose file was not found."""
ZENITH = np.array([0.0, 1.0, 0.0, 0.0])
"""Mounting of a camera that looks along -z exactly, as the paper says of SCA1."""
GYRO_AXES = {
    "C": np.array([
        [0.942826211, 0.001810853, 0.33327985], [-0.472597539, 0.815825089, 0.333288147],
        [-0.470092696, -0.817231401, 0.333385204], [-0.000592072, -0.000382796, -0.999999751],
    ]),
    "D": np.array([
        [0.942687237, 0.000111944, 0.33367763], [-0.471344745, 0.816437037, 0.333563632],
        [-0.471100307, -0.816914065, 0.332740005], [0.000753399, 0.000461058, -0.99999961],
    ]),
}  # fmt: skip
"""Sensitive axes of the four gyros in the IMU frame."""
IMU_TO_SRF = {
    "C": np.array([
        [-0.501252164183920, 0.865301254687325, -0.000080854668175],
        [0.865300283426991, 0.501251737450002, 0.001454374272271],
        [0.001299000425484, 0.000659044684221, -0.999998939128437],
    ]),
    "D": np.array([
        [-0.501005885615109, 0.865443870184570, 0.000100692470726],
        [0.865443802410115, 0.501005791604386, 0.000470795904316],
        [0.000356999918493, 0.000323015193725, -0.999999884106115],
    ]),
}  # fmt: skip
PHASE_CENTRE = {"C": np.array([1.4443985, -0.00017, 0.000448]), "D": np.array([1.4444575, 0.000054, 0.000230])}
"""K-band antenna phase centres in the SRF [m]."""
SUN = np.array([0.181, -0.902, -0.391]) / np.linalg.norm([0.181, -0.902, -0.391])
"""Direction of the Sun on 2019-01-01 in the ICRF."""

WRAP_DEG = 5758.0
_SECOND = 15e3  # bytes for a second of flight: both satellites with truth, sensors and all filters (9e3 measured)
GYRO_HZ = 8
CAMERA_HZ = 2
ARCSEC = math.pi / 648000.0


def gyro_matrix(satellite: str, axes: tuple[int, ...] = (1, 2, 3, 4)) -> Array:
    """H (len(axes), 3): sensitive axes of the gyros in use, in the SRF; m = H omega. Equation (2)."""
    H = GYRO_AXES[satellite] @ IMU_TO_SRF[satellite].T
    return H[[a - 1 for a in axes]]


def arw_density(arw_deg_sqrt_h: float) -> float:
    """Angle random walk of one gyro axis [rad/sqrt(s)] from deg/sqrt(h)."""
    return math.radians(arw_deg_sqrt_h) / 60.0


def mounting(mount: str = "qsa") -> Array:
    """Mounting quaternions (3, 4), SRF to SCF: the real ones, or with camera 1 exactly at the zenith."""
    q = QSA.copy()
    if mount == "zenith":
        q[0] = ZENITH
    return q


def camera_information(q_qsa: Array, sigma: float, k_aniso: float) -> Array:
    """Information matrices (3, 3, 3) [rad^-2] of the cameras in SRF axes.

    L = R(q_QSA)' diag(1, 1, 1/k^2) R(q_QSA) / sigma^2; q_qsa : (3, 4); sigma : across the boresight [rad]; k_aniso :
    how much worse about it. Source: Romans (2003).
    """
    R = matrix(q_qsa)
    return np.einsum("cki,k,ckj->cij", R, np.array([1.0, 1.0, 1.0 / k_aniso**2]) / sigma**2, R)


def los_frame(r_self: Array, r_other: Array) -> Array:
    """C_LOS->ICRF (n, 3, 3): columns x to the other satellite, y = x cross r, z = x cross y (nadir)."""
    x = r_other - r_self
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    y = np.cross(x, r_self)
    y /= np.linalg.norm(y, axis=-1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def _once(name: str, numbers: Iterable[int]) -> tuple[int, ...]:
    """Numbers in order. Raises ValueError where one occurs twice."""
    given = sorted(numbers)
    if len(set(given)) < len(given):
        raise ValueError(f"{name} = {given} names {max(given, key=given.count)} twice; name each once.")
    return tuple(given)


class _Settings:
    """What scenario and tuning share."""

    sca_sigma_arcsec: float

    @classmethod
    def from_parameters(cls, parameters: dict[str, Any], **changes: Any) -> Self:
        """Those of a notebook's parameters, whose names are those of the fields."""
        p = {**parameters, **changes}
        given = {item.name: p[item.name] for item in fields(cls) if item.name in p}
        for name in {"cameras_off", "axes"} & set(given):
            given[name] = _once(name, given[name])
        return cls(**given)

    @property
    def sigma(self) -> float:
        """Noise of a camera across its boresight [rad]."""
        return self.sca_sigma_arcsec * ARCSEC


@dataclass(frozen=True)
class Scenario(_Settings):
    """What is flown and what its sensors do; SI and radians except where a name carries its unit.

    mount_err_rad : each camera sits wrong by a constant N(0, .^2) per SRF axis. shift_s : the tag t of every camera
    carries the attitude of t - shift_s. gap_s : no camera at all for so long, from gap_start_s on. fov_rad : 1-sigma
    Gauss-Markov error of each camera per axis (three times that about the boresight), correlation time fov_tau_s.
    bias_1cpr_deg_h : gyro bias that turns once a revolution. near_wrap : start angles of axes 1 and 3 stand 20 deg
    before the range ends. Raises ValueError, one sentence each, for values that make no flight;
    TooLarge for a flight that memory does not hold.
    """

    duration_s: float = 21600.0
    arw_deg_sqrt_h: float = 7e-4
    sca_sigma_arcsec: float = 5.0
    k_aniso: float = 9.0
    mount: str = "qsa"
    mount_err_rad: float = 0.0
    cameras_off: tuple[int, ...] = ()
    gap_s: float = 0.0
    gap_start_s: float = 7200.0
    shift_s: float = 0.0
    fov_rad: float = 0.0
    fov_tau_s: float = 300.0
    bias_1cpr_deg_h: float = 0.0
    near_wrap: bool = False
    altitude: float = 490e3
    eccentricity: float = 0.0015
    inc: float = math.radians(89.0)
    raan: float = math.radians(100.0)
    argp: float = math.radians(90.0)
    separation: float = 220e3

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, float) and not math.isfinite(value):
                raise ValueError(f"{item.name} = {value} is not finite.")
        if self.duration_s < 60 or self.duration_s != int(self.duration_s):
            raise ValueError(f"duration_s = {self.duration_s:g} must be a whole number of seconds, 60 or more.")
        memory.require(f"A flight of {self.duration_s:g} s", _SECOND * self.duration_s, "give a shorter duration_s")
        for name in ("arw_deg_sqrt_h", "sca_sigma_arcsec", "k_aniso", "fov_tau_s"):
            if getattr(self, name) <= 0:
                raise ValueError(f"{name} = {getattr(self, name):g} must be positive.")
        if self.mount not in ("qsa", "zenith"):
            raise ValueError(f"mount = {self.mount!r} is unknown; give qsa or zenith.")
        if set(self.cameras_off) - {1, 2, 3} or set(self.cameras_off) == {1, 2, 3}:
            raise ValueError(
                f"cameras_off = {list(self.cameras_off)} must name some of cameras 1, 2, 3, not all of them."
            )


@dataclass(frozen=True)
class Tuning(_Settings):
    """What the filters assume.

    arw_deg_sqrt_h : of one gyro axis; axes : gyro axes in use; sca_sigma_arcsec, k_aniso : of the cameras (weights of
    their combination); apm_factor, kappa : scale of the gyro noise in the filters of the paper and in the JPL-like
    stand-in; bias_walk : of one axis [rad/s/sqrt(s)]; p0_attitude [rad^2], p0_bias [(rad/s)^2]; gate : largest NIS
    admitted (0: none); update_hz : 1 as in the paper, or 2.
    """

    arw_deg_sqrt_h: float = 7e-4
    axes: tuple[int, ...] = (1, 2, 3, 4)
    sca_sigma_arcsec: float = 5.0
    k_aniso: float = 9.0
    apm_factor: float = 1.0
    kappa: float = 3.0
    bias_walk: float = 4e-11
    p0_attitude: float = 1e-7
    p0_bias: float = 1e-12
    gate: float = 0.0
    update_hz: int = 1

    def __post_init__(self) -> None:
        for name in (
            "arw_deg_sqrt_h", "sca_sigma_arcsec", "k_aniso", "apm_factor", "kappa", "bias_walk", "p0_attitude",
            "p0_bias",
        ):  # fmt: skip
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} = {value:g} must be positive and finite.")
        if len(set(self.axes)) < 3 or set(self.axes) - {1, 2, 3, 4}:
            raise ValueError(
                f"axes = {list(self.axes)} leaves the rate undetermined; name at least three of gyro axes 1 to 4."
            )
        if self.update_hz not in (1, 2):
            raise ValueError(f"update_hz = {self.update_hz} is not offered; give 1 or 2.")

    def rate_covariance(self, satellite: str) -> Array:
        """Gyro noise density in SRF axes (3, 3) [rad^2/s]: N_axis^2 (H'H)^-1, not isotropic when an axis is missing."""
        H = gyro_matrix(satellite, self.axes)
        return arw_density(self.arw_deg_sqrt_h) ** 2 * np.linalg.solve(H.T @ H, np.eye(3))

    def bias_covariance(self, satellite: str) -> Array:
        """Density of the bias random walk in SRF axes (3, 3) [(rad/s)^2/s]."""
        return self.rate_covariance(satellite) * (self.bias_walk / arw_density(self.arw_deg_sqrt_h)) ** 2


@dataclass(frozen=True)
class Telemetry:
    """What one satellite's sensors give; times in seconds after the origin t0 (GPS seconds, an integer).

    t_camera : (n,) [s]; q_camera : (3, n, 4) SCF to ICRF, NaN where invalid; q_qsa : (3, 4) SRF to SCF;
    t_gyro : (4, m) [s], each axis at its own instants; gyro : (4, m) filtered angle [deg], wrapping at +-5758.
    """

    satellite: str
    t0: int
    t_camera: Array
    q_camera: Array
    q_qsa: Array
    t_gyro: Array
    gyro: Array
