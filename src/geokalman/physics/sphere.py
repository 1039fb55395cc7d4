"""Functions on the sphere: normalised Legendre functions, synthesis of spherical harmonics, grids and their means."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray
from scipy.fft import irfft

Array = NDArray[np.float64]

N_MAX_VALID = 2190
"""Highest degree for which synthesis was tested; the scaled recursion of Holmes & Featherstone (2002) holds to 2700."""
_SCALE = 1e-280  # P_nm / cos(phi)^m exceeds 1e308 unscaled (Holmes & Featherstone 2002, section 2.3)
_POINTS_AT_ONCE = 4096
_ROWS_AT_ONCE = 32  # parallels whose spectrum stays in the cache


def cell_centred_grid(step_deg: float) -> tuple[Array, Array]:
    """Give latitudes and longitudes of the cell centres of a global grid.

    phi_i = -90 deg + (i + 1/2) step.
    step_deg : size of a cell [deg]; 180 must be a whole multiple of it. Returns lat (180/step,), ascending, and lon
    (360/step,), from step/2 to 360 deg - step/2 [rad]. Raises ValueError where such cells do not tile the sphere.

    >>> lat, lon = cell_centred_grid(90.0)
    >>> np.degrees(lat).round(9).tolist(), np.degrees(lon).round(9).tolist()
    ([-45.0, 45.0], [45.0, 135.0, 225.0, 315.0])
    """
    rows = round(180.0 / step_deg) if 0.0 < step_deg <= 180.0 else 0
    if rows < 1 or abs(rows * step_deg - 180.0) > 1e-9:
        raise ValueError(f"A cell of {step_deg} deg does not tile the sphere: 180 deg must be a multiple of it.")
    step = np.pi / rows
    return (np.arange(rows) + 0.5 - rows / 2) * step, (np.arange(2 * rows) + 0.5) * step


def area_rms(grid: ArrayLike, lat: ArrayLike | None = None) -> float:
    """Compute the area-weighted rms of a global grid, sqrt(sum g^2 cos(phi) / sum cos(phi)).

    grid : (n_lat, n_lon), any unit; lat : (n_lat,) [rad], None for the rows of `cell_centred_grid`. Returns a float in
    the unit of the grid. Raises ValueError where grid and lat do not fit.

    >>> lat, lon = cell_centred_grid(1.0)
    >>> round(area_rms(np.outer(np.sin(lat), np.ones(lon.size))), 3)  # 1 / sqrt 3
    0.577
    """
    grid = np.asarray(grid, dtype=float)
    if grid.ndim != 2:
        raise ValueError(f"A grid has shape (n_lat, n_lon), not {grid.shape}.")
    lat = cell_centred_grid(180.0 / grid.shape[0])[0] if lat is None else np.asarray(lat, dtype=float)
    if lat.shape != grid.shape[:1]:
        raise ValueError(f"{lat.size} latitudes do not fit a grid of {grid.shape[0]} rows.")
    weight = np.cos(lat)
    square = np.mean(np.square(grid), axis=1)
    return float(np.sqrt(weight @ square / weight.sum()))


def legendre(n_max: int, lat: ArrayLike) -> Array:
    """Compute fully normalised Legendre functions P_nm(sin phi), no Condon-Shortley phase.

    P_nm = a_nm t P_(n-1)m - b_nm P_(n-2)m with t = sin phi, standard forward columns from the sectorials
    P_mm = u sqrt((2m+1)/(2m)) P_(m-1)(m-1), u = cos phi, carried as 1e-280 P_nm/u^m (Holmes & Featherstone 2002,
    equations 11, 12, 18). Valid to degree 2190, poles included.

    n_max : highest degree; lat : (k,) [rad]. Returns (k, n_max+1, n_max+1), ``[point, n, m]``, zero for m > n.

    >>> legendre(1, np.radians(30.0))[0].round(3).tolist()  # 1, sqrt 3 sin phi, sqrt 3 cos phi
    [[1.0, 0.0], [0.866, 1.5]]
    """
    lat = np.atleast_1d(np.asarray(lat, dtype=float))
    out = np.zeros((lat.size, n_max + 1, n_max + 1))
    _legendre(n_max, np.sin(lat), np.cos(lat), out)
    return out


def synthesis(
    C: ArrayLike, S: ArrayLike, lat: ArrayLike, lon: ArrayLike, weights: ArrayLike | None = None, q: ArrayLike = 1.0
) -> Array:
    """Sum spherical harmonics on the grid lat x lon.

    f(phi_i, lambda_j) = sum_n W_n q_i^n sum_m (C_nm cos m lambda_j + S_nm sin m lambda_j) P_nm(sin phi_i)

    Order by order: Legendre sums at the latitudes (north and south together), then an FFT along equidistant
    longitudes that close the circle, a matrix product along any others.

    C, S : (N+1, N+1) fully normalised coefficients, N <= 2190; lat : (n_lat,) geocentric [rad]; lon : (n_lon,) [rad];
    weights : (N+1,) factor W_n of each degree, e.g. of a filter, None for 1; q : scalar or (n_lat,), ratio R/r of the
    reference radius to the radius of the point. Returns (n_lat, n_lon), the unit of the coefficients.
    Raises ValueError for shapes that do not fit, a latitude outside [-90, 90] deg, a degree above 2190.

    >>> C = np.array([[0.0, 0.0], [3**-0.5, 0.0]])
    >>> synthesis(C, np.zeros((2, 2)), np.radians([-30.0, 90.0]), [0.0, 1.0]).round(9).tolist()  # sin phi
    [[-0.5, -0.5], [1.0, 1.0]]
    """
    C, S, lat, q = _checked(C, S, lat, weights, q)
    lon = np.atleast_1d(np.asarray(lon, dtype=float))
    orders = np.arange(C.shape[0])
    if _closes_circle(lon) and lon.size >= 2 * orders[-1]:
        phase = 0.5 * np.exp(1j * lon[0] * orders)
        phase[2 * orders == lon.size] *= 2.0  # the Nyquist order has no conjugate twin
        sums, column, south = _order_sums(C, S, lat, q)
        out = np.empty((lat.size, lon.size))
        spectrum = np.empty((_ROWS_AT_ONCE, lon.size // 2 + 1), dtype=complex)
        for start in range(0, lat.size, _ROWS_AT_ONCE):
            rows = slice(start, min(start + _ROWS_AT_ONCE, lat.size))
            part = spectrum[: rows.stop - start]
            _fill_spectrum(sums, column[rows], south[rows], phase, part)
            out[rows] = irfft(part, n=lon.size, axis=1, norm="forward")
        return out
    A, B = _at_latitudes(*_order_sums(C, S, lat, q))
    angle = np.outer(orders, lon)
    return A.T @ np.cos(angle) + B.T @ np.sin(angle)


def synthesis_points(
    C: ArrayLike, S: ArrayLike, lat: ArrayLike, lon: ArrayLike, weights: ArrayLike | None = None, q: ArrayLike = 1.0
) -> Array:
    """Sum spherical harmonics at scattered points.

    As `synthesis`, with lat, lon and q (k,) and a result (k,).

    >>> C = np.array([[0.0, 0.0], [0.0, 3**-0.5]])
    >>> synthesis_points(C, np.zeros((2, 2)), [0.0, 0.0], np.radians([0.0, 60.0])).round(9).tolist()
    [1.0, 0.5]
    """
    C, S, lat, q = _checked(C, S, lat, weights, q)
    lon = np.broadcast_to(np.asarray(lon, dtype=float), lat.shape)
    orders = np.arange(C.shape[0])[:, None]
    out = np.empty(lat.size)
    for start in range(0, lat.size, _POINTS_AT_ONCE):
        part = slice(start, start + _POINTS_AT_ONCE)
        A, B = _at_latitudes(*_order_sums(C, S, lat[part], q[part]))
        angle = orders * lon[part]
        out[part] = np.einsum("mk,mk->k", A, np.cos(angle)) + np.einsum("mk,mk->k", B, np.sin(angle))
    return out


def _checked(
    C: ArrayLike, S: ArrayLike, lat: ArrayLike, weights: ArrayLike | None, q: ArrayLike
) -> tuple[Array, Array, Array, Array]:
    C, S = np.asarray(C, dtype=float), np.asarray(S, dtype=float)
    lat = np.atleast_1d(np.asarray(lat, dtype=float))
    if C.ndim != 2 or C.shape[0] != C.shape[1] or C.shape != S.shape:
        raise ValueError(f"C {C.shape} and S {S.shape} must both be (N+1, N+1).")
    if C.shape[0] - 1 > N_MAX_VALID:
        raise ValueError(f"Degree {C.shape[0] - 1} exceeds {N_MAX_VALID}, the highest for which synthesis was tested.")
    if not np.all(np.abs(lat) <= np.pi / 2 + 1e-12):
        raise ValueError(f"Latitude {lat[~(np.abs(lat) <= np.pi / 2 + 1e-12)][0]} rad is outside [-pi/2, pi/2].")
    if weights is not None:
        weights = np.asarray(weights, dtype=float)
        if weights.shape != C.shape[:1]:
            raise ValueError(f"weights has shape {weights.shape}; one per degree, {C.shape[:1]}, is right.")
        C, S = C * weights[:, None], S * weights[:, None]
    return C, S, lat, np.ascontiguousarray(np.broadcast_to(np.asarray(q, dtype=float), lat.shape))


def _closes_circle(lon: Array) -> bool:
    step = 2.0 * np.pi / lon.size
    return bool(np.all(np.abs(lon - lon[0] - step * np.arange(lon.size)) < 1e-13 * (1.0 + abs(lon[0]))))


def _order_sums(C: Array, S: Array, lat: Array, q: Array) -> tuple[Array, NDArray[np.int64], NDArray[np.bool_]]:
    """Legendre sums of each order (4, N+1, k) at the k distinct |lat|; the k of each latitude, and whether it is south.

    The four are sum_n C_nm q^n P_nm and the same with S_nm, over even n - m, then over odd n - m.
    """
    t = np.sin(lat)
    pairs, column = np.unique(np.abs(t) + 1j * q, return_inverse=True)  # sorted by |t|, then q
    half, ratio = pairs.real.copy(), pairs.imag.copy()
    sums = np.zeros((4, C.shape[0], half.size))
    u = np.sqrt((1.0 - half) * (1.0 + half))
    _legendre_sums(np.ascontiguousarray(C.T), np.ascontiguousarray(S.T), half, u, ratio, sums)
    return sums, column, t < 0.0


def _at_latitudes(sums: Array, column: NDArray[np.int64], south: NDArray[np.bool_]) -> tuple[Array, Array]:
    """A_m(phi_i) = sum_n C_nm q_i^n P_nm(sin phi_i), and B_m with S_nm, (N+1, n_lat): P_nm(-t) = (-1)^(n-m) P_nm(t)."""
    sign = np.where(south, -1.0, 1.0)
    A, B = (np.take(sums[k], column, axis=1) + sign * np.take(sums[k + 2], column, axis=1) for k in (0, 1))
    return A, B


@njit(cache=True)
def _fill_spectrum(
    sums: Array, column: NDArray[np.int64], south: NDArray[np.bool_], phase: NDArray, spectrum: NDArray
) -> None:
    """Half-complex spectrum of each parallel: phase_m (A_m - i B_m) for m > 0, A_0 for m = 0."""
    count = sums.shape[1]
    for i in range(column.size):
        k = column[i]
        sign = -1.0 if south[i] else 1.0
        for m in range(count):
            a, b = sums[0, m, k] + sign * sums[2, m, k], sums[1, m, k] + sign * sums[3, m, k]
            spectrum[i, m] = phase[m] * complex(a, -b)
        spectrum[i, 0] *= 2.0
        spectrum[i, count:] = 0.0


@njit(cache=True)
def _step_factors(n: int, m: int) -> tuple[float, float]:
    """a_nm and b_nm of P_nm = a_nm t P_(n-1)m - b_nm P_(n-2)m, n > m (Holmes & Featherstone 2002, equation 12)."""
    d = float((n - m) * (n + m))
    a = np.sqrt((2.0 * n - 1.0) * (2.0 * n + 1.0) / d)
    if n == m + 1:
        return a, 0.0
    return a, np.sqrt((2.0 * n + 1.0) * (n + m - 1.0) * (n - m - 1.0) / (d * (2.0 * n - 3.0)))


@njit(cache=True)
def _sectorial_factor(m: int) -> float:
    """P_mm / (u P_(m-1)(m-1))."""
    return np.sqrt(3.0) if m == 1 else np.sqrt((2.0 * m + 1.0) / (2.0 * m))


@njit(cache=True)
def _legendre(n_max: int, t: Array, u: Array, out: Array) -> None:
    power = np.full(t.size, 1.0 / _SCALE)  # u^m / _SCALE
    ones = np.ones(t.size)
    seed = _SCALE  # _SCALE P_mm / u^m
    for m in range(n_max + 1):
        before, now = np.zeros(t.size), np.full(t.size, seed)
        out[:, m, m] = now * power
        for n in range(m + 1, n_max + 1):
            a, b = _step_factors(n, m)
            _advance(a, b, t, ones, before, now)
            before, now = now, before
            out[:, n, m] = now * power
        seed *= _sectorial_factor(m + 1)
        power *= u


@njit(cache=True)
def _advance(a: float, b: float, t: Array, q2: Array, before: Array, now: Array) -> None:
    """One step of the recursion at all latitudes; the new value replaces the one before."""
    for i in range(t.size):
        before[i] = a * t[i] * now[i] - b * q2[i] * before[i]


@njit(cache=True)
def _add(c: float, s: float, p: Array, sum_c: Array, sum_s: Array) -> None:
    for i in range(p.size):
        sum_c[i] += c * p[i]
        sum_s[i] += s * p[i]


@njit(cache=True)
def _legendre_sums(C: Array, S: Array, t: Array, u: Array, q: Array, sums: Array) -> None:
    """Legendre sums of each order at latitudes with ascending t = sin(phi) >= 0, over even and over odd n - m.

    C, S are (order, degree); sums (4, order, latitude) holds C even, S even, C odd, S odd. With q = R/r the recursion
    carries q^n P_nm. Latitudes where an order is negligible are left out: P_nm < 1e-15 for m > N u + max(100, N/100)
    (Reinecke & Seljebotn 2013, libsharp).
    """
    n_max = C.shape[0] - 1
    margin = max(100.0, 0.01 * n_max)
    tq, q2 = t * q, q * q
    power = np.full(t.size, 1.0 / _SCALE)  # (q u)^m / _SCALE
    first, second = np.empty(t.size), np.empty(t.size)
    seed = _SCALE
    for m in range(n_max + 1):
        last = 0  # latitudes 0 .. last-1 are those equatorward of the negligible ones
        while last < t.size and m <= n_max * u[last] + margin:
            last += 1
        now, before = first[:last], second[:last]
        tm, qm = tq[:last], q2[:last]
        now[:] = seed
        before[:] = 0.0
        parity = 0
        _add(C[m, m], S[m, m], now, sums[0, m, :last], sums[1, m, :last])
        for n in range(m + 1, n_max + 1):
            a, b = _step_factors(n, m)
            _advance(a, b, tm, qm, before, now)
            before, now = now, before
            parity = 2 - parity
            _add(C[m, n], S[m, n], now, sums[parity, m, :last], sums[parity + 1, m, :last])
        for k in range(4):
            for i in range(last):
                sums[k, m, i] *= power[i]
        seed *= _sectorial_factor(m + 1)
        for i in range(t.size):
            power[i] *= u[i] * q[i]
