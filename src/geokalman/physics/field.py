"""A gravity field in fully normalised spherical harmonics: the coefficients and what they mean."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geokalman.constants import GM_EARTH, R_EARTH

Array = NDArray[np.float64]
TIDE_SYSTEMS = ("tide_free", "zero_tide", "mean_tide", "unknown")


@dataclass(frozen=True, eq=False)
class GravityField:
    """Exterior gravity potential of a body in fully normalised (4 pi) spherical harmonics.

    V(r, phi, lambda) = GM/r sum_n (R/r)^n sum_m (C_nm cos m lambda + S_nm sin m lambda) P_nm(sin phi)

    Degrees 0 and 1 follow one rule in the whole package: C_00 = 1 (the mass is in GM) and degree 1 is zero (the
    origin is the centre of mass). A field that says otherwise is refused.

    name : of the model; gm : gravitational constant times mass [m^3 s^-2]; radius : of the coefficients [m];
    C, S : (N+1, N+1) ``C[n, m]``, ``S[n, m]``, zero for m > n, ``S[n, 0] = 0``, kept read-only and C-contiguous;
    tide_system : one of `TIDE_SYSTEMS`; sigma_C, sigma_S : (N+1, N+1) standard deviations, None where there are none.
    Raises ValueError naming the entry that is not finite, out of place, of the wrong shape, or against the rule for
    degrees 0 and 1.

    >>> field = GravityField("C22 alone", 4e14, 6e6, C=np.diag([1.0, 0.0, 1e-6]), S=np.zeros((3, 3)))
    >>> field.n_max, round(field.rescaled(4e14, 3e6).C[2, 2].item() * 1e6, 9)  # (6 / 3)^2
    (2, 4.0)
    """

    name: str
    gm: float
    radius: float
    C: Array = field(repr=False)
    S: Array = field(repr=False)
    tide_system: str = "unknown"
    sigma_C: Array | None = field(default=None, repr=False)
    sigma_S: Array | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for key in ("gm", "radius"):
            value = float(getattr(self, key))
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{self.name}: {key} = {value} must be positive and finite.")
            object.__setattr__(self, key, value)
        if self.tide_system not in TIDE_SYSTEMS:
            raise ValueError(f"{self.name}: tide_system '{self.tide_system}' is none of {', '.join(TIDE_SYSTEMS)}.")
        if (self.sigma_C is None) != (self.sigma_S is None):
            raise ValueError(f"{self.name}: sigma_C and sigma_S are given both or not at all.")
        for key in ("C", "S", "sigma_C", "sigma_S"):
            if getattr(self, key) is not None:
                object.__setattr__(self, key, _triangle(getattr(self, key), f"{self.name}: {key}"))
        shape = self.C.shape
        for key in ("S", "sigma_C", "sigma_S"):
            if getattr(self, key) is not None and getattr(self, key).shape != shape:
                raise ValueError(f"{self.name}: {key} has shape {getattr(self, key).shape}, C has {shape}.")
        if np.any(self.S[:, 0]):
            raise ValueError(f"{self.name}: S[n, 0] must be zero, S[{np.flatnonzero(self.S[:, 0])[0]}, 0] is not.")
        if self.C[0, 0] != 1.0:
            raise ValueError(f"{self.name}: C[0, 0] = {self.C[0, 0]} must be 1: the mass of the body is in GM.")
        if self.C[1, 0] or self.C[1, 1] or self.S[1, 1]:
            raise ValueError(
                f"{self.name}: degree 1 (C10 = {self.C[1, 0]}, C11 = {self.C[1, 1]}, S11 = {self.S[1, 1]}) must be "
                "zero: the origin of the coordinates is the centre of mass."
            )

    @property
    def n_max(self) -> int:
        """Give the highest degree and order."""
        return self.C.shape[0] - 1

    def truncate(self, n: int) -> GravityField:
        """Truncate to degree and order `n`; raises ValueError unless 2 <= n <= n_max."""
        if not 2 <= n <= self.n_max:
            raise ValueError(
                f"n_max = {n} is out of range: {self.name} has degrees 2 to {self.n_max}; give {self.n_max} or less."
            )
        if n == self.n_max:
            return self
        parts = {k: getattr(self, k) for k in ("C", "S", "sigma_C", "sigma_S")}
        return replace(self, **{k: v if v is None else v[: n + 1, : n + 1] for k, v in parts.items()})

    def with_coefficients(self, C: Array, S: Array, name: str) -> GravityField:
        """Replace the coefficients by others (N+1, N+1), e.g. recovered ones; no sigmas."""
        return replace(self, name=name, C=C, S=S, sigma_C=None, sigma_S=None)

    def rescaled(self, gm: float, radius: float) -> GravityField:
        """Refer the same potential, degrees 2 and up, to another GM [m^3 s^-2] and radius [m].

        C'_nm = C_nm (GM/GM') (R/R')^n for n >= 2; degrees 0 and 1 keep the package's rule, so that fields of
        different constants can be subtracted coefficient by coefficient.
        """
        factor = (self.gm / gm) * (self.radius / radius) ** np.arange(self.n_max + 1.0)
        factor[:2] = 1.0
        parts = {k: getattr(self, k) for k in ("C", "S", "sigma_C", "sigma_S")}
        scaled = {k: v if v is None else v * factor[:, None] for k, v in parts.items()}
        return replace(self, gm=gm, radius=radius, **scaled)

    def digest(self) -> str:
        """Hash all of the field by SHA-256 (hex); equal fields give the same in any process."""
        head = f"{self.name}\0{self.gm!r}\0{self.radius!r}\0{self.tide_system}\0{self.n_max}\0{self.sigma_C is None}"
        digest = hashlib.sha256(head.encode())
        for key in ("C", "S", "sigma_C", "sigma_S"):
            if getattr(self, key) is not None:
                digest.update((getattr(self, key) + 0.0).tobytes())  # + 0.0: the two zeros are equal
        return digest.hexdigest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, GravityField) and self.digest() == other.digest()

    def __hash__(self) -> int:
        return int(self.digest()[:15], 16)

    def __reduce__(self) -> tuple:  # through __init__, so that the arrays of a copy are read-only too
        keys = ("name", "gm", "radius", "C", "S", "tide_system", "sigma_C", "sigma_S")
        return GravityField, tuple(getattr(self, key) for key in keys)


class Body(NamedTuple):
    """What tells the field of one body from another: GM [m^3 s^-2], reference radius [m], fully normalised C20."""

    name: str
    gm: float
    radius: float
    C20: float


EARTH = Body("the Earth", GM_EARTH, R_EARTH, -4.84165e-4)
MOON = Body("the Moon", 4.9028e12, 1738.0e3, -9.088e-5)
MARS = Body("Mars", 4.2828e13, 3397.0e3, -8.745e-4)
BODIES = (EARTH, MOON, MARS)


class Misfit(NamedTuple):
    """What of a field is not that of a body (gravity_constant, radius or C20), and a sentence that says so."""

    what: str
    sentence: str


def misfit(gm: float, radius: float, C20: float, body: Body) -> Misfit | None:
    """Tell which constant of a field is not that of the body, or give None.

    gm [m^3 s^-2] may differ by 1 %, radius [m] by 3 %, C20 (fully normalised) by 2 %.
    """
    if abs(gm / body.gm - 1.0) > 0.01:
        cure = "it is in km^3/s^2" if abs(1e9 * gm / body.gm - 1.0) < 0.01 else "it is that of another body"
        return Misfit("gravity_constant", f"GM = {gm:g} is not that of {body.name}, {body.gm:g} m^3/s^2; {cure}.")
    if abs(radius / body.radius - 1.0) > 0.03:
        cure = "; it is in km" if abs(1e3 * radius / body.radius - 1.0) < 0.03 else ""
        return Misfit("radius", f"radius = {radius:g} is not that of {body.name}, {body.radius:g} m{cure}.")
    if abs(C20 / body.C20 - 1.0) > 0.02:
        unnormalised = f"unnormalised it would be {math.sqrt(5.0) * body.C20:.4g}"
        wanted = f"where the fully normalised one of {body.name} is {body.C20:g}; {unnormalised}"
        return Misfit("C20", f"C20 = {C20:g} {wanted}.")
    return None


def require_body(field: GravityField, body: Body) -> GravityField:
    """Pass the field on, or raise ValueError where it is not that of the body (`misfit`)."""
    if found := misfit(field.gm, field.radius, field.C[2, 0], body):
        raise ValueError(f"{field.name}: {found.sentence}.")
    return field


def _triangle(values: Array, where: str) -> Array:
    array = np.array(values, dtype=np.float64, order="C")  # own copy: nobody else can write into a frozen field
    if array.ndim != 2 or array.shape[0] != array.shape[1] or array.shape[0] < 3:
        raise ValueError(f"{where} has shape {array.shape}; it must be (N+1, N+1) with N >= 2.")
    for bad, word in ((~np.isfinite(array), "is not finite"), (np.triu(array, 1) != 0, "must be zero: m exceeds n")):
        if bad.any():
            n, m = np.argwhere(bad)[0]
            raise ValueError(f"{where}[{n}, {m}] = {array[n, m]} {word}.")
    array.flags.writeable = False
    return array
