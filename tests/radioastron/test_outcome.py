"""What a session gives in a reading: against the full linear draws, closed forms, and numbers of a second reader."""

from dataclasses import replace

import numpy as np
import pytest

from execbook import multiverse
from execbook.project import root as project_root
from geokalman.constants import C_LIGHT
from geokalman.kalman.consistency import nees
from geokalman.radioastron import assess, formal, outcome, worlds
from geokalman.radioastron.correlator import Setup, coherence, drifting
from geokalman.radioastron.data import INFLATED, NAIVE, Scenario, Tuning
from geokalman.radioastron.model import toward

ROOT = project_root()


@pytest.fixture(scope="module")
def st():
    return outcome.geometry("ST", "real")


@pytest.mark.parametrize("bias", ["none", "common", "per-pass"])
@pytest.mark.parametrize("weights", [INFLATED, NAIVE, Tuning(10.0, 1e-3, True)])
def test_reduced_draws_have_the_spread_of_full_ones(st, bias, weights):
    """4000 draws of either kind, by independent streams: standard deviations of all six components within 6 %."""
    levels = Scenario(bias=bias)
    full = formal.large_sample(st.linear, levels, weights, np.random.default_rng(5), known=st.effects)
    reduced, _ = formal.reduced_sample(st.linear, st.effects, levels, weights, np.random.default_rng(6))
    for one, other in zip(full, reduced, strict=True):
        np.testing.assert_allclose(one.std(axis=0), other.std(axis=0), rtol=0.06)


def test_an_honest_filter_has_six(st):
    """White noise of the assumed size, no bias, no unknown force: the normalised error squared is 6 (error 0.05)."""
    levels = Scenario(bias="none", pressure_error=0.0, acceleration=0.0, impulse=0.0)
    sample, own = formal.reduced_sample(st.linear, st.effects, levels, NAIVE, np.random.default_rng(1))
    scale = np.sqrt(np.diag(own))
    covariance = np.broadcast_to(own / np.outer(scale, scale), (len(sample.post), 6, 6))
    assert np.mean(nees(sample.post / scale, covariance)) == pytest.approx(6.0, abs=0.25)


def test_draws_with_another_prior_than_assumed(st):
    """Covariance (I - K H) P0 (I - K H)' + K R K' with the gain of five times the sigmas, and no unknown force."""
    levels = Scenario(bias="none", pressure_error=0.0, acceleration=0.0, impulse=0.0)
    wide = replace(levels, prior_position=1e4, prior_velocity=0.25)
    solution = formal.solve(st.linear, wide, NAIVE)
    noise = np.einsum("pki,i,qki->pq", solution.gain, np.array([10.0, 1e-3]) ** 2, solution.gain)
    covariance = solution.prior_gain @ levels.prior_cov @ solution.prior_gain.T + noise
    expected = np.sqrt(np.diag(st.linear.Phi @ covariance @ st.linear.Phi.T))
    sample, _ = formal.reduced_sample(st.linear, st.effects, levels, NAIVE, np.random.default_rng(2), prior_scale=5.0)
    np.testing.assert_allclose(sample.post.std(axis=0), expected, rtol=0.06)


def test_errors_of_the_data_that_an_orbit_error_makes_move_the_orbit_by_it(st):
    """All but what the prior holds back: sum K_k H_k e = (I - prior gain) e."""
    error, levels = np.array([50.0, -20.0, 10.0, 1e-3, -2e-3, 1e-3]), Scenario()
    made = np.einsum("kij,j->ki", st.linear.H, error)
    source = toward(outcome.orbits.toward_circle(st.linear.session, 90.0))
    found = formal.response(st.linear, levels, INFLATED, made, source)
    moved = st.linear.Phi @ (error - formal.solve(st.linear, levels, INFLATED).prior_gain @ error)
    assert found.delay == pytest.approx(moved[:3] @ source / C_LIGHT, rel=1e-6)
    assert found.rate == pytest.approx(moved[3:] @ source / C_LIGHT, rel=1e-6)


@pytest.mark.parametrize(("band", "bandwidth", "channels"), [("L", 16e6, 256), ("L", 32e6, 512), ("C", 16e6, 256)])
def test_drifting_is_coherence_without_its_grid(band, bandwidth, channels):
    """The padded transform loses up to 2.5 % between its cells, the closed form less."""
    setup = Setup(band, bandwidth, channels)
    for rate, acceleration in ((2e-11, 0.0), (1.8e-10, 0.0), (0.0, 3e-15), (1.8e-10, 3e-15)):
        fast = float(drifting(setup, np.array([rate]), np.array([acceleration]))[0])
        slow = coherence(setup, rate, acceleration)
        assert -0.02 < fast / slow - 1.0 < 0.03


