"""numba's compilation cache after a fault: what is damaged is compiled anew, and the numbers stay the same."""

import ast
import importlib
import itertools
import os
import pickle
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from numba import config
from numba.core.dispatcher import Dispatcher

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
    env = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA")} | {"NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run([sys.executable, "-c", CALL], env=env, capture_output=True, text=True, timeout=600, **limits)
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
    assert all(compilation.is_sound(path) for path in files(cache))


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


def in_copy(package: Path, code: str, **environment: str) -> list[str]:
    """Run code with a copy of the package; gives the words that it prints."""
    env = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_CACHE")}
    env |= {"PYTHONPATH": str(package), **environment}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


KERNEL = """
from numba import njit

from geokalman import compilation


@njit(cache=True)
def inner(x):
    return x + {}.0
"""
LOOP = """
from numba import njit

from geokalman.kernel_module import inner


@njit(cache=True)
def outer(n):
    total = 0.0
    for _ in range(n):
        total += inner(1.0)
    return total
"""
OUTER = "from geokalman.loop_module import outer\nprint(outer(10), sum(outer.stats.cache_hits.values()))"


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_an_edited_kernel_never_runs_from_a_stale_cache(package_copy, tmp_path):
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    kernel = package_copy / "geokalman" / "kernel_module.py"
    kernel.write_text(KERNEL.format(1))
    (package_copy / "geokalman" / "loop_module.py").write_text(LOOP)
    assert in_copy(package_copy, OUTER, **cache) == ["20.0", "0"]
    assert in_copy(package_copy, OUTER, **cache) == ["20.0", "1"]  # the cache works at all
    stat = kernel.stat()
    kernel.write_text(KERNEL.format(2))
    os.utime(kernel, ns=(stat.st_atime_ns, stat.st_mtime_ns))  # numba looks at time and size only: both as before
    assert kernel.stat().st_size == stat.st_size
    assert in_copy(package_copy, OUTER, **cache) == ["30.0", "0"]
    kernel.write_text(KERNEL.format(1))
    assert in_copy(package_copy, OUTER, **cache)[0] == "20.0"


def test_importing_the_package_changes_nothing_else(tmp_path):
    """No variable of the environment, no folder; another library's functions stay where numba puts them."""
    (tmp_path / "theirs.py").write_text("from numba import njit\n\n@njit(cache=True)\ndef f(x):\n    return x + 1\n")
    code = (
        "import os, pathlib\nbefore = dict(os.environ)\nimport geokalman\nimport geokalman.kalman, theirs\nassert"
        " dict(os.environ) == before and not pathlib.Path('home').exists()\nfrom numba.core import"
        " caching\nprint(theirs.f(1), type(theirs.f._cache._cache_file).__name__, theirs.f._cache.cache_path)"
    )
    env = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA")} | {
        "XDG_CACHE_HOME": str(tmp_path / "home")
    }
    path = os.pathsep.join([str(tmp_path), env.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", code], env=env | {"PYTHONPATH": path}, cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["2", "IndexDataCacheFile", str(tmp_path / "__pycache__")]


COMPILED = [p for p in compilation.PACKAGE.rglob("*.py") if "njit" in p.read_text() and p.name != "compilation.py"]


@pytest.mark.parametrize("path", COMPILED, ids=lambda path: path.stem)
@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_every_compiled_function_is_kept_here(path):
    name = ".".join(path.relative_to(compilation.PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
    module = importlib.import_module(name)
    ours = [f for f in vars(module).values() if isinstance(f, Dispatcher) and f.py_func.__module__ == name]
    kept = [f._cache._impl.locator for f in ours if hasattr(f._cache, "_impl")]
    assert all(isinstance(locator, compilation.Locator) for locator in kept)
    assert {locator.get_source_stamp() for locator in kept} <= {compilation.stamp(path)}


def fast_math(source: str) -> list[int]:
    """Lines that let the compiler change the arithmetic."""
    return [
        node.value.lineno
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.keyword) and node.arg == "fastmath"
    ]


@pytest.mark.parametrize("path", COMPILED, ids=lambda path: path.stem)
def test_no_compiled_function_has_an_arithmetic_of_its_own(path):
    """What the compiler contracts depends on what it inlines, and so on what was in the cache: numbers would have a
    history."""
    assert fast_math(path.read_text(encoding="utf-8")) == []


def test_the_guard_of_the_arithmetic_bites():
    assert fast_math("x = 1\n@njit(cache=True, fastmath={'contract'})\ndef f(): pass") == [2]


def test_only_the_latest_earlier_sources_stay(tmp_path, monkeypatch):
    monkeypatch.setattr(compilation, "folder", lambda: tmp_path)
    for k in range(6):
        monkeypatch.setattr(compilation, "stamp", lambda _, k=k: f"{k:016d}")
        locator = compilation.Locator(lambda: None, compilation.PACKAGE / "kalman" / "linear.py")
        locator.ensure_cache_path()
        os.utime(locator.get_cache_path(), (k, k))
    assert sorted(os.listdir(tmp_path / "kalman" / "linear")) == [f"{k:016d}" for k in range(2, 6)]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_home_of_the_cache_falls_back(tmp_path):
    (tmp_path / "cache").mkdir(mode=0o500)
    code = "from geokalman import compilation; print(compilation.folder())"
    [folder] = in_copy(compilation.PACKAGE.parent, code, NUMBA_CACHE_DIR=str(tmp_path / "cache" / "x"))
    assert not folder.startswith(str(tmp_path)) and os.access(folder, os.W_OK)


OWN = "from pathlib import Path; import tempfile; own = Path(tempfile.gettempdir(), f'geokalman-{os.getuid()}')"
FORBIDDEN = {
    "ours": ("own.mkdir(0o700)", True),
    "new": ("", True),
    "readable": ("own.mkdir(0o755)", False),
    "writable": ("own.mkdir(); own.chmod(0o777)", False),
    "link": ("Path(own.parent, 'x').mkdir(0o700); own.symlink_to('x')", False),
    "dangling": ("own.symlink_to('nowhere')", False),
    "file": ("own.touch()", False),
    "another's": ("owner = os.getuid(); os.getuid = lambda: owner + 1; own = own.with_name(f'geokalman-{owner + 1}'); own.mkdir(0o700)", False),
}  # fmt: skip


@pytest.mark.parametrize("prepare, taken", FORBIDDEN.values(), ids=FORBIDDEN)
def test_the_temporary_home_of_the_cache_is_private(tmp_path, prepare, taken):
    """Machine code that another user put there would be executed; a fresh folder is made, and goes with the process."""
    (tmp_path / "temporary").mkdir()
    (tmp_path / "no folder").touch()
    code = f"import os\n{OWN}\n{prepare}\nfrom geokalman import compilation; home = compilation.folder()\n"
    code += "print(home == own, oct(home.stat().st_mode)[-3:], home.is_symlink(), home)"
    asked = {"NUMBA_CACHE_DIR": str(tmp_path / "no folder" / "cache"), "TMPDIR": str(tmp_path / "temporary")}
    own, mode, link, home = in_copy(compilation.PACKAGE.parent, code, **asked)
    assert (own, mode, link) == (str(taken), "700", "False")
    assert Path(home).parent == tmp_path / "temporary" and Path(home).exists() == taken
