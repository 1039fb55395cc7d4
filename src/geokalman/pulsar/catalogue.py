"""X-ray pulsars for navigation: Table 1, directions, and the accuracy of a range.

The body of the paper's Table 1 is lost. Fluxes, pulsed fractions and widths are those tabulated after Sheikh (2005,
thesis, University of Maryland); those of B1509-58 and all distances are of the same literature but less certain.
Positions are rounded catalogue ones.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geokalman.constants import C_LIGHT, PARSEC

AREA, DURATION, BACKGROUND = 1e4, 500.0, 0.005
"""Default detector area [cm^2], observation duration [s] and background [photon cm^-2 s^-1]."""


class RangingWarning(UserWarning):
    """A ranging accuracy that suggests a wrong unit."""


@dataclass(frozen=True)
class Pulsar:
    """One pulsar.

    ra, dec [deg, ICRS]; period [s]; flux [photon cm^-2 s^-1]; pulsed : fraction; width : of the pulse at half height
    [s]; distance [m].
    Raises ValueError, naming the pulsar and the value, for numbers that no pulsar has.
    """

    name: str
    ra: float
    dec: float
    period: float
    flux: float
    pulsed: float
    width: float
    distance: float

    def __post_init__(self) -> None:
        for key in ("ra", "dec", "period", "flux", "pulsed", "width", "distance"):
            if not math.isfinite(getattr(self, key)):
                raise ValueError(f"{self.name}: {key} = {getattr(self, key)} is not finite.")
        parsecs = self.distance / PARSEC
        for wrong, why in (
            (not 0.0 <= self.ra < 360.0, f"right ascension {self.ra:g} deg is outside [0, 360)."),
            (not -90.0 <= self.dec <= 90.0, f"declination {self.dec:g} deg is outside [-90, 90]."),
            (
                min(self.flux, self.distance, self.width) <= 0.0,
                f"flux {self.flux:g}, width {self.width:g} and distance {self.distance:g} must be positive.",
            ),
            (
                self.period <= self.width,
                f"period {self.period:g} s is not longer than the pulse width {self.width:g} s.",
            ),
            (not 1.0 <= parsecs <= 1e8, f"distance {self.distance:g} m is {parsecs:.3g} pc, not 1 pc to 100 Mpc."),
            (self.period > 1e5, f"period {self.period:g} s is longer than any pulsar's, 1e5 s."),
            (not 0.0 < self.pulsed <= 1.0, f"pulsed fraction {self.pulsed:g} is outside (0, 1]."),
        ):
            if wrong:
                raise ValueError(f"{self.name}: {why}.")

    @property
    def direction(self) -> NDArray[np.float64]:
        """Unit vector to the pulsar in ICRF axes (3,)."""
        ra, dec = math.radians(self.ra), math.radians(self.dec)
        return np.array([math.cos(dec) * math.cos(ra), math.cos(dec) * math.sin(ra), math.sin(dec)])


_KPC = 1e3 * PARSEC
PULSARS = (
    Pulsar("B0531+21", 83.63321, 22.01446, 0.0335, 1.54, 0.70, 1.67e-3, 2.0 * _KPC),
    Pulsar("B1821-24", 276.13337, -24.86968, 0.00305, 1.93e-4, 0.98, 5.5e-5, 5.5 * _KPC),
    Pulsar("B1937+21", 294.91067, 21.58309, 0.00156, 4.99e-5, 0.86, 2.1e-5, 3.6 * _KPC),
    Pulsar("B0540-69", 85.04667, -69.33171, 0.0504, 5.15e-3, 0.67, 2.5e-3, 49.4 * _KPC),
    Pulsar("B1957+20", 299.90317, 20.80421, 0.0016, 8.31e-5, 0.60, 8.0e-5, 1.53 * _KPC),
    Pulsar("B1509-58", 228.48175, -59.13583, 0.150, 1.62e-2, 0.65, 1.5e-2, 4.2 * _KPC),
    Pulsar("J0218+4232", 34.52646, 42.53818, 0.00232, 6.65e-5, 0.73, 3.5e-4, 5.85 * _KPC),
)
"""Table 1, as far as it can be reconstructed; its numbers 1 to 7."""


def directions(pulsars: Sequence[Pulsar]) -> NDArray[np.float64]:
    """Give unit vectors to the pulsars in ICRF axes (m, 3)."""
    return np.array([pulsar.direction for pulsar in pulsars])


def require_distinct(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give back directions (m, 3).

    Raises ValueError, with their numbers, where one is no unit vector or two are the same.
    """
    vectors = np.asarray(vectors, dtype=float)
    if vectors.ndim != 2 or vectors.shape[1] != 3:
        raise ValueError(f"directions have the shape {vectors.shape}; they must be (m, 3).")
    for k, norm in enumerate(np.sqrt((vectors**2).sum(1))):
        if not abs(norm - 1.0) < 1e-9:
            raise ValueError(f"direction {k + 1} has the length {norm:g}; it must be a unit vector.")
    for k in range(len(vectors)):
        for i in range(k):
            if np.abs(vectors[k] - vectors[i]).max() < 1e-12:
                twice = f"directions {i + 1} and {k + 1}"
                raise ValueError(f"{twice} are the same pulsar; it gives one observation, not two.")
    return vectors


def ranging_sigma(
    pulsar: Pulsar, area: float = AREA, duration: float = DURATION, background: float = BACKGROUND
) -> float:
    """Give the accuracy of the range to a pulsar [m] from photons counted for a while.

    sigma = c W / (2 SNR),  SNR = F A p T / sqrt([B + F (1 - p)] A T d + F A p T),  d = W / P.
    area A [cm^2]; duration T [s]; background B [photon cm^-2 s^-1]; F flux, p pulsed fraction, W width, P period.
    Warns where the result suggests that the area is in square metres or the flux in another unit; raises ValueError
    for a value that is not positive. Source: Sheikh (2005); the paper's (14)-(16).
    """
    for name, value in (("area", area), ("duration", duration), ("background", background)):
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} = {value:g} is not a positive number.")
    signal = pulsar.flux * area * pulsar.pulsed * duration
    noise = (background + pulsar.flux * (1.0 - pulsar.pulsed)) * area * duration * pulsar.width / pulsar.period
    sigma = C_LIGHT * pulsar.width / (2.0 * signal / math.sqrt(noise + signal))
    if not 1.0 <= sigma <= 1e5:
        hint = f"area must be in cm^2 (it is {area:g}), flux in photon cm^-2 s^-1"
        text = f"{pulsar.name}: a range to {sigma:.3g} m in {duration:g} s; {hint}"
        warnings.warn(text, RangingWarning, stacklevel=2)
    return sigma


def single_epoch_covariance(vectors: NDArray[np.float64], sigmas: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the covariance (3, 3) [m^2] of a position by least squares from a range to each.

    vectors (m, 3); sigmas (m,) [m]. Raises ValueError where the directions leave a direction of space undetermined.
    """
    scaled = require_distinct(vectors) / np.asarray(sigmas)[:, None]
    if np.linalg.matrix_rank(scaled * np.min(sigmas), tol=1e-12) < 3:
        raise ValueError(f"{len(vectors)} pulsars do not span space; a position needs three independent ones.")
    root = np.linalg.qr(scaled, mode="r")
    inverse = np.linalg.solve(root, np.eye(3))
    return inverse @ inverse.T
