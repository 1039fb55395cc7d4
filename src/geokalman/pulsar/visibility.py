"""Which pulsars an orbiter sees: those that Mars does not hide, and how far it flies while it counts their photons."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geokalman.constants import C_LIGHT
from geokalman.pulsar.model import STEP, Array


def hidden(r: Array, directions: Array, radius: float) -> NDArray[np.bool_]:
    """Tell which pulsars stand behind the disc of Mars: (n, m).

    r.n < 0 and |r - (r.n) n| < radius, for the positions r (n, 3) [m] from the centre of Mars, a sphere of that radius
    [m] without air, and the unit vectors n to the pulsars (m, 3), in the same axes.
    """
    along = r @ directions.T
    across = np.einsum("ni,ni->n", r, r)[:, None] - along**2
    return (along < 0.0) & (across < radius**2)


def hidden_share(a: float, radius: float, elevation: Array) -> Array:
    """Give the share of a circular orbit in which a pulsar is hidden.

    arccos(sqrt(1 - (R/a)^2) / cos e) / pi, and 0 where the cosine is too small. a, radius : of orbit and planet [m];
    elevation e : of the pulsar above the plane of the orbit [rad].
    """
    ratio = np.sqrt(1.0 - (radius / a) ** 2) / np.cos(elevation)
    return np.arccos(np.minimum(ratio, 1.0)) / np.pi


def exposure(v: Array, directions: Array, duration: float = STEP) -> tuple[float, float]:
    """Give how far the orbiter flies while it counts photons.

    The length of the arc [m], root mean square, and the largest change of the time of arrival along a line to a pulsar
    [s], largest |v.n| duration / c. v (n, 3) [m/s]; directions (m, 3).
    """
    arc = np.sqrt(np.einsum("ni,ni->n", v, v).mean()) * duration
    return float(arc), float(np.abs(v @ directions.T).max() * duration / C_LIGHT)
