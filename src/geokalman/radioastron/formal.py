"""What a session can know: covariance of the orbit without a single measurement, with ignored biases considered, and
the large-sample statistics of the linear problem.

    N = P0^-1 + sum H' R_f^-1 H,   P_f = N^-1
    P_c = P_f (P0^-1 + sum H' R_f^-1 R_t R_f^-1 H + K_b B K_b') P_f,   K_b = sum H' R_f^-1 G
with R_f the weights of the estimator, R_t the true noise, G and B design and covariance of biases that it does not
estimate. Source: Tapley, Schutz & Born (2004), section 6.2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag

from geokalman.constants import C_LIGHT
from geokalman.physics.satellite import Dynamics
from geokalman.radioastron.data import Scenario, Tuning
from geokalman.radioastron.estimate import linearise_step, links
from geokalman.radioastron.model import STATIONS, Array, Session, find_stations, nominal_state, toward
from geokalman.radioastron.model import world as world_of
from geokalman.radioastron.simulate import schedule
from geokalman.radioastron.visibility import check_passes

_CURVE = 300.0  # s between nodes of the spline through the transition matrix


class Sigmas(NamedTuple):
    """Formal sigmas at mid-observation: delay [s], its rate [s/s], position, velocity (root of the trace) [m, m/s]."""

    delay: float
    rate: float
    position: float
    velocity: float


@dataclass(frozen=True, eq=False)
class Geometry:
    """A session linearised about its nominal orbit.

    t (n,), station, arc: the schedule; H (n, 2, 6): design of range and range-rate with respect to the state at t[0];
    start (6,): the nominal state then; Phi (6, 6): from t[0] to mid-observation; middle (6,): the state there.
    """

    session: Session
    world: Dynamics
    stations: tuple[str, ...]
    t: Array
    station: Array
    arc: Array
    H: Array
    start: Array
    Phi: Array
    middle: Array


def linearise(session: Session, world: Dynamics, stations: tuple[str, ...]) -> Geometry:
    """Design of all measurements of a session, every station at every epoch of both passes.

    Raises ValueError where a station does not see the spacecraft at the ends of a pass.
    """
    start = nominal_state(session, world)
    t, station, arc = schedule(session, stations)
    check_passes(world, t, station, start, stations)
    H = linearise_step(t, start, links(stations, station), world.params)[1]
    middle, Phi = world.transition(start, session.first, session.middle)
    return Geometry(session, world, stations, t, station, arc, H, start, Phi, middle)


def bias_design(g: Geometry, per_pass: bool) -> Array:
    """G (n, 2, k): one range and one range-rate bias of each station, common to the passes or one pair for each."""
    arcs = int(g.arc.max()) + 1 if per_pass else 1
    G = np.zeros((len(g.t), 2, 2 * arcs * len(g.stations)))
    first = 2 * (g.station * arcs + (g.arc if per_pass else 0))
    for i in range(2):
        G[np.arange(len(g.t)), i, first + i] = 1.0
    return G


def _inverse(N: Array) -> Array:
    scale = 1.0 / np.sqrt(np.diag(N))
    return np.linalg.solve(N * np.outer(scale, scale), np.eye(len(N))) * np.outer(scale, scale)


@dataclass(frozen=True, eq=False)
class LinearEstimate:
    """Gain and covariances of the linear estimate of the state at t[0].

    gain (6, n, 2): estimate = gain . residuals; prior_gain (6, 6): what of an a-priori error stays; own (6, 6): the
    covariance that the estimator states; consider (6, 6): the true one under the levels of the data.
    """

    gain: Array
    prior_gain: Array
    own: Array
    consider: Array


def solve(g: Geometry, levels: Scenario, weights: Tuning) -> LinearEstimate:
    """Weigh a session's measurements as an estimator does, and say what that is worth under the true levels.

    With estimate_bias one pair of biases per station and pass joins the unknowns, and biases of the data are no
    longer ignored.
    """
    w = np.array([weights.sigma_range**-2.0, weights.sigma_rate**-2.0])
    A, prior = g.H, np.diag(1.0 / np.diag(levels.prior_cov))
    if weights.estimate_bias:
        G = bias_design(g, per_pass=True)
        A = np.concatenate([g.H, G], axis=2)
        pair = [weights.bias_range**-2.0, weights.bias_rate**-2.0]
        prior = block_diag(prior, np.diag(np.tile(pair, G.shape[2] // 2)))
    P = _inverse(prior + np.einsum("kip,i,kiq->pq", A, w, A))
    gain = np.einsum("pq,kiq,i->pki", P, A, w)[:6]
    prior_gain = (P @ prior)[:6, :6]
    variance_true = np.array([levels.sigma_range**2, levels.sigma_rate**2])
    consider = prior_gain @ levels.prior_cov @ prior_gain.T + np.einsum("pki,i,qki->pq", gain, variance_true, gain)
    if levels.bias != "none":
        G = bias_design(g, levels.bias == "per-pass")
        K = np.einsum("pki,kib->pb", gain, G)
        consider += (K * _bias_sigmas(levels, G) ** 2) @ K.T
    return LinearEstimate(gain, prior_gain, P[:6, :6], consider)


def _bias_sigmas(levels: Scenario, G: Array) -> Array:
    """Sigmas (k,) of the biases of a design G (n, 2, k)."""
    return np.tile([levels.bias_range, levels.bias_rate], G.shape[2] // 2)


def at_middle(g: Geometry, P: Array, source: Array) -> Sigmas:
    """Sigmas at mid-observation of a covariance P (6, 6) at t[0], source (3,) the unit vector to the source."""
    Q = g.Phi @ P @ g.Phi.T
    r, v = Q[:3, :3], Q[3:, 3:]
    squares = (source @ r @ source / C_LIGHT**2, source @ v @ source / C_LIGHT**2, np.trace(r), np.trace(v))
    return Sigmas(*(float(np.sqrt(s)) for s in squares))


class Evaluation(NamedTuple):
    """Sigmas at mid-observation: a priori, of the estimator itself, and true ones that consider the biases."""

    prior: Sigmas
    own: Sigmas
    consider: Sigmas


def evaluate(
    session: Session, levels: Scenario, weights: Tuning, stations: tuple[str, ...] = (), source: str = ""
) -> Evaluation:
    """One row of the table of formal sigmas; stations: none is the session's own; source as in `model.find_source`."""
    g = linearise(session, world_of(session), find_stations(stations, session))
    solution, direction = solve(g, levels, weights), toward(session, source)
    return Evaluation(*(at_middle(g, P, direction) for P in (levels.prior_cov, solution.own, solution.consider)))


