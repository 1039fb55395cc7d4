"""Eight-lane operations against numpy, compiled or not."""

import numba
import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError

from geokalman.physics.simd import LANES, load, mul, muladd, splat, store


@njit
def work(a, b, out, number):
    for i in range(0, a.size - LANES + 1, LANES):
        x, y = load(a, i), load(b, i + 1)
        store(out, i, muladd(splat(number), mul(x, y), x))


@njit
def only_load(a):
    load(a, 0)
    return 0


@pytest.mark.parametrize("size", [8, 16, 24])
def test_operations_lane_by_lane(size):
    rng = np.random.default_rng(1)
    a, b, out = rng.standard_normal(size), rng.standard_normal(size + 1), np.zeros(size)
    work(a, b, out, 3.5)
    np.testing.assert_allclose(out, 3.5 * a * b[1:] + a, rtol=0, atol=8e-15)


def test_store_touches_eight_numbers_only():
    out = np.full(18, -1.0)
    work(np.ones(8), np.ones(9), out[5:], 1.0)
    np.testing.assert_array_equal(out, [-1.0] * 5 + [2.0] * 8 + [-1.0] * 5)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="types are numba's")
def test_only_contiguous_float64_vectors():
    with pytest.raises(TypingError, match="contiguous float64 vectors, not array"):
        only_load(np.zeros(32)[::2])
    with pytest.raises(TypingError, match="contiguous float64 vectors"):
        only_load(np.zeros(16, np.float32))
