"""The pair of satellites as the paper models it: the scenario, the range relations and the nine-state kinematic model.

Source throughout: Sharifi, Farzaneh & Amootaghi (2019), with the errata of the book's page; equation numbers are
theirs.
The relative vectors are leading minus trailing satellite, ``dr = r_A - r_B``, in the inertial frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geokalman import memory
from geokalman.kalman.checks import array, covariance
from geokalman.kalman.discretise import white_jerk
from geokalman.physics.field import EARTH
from geokalman.physics.harmonics import GravityField, load_field

Array = NDArray[np.float64]

POSITION, VELOCITY, ACCELERATION = slice(0, 3), slice(3, 6), slice(6, 9)
"""Parts of the relative state x = [dr, dv, da] [m, m/s, m/s^2] of equation (50)."""

DAY = 86400.0
_EPOCH = 3000.0  # bytes for an epoch: orbits, a filter's predicted and updated states and covariances, a smoother's
LOWEST_PERIGEE = 150e3  # m above the reference radius: below it no satellite completes a revolution


@dataclass(frozen=True)
class Scenario:
    """What is flown: field, orbit of the trailing satellite, separation in time, sampling and integrator. SI and
    radians.

    The leading satellite A starts in the state that the trailing one, B, reaches after `tau` seconds. With `start` =
    "same-elements" it starts on B's osculating elements with a later mean anomaly instead: a pitfall, since the mean
    semi-major axes then differ by half a kilometre.

    Raises ValueError, one sentence each, for a span without epochs, an orbit that is no ellipse or meets the Earth, an
    output step that the integrator's step does not divide, and an unknown integrator; TooLarge for more epochs than
    memory holds.
    """

    days: float = 30.0
    dt: float = 30.0
    n_max: int = 70
    a: float = 6834e3
    e: float = 0.0018
    inc: float = math.radians(89.0)
    raan: float = 0.3
    argp: float = 0.5
    m0: float = 0.1
    tau: float = 28.9
    integrator: str = "gj"
    h: float = 10.0
    field: str = ""
    rtol: float = 1e-12
    atol: float = 1e-9
    start: str = "time-shift"

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, float) and not math.isfinite(value):
                raise ValueError(f"{item.name} = {value} is not finite.")
        if self.days <= 0:
            raise ValueError(f"days = {self.days:g} leaves nothing to integrate; give a positive number of days.")
        if self.dt <= 0:
            raise ValueError(f"dt = {self.dt:g} s is not a sampling interval; give a positive number of seconds.")
        if self.epochs < 2:
            raise ValueError(
                f"days = {self.days:g} is shorter than one sampling interval of dt = {self.dt:g} s; give more days."
            )
        if self.n_max < 2:
            raise ValueError(f"n_max = {self.n_max} is below 2; degrees 0 and 1 are held fixed, so give 2 or more.")
        if not 0 <= self.e < 1:
            raise ValueError(f"e = {self.e:g} is not the eccentricity of an ellipse; give 0 <= e < 1.")
        memory.require(
            f"A pair of orbits of {self.epochs} epochs, with its filters,",
            _EPOCH * self.epochs,
            "give fewer days or a longer dt",
        )
        radius = self.gravity().radius
        perigee = self.a * (1 - self.e) - radius
        if perigee < LOWEST_PERIGEE:
            where = f"{abs(perigee) / 1e3:.1f} km {'below' if perigee < 0 else 'above'} the reference radius"
            raise ValueError(
                f"a_km = {self.a / 1e3:g} with e = {self.e:g}: the orbit meets the"
                f" {'Earth' if perigee < 0 else 'atmosphere'}, its perigee is {where} {radius / 1e3:.1f} km; give one"
                f" at least {LOWEST_PERIGEE / 1e3:g} km above it."
            )
        if self.tau <= 0:
            raise ValueError(f"tau_s = {self.tau:g} s does not separate the satellites; give a positive time.")
        if self.start not in ("time-shift", "same-elements"):
            raise ValueError(f"start = {self.start!r} is unknown; give time-shift or same-elements.")
        if self.integrator not in ("gj", "dop853", "rk45"):
            raise ValueError(f"integrator = {self.integrator!r} is unknown; give gj, dop853 or rk45.")
        if self.integrator != "rk45":
            steps = self.dt / self.h if self.h > 0 else 0.0
            if abs(steps - round(steps)) > 1e-9 or round(steps) < 1:
                raise ValueError(
                    f"h_int = {self.h:g} s does not divide dt = {self.dt:g} s; give a step that goes into dt a whole"
                    " number of times."
                )

    @classmethod
    def from_parameters(cls, parameters: dict[str, Any], **changes: Any) -> Scenario:
        """The scenario of a notebook's parameters: `a_km`, `inc_deg`, `tau_s` and `h_int` carry their units, the rest
        are SI.

        `h_int` = None means the largest step that divides dt, up to 10 s for Gauss-Jackson and 15 s for DOP853.
        """
        p = {**parameters, **changes}
        given = {
            name: p[name]
            for name in (
                "days",
                "dt",
                "n_max",
                "e",
                "raan",
                "argp",
                "m0",
                "integrator",
                "field",
                "rtol",
                "atol",
                "start",
            )
            if name in p
        }
        if "a_km" in p:
            given["a"] = 1e3 * p["a_km"]
        if "inc_deg" in p:
            given["inc"] = math.radians(p["inc_deg"])
        if "tau_s" in p:
            given["tau"] = p["tau_s"]
        step = p.get("h_int")
        given["h"] = (
            default_step(given.get("integrator", cls.integrator), given.get("dt", cls.dt)) if step is None else step
        )
        return cls(**given)

    @property
    def epochs(self) -> int:
        """Number of epochs, both ends included: 86401 for 30 days at 30 s."""
        return math.floor(self.days * DAY / self.dt + 1e-9) + 1

    @property
    def t(self) -> Array:
        """Epochs [s], (n,)."""
        return self.dt * np.arange(self.epochs)

    def gravity(self) -> GravityField:
        """The field that is flown, truncated at `n_max`; raises ValueError for one that is not the Earth's."""
        return load_field(self.field or "EGM96", self.n_max, EARTH)


