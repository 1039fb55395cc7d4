"""Pulsars, ranging accuracy and timing model: anchors of the specification, exact differences, and what is refused."""

from dataclasses import replace
from decimal import Decimal, localcontext

import numpy as np
import pytest

from geokalman.constants import C_LIGHT
from geokalman.data import data_path
from geokalman.physics.ephemeris import load_ephemeris
from geokalman.pulsar import photons, timing
from geokalman.pulsar.catalogue import (
    PULSARS,
    RangingWarning,
    directions,
    ranging_sigma,
    require_distinct,
    single_epoch_covariance,
)
from geokalman.pulsar.model import TRANSFER, all_directions, all_sigmas

ROWS = [
    (0.750348, 0.660374, -0.029729), (-0.601567, -0.795336, 0.074548), (-0.359685, -0.461729, 0.810822),
    (0.280469, -0.393815, -0.875355), (-0.285195, -0.495475, 0.820468),
    (-0.512953, -0.523868, -0.680031), (0.717535, 0.274464, 0.640167),
]  # fmt: skip


def test_rows_of_h():
    np.testing.assert_allclose(all_directions(), ROWS, atol=6e-7)


def test_ranging_accuracy():
    np.testing.assert_allclose(all_sigmas(), [109.0, 325.8, 344.5, 2987.2, 1867.7, 10283.5, 13717.6], atol=0.05)
    for duration, expected in (
        (1000.0, (77.1, 230.4, 243.6)),
        (5000.0, (34.5, 103.0, 109.0)),
        (1e5, (7.7, 23.0, 24.4)),
    ):
        np.testing.assert_allclose([ranging_sigma(p, duration=duration) for p in PULSARS[:3]], expected, atol=0.06)


def test_accuracy_is_width_over_twice_the_signal_to_noise_ratio():
    """All photons pulsed, no background to speak of: SNR is the root of the number of photons."""
    p = replace(PULSARS[0], pulsed=1.0)
    assert ranging_sigma(p, background=1e-30) == pytest.approx(C_LIGHT * p.width / 2 / np.sqrt(p.flux * 1e4 * 500))


def test_single_epoch_sigmas():
    def sigmas(vectors, s):
        return np.sqrt(np.diag(single_epoch_covariance(vectors, s)))

    np.testing.assert_allclose(sigmas(directions(PULSARS), all_sigmas()), [1397.9, 306.0, 983.8], atol=0.05)
    np.testing.assert_allclose(sigmas(directions(PULSARS[:3]), all_sigmas()[:3]), [1478.4, 325.3, 1052.6], atol=0.05)
    np.testing.assert_allclose(sigmas(all_directions(), all_sigmas()), [1121.8, 1235.1, 481.2], atol=0.05)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"ra": 360.0}, "right ascension"), ({"ra": -1.0}, "right ascension"), ({"dec": 90.1}, "declination"),
        ({"dec": np.nan}, "not finite"), ({"width": 0.05}, "not longer than the pulse width"),
        ({"pulsed": 0.0}, "pulsed fraction"), ({"pulsed": 1.1}, "pulsed fraction"), ({"flux": 0.0}, "must be positive"),
        ({"distance": -1.0}, "must be positive"), ({"width": 0.0}, "must be positive"),
        ({"distance": 2.0}, "distance 2 m is 6.48e-17 pc"), ({"period": 1e6}, "longer than any pulsar's"),
    ],
)  # fmt: skip
def test_impossible_pulsars_are_refused(change, match):
    with pytest.raises(ValueError, match=match):
        replace(PULSARS[0], **change)


