"""What an experiment is of: pulsars, orbiter, mission, and the presets A to E.

Source throughout: Wei, Yang, Zhang, Liu & Yi (2014); its tables are lost, so what stands here is a reconstruction: see
the page of the paper for the source of each value. Equation numbers are the paper's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geokalman.constants import C_LIGHT
from geokalman.physics import mars
from geokalman.pulsar.catalogue import PULSARS, directions, ranging_sigma

Array = NDArray[np.float64]

STEP = 500.0
"""Interval between epochs [s]; an observation lasts as long."""
CENTURIES = 0.14
"""Julian centuries TDB since J2000 at which the Mars equator is frozen as inertial frame in all presets."""
CLOCK = C_LIGHT * 1e-9
"""Clock error of 1e-9 s [m]: a constant."""
TRANSFER = C_LIGHT * 1e-7
"""Error of the transfer of the timing model of 1e-7 s [m]: white in every observation, unless an experiment says
otherwise."""
DAY = 86400.0


class Orbit(NamedTuple):
    """Elements in the inertial Mars equatorial frame [m, -, rad ...], and the epoch JD TDB."""

    a: float = 3780e3
    e: float = 0.0085
    inc: float = math.radians(92.9)
    raan: float = math.radians(30.0)
    argp: float = math.radians(270.0)
    m0: float = 0.0
    epoch: float = 2456658.5


@dataclass(frozen=True)
class World:
    """What is true of an experiment, unknown to its filters.

    mismatch : lambda of the true field, a = a_J2 + lambda (a_rich - a_J2): 0 is J2, 1 the rich field; sigma_scale : of
    range and transfer noise; error : of every component of the initial estimate [m, m/s]; transfer_scale : of the
    transfer noise, where it is not that of the ranges.
    Raises ValueError for a scale that is not positive and an error that is not finite.
    """

    mismatch: float = 0.0
    sigma_scale: float = 1.0
    error: tuple[float, float] = (0.0, 0.0)
    transfer_scale: float | None = None

    def __post_init__(self) -> None:
        _require_positive(sigma_scale=self.sigma_scale, transfer_scale=self.transfer)
        if not all(map(math.isfinite, self.error)):
            raise ValueError(f"error = {self.error} of the initial estimate must be finite.")

    @property
    def transfer(self) -> float:
        """Factor of the transfer noise."""
        return self.sigma_scale if self.transfer_scale is None else self.transfer_scale


@dataclass(frozen=True)
class Belief:
    """What a filter believes of its start and of its motion.

    noise : "qd" for diag(q_pos^2 x3, q_vel^2 x3) [m, m/s] per 500 s, "qc" for white acceleration q_acc [m/s^1.5];
    p0 : sigmas of initial position [m] and velocity [m/s].
    Raises ValueError for sigmas that are not positive and another noise.
    """

    noise: str = "qd"
    q_pos: float = 1.0
    q_vel: float = 1e-3
    q_acc: float = 1e-7
    p0: tuple[float, float] = (1e3, 1.0)

    def __post_init__(self) -> None:
        _require_positive(q_pos=self.q_pos, q_vel=self.q_vel, q_acc=self.q_acc)
        if not (min(self.p0) > 0 and all(map(math.isfinite, self.p0))):
            raise ValueError(f"p0 = {self.p0}: sigmas must be positive and finite.")
        if self.noise not in ("qd", "qc"):
            raise ValueError(f"noise = {self.noise!r} is unknown; give qd or qc.")

    def process_noise(self, dt: float) -> Array:
        """Give Q of a step of dt [s] (6, 6): that of 500 s, in proportion, or integrated (qc)."""
        if self.noise == "qd":
            return np.diag(np.repeat([self.q_pos**2 * dt / STEP, self.q_vel**2 * dt / STEP], 3))
        q2 = self.q_acc**2
        return np.kron([[q2 * dt**3 / 3, q2 * dt**2 / 2], [q2 * dt**2 / 2, q2 * dt]], np.eye(3))

    @property
    def P0(self) -> Array:
        """Initial covariance (6, 6)."""
        return np.diag(np.repeat(self.p0, 3) ** 2)


def _require_positive(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} = {value:g} is not a positive number.")


@dataclass(frozen=True)
class Preset:
    """A named experiment: its world, the filters' belief, and (q_pos, q_vel) of a tuned one."""

    name: str
    meaning: str
    world: World
    belief: Belief
    tuned: tuple[float, float] | None = None

    def tuned_belief(self) -> Belief:
        """Give the belief with the tuned process noise. Raises ValueError where none is defined."""
        if self.tuned is None:
            raise ValueError(f"preset {self.name} defines no tuned process noise; C and E do.")
        return replace(self.belief, noise="qd", q_pos=self.tuned[0], q_vel=self.tuned[1])


