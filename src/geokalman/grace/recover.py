"""Recovery of a gravity field from line-of-sight gravity differences: the acceleration approach, equations (47) to
(49).

Every epoch gives one equation, e . (g_A - g_B) = observed, linear in the coefficients of degree 2 and above; degrees 0
and 1 are held. All methods are right-hand sides of one normal matrix. Positions in the design matrix are the true ones
for all methods: the smoothed ones differ by micrometres, which does not show.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from geokalman import memory
from geokalman.constants import GM_EARTH, OMEGA_EARTH, R_EARTH
from geokalman.grace.model import DAY, Array, distance
from geokalman.grace.simulate import Truth
from geokalman.leastsquares import NormalEquations, SingularNormalMatrix, Solution, sum_normals
from geokalman.physics.field import GravityField
from geokalman.physics.frames import to_ecef
from geokalman.physics.partials import column_count, column_names, design_block, from_vector
from geokalman.progress import track

BLOCK = 2048  # rows of the design matrix held in memory at a time: 83 MB at degree 70
_ROWS, _COLUMNS = 256, 1024  # of the sample by which the time is foreseen


@dataclass(frozen=True)
class Recovery:
    """Coefficients (ids, N+1, N+1) recovered from each observable, and how the normal matrix stood.

    formal_C, formal_S (N+1, N+1): standard deviations for white observations of unit variance [per m/s^2]; condition:
    ratio of the extreme eigenvalues of the normal matrix scaled to unit diagonal.
    """

    n_max: int
    ids: tuple[str, ...]
    C: Array
    S: Array
    formal_C: Array
    formal_S: Array
    condition: float
    equations: int
    unknowns: int

    def coefficients(self, observable: str) -> tuple[Array, Array]:
        """C and S (N+1, N+1) recovered from the observable. Raises KeyError with the ids at hand."""
        if observable not in self.ids:
            raise KeyError(f"observable {observable!r} was not recovered; at hand are {', '.join(self.ids)}.")
        k = self.ids.index(observable)
        return self.C[k], self.S[k]


def outlook(epochs: int, n_max: int) -> float:
    """Seconds that `recover` may take on this machine, by a sample of its rows and of its algebra.

    Raises TooLarge, before anything is computed, where memory does not hold the normal matrix, naming the largest n_max
    for which it does.
    """
    _require_memory(n_max)
    unknowns = column_count(n_max)
    columns = min(unknowns, _COLUMNS)
    r = R_EARTH * (1.1 + 0.1 * np.random.default_rng(0).random((_ROWS, 3)))
    normals, block = NormalEquations(columns), np.ones((_ROWS, columns))
    rows = algebra = np.inf
    for _ in range(2):  # the first call loads what is compiled
        begun = time.perf_counter()
        design_block(GM_EARTH, R_EARTH, n_max, r, r + 1e5, r / distance(r)[:, None], None)
        between = time.perf_counter()
        normals.add(block, block[:, 0])
        rows, algebra = min(rows, between - begun), min(algebra, time.perf_counter() - between)
    operation = algebra / (_ROWS * columns**2)
    return (
        epochs * (rows / _ROWS + unknowns**2 * operation) + unknowns**3 * operation
    )  # of it two thirds: factor, inverse


def _require_memory(n_max: int) -> None:
    """The normal matrix, its inverse and a block of rows are held in memory at a time."""

    def size(n: int) -> float:
        return 8.0 * column_count(n) * (2.0 * column_count(n) + BLOCK)

    free = memory.available()
    fits = max((n for n in range(2, n_max + 1) if size(n) <= free), default=2)
    what = f"The normal matrix of {column_count(n_max)} coefficients to degree {n_max}, with its inverse,"
    memory.require(what, size(n_max), f"an n_max of {fits} fits")


def recover(
    orbit: Truth,
    gravity: GravityField,
    observables: Mapping[str, Array],
    edge: int = 100,
    n_max: int | None = None,
    executor: Executor | None = None,
) -> Recovery:
    """Least-squares coefficients of degrees 2 to n_max from each observable, unit weights.

    Parameters
    ----------
    orbit : positions of the design matrix
    gravity : gives GM and the radius of the unknowns, and holds degrees 0 and 1; its own coefficients are not used
    observables : id -> (n,) line-of-sight gravity difference [m/s^2]
    edge : epochs left out at either end
    n_max : highest degree of the unknowns; default that of the field
    executor : sums blocks of rows in its workers; default is this process, whose BLAS may use several threads

    Returns
    -------
    Recovery

    Raises
    ------
    ValueError
        Where there is no observable or one does not fit the orbit, the edges leave no epoch, an observable is not
        finite between them (naming the epoch), or the epochs are fewer than the unknowns; SingularNormalMatrix, naming
        degrees and orders, where they do not determine them; TooLarge where memory does not hold the normal matrix.
    """
    n_max = gravity.n_max if n_max is None else n_max
    solution = _solution(orbit, gravity, observables, edge, n_max, executor)
    C, S = _triangles(solution, n_max)
    formal_C, formal_S = from_vector(np.sqrt(solution.variances()), n_max)
    rows, unknowns = len(orbit.t) - 2 * edge, column_count(n_max)
    return Recovery(n_max, tuple(observables), C, S, formal_C, formal_S, solution.condition(), rows, unknowns)


def coefficients(
    orbit: Truth, gravity: GravityField, observables: Mapping[str, Array], edge: int = 100, n_max: int | None = None
) -> dict[str, tuple[Array, Array]]:
    """C and S (N+1, N+1) from each observable as `recover` gives them, without accuracies, in a third of the time.

    Parameters and errors are those of `recover`.
    """
    n_max = gravity.n_max if n_max is None else n_max
    C, S = _triangles(_solution(orbit, gravity, observables, edge, n_max, None), n_max)
    return {name: (C[k], S[k]) for k, name in enumerate(observables)}


def _triangles(solution: Solution, n_max: int) -> tuple[Array, Array]:
    C, S = (np.array(parts) for parts in zip(*(from_vector(x, n_max) for x in solution.estimate.T), strict=True))
    C[:, 0, 0] = 1.0
    return C, S


def _solution(
    orbit: Truth,
    gravity: GravityField,
    observables: Mapping[str, Array],
    edge: int,
    n_max: int,
    executor: Executor | None,
) -> Solution:
    _require_memory(n_max)
    count, ids = len(orbit.t), tuple(observables)
    if not ids:
        raise ValueError("there is no observable to recover from; give at least one.")
    for name, series in observables.items():
        if np.shape(series) != (count,):
            raise ValueError(
                f"observable {name} has the shape {np.shape(series)}, the orbit has {count} epochs; give one value for"
                " each."
            )
    if edge < 0:
        raise ValueError(f"edge = {edge} is not a number of epochs; give 0 or more.")
    rows, unknowns = count - 2 * edge, column_count(n_max)
    if rows < unknowns:
        raise ValueError(
            f"{max(rows, 0)} epochs (of {count}, without {edge} at either end) cannot determine the {unknowns}"
            f" coefficients of degrees 2 to {n_max}; give at least {(unknowns + 2 * edge - 1) * orbit.dt / DAY:.2f}"
            " days, or a lower n_max."
        )
    los = np.column_stack([observables[name] for name in ids])[edge : count - edge]
    if not np.isfinite(los).all():
        row, k = np.argwhere(~np.isfinite(los))[0]
        raise ValueError(
            f"observable {ids[k]} is not finite at epoch {edge + row}; edge = {edge} must cover the stencils."
        )
    inner = slice(edge, count - edge)
    r_A, r_B = (to_ecef(orbit.t[inner], state[inner, :3], OMEGA_EARTH) for state in (orbit.A, orbit.B))
    starts = range(0, rows, BLOCK)
    blocks = ((r_A[k : k + BLOCK], r_B[k : k + BLOCK], los[k : k + BLOCK]) for k in starts)
    if executor is None:
        normals = _empty(n_max, len(ids))
        design = np.empty((min(BLOCK, rows), unknowns))
        for block in track(blocks, "normal equations", len(starts)):
            _add(normals, gravity.gm, gravity.radius, n_max, block, design)
    else:
        normals = sum_normals(partial(_block_normals, gravity.gm, gravity.radius, n_max), blocks, executor)
    try:
        return normals.factor(overwrite=True)
    except SingularNormalMatrix as error:
        raise SingularNormalMatrix(
            f"{error} A longer span, an orbit closer to the poles or an n_max below {n_max} may determine them."
        ) from None


def _empty(n_max: int, q: int) -> NormalEquations:
    return NormalEquations(column_count(n_max), q, [f"{kind}[{n},{m}]" for kind, n, m in column_names(n_max)])


def _block_normals(gm: float, radius: float, n_max: int, block: tuple[Array, Array, Array]) -> NormalEquations:
    normals = _empty(n_max, block[2].shape[1])
    _add(normals, gm, radius, n_max, block, None)
    return normals


def _add(
    normals: NormalEquations,
    gm: float,
    radius: float,
    n_max: int,
    block: tuple[Array, Array, Array],
    design: Array | None,
) -> None:
    """Add a block of epochs; the observations are reduced by the point mass, which is held."""
    r_A, r_B, los = block
    e = (r_A - r_B) / distance(r_A - r_B)[:, None]
    central = -gm * (r_A / distance(r_A)[:, None] ** 3 - r_B / distance(r_B)[:, None] ** 3)
    held = np.einsum("ij,ij->i", e, central)
    rows = design_block(gm, radius, n_max, r_A, r_B, e, None if design is None else design[: len(e)])
    normals.add(rows, los - held[:, None])
