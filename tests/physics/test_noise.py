"""White noise and flicker: moments, spectrum, and what stays as it was."""

import numpy as np
import pytest

from geokalman.physics.noise import flicker, white


def test_white_noise_is_the_generators_numbers_times_sigma():
    wanted = 0.02 * np.random.default_rng(20190424).standard_normal((5, 3))
    np.testing.assert_array_equal(white(np.random.default_rng(20190424), 0.02, (5, 3)), wanted)


def test_zero_sigma_advances_the_generator_all_the_same():
    one, other = np.random.default_rng(1), np.random.default_rng(1)
    assert not np.any(white(one, 0.0, 7))
    white(other, 1.0, 7)
    assert one.random() == other.random()


def test_spectral_density_of_flicker_is_white_times_one_plus_corner_over_frequency():
    dt, corner, n, runs, sigma = 30.0, 5e-3, 4096, 400, 3e-7
    series = flicker(white(np.random.default_rng(7), sigma, (n, runs)), dt, corner)
    frequency = np.fft.rfftfreq(n, dt)[1:-1]
    density = 2.0 * dt / n * np.mean(np.abs(np.fft.rfft(series, axis=0)[1:-1]) ** 2, axis=1)  # one-sided
    wanted = 2.0 * sigma**2 * dt * (1.0 + corner / frequency)
    ratio = density / wanted
    # the mean of 400 exponential variates scatters by 5 %; of all 2047 frequencies the largest by about 4.5 of that
    assert ratio.mean() == pytest.approx(1.0, abs=5 * 0.05 / np.sqrt(frequency.size))
    assert np.all(np.abs(ratio - 1.0) < 5.5 * 0.05)
    low = frequency < 1e-4
    assert ratio[low].mean() == pytest.approx(1.0, abs=5 * 0.05 / np.sqrt(low.sum()))


@pytest.mark.parametrize("n", [64, 65])
def test_flicker_multiplies_each_frequency_of_a_two_sided_transform(n):
    series = np.random.default_rng(3).standard_normal(n)
    frequency = np.abs(np.fft.fftfreq(n, 5.0))
    factor = np.where(frequency > 0, np.sqrt(1.0 + 5e-3 / np.where(frequency > 0, frequency, 1.0)), 1.0)
    wanted = np.fft.ifft(np.fft.fft(series) * factor).real
    np.testing.assert_allclose(flicker(series, 5.0, 5e-3), wanted, rtol=0, atol=1e-13)


def test_flicker_keeps_the_mean_and_without_a_corner_everything():
    series = np.random.default_rng(3).standard_normal((101, 2)) + 4.0
    np.testing.assert_allclose(flicker(series, 30.0, 5e-3).mean(axis=0), series.mean(axis=0), rtol=1e-14)
    limit = 8 * np.log2(len(series)) * np.spacing(np.abs(series).max())  # two transforms of log2(n) stages
    np.testing.assert_allclose(flicker(series, 30.0, 0.0), series, rtol=0, atol=limit)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: white(np.random.default_rng(0), -1.0, 3), "sigma = -1.0 must be finite and not negative"),
        (lambda: white(np.random.default_rng(0), np.nan, 3), "sigma = nan must be"),
        (lambda: flicker(np.ones(4), 0.0, 1.0), "dt = 0.0 s must be positive"),
        (lambda: flicker(np.ones(4), 1.0, -1.0), "Corner frequency -1.0 Hz must be"),
    ],
)
def test_what_is_no_noise_is_refused(call, says):
    with pytest.raises(ValueError, match=says):
        call()