def default_step(integrator: str, dt: float) -> float:
    """Step [s] that keeps the relative orbit at rounding level: the largest divisor of dt up to 10 s (gj) or 15 s
    (dop853)."""
    longest = {"gj": 10.0, "dop853": 15.0}.get(integrator, dt)
    return dt / math.ceil(dt / longest - 1e-9)


@dataclass(frozen=True)
class Tuning:
    """Weights of the kinematic filters, given by the two dimensionless numbers that alone matter without noise.

    lambda_q = q h^5 / sigma_r^2 and mu = sigma_rr h / sigma_r, with h the sampling interval, q the power spectral
    density of the jerk per axis [m^2 s^-5], sigma_r [m] of each component of dr and sigma_rr [m/s] of the range-rate.
    alpha, beta, kappa are those of equations (32), (35), (36).

    Raises ValueError for a sigma, lambda_q or mu that is not positive.
    """

    lambda_q: float = 4250.0
    mu: float = 9.0
    sigma_r: float = 1e-3
    alpha: float = 1.0
    beta: float = 0.0
    kappa: float = 2.0

    def __post_init__(self) -> None:
        for name in ("lambda_q", "mu", "sigma_r", "alpha"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} = {value:g} is not a positive number; a filter cannot weigh with it.")
        if not math.isfinite(self.beta):
            raise ValueError(f"beta = {self.beta:g} is not finite; the paper has 0, and 2 suits Gaussians.")
        if not 0 < 9 + self.kappa < math.inf:
            raise ValueError(
                f"kappa = {self.kappa:g} does not make n + kappa positive and finite for the n = 9 states; give kappa"
                " > -9."
            )

    @classmethod
    def from_parameters(cls, parameters: dict[str, Any], dt: float, **changes: Any) -> Tuning:
        """The tuning of a notebook's parameters; `filter_sigma_r` and `filter_sigma_rr`, where given, set the sigmas
        directly."""
        p = {**parameters, **changes}
        given = {name: p[name] for name in ("lambda_q", "mu", "sigma_r", "alpha", "beta", "kappa") if name in p}
        if p.get("filter_sigma_r") is not None:
            given["sigma_r"] = p["filter_sigma_r"]
        if p.get("filter_sigma_rr") is not None:
            given["mu"] = p["filter_sigma_rr"] * dt / given.get("sigma_r", cls.sigma_r)
        return cls(**given)

    @classmethod
    def from_densities(cls, dt: float, q: float, sigma_r: float, sigma_rr: float, **sigma_points: float) -> Tuning:
        """The tuning with jerk density q [m^2 s^-5], sigma_r [m] and sigma_rr [m/s] at the sampling interval dt [s]."""
        return cls(lambda_q=q * dt**5 / sigma_r**2, mu=sigma_rr * dt / sigma_r, sigma_r=sigma_r, **sigma_points)

    def q(self, dt: float) -> float:
        """Power spectral density of the jerk, per axis [m^2 s^-5]."""
        return self.lambda_q * self.sigma_r**2 / dt**5

    def sigma_rr(self, dt: float) -> float:
        """Standard deviation of the range-rate [m/s] that the filter assumes."""
        return self.mu * self.sigma_r / dt


