"""The memo: keyed by arguments and code, checked, locked, bounded."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from geokalman import sources
from geokalman.reproduce.errors import Fault
from geokalman.reproduce.memo import Memo


class Pair(NamedTuple):
    a: np.ndarray
    b: float


@dataclass(frozen=True)
class Setup:
    n: int
    scale: float = 1.0


def counting(function):
    """A function that pretends to stand in the package, and counts its calls."""

    def counted(*args, **kwargs):
        counted.calls += 1
        return function(*args, **kwargs)

    counted.calls = 0
    counted.__module__, counted.__qualname__ = "geokalman.files", "counted"
    return counted


def test_computes_once_and_gives_the_same(tmp_path):
    f = counting(lambda setup, x, flag=False: Pair(np.arange(setup.n) * setup.scale * x, x))
    kept = Memo(tmp_path)(f)
    first, second = (kept(Setup(4, 2.0), 3.0, flag=True) for _ in range(2))
    assert f.calls == 1 and isinstance(second, Pair)
    np.testing.assert_array_equal(first.a, second.a)


@pytest.mark.parametrize("args", [(Setup(4, 2.5), 3.0), (Setup(4, 2.0), 3.0000000001), (Setup(4, 2.0), 3)])
def test_other_arguments_other_result(tmp_path, args):
    f = counting(lambda setup, x: (setup, x))
    kept = Memo(tmp_path)(f)
    kept(Setup(4, 2.0), 3.0)
    kept(*args)
    assert f.calls == 2


def test_arrays_dictionaries_and_functions_as_arguments(tmp_path):
    f = counting(lambda *args: 1)
    kept = Memo(tmp_path)(f)
    for _ in range(2):
        kept(np.arange(5.0), {"b": 1, "a": 2}, sources.closure)
    assert f.calls == 1
    kept(np.arange(5.0), {"a": 2, "b": 1}, sources.closure)
    assert f.calls == 1
    kept(np.arange(5.0), {"a": 2, "b": 1}, sources.code_hash)
    kept(np.arange(5.0).astype("f4"), {"a": 2, "b": 1}, sources.closure)
    assert f.calls == 3


def test_a_path_counts_by_its_contents(tmp_path):
    f = counting(lambda path: path.read_text())
    kept = Memo(tmp_path / "memo")(f)
    own = tmp_path / "own.gfc"
    for text in ("one", "one", "two"):
        own.write_text(text)
        assert kept(own) == text
    assert f.calls == 2


def test_ignored_arguments_do_not_enter_the_key(tmp_path):
    f = counting(lambda x, executor=None: x)
    kept = Memo(tmp_path)(f, ignore=("executor",))
    kept(1, executor=object())
    kept(1, executor=object())
    assert f.calls == 1


@pytest.mark.parametrize(
    "damage",
    [
        lambda b: b[:-40],
        lambda b: b[: len(b) // 2] + bytes([b[len(b) // 2] ^ 1]) + b[len(b) // 2 + 1 :],
        lambda b: b"",
        lambda b: b + b"x",
    ],
    ids=["truncated", "one bit", "empty", "longer"],
)
def test_a_damaged_entry_is_noticed_and_recomputed(tmp_path, damage):
    f = counting(lambda: np.arange(1000.0))
    kept = Memo(tmp_path)(f)
    kept()
    [entry] = tmp_path.glob("*.pickle")
    entry.write_bytes(damage(entry.read_bytes()))
    with pytest.warns(UserWarning, match="damaged .its checksum does not hold.; computing it anew"):
        np.testing.assert_array_equal(kept(), np.arange(1000.0))
    assert f.calls == 2
    kept()
    assert f.calls == 2


def test_an_error_is_not_kept(tmp_path):
    f = counting(lambda: 1 / 0)
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            Memo(tmp_path)(f)()
    assert f.calls == 2 and not list(tmp_path.glob("*.pickle"))


def test_bounded_by_least_recent_use(tmp_path):
    f = counting(lambda k: np.full(1000, float(k)))
    kept = Memo(tmp_path, limit=3 * 8300)(f)
    for k in range(3):
        kept(k)
        for entry in tmp_path.glob("*.pickle"):  # all used a second earlier
            stat = entry.stat()
            os.utime(entry, (stat.st_atime - 1, stat.st_mtime - 1))
    kept(0)  # used again: the oldest is now 1
    kept(3)
    assert len(list(tmp_path.glob("*.pickle"))) == 3 and f.calls == 4
    kept(0)
    assert f.calls == 4
    kept(1)
    assert f.calls == 5


def test_a_result_larger_than_the_limit_is_kept_alone(tmp_path):
    kept = Memo(tmp_path, limit=10)(counting(lambda: np.zeros(100)))
    kept()
    assert len(list(tmp_path.glob("*.pickle"))) == 1


def test_disk_full_gives_the_result_all_the_same(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    f = counting(lambda: 5)
    monkeypatch.setattr(os, "replace", full)
    with pytest.warns(UserWarning, match="A result was not kept: .*the disk is full"):
        assert Memo(tmp_path)(f)() == 5
    assert not list(tmp_path.glob("*.pickle")) and not list(tmp_path.glob(".*"))


def test_a_memo_that_cannot_be_used_only_warns(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.warns(UserWarning, match="cannot be used .*; computing anew"):
        assert Memo(tmp_path / "file" / "memo")(counting(lambda: 5))() == 5


def test_functions_of_a_notebook_are_refused(tmp_path):
    def local():
        return 1

    local.__module__ = "__main__"
    with pytest.raises(Fault, match="local stands in __main__; only functions of geokalman can be kept"):
        Memo(tmp_path)(local)


def test_source_edited_since_import_is_never_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(sources, "edited", lambda modules: {"geokalman.files"})
    f = counting(lambda: 5)
    for _ in range(2):
        with pytest.warns(UserWarning, match="geokalman.files changed since it was imported"):
            Memo(tmp_path / "memo")(f)()
    assert f.calls == 2 and not (tmp_path / "memo").exists()


CALL = """
import sys
from pathlib import Path
from geokalman import caller
from geokalman.reproduce.memo import Memo
print(Memo(Path(sys.argv[1]))(caller.work)(2.0))
"""


def run_copy(package: Path, memo: Path, wait=True, **environment):
    env = {k: v for k, v in os.environ.items() if not k.startswith(("GEOKALMAN", "NUMBA_CACHE"))} | {
        "PYTHONPATH": str(package), **environment
    }  # fmt: skip
    process = subprocess.Popen([sys.executable, "-c", CALL, str(memo)], env=env, stdout=subprocess.PIPE, text=True)
    return process.communicate()[0].split() if wait else process


def test_an_edited_callee_is_seen_by_its_kept_caller(package_copy, tmp_path):
    (package_copy / "geokalman" / "callee.py").write_text("def f(x):\n    return x + 1\n")
    (package_copy / "geokalman" / "middle.py").write_text(
        "from geokalman.callee import f\n\n\ndef g(x):\n    return 10 * f(x)\n"
    )
    caller = "from geokalman import middle\n\n\ndef work(x):\n    print('computed')\n    return middle.g(x)\n"
    (package_copy / "geokalman" / "caller.py").write_text(caller)
    memo = tmp_path / "memo"
    assert run_copy(package_copy, memo) == ["computed", "30.0"]
    assert run_copy(package_copy, memo) == ["30.0"]
    (package_copy / "geokalman" / "callee.py").write_text("def f(x):\n    return x + 2\n")
    assert run_copy(package_copy, memo) == ["computed", "40.0"]
    (package_copy / "geokalman" / "files.py").write_text(
        "# not behind the caller\n" + (package_copy / "geokalman" / "files.py").read_text()
    )
    assert run_copy(package_copy, memo) == ["40.0"]


def test_another_computing_setting_is_another_result(package_copy, tmp_path):
    (package_copy / "geokalman" / "caller.py").write_text("def work(x):\n    print('computed')\n    return x\n")
    for environment in ({}, {"NUMBA_CPU_NAME": "generic"}, {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}):
        assert run_copy(package_copy, tmp_path / "memo", **environment) == ["computed", "2.0"]
        assert run_copy(package_copy, tmp_path / "memo", **environment) == ["2.0"]


def test_two_processes_compute_once(package_copy, tmp_path):
    caller = "import time\n\n\ndef work(x):\n    print('computed', flush=True)\n    time.sleep(1.5)\n    return x\n"
    (package_copy / "geokalman" / "caller.py").write_text(caller)
    processes = [run_copy(package_copy, tmp_path / "memo", wait=False) for _ in range(2)]
    told = "".join(p.communicate()[0] for p in processes).split()
    assert sorted(told) == ["2.0", "2.0", "computed"]
