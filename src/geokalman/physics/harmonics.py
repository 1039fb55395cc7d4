"""Spherical harmonics of a gravity field: its spectrum, smoothing and geoid."""

from __future__ import annotations

import functools
import math
import os
import zipfile

import numpy as np
from numpy.typing import ArrayLike

from geokalman.constants import R_MEAN_EARTH
from geokalman.data import CorruptedData, data_path
from geokalman.physics.field import Array, Body, GravityField, require_body
from geokalman.physics.icgem import read_gfc
from geokalman.physics.sphere import area_rms, cell_centred_grid, legendre, synthesis, synthesis_points

__all__ = [
    "GravityField",
    "area_rms",
    "cell_centred_grid",
    "degree_amplitude",
    "degree_variance",
    "error_degree_variance",
    "gaussian_weights",
    "geoid_difference",
    "legendre",
    "load_field",
    "synthesis",
    "synthesis_points",
]

VENDORED = {"EGM96": "egm96.npz", "JGM3": "jgm3.npz", "GMM2B": "gmm2b.npz"}
MONTHLY = {"GRACE-FO-2020-03": "grace_fo_2020_03.npz", "GRACE-FO-2020-06": "grace_fo_2020_06.npz"}
GAUSSIAN_CUT = 1e-7
"""Weights from the first one below this on are zero: there the recursion has lost its digits."""


def load_field(
    name_or_path: str | os.PathLike = "EGM96", n_max: int | None = None, body: Body | None = None
) -> GravityField:
    """Load a vendored gravity field by name, or any ICGEM file by path.

    name_or_path : `EGM96` (also the empty name), `JGM3`, `GMM2B` of Mars, `GRACE-FO-2020-03`, `-06`, in any case; or a
    `.gfc` (`.gfc.gz`) file. n_max : degree and order to which it is wanted, None for all. body : whose field it must
    be, such as `field.EARTH`, None for any.
    Raises ValueError for n_max below 2 or above the field's degree and for a field of another body; GfcError (a
    ValueError), with file and line, for a damaged file; FileNotFoundError; geokalman.data.CorruptedData where a
    vendored field fails its checksum.

    >>> field = load_field("EGM96", n_max=2)
    >>> field.C.shape, round(field.C[2, 0].item() * 1e6, 3)
    ((3, 3), -484.165)
    """
    text = os.fspath(name_or_path) or "EGM96"
    vendored = (VENDORED | MONTHLY).get(text.upper())
    if vendored is not None:
        path = data_path(vendored)
        field = _read_npz(path, path.stat().st_mtime_ns)
        field = field if body is None else require_body(field, body)
    elif not os.path.isfile(text):
        raise FileNotFoundError(f"No gravity field '{text}': it is neither {' nor '.join(VENDORED)} nor an ICGEM file.")
    else:
        field = read_gfc(text, body=body)
    return field if n_max is None else field.truncate(n_max)


def degree_variance(C: ArrayLike, S: ArrayLike) -> Array:
    """Compute degree variances, DV(n) = sum_m (C_nm^2 + S_nm^2).

    C, S : (..., N+1, N+1) fully normalised coefficients. Returns (..., N+1), dimensionless, index n from 0.
    Raises ValueError where C and S have not one shape. Source: grace-fusion (54).

    >>> degree_variance(np.eye(2), np.eye(2)).tolist()
    [2.0, 2.0]
    """
    C, S = np.asarray(C, dtype=float), np.asarray(S, dtype=float)
    if C.shape != S.shape or C.ndim < 2 or C.shape[-1] != C.shape[-2]:
        raise ValueError(f"C {C.shape} and S {S.shape} must both be (..., N+1, N+1).")
    return np.einsum("...nm,...nm->...n", C, C) + np.einsum("...nm,...nm->...n", S, S)


def error_degree_variance(dC: ArrayLike, dS: ArrayLike) -> Array:
    """Compute degree variances of errors or standard deviations, sum_m (dC_nm^2 + dS_nm^2).

    dC, dS : (..., N+1, N+1). Returns (..., N+1), as `degree_variance`.

    >>> error_degree_variance(np.eye(2), np.zeros((2, 2))).tolist()
    [1.0, 1.0]
    """
    return degree_variance(dC, dS)


