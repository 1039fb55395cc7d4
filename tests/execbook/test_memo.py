"""The memo: keyed by arguments and code, checked, locked, bounded."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from execbook import sources
from execbook.errors import Fault
from execbook.memo import Memo


class Pair(NamedTuple):
    a: np.ndarray
    b: float


@dataclass(frozen=True)
class Setup:
    n: int
    scale: float = 1.0


def counting(function):
    """A function that pretends to stand in the package `execbook`, and counts its calls."""

    def counted(*args, **kwargs):
        counted.calls += 1
        return function(*args, **kwargs)

    counted.calls = 0
    counted.__module__, counted.__qualname__ = "execbook.atomic", "counted"
    return counted


def test_computes_once_and_gives_the_same(tmp_path):
    f = counting(lambda setup, x, flag=False: Pair(np.arange(setup.n) * setup.scale * x, x))
    kept = Memo(tmp_path, "execbook")(f)
    first, second = (kept(Setup(4, 2.0), 3.0, flag=True) for _ in range(2))
    assert f.calls == 1 and isinstance(second, Pair)
    np.testing.assert_array_equal(first.a, second.a)


@pytest.mark.parametrize("args", [(Setup(4, 2.5), 3.0), (Setup(4, 2.0), 3.0000000001), (Setup(4, 2.0), 3)])
def test_other_arguments_other_result(tmp_path, args):
    f = counting(lambda setup, x: (setup, x))
    kept = Memo(tmp_path, "execbook")(f)
    kept(Setup(4, 2.0), 3.0)
    kept(*args)
    assert f.calls == 2


def test_arrays_dictionaries_and_functions_as_arguments(tmp_path):
    f = counting(lambda *args: 1)
    kept = Memo(tmp_path, "execbook")(f)
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
    kept = Memo(tmp_path / "memo", "execbook")(f)
    own = tmp_path / "own.gfc"
    for text in ("one", "one", "two"):
        own.write_text(text)
        assert kept(own) == text
    assert f.calls == 2


def test_ignored_arguments_do_not_enter_the_key(tmp_path):
    f = counting(lambda x, executor=None: x)
    kept = Memo(tmp_path, "execbook")(f, ignore=("executor",))
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
    kept = Memo(tmp_path, "execbook")(f)
    kept()
    [entry] = tmp_path.glob("*.pickle")
    entry.write_bytes(damage(entry.read_bytes()))
    with pytest.warns(UserWarning, match="damaged .its checksum does not hold.; it is computed again"):
        np.testing.assert_array_equal(kept(), np.arange(1000.0))
    assert f.calls == 2
    kept()
    assert f.calls == 2


def test_an_error_is_not_kept(tmp_path):
    f = counting(lambda: 1 / 0)
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            Memo(tmp_path, "execbook")(f)()
    assert f.calls == 2 and not list(tmp_path.glob("*.pickle"))


def test_bounded_by_least_recent_use(tmp_path):
    f = counting(lambda k: np.full(1000, float(k)))
    kept = Memo(tmp_path, "execbook", limit=3 * 8300)(f)
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
    kept = Memo(tmp_path, "execbook", limit=10)(counting(lambda: np.zeros(100)))
    kept()
    assert len(list(tmp_path.glob("*.pickle"))) == 1


def test_disk_full_gives_the_result_all_the_same(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    f = counting(lambda: 5)
    monkeypatch.setattr(os, "replace", full)
    with pytest.warns(UserWarning, match="A result was not kept: .*the disk is full"):
        assert Memo(tmp_path, "execbook")(f)() == 5
    assert not list(tmp_path.glob("*.pickle")) and not list(tmp_path.glob(".*"))


def test_a_memo_that_cannot_be_used_only_warns(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.warns(UserWarning, match="cannot be used .*; results are computed again"):
        assert Memo(tmp_path / "file" / "memo", "execbook")(counting(lambda: 5))() == 5


def test_functions_of_a_notebook_are_refused(tmp_path):
    def local():
        return 1

    local.__module__ = "__main__"
    with pytest.raises(Fault, match="local belongs to __main__; only functions of execbook can be kept"):
        Memo(tmp_path, "execbook")(local)


def test_source_edited_since_import_is_never_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(sources, "edited", lambda modules: {"execbook.atomic"})
    f = counting(lambda: 5)
    for _ in range(2):
        with pytest.warns(UserWarning, match="execbook.atomic changed since the import"):
            Memo(tmp_path / "memo", "execbook")(f)()
    assert f.calls == 2 and not (tmp_path / "memo").exists()


CALL = """
import sys
from pathlib import Path
from toys import caller
from execbook.memo import Memo
print(Memo(Path(sys.argv[1]), "toys")(caller.work)(2.0))
"""


@pytest.fixture
def toys(tmp_path):
    """A package with a function that is kept: a caller, a module between, a callee, and one that has no part in it."""
    package = tmp_path / "made" / "toys"
    package.mkdir(parents=True)
    texts = {
        "__init__": "", "other": "", "callee": "def f(x):\n    return x + 1\n",
        "middle": "from toys.callee import f\n\n\ndef g(x):\n    return 10 * f(x)\n",
        "caller": "from toys import middle\n\n\ndef work(x):\n    print('computed', flush=True)\n    return middle.g(x)\n",
    }  # fmt: skip
    for name, text in texts.items():
        (package / f"{name}.py").write_text(text)
    return package


def called(package: Path, memo: Path, wait=True, **environment):
    path = os.pathsep.join([str(package.parent), os.environ.get("PYTHONPATH", "")])
    env = os.environ | {"PYTHONPATH": path, **environment}
    process = subprocess.Popen([sys.executable, "-c", CALL, str(memo)], env=env, stdout=subprocess.PIPE, text=True)
    return process.communicate()[0].split() if wait else process


def test_an_edited_callee_is_seen_by_its_kept_caller(toys, tmp_path):
    memo = tmp_path / "memo"
    assert called(toys, memo) == ["computed", "30.0"]
    assert called(toys, memo) == ["30.0"]
    (toys / "callee.py").write_text("def f(x):\n    return x + 2\n")
    assert called(toys, memo) == ["computed", "40.0"]
    (toys / "other.py").write_text("# not behind the caller\n")
    assert called(toys, memo) == ["40.0"]


def test_another_computing_setting_is_another_result(toys, tmp_path):
    for environment in ({}, {"NUMBA_CPU_NAME": "generic"}):
        assert called(toys, tmp_path / "memo", **environment) == ["computed", "30.0"]
        assert called(toys, tmp_path / "memo", **environment) == ["30.0"]


def test_two_processes_compute_once(toys, tmp_path):
    text = (toys / "caller.py").read_text()
    (toys / "caller.py").write_text(
        text.replace("    return", "    time.sleep(1.5)\n    return").replace("from", "import time\n\nfrom", 1)
    )
    processes = [called(toys, tmp_path / "memo", wait=False) for _ in range(2)]
    told = "".join(p.communicate()[0] for p in processes).split()
    assert sorted(told) == ["30.0", "30.0", "computed"]