def test_drifting_in_closed_form():
    """A pure rate costs nothing while it is far below B T: 1; curvature alone is a Fresnel integral."""
    from scipy.special import fresnel

    setup, q = Setup("L"), 5e-15
    assert drifting(setup, np.array([0.0]), np.array([0.0]))[0] == pytest.approx(1.0)
    x = np.sqrt(2.0 * (setup.frequency + 0.5 * setup.bandwidth) * q) * 300.0
    s, c = fresnel(x)
    assert drifting(setup, np.array([0.0]), np.array([q]))[0] >= np.hypot(s, c) / x - 0.005


def test_shares_of_a_second_reader():
    """Tenfold gains around the circle on the real orbits: ST 17-34 %, OE 36-49 %, BC 12-19 %; rates after tracking."""
    for name, low, high, least, most in (
        ("ST", 0.17, 0.34, 0.66e-10, 1.4e-10), ("OE", 0.36, 0.49, 1.7e-11, 2.6e-11), ("BC", 0.12, 0.19, 0.8e-10, 1.1e-10)
    ):  # fmt: skip
        found = outcome.around(name, outcome.Reading(), np.arange(0.0, 360.0, 45.0))
        assert found["tenfold"].min() > low - 0.03 and found["tenfold"].max() < high + 0.03
        assert found["rate"].min() > 0.93 * least and found["rate"].max() < 1.07 * most


def test_printed_numbers_meet_themselves():
    """Three independent halves: shares of 1/2 and a joint share of 1/8; all of them where a factor is enormous."""
    rng = np.random.default_rng(0)
    signs = np.where(rng.integers(0, 2, (3, 80000)), 1.0, 100.0)
    zero = np.zeros(80000)
    d = outcome.Draws(
        None, None, assess.Residual(2e-6 * signs[2], signs[0], zero), assess.Residual(1e-6 * signs[2], signs[1], zero),
        None, None,
    )  # fmt: skip
    found = outcome.jointly(d, 1.0, 1.0, 1e-6)
    assert found["joint.share"][0] == pytest.approx(0.125, abs=0.01)
    assert found["joint.product"][0] == pytest.approx(0.125, abs=0.01)
    assert outcome.jointly(d, 1.0, 1.0, 1e-6, 1e4)["joint.share"][0] == 1.0


def test_what_figure_3_compares():
    """Post-correlation that leaves the rate is worse than one that takes it off; a predicted filter is no worse."""
    d = outcome.draw("OE", outcome.Reading(), 200, np.random.default_rng(3))
    seen = {
        stage: outcome.signals(d, Setup("C"), 184.0, np.random.default_rng(4), 40, stage)
        for stage in ("delay-and-rate", "delay", "predicted")
    }
    np.testing.assert_array_equal(seen["delay-and-rate"].staged, seen["delay-and-rate"].post)
    assert np.median(seen["delay"].corrected) < np.median(seen["delay-and-rate"].corrected)
    np.testing.assert_array_equal(seen["predicted"].corrected, seen["delay-and-rate"].corrected)
    assert np.median(seen["predicted"].staged) > np.median(seen["predicted"].post)


def test_rows_of_what_is_printed():
    given = {f"{key}.{end}": (value, "") for _, printed, key in outcome.PRINTED
             for end, value in zip(("low", "median", "high"), (0.5 * printed, printed, 2.0 * printed), strict=True)}  # fmt: skip
    rows = outcome.printed(given)
    assert len(rows) == len(outcome.PRINTED) and all(row[-1] == "yes" for row in rows)


def test_the_default_world_is_the_page():
    """The world of the defaults of readings.yml, at the page's scale, and its numbers by name; again the same."""
    declared = multiverse.choices(ROOT, "radioastron-orbit")
    world = multiverse.default(declared)
    assert worlds.reading(world) == outcome.Reading()
    found = worlds.metrics(world)
    page = outcome.numbers(outcome.Reading())
    assert found == {f"{worlds.PAGE}:{key}": value for key, (value, _) in page.items()}
    text = (ROOT / "book" / f"{worlds.PAGE}.md").read_text(encoding="utf-8")
    assert "draws = 2000 " in text and "correlated = 100 " in text and "seed = 1 " in text


def test_every_option_makes_a_world():
    """Each option of each choice alone changes some number, and a place in the list of worlds other draws."""
    declared = multiverse.choices(ROOT, "radioastron-orbit")
    usual = multiverse.default(declared)
    readings = {worlds.reading(usual)}
    for choice in declared:
        values = [o.id for o in choice.options] or list(choice.range)
        readings |= {worlds.reading({**usual, choice.id: value}) for value in values}
    assert len(readings) == 1 + sum(len(c.options) - 1 if c.options else 2 for c in declared)
    small = [outcome.numbers(outcome.Reading(), 100, 10, seed)["st.post.rate.rms"][0] for seed in (1, 2)]
    assert small[0] != small[1]
    with pytest.raises(KeyError):
        worlds.reading({**usual, "impulse": "large"})
    assert replace(outcome.Reading(), impulse=0.0).levels.impulse == 0.0