def ellipsoid(P: Array) -> tuple[Array, Array]:
    """Sigmas (3,) [m], ascending, and directions (3, 3), columns, of the position part of a covariance."""
    values, vectors = np.linalg.eigh(P[:3, :3])
    return np.sqrt(values), vectors


def local_axes(position: Array) -> Array:
    """Directions (3, 3), rows: radial, east (along z x r) and north of a position (3,)."""
    up = position[:3] / np.linalg.norm(position[:3])
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east)
    return np.array([up, east, np.cross(up, east)])


def angle_to_source(position: Array, source: Array) -> float:
    """Angle [rad] between the geocentric direction of the spacecraft and the source."""
    return float(np.arccos(np.clip(position[:3] @ source / np.linalg.norm(position[:3]), -1.0, 1.0)))


def projected_baseline(world: Dynamics, t: float, position: Array, telescope: str, source: Array) -> float:
    """Length [m] of the baseline from a telescope to the spacecraft at t [s], (3,) [m], as seen from the source."""
    b = position[:3] - world.gcrs_from_itrs(t) @ np.array(STATIONS[telescope])
    return float(np.linalg.norm(b - (b @ source) * source))


class Response(NamedTuple):
    """Change of delay [s] and rate [s/s] at mid-observation."""

    delay: float
    rate: float