@pytest.mark.parametrize("name", ["area", "duration", "background"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_impossible_observations_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        ranging_sigma(PULSARS[0], **{name: value})


def test_an_accuracy_that_smells_of_a_wrong_unit_warns():
    with pytest.warns(RangingWarning, match="cm"):
        ranging_sigma(PULSARS[6], area=1.0)  # square metres
    with pytest.warns(RangingWarning):
        ranging_sigma(PULSARS[0], area=1e9)


@pytest.mark.parametrize("vector", [(0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (np.nan, 0.0, 1.0)])
def test_directions_must_be_unit_vectors(vector):
    with pytest.raises(ValueError, match="direction 2 has the length"):
        require_distinct(np.array([(1.0, 0.0, 0.0), vector]))


def test_a_pulsar_given_twice_or_a_flat_set_is_refused():
    n = directions(PULSARS[:2])
    with pytest.raises(ValueError, match="directions 1 and 3 are the same"):
        require_distinct(n[[0, 1, 0]])
    with pytest.raises(ValueError, match=r"must be \(m, 3\)"):
        require_distinct(n[:, :2])
    with pytest.raises(ValueError, match="do not span space"):
        single_epoch_covariance(n, np.ones(2))


def at_mars(days):
    e = load_ephemeris()
    return e.position("mars", 2456658.5 + days), e.position("mars", 2456658.5 + days, centre="sun")


def test_differences_of_the_timing_model_are_exact():
    """Against the terms themselves in 40 digits."""
    b, b_sun = (x[0] for x in at_mars(np.array([100.0])))
    r, n, D = np.array([1.1e6, -3.2e6, 1.6e6]), PULSARS[4].direction, PULSARS[4].distance
    with localcontext() as context:
        context.prec = 40

        def exact(v):
            return [Decimal(float(x)) for x in v]

        def dot(u, v):
            return sum(x * y for x, y in zip(u, v, strict=True))

        def moved(v):
            return [x + y for x, y in zip(exact(v), exact(r), strict=True)]

        def parallax(v):
            return (dot(exact(n), v) ** 2 - dot(v, v)) / (2 * Decimal(D))

        def shapiro(v):
            return Decimal(C_LIGHT * timing.SHAPIRO) * (dot(exact(n), v) + dot(v, v).sqrt()).ln()

        wanted = [float(f(moved(v)) - f(exact(v))) for f, v in ((parallax, b), (shapiro, b_sun))]
        whole = float(parallax(exact(b)))
    assert timing.differential_parallax(n, b, r, D) == pytest.approx(wanted[0], rel=1e-9)
    assert timing.differential_shapiro(n, b_sun, r) == pytest.approx(wanted[1], rel=1e-9)
    assert timing.parallax(n, b, D) * C_LIGHT == pytest.approx(whole, rel=1e-12)


def test_largest_differences_over_a_mars_year():
    b, b_sun = at_mars(np.arange(688.0))
    r = 3780e3 * np.vstack([np.eye(3), -np.eye(3)])
    crab, south = PULSARS[0], PULSARS[1]
    shapiro = max(np.abs(timing.differential_shapiro(crab.direction, b_sun, x)).max() for x in r)
    assert shapiro == pytest.approx(2.28, abs=0.1)
    parallax = max(np.abs(timing.differential_parallax(crab.direction, b, x, crab.distance)).max() for x in r)
    assert parallax == pytest.approx(0.0151, abs=1e-4)
    assert timing.largest_shapiro(south.direction, b_sun, 3780e3).max() == pytest.approx(24.8, abs=0.05)
    assert timing.largest_parallax(PULSARS[4].direction, b, 3780e3, PULSARS[4].distance).max() == pytest.approx(
        0.019, abs=1e-3
    )
    assert np.abs(timing.roemer(south.direction, b)).max() == pytest.approx(792.8, abs=0.1)
    assert np.ptp(timing.shapiro(south.direction, b_sun)) == pytest.approx(123e-6, abs=1e-6)


def test_pulsars_near_the_sun_are_flagged():
    _, b_sun = at_mars(np.arange(688.0))
    mask = timing.near_sun(directions(PULSARS), b_sun)
    assert mask.shape == (688, 7)
    angle = timing.sun_angle(PULSARS[0].direction, b_sun)
    np.testing.assert_array_equal(mask[:, 0], angle < np.radians(5.0))
    assert mask.any(axis=0).tolist() == [True, True] + 5 * [False]
    away = max(timing.largest_shapiro(p.direction, b_sun[~mask[:, k]], 3780e3).max() for k, p in enumerate(PULSARS))
    assert away < 1.2 < TRANSFER


def test_positions_are_those_of_the_ephemerides_of_the_pulsars():
    """Against the .par files of observers: within two arc seconds, the rounding of Table 1 and proper motion."""
    for name, number in (("b1509", 5), ("j0218", 6)):
        par = photons.read_par(data_path(f"photons/{name}.par"))
        assert np.linalg.norm(photons.par_direction(par) - PULSARS[number].direction) < 1e-5
    par = photons.read_par(data_path("photons/b1937.par"))  # in ecliptic coordinates
    lon, lat, eps = np.radians([float(par["LAMBDA"]), float(par["BETA"]), 23.43928])
    x, y, z = np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)
    equatorial = np.array([x, y * np.cos(eps) - z * np.sin(eps), y * np.sin(eps) + z * np.cos(eps)])
    assert np.linalg.norm(equatorial - PULSARS[2].direction) < 1e-5