def degree_amplitude(variance: ArrayLike, radius: float) -> Array:
    """Compute the geoid amplitude of each degree, R sqrt(DV(n)) [m].

    variance : (..., N+1) degree variances; radius : R [m].

    >>> degree_amplitude([4e-14], 6.0e6).tolist()
    [1.2]
    """
    return radius * np.sqrt(np.asarray(variance, dtype=float))


def gaussian_weights(n_max: int, radius_km: float) -> Array:
    """Compute the weights W_n of Gaussian smoothing, W_0 = 1, by Jekeli's recursion.

    b = ln 2 / (1 - cos(r / 6371 km)), W_1 = (1 + e^-2b)/(1 - e^-2b) - 1/b, W_(n+1) = -(2n+1)/b W_n + W_(n-1),
    zero from the first weight below 1e-7 on, because the recursion is unstable there.
    n_max : highest degree; radius_km : distance at which the kernel has fallen to one half [km], 0 for no smoothing.
    Returns (n_max + 1,). Raises ValueError for a radius that is negative, not finite, or longer than half the
    circumference. Source: Jekeli (1981), OSU report 327, (59)-(63); Wahr, Molenaar & Bryan (1998), (34).

    >>> gaussian_weights(2, 0.0).tolist()
    [1.0, 1.0, 1.0]
    """
    angle = radius_km * 1e3 / R_MEAN_EARTH
    if not 0.0 <= angle <= math.pi:
        raise ValueError(f"Gaussian radius {radius_km} km is outside [0, {math.pi * R_MEAN_EARTH / 1e3:.0f}] km.")
    if angle == 0.0:
        return np.ones(n_max + 1)
    b = math.log(2.0) / (2.0 * math.sin(0.5 * angle) ** 2)
    weights = np.zeros(n_max + 2)
    weights[0] = 1.0
    weights[1] = 1.0 / math.tanh(b) - 1.0 / b
    for n in range(1, n_max):
        following = weights[n - 1] - (2 * n + 1) / b * weights[n]
        if following < GAUSSIAN_CUT:
            break
        weights[n + 1] = following
    return weights[: n_max + 1]


def geoid_difference(
    dC: ArrayLike, dS: ArrayLike, radius: float, step_deg: float = 0.5, gauss_km: float = 0.0
) -> Array:
    """Compute the smoothed geoid of coefficient differences on a cell-centred global grid.

    dN = R sum_n W_n sum_m (dC_nm cos m lambda + dS_nm sin m lambda) P_nm(sin phi)
    dC, dS : (N+1, N+1) differences of fully normalised coefficients; radius : R [m]; step_deg : size of a cell [deg];
    gauss_km : Gaussian radius [km], 0 for no smoothing. Returns (180/step, 360/step) [m] on `cell_centred_grid`, from
    the south-west. Raises ValueError as that grid, `gaussian_weights` and `synthesis` do.

    >>> dC = np.zeros((3, 3))
    >>> dC[0, 0] = 1e-9
    >>> geoid_difference(dC, np.zeros((3, 3)), 6.0e6, step_deg=90.0).round(4).tolist()[0]
    [0.006, 0.006, 0.006, 0.006]
    """
    dC, dS = np.asarray(dC, dtype=float), np.asarray(dS, dtype=float)
    lat, lon = cell_centred_grid(step_deg)
    return radius * synthesis(dC, dS, lat, lon, weights=gaussian_weights(dC.shape[0] - 1, gauss_km))


@functools.lru_cache(maxsize=4)
def _read_npz(path: os.PathLike, changed: int) -> GravityField:
    """Read the lower triangles that `data/scripts/make_egm96.py` stores row by row.

    changed : time of the file's last change, so that another file of the same name is read anew.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            rows, columns = np.tril_indices(int(stored["n_max"]) + 1)
            arrays = {}
            for key in ("C", "S", "sigma_C", "sigma_S"):
                if key in stored:
                    arrays[key] = np.zeros((rows[-1] + 1, rows[-1] + 1))
                    arrays[key][rows, columns] = stored[key]
            return GravityField(
                name=str(stored["name"]),
                gm=float(stored["gm"]),
                radius=float(stored["radius"]),
                tide_system=str(stored["tide_system"]),
                **arrays,
            )
    except (zipfile.BadZipFile, KeyError) as error:
        raise CorruptedData(f"{path} is no field made by data/scripts/make_egm96.py: {error}") from None