def response(g: Geometry, levels: Scenario, weights: Tuning, error: Array, source: Array) -> Response:
    """What errors (n, 2) of ranges [m] and range-rates [m/s] do to the residual at mid-observation: sum K_k error_k."""
    moved = g.Phi @ np.einsum("pki,ki->p", solve(g, levels, weights).gain, error)
    return Response(float(moved[:3] @ source) / C_LIGHT, float(moved[3:] @ source) / C_LIGHT)


class Sample(NamedTuple):
    """Errors of many linear draws at mid-observation, before and after tracking, (draws, 6) [m, m/s]."""

    prior: Array
    post: Array


@dataclass(frozen=True, eq=False)
class Effects:
    """What the unknown forces do to a session, per unit and linear about its nominal orbit.

    own (n, 2, 6): design with respect to the state of the same time; forces (4, n, 6), middle (4, 6): change of the
    orbit at the measurements and at mid-observation by pressure scale and constant acceleration; Phi: spline through
    the transition matrices from t[0].
    """

    own: Array
    forces: Array
    middle: Array
    Phi: CubicSpline


def effects(g: Geometry) -> Effects:
    """Compute what `large_sample` needs of a geometry, however often it draws."""
    forces, middle = _force_effects(g)
    nodes = np.arange(g.session.first, g.session.observation[1] + _CURVE, _CURVE)
    Phi = CubicSpline(nodes, np.array([g.world.transition(g.start, g.session.first, t)[1] for t in nodes]))
    states = _from_start(g)  # (n, 6, 6), H at t[0] = h(t) Phi(t, t0)
    own = np.swapaxes(np.linalg.solve(np.swapaxes(states, 1, 2), np.swapaxes(g.H, 1, 2)), 1, 2)
    return Effects(own, forces, middle, Phi)


def large_sample(
    g: Geometry,
    levels: Scenario,
    weights: Tuning,
    rng: np.random.Generator,
    draws: int = 4000,
    prior_scale: float = 1.0,
    known: Effects | None = None,
) -> Sample:
    """Errors of the linear estimate over many draws of everything that `simulate.draw` draws.

    prior_scale : sigmas of P(0) that the estimator assumes, in units of those that the error is drawn from;  known :
    the `effects` of the geometry where they were computed before.
    """
    solution = solve(g, _scaled(levels, prior_scale), weights)
    known = known or effects(g)
    error0, p, when, kick, middle = _disturbed(g, known, levels, rng, draws)
    motion = np.einsum("dp,pkj->dkj", p, known.forces)  # true minus nominal orbit at the measurements
    z = np.einsum("kij,dkj->dki", known.own, motion)
    z += np.einsum("kij,dj->dki", g.H, kick) * (g.t >= when[:, None])[..., None]
    z += rng.standard_normal(z.shape) * (levels.sigma_range, levels.sigma_rate)
    if levels.bias != "none":
        G = bias_design(g, levels.bias == "per-pass")
        z += np.einsum("kib,db->dki", G, rng.standard_normal((draws, G.shape[2])) * _bias_sigmas(levels, G))
    estimate = error0 @ solution.prior_gain.T + np.einsum("pki,dki->dp", solution.gain, z)
    return Sample(error0 @ g.Phi.T - middle, estimate @ g.Phi.T - middle)