REAL = World(mismatch=1.0)
PRESETS = {
    p.name: p
    for p in (
        Preset("A", "over-confident start", World(error=(1000.0, 0.5)), Belief("qc", p0=(10.0, 0.01))),
        Preset("B", "everything consistent", World(), Belief("qc")),
        Preset("C", "J2 filter in the real field, process noise too small", REAL, Belief(), tuned=(150.0, 0.6)),
        Preset("D", "J2 filter in the real field, process noise tuned", REAL, Belief(q_pos=150.0, q_vel=0.6)),
        Preset("E", "as C, with ranges 15 times more accurate", World(1.0, 0.067), Belief(), tuned=(70.0, 0.28)),
    )
}


def preset(name: str, **changes: Any) -> Preset:
    """Give the preset of that name, with changes of world and belief that are not None.

    Raises ValueError for another name.
    """
    if name not in PRESETS:
        raise ValueError(f"preset {name!r} is unknown; the presets are {', '.join(PRESETS)}.")
    chosen, given = PRESETS[name], {key: value for key, value in changes.items() if value is not None}
    world = {key: given.pop(key) for key in ("mismatch", "sigma_scale", "error", "transfer_scale") if key in given}
    return replace(chosen, world=replace(chosen.world, **world), belief=replace(chosen.belief, **given))


@dataclass(frozen=True)
class Mission:
    """The orbiter, how long it is observed and by which pulsars.

    Raises ValueError for a span without epochs and for pulsars that are unknown or named twice.
    """

    orbit: Orbit = Orbit()
    days: float = 5.0
    pulsars: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 7)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.days) and self.days * DAY >= STEP):
            raise ValueError(f"days = {self.days:g} leaves no epoch; they are {STEP:g} s apart.")
        object.__setattr__(self, "pulsars", tuple(self.pulsars))
        unknown = [k for k in self.pulsars if not 1 <= k <= len(PULSARS)]
        if unknown or not self.pulsars:
            raise ValueError(f"pulsars = {list(self.pulsars)}: give numbers of Table 1, 1 to {len(PULSARS)}.")
        if len(set(self.pulsars)) < len(self.pulsars):
            raise ValueError(f"pulsars = {list(self.pulsars)} names one twice; each gives one observation an epoch.")

    @classmethod
    def from_parameters(cls, parameters: dict[str, Any]) -> Mission:
        """Make the mission of a notebook's parameters `raan_deg`, `days` and `pulsars`."""
        p = parameters
        orbit = Orbit(raan=math.radians(p["raan_deg"])) if "raan_deg" in p else Orbit()
        return cls(orbit, p.get("days", cls.days), tuple(p.get("pulsars", cls.pulsars)))

    @property
    def epochs(self) -> int:
        """Number of observation epochs, k = 1 ... : 864 for five days."""
        return math.floor(self.days * DAY / STEP + 1e-9)

    @property
    def t(self) -> Array:
        """Times of the observations [s], (n,): the first is 500 s after the initial state."""
        return STEP * np.arange(1.0, self.epochs + 1)

    @property
    def columns(self) -> list[int]:
        """Columns of the observed pulsars in arrays of all seven."""
        return [k - 1 for k in self.pulsars]

    def H(self) -> Array:
        """Give the directions to the observed pulsars: the position columns of (13), (m, 3)."""
        return np.ascontiguousarray(all_directions()[self.columns])

    def sigmas(self) -> Array:
        """Give the ranging accuracy (14)-(16) of the observed pulsars in 500 s [m], (m,)."""
        return all_sigmas()[self.columns]


def all_directions() -> Array:
    """Give unit vectors to the seven pulsars in the inertial Mars frame (7, 3)."""
    return directions(PULSARS) @ mars.icrf_from_smci(CENTURIES)


def all_sigmas() -> Array:
    """Give the ranging accuracy of the seven pulsars in 500 s with a square metre [m], (7,)."""
    return np.array([ranging_sigma(pulsar) for pulsar in PULSARS])