@dataclass(frozen=True)
class Observations:
    """What a method may see: epochs every dt [s], relative positions (n, 3) [m], range-rates (n,) [m/s], and a prior.

    A missing observation is NaN. The prior is N(prior_mean (9,), prior_cov (9, 9)) of [dr, dv, da] at the first epoch.
    Raises ValueError for shapes that do not fit, an infinite observation (naming the epoch), a prior that is not finite
    or not symmetric; NotPositiveDefinite for a prior covariance with a negative eigenvalue.
    """

    dt: float
    baseline: Array
    rate: Array
    prior_mean: Array
    prior_cov: Array

    def __post_init__(self) -> None:
        if not 0 < self.dt < math.inf:
            raise ValueError(f"dt = {self.dt:g} s is not a sampling interval; give a positive number of seconds.")
        object.__setattr__(self, "prior_mean", array("prior_mean", self.prior_mean, 9))
        object.__setattr__(self, "prior_cov", covariance("prior_cov", self.prior_cov, 9))
        n = len(self.baseline)
        if self.baseline.shape != (n, 3) or self.rate.shape != (n,):
            raise ValueError(
                f"relative positions of shape {self.baseline.shape} and range-rates of shape {self.rate.shape} do not"
                " belong together; give (n, 3) and (n,)."
            )
        for name, series in (("relative position", self.baseline), ("range-rate", self.rate)):
            bad = np.isinf(series.reshape(n, -1)).any(axis=1)
            if bad.any():
                raise ValueError(f"the {name} at epoch {int(bad.argmax())} is infinite; a missing observation is NaN.")


def kinematic(dt: float, q: float) -> tuple[Array, Array]:
    """Transition matrix (50) and process noise (51) of x = [dr, dv, da] under white jerk of density q: two (9, 9)."""
    return white_jerk(dt, q, axes=3)


def distance(dr: Array) -> Array:
    """Range (44): rho = |dr| [m]; dr is (..., 3)."""
    return np.sqrt(np.einsum("...i,...i", dr, dr))


def range_rate(dr: Array, dv: Array) -> Array:
    """Range-rate (45): <dv, dr> / rho [m/s]; (..., 3) each.

    Computed from a state, never from differences of ranges: at a few seconds the rounding of rho (3e-11 m) would show.
    """
    return np.einsum("...i,...i", dr, dv) / distance(dr)


def range_acceleration(dr: Array, dv: Array, da: Array) -> Array:
    """Range-acceleration (46, corrected): (<dv, dv> + <dr, da> - range_rate^2) / rho [m/s^2]."""
    rho, rate = distance(dr), range_rate(dr, dv)
    return (np.einsum("...i,...i", dv, dv) + np.einsum("...i,...i", dr, da) - rate**2) / rho


def los_gravity(rho: Array, rate: Array, acceleration: Array, dv: Array) -> Array:
    """Line-of-sight gravity difference (47, corrected), no surface forces: rho'' - (<dv, dv> - rho'^2) / rho [m/s^2].

    rho, rate, acceleration: (n,) range and its derivatives [m, m/s, m/s^2]; dv: (n, 3) [m/s].
    With the range-acceleration of a state by (46) this is identically e . da.
    """
    return acceleration - (np.einsum("...i,...i", dv, dv) - rate**2) / rho


def los_acceleration(dr: Array, da: Array) -> Array:
    """Relative acceleration along the line of sight, e . da with e = dr / rho [m/s^2]."""
    return np.einsum("...i,...i", dr, da) / distance(dr)