def reduced_sample(
    g: Geometry,
    known: Effects,
    levels: Scenario,
    weights: Tuning,
    rng: np.random.Generator,
    draws: int = 4000,
    prior_scale: float = 1.0,
) -> tuple[Sample, Array]:
    """Errors as of `large_sample`, drawn where they enter the six states, and the covariance that the estimator states.

    With the gain K_k of measurement k: noise of covariance sum K_k R K_k', biases through sum K_k G_k, constant forces
    through sum K_k h_k times their effect, an impulse at t through the sum of K_k H_k over t_k >= t. The covariance
    (6, 6) is that of mid-observation. A hundred times cheaper than drawing every measurement.
    """
    solution = solve(g, _scaled(levels, prior_scale), weights)
    gain, count = solution.gain, len(g.t)
    error0, p, when, kick, middle = _disturbed(g, known, levels, rng, draws)
    later = np.zeros((count + 1, 6, 6))
    later[:count] = np.cumsum(np.einsum("pki,kij->kpj", gain, g.H)[::-1], axis=0)[::-1]
    variance = np.einsum("pki,i,qki->pq", gain, np.array([levels.sigma_range, levels.sigma_rate]) ** 2, gain)
    scale = np.sqrt(np.diag(variance))
    root = scale[:, None] * np.linalg.cholesky(variance / np.outer(scale, scale) + 1e-12 * np.eye(6))
    estimate = error0 @ solution.prior_gain.T + p @ np.einsum("pki,kij,mkj->mp", gain, known.own, known.forces)
    estimate += np.einsum("dpj,dj->dp", later[np.searchsorted(g.t, when)], kick)
    estimate += rng.standard_normal((draws, 6)) @ root.T
    if levels.bias != "none":
        G = bias_design(g, levels.bias == "per-pass")
        biases = rng.standard_normal((draws, G.shape[2])) * _bias_sigmas(levels, G)
        estimate += biases @ np.einsum("pki,kib->bp", gain, G)
    own = g.Phi @ solution.own @ g.Phi.T
    return Sample(error0 @ g.Phi.T - middle, estimate @ g.Phi.T - middle), own


def _disturbed(
    g: Geometry, known: Effects, levels: Scenario, rng: np.random.Generator, draws: int
) -> tuple[Array, Array, Array, Array, Array]:
    """Draw what no measurement noise is.

    Returns the error of the a-priori state (draws, 6); pressure scale and acceleration (draws, 4); times of the impulse
    (draws,) and the impulse as an error at t[0] (draws, 6); and what all of these move the orbit by at mid-observation.
    """
    session = g.session
    error0 = rng.standard_normal((draws, 6)) * np.sqrt(np.diag(levels.prior_cov))
    axes = rng.standard_normal((2, draws, 3))
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    p = np.column_stack([levels.pressure_error * rng.standard_normal(draws), levels.acceleration * axes[0]])
    when = rng.uniform(session.first, session.observation[1], draws)
    impulse = np.concatenate([np.zeros((draws, 3)), levels.impulse * axes[1]], axis=1)
    kick = np.linalg.solve(known.Phi(when), impulse[..., None])[..., 0]
    return error0, p, when, kick, p @ known.middle + (kick @ g.Phi.T) * (session.middle >= when)[:, None]


def _scaled(levels: Scenario, scale: float) -> Scenario:
    """The levels with another a-priori sigma."""
    return replace(levels, prior_position=scale * levels.prior_position, prior_velocity=scale * levels.prior_velocity)


def _from_start(g: Geometry) -> Array:
    """Transition matrices (n, 6, 6) from t[0] to each measurement."""
    out, y, Phi, before = np.empty((len(g.t), 6, 6)), g.start, np.eye(6), g.session.first
    for k, t in enumerate(g.t):
        if t > before:
            y, step = g.world.transition(y, before, float(t))
            Phi, before = step @ Phi, float(t)
        out[k] = Phi
    return out


def _force_effects(g: Geometry) -> tuple[Array, Array]:
    """Change of the orbit per unit of the pressure scale and of a constant acceleration: (4, n, 6), middle (4, 6)."""
    times = np.unique(np.append(g.t, g.session.middle))
    nominal = g.world.propagate(g.start, times).y
    changes = [(1.0, g.world.with_changes(pressure_scale=2.0))]
    changes += [(1e-9, g.world.with_changes(constant=1e-9 * axis)) for axis in np.eye(3)]
    difference = np.array([(world.propagate(g.start, times).y - nominal) / size for size, world in changes])
    return difference[:, np.searchsorted(times, g.t)], difference[:, -1]
