"""Memory that is there, and refusals before it is taken."""

import math
import resource
import subprocess
import sys

import pytest

from geokalman import memory


@pytest.fixture
def nothing_else(monkeypatch):
    """Neither the machine nor `ulimit` bounds memory."""
    monkeypatch.setattr(memory, "_machine", lambda: math.inf)
    monkeypatch.setattr(memory, "_limit", lambda: math.inf)


def test_some_memory_is_there_and_no_more_than_is_built_in():
    assert 1e7 < memory.available() <= memory._machine()


def test_what_does_not_fit_is_refused_in_one_sentence(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 3e9)
    memory.require("A matrix", 2.9e9, "give a lower n")
    sentence = r"^A matrix needs 3.1 GB of memory, and 3 GB are available; give a lower n\.$"
    with pytest.raises(memory.TooLarge, match=sentence):
        memory.require("A matrix", 3.1e9, "give a lower n")
    with pytest.raises(MemoryError):  # for callers that know Python's own
        memory.require("A matrix", math.inf, "give a lower n")


@pytest.mark.parametrize(
    "size, text", [(800, "800 B"), (83e6, "83 MB"), (999e6, "999 MB"), (12.2e9, "12.2 GB"), (104e12, "104 TB")]
)
def test_bytes_for_readers(size, text):
    assert memory.text(size) == text


def test_a_limit_of_the_shell_counts():
    code = "from geokalman import memory; print(memory.available())"

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (10**9, 10**9))

    done = subprocess.run([sys.executable, "-c", code], preexec_fn=limit, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert 0 < float(done.stdout) < 1e9


@pytest.mark.parametrize(
    "line, folder, files",
    [
        ("0::/pod/this", "", {"memory.max": "5000", "memory.current": "1500", "memory.stat": "anon 1\ninactive_file 500\n"}),
        ("4:memory:/pod/this", "memory", {
            "memory.limit_in_bytes": "5000", "memory.usage_in_bytes": "1500", "memory.stat": "cache 9\ninactive_file 500\n",
        }),
    ],
    ids=["version 2", "version 1"],
)  # fmt: skip
@pytest.mark.parametrize("bounded", ["pod", "pod/this"])
def test_a_control_group_counts_and_those_above_it(tmp_path, monkeypatch, nothing_else, line, folder, files, bounded):
    """The limit minus what is used, where files that are only cached are as good as free."""
    monkeypatch.setattr(memory, "_CGROUPS", tmp_path)
    place = tmp_path / folder / bounded
    place.mkdir(parents=True)
    for name, text in files.items():
        (place / name).write_text(text)
    (tmp_path / folder / "pod" / "this").mkdir(exist_ok=True)
    real = memory._lines
    monkeypatch.setattr(memory, "_lines", lambda path: [line] if str(path) == "/proc/self/cgroup" else real(path))
    assert memory.available() == 4000.0
    (place / next(iter(files))).write_text("max")
    assert memory.available() == math.inf


def test_without_the_files_of_linux_all_that_is_built_in_counts(monkeypatch):
    monkeypatch.setattr(memory, "_lines", lambda path: [])
    assert memory.available() == memory._machine() > 1e7
