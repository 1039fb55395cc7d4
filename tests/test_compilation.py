"""numba's compilation cache after a fault: what is damaged is compiled anew, and the numbers stay the same."""

import itertools
import os
import pickle
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from geokalman import compilation

CALL = """
import numpy as np
from numba.core.dispatcher import Dispatcher
from geokalman.physics import quaternion

p, turn = np.array([0.5, -0.5, 0.5, 0.5]), np.array([0.3, -0.2, 0.1])
q, work, product, moved, back = np.empty((5, 4))
quaternion.exp_point(turn, q)
quaternion.multiply_point(p, q, product)
quaternion.log_point(product, back)
quaternion.retract_point(p, turn, work, moved)
quaternion.difference_point(p, moved, work, turn)
ours = [f.stats for f in vars(quaternion).values() if isinstance(f, Dispatcher)]
hits, misses = sum(len(s.cache_hits) for s in ours), sum(len(s.cache_misses) for s in ours)
print(*map(float.hex, [back[0], moved[1], turn[2]]), hits, misses)
"""


class Broken:
    """Its pickle raises an error wherever it is read."""

    def __reduce__(self):
        return (__import__, ("no_such_module_of_anybody",))


def flipped(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


DAMAGE = [
    lambda data: data[: len(data) // 2],
    lambda data: b"",
    lambda data: os.urandom(len(data)),
    flipped,
    lambda data: pickle.dumps(Broken()),
]


def call(cache: Path, **limits) -> list[str]:
    """Run compiled functions of the package with their cache there: three numbers, hits and misses of the cache."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(("GEOKALMAN", "NUMBA"))}
    env |= {"NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", CALL], env=env, capture_output=True, text=True, timeout=600, **limits
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """Cache folder of the package's own compiled functions, and what they give."""
    cache = tmp_path_factory.mktemp("numba")
    *numbers, hits, misses = call(cache)
    assert hits == "0" != misses
    assert call(cache) == [*numbers, misses, "0"]  # the cache works at all
    return cache, numbers, misses


def files(cache: Path) -> list[Path]:
    return [path for path in sorted(cache.rglob("*.nb*")) if path.is_file()]


@pytest.mark.parametrize("kind", [".nbi", ".nbc"])
def test_a_damaged_cache_heals(compiled, tmp_path, kind):
    """Every file of one kind is damaged, one in this way and the next in that, so that each way has its turn."""
    cache, numbers, misses = compiled
    cache = shutil.copytree(cache, tmp_path / "cache")
    spoilt = [path for path in files(cache) if path.suffix == kind]
    assert len(spoilt) >= len(DAMAGE)
    for path, damage in zip(spoilt, itertools.cycle(DAMAGE)):
        path.write_bytes(damage(path.read_bytes()))
    assert call(cache) == [*numbers, "0", misses]
    assert all(compilation._sound(path) for path in files(cache))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read anything")
def test_a_cache_that_may_not_be_read_heals(compiled, tmp_path):
    cache, numbers, misses = compiled
    cache = shutil.copytree(cache, tmp_path / "cache")
    for path in files(cache):
        path.chmod(0)
    assert call(cache) == [*numbers, "0", misses]


def test_a_folder_in_the_place_of_a_file_is_no_obstacle(compiled, tmp_path):
    cache, numbers, misses = compiled
    cache = shutil.copytree(cache, tmp_path / "cache")
    for path in files(cache):
        path.unlink()
        path.mkdir()
    assert call(cache) == [*numbers, "0", misses]


def test_a_full_disk_keeps_nothing_and_harms_nothing(compiled, tmp_path):
    def full():
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

    _, numbers, misses = compiled
    assert call(tmp_path / "cache", preexec_fn=full) == [*numbers, "0", misses]
    assert not files(tmp_path / "cache")
