"""tools/environment.py: the locks and nothing else, on machines that they are for, whole or not at all."""

from __future__ import annotations

import ast
import importlib.util
import inspect
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import zipfile
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SCRIPT = ROOT / "tools" / "environment.py"


def load():
    spec = importlib.util.spec_from_file_location("environment_tool", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# --- what is done, and when: pip and venv replaced by a diary


@pytest.fixture
def tool(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The script on a copy of the project's locks; what it would run is written into its `diary`."""
    module = load()
    for name in ("environment.txt", "tools/locks/test.txt", "tools/locks/uv.txt", "pyproject.toml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    module.diary, module.answer = [], {}

    def failure(command: list, **_: object) -> str | None:
        words = [str(word) for word in command]
        if "venv" in words:
            entry = "new"
        else:
            entry = "check" if words[-1] == "check" else "package" if "-e" in words else Path(words[-1]).name
        module.diary.append(entry)
        return module.answer.get(entry)

    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(module, "failure", failure)
    return module


def entries(tool, folder: Path, *extras: str) -> list[str]:
    tool.diary.clear()
    tool.bring_up_to_date(folder, list(extras))
    return list(tool.diary)


WHOLE = ["new", "uv.txt", "environment.txt", "package", "src", "check"]


def test_the_environment_follows_its_locks(tool, tmp_path: Path) -> None:
    folder = tmp_path / "venv"
    assert entries(tool, folder) == WHOLE
    assert entries(tool, folder) == []
    assert entries(tool, folder, "test") == ["uv.txt", "test.txt", "check"]
    assert entries(tool, folder, "test") == []
    (tmp_path / "pyproject.toml").write_text("changed")
    assert entries(tool, folder) == ["package", "src", "check"]
    (tmp_path / "environment.txt").write_text("changed")
    assert entries(tool, folder, "test") == ["uv.txt", "environment.txt", "test.txt", "package", "src", "check"]


@pytest.mark.parametrize("where", ["new", "environment.txt", "package", "check"])
def test_an_interrupted_installation_starts_anew(tool, tmp_path: Path, where: str) -> None:
    folder = tmp_path / "venv"
    entries(tool, folder)
    (tmp_path / "environment.txt").write_text("changed")
    if where == "new":
        (folder / "installed.json").unlink()
    tool.answer = {where: "a dependency is missing"}
    with pytest.raises(SystemExit, match="a dependency is missing"):
        entries(tool, folder)
    tool.answer = {}
    (folder / "half").touch()
    assert entries(tool, folder) == WHOLE
    assert not (folder / "half").exists() and entries(tool, folder) == []


def test_an_environment_that_was_moved_is_made_anew(tool, tmp_path: Path) -> None:
    entries(tool, tmp_path / "venv")
    (tmp_path / "venv").rename(tmp_path / "moved")
    assert entries(tool, tmp_path / "moved")[0] == "new"


def test_a_folder_that_is_no_environment_is_left_alone(tool, tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    (home / "letters").touch()
    with pytest.raises(SystemExit, match=f"{home} is not empty and is no virtual environment"):
        entries(tool, home)
    assert (home / "letters").exists()


# --- machines and Pythons


def test_this_machine_is_taken() -> None:
    tool = load()
    assert tool.unsupported(tool.this_host()) is None


@pytest.mark.parametrize(
    "system, machine, version",
    [("Linux", "x86_64", (2, 28)), ("Linux", "aarch64", (2, 41)), ("Darwin", "arm64", (14, 0))],
)
@pytest.mark.parametrize("python", [(3, 11), (3, 12), (3, 13)])
def test_machines_that_the_locks_are_for(python, system, machine, version) -> None:
    tool = load()
    assert tool.unsupported(tool.Host(python, "CPython", system, machine, version, True)) is None


@pytest.mark.parametrize(
    "differs, sentence",
    [
        (
            {"python": (3, 10)},
            "python3 is CPython 3.10; the locked packages are for CPython 3.11 to 3.13. "
            "Name one of these, as in: make env PYTHON=python3.13",
        ),
        ({"python": (3, 14)}, "python3 is CPython 3.14; the locked packages are for"),
        ({"kind": "free-threaded CPython"}, "python3 is free-threaded CPython 3.12; the locked packages are for"),
        ({"kind": "PyPy"}, "python3 is PyPy 3.12; the locked packages are for"),
        (
            {"system": "Darwin", "machine": "x86_64", "version": (15, 1)},
            "This is a Python for x86_64 on macOS; llvmlite and satkit have wheels for arm64 only.",
        ),
        (
            {"system": "Darwin", "machine": "arm64", "version": (13, 6)},
            "This machine has macOS 13.6; the locked wheels of pyproj need 14.0 or later.",
        ),
        (
            {"version": (2, 17)},
            "This machine has glibc 2.17; the locked wheels of NumPy, SciPy and others need 2.28 or later.",
        ),
        (
            {"version": ()},
            "This Linux has a C library other than glibc; numba and llvmlite need glibc 2.28 or later.",
        ),
        (
            {"machine": "riscv64"},
            "This is Linux on riscv64; the locked packages have wheels for Linux on x86_64 and aarch64 and for macOS",
        ),
        ({"machine": "32 bits"}, "This is Linux on 32 bits; the locked packages"),
        ({"system": "Windows", "machine": "AMD64", "version": ()}, "This is Windows on AMD64; the locked packages"),
        ({"ensurepip": False}, "This Python cannot make a virtual environment, for it has no ensurepip: apt install"),
    ],
)
def test_other_machines_are_refused_in_a_sentence(differs: dict, sentence: str) -> None:
    tool = load()
    host = tool.Host((3, 12), "CPython", "Linux", "x86_64", (2, 36), True)
    assert tool.unsupported(host) is None
    refused = tool.unsupported(host._replace(**differs))
    assert refused.startswith(sentence) and "\n" not in refused


def test_a_refusal_comes_before_anything_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tool = load()
    monkeypatch.setattr(tool.platform, "system", lambda: "Windows")
    monkeypatch.setattr(sys, "argv", ["environment.py", "--venv", str(tmp_path / "venv")])
    with pytest.raises(SystemExit, match="This is Windows"):
        tool.main()
    assert list(tmp_path.iterdir()) == []


def test_an_old_python_gets_far_enough_to_be_refused() -> None:
    text = SCRIPT.read_text()
    ast.parse(text, feature_version=(3, 6))
    assert "\nfrom __future__" not in text
    builtins = [node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Subscript)]
    assert [node.id for node in builtins if getattr(node, "id", "") in ("dict", "list", "tuple")] == []


def test_the_locks_are_tried_on_the_machines_that_are_taken() -> None:
    script = (ROOT / "tools" / "lock.sh").read_text()
    for (system, machine), (major, minor) in load().WHEELS.items():
        if system == "Linux":
            assert f"{machine}-manylinux_{major}_{minor}" in script
        else:
            assert "aarch64-apple-darwin" in script and f"MACOSX_DEPLOYMENT_TARGET={major}.{minor}" in script


# --- real installers, on packages made here, without a network


def wheel(folder: Path, name: str, version: str, *metadata: str, script: str = "") -> str:
    """Write a wheel with one module, which knows its version, and perhaps a script of its name; its line in a lock."""
    path = folder / f"{name}-{version}-py3-none-any.whl"
    about = f"{name}-{version}.dist-info"
    described = ["Metadata-Version: 2.1", f"Name: {name}", f"Version: {version}", *metadata, ""]
    content = {
        f"{name}.py": f"version = '{version}'\n",
        f"{about}/METADATA": "\n".join(described),
        f"{about}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    if script:
        content[f"{name}-{version}.data/scripts/{name}"] = script
    content[f"{about}/RECORD"] = "".join(f"{file},,\n" for file in [*content, f"{about}/RECORD"])
    with zipfile.ZipFile(path, "w") as archive:
        for file, text in content.items():
            entry = zipfile.ZipInfo(file)
            entry.external_attr = 0o100755 << 16
            archive.writestr(entry, text)
    return f"{name}=={version} --hash=sha256:{sha256(path.read_bytes()).hexdigest()}\n"


BACKEND = """
def build_editable(folder, *_):
    wheel(Path(folder), "geokalman", "0")
    return "geokalman-0-py3-none-any.whl"
"""


@pytest.fixture
def stranger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A clone with a small lock a week later: `base`, which `plugin` requires with an extra, has a newer release."""
    clone, links = tmp_path / "clone", tmp_path / "links"
    (clone / "tools" / "locks").mkdir(parents=True)
    links.mkdir()
    shutil.copy(SCRIPT, clone / "tools")
    extra = ("Provides-Extra: more", 'Requires-Dist: helper; extra == "more"')
    lock = wheel(links, "base", "1.0", *extra)
    lock += wheel(links, "helper", "1.0")
    lock += wheel(links, "plugin", "1.0", "Requires-Dist: base[more]")
    wheel(links, "base", "2.0", *extra)
    (clone / "environment.txt").write_text(lock)
    (clone / "tools" / "locks" / "uv.txt").write_text(wheel(tmp_path, "uv", "1.0"))  # which no index has
    (clone / "pyproject.toml").write_text(
        '[build-system]\nrequires = []\nbuild-backend = "backend"\nbackend-path = ["."]\n'
        '[project]\nname = "geokalman"\nversion = "0"\n'
    )
    code = "import zipfile\nfrom hashlib import sha256\nfrom pathlib import Path\n"
    (clone / "backend.py").write_text(code + inspect.getsource(wheel) + BACKEND)
    for name in [name for name in os.environ if name.startswith(("PIP_", "UV_"))]:
        monkeypatch.delenv(name)
    settings = tmp_path / "pip.conf"
    settings.write_text(f"[global]\nno-index = true\nuser = true\n[install]\nfind-links =\n    {links}\n")
    monkeypatch.setenv("PIP_CONFIG_FILE", str(settings))
    monkeypatch.setenv("UV_CACHE_DIR", str(tmp_path / "cache"))
    return clone


def offer_uv(stranger: Path, script: str) -> None:
    """Put a wheel of uv that is but this shell script where packages come from, and pin it."""
    line = wheel(stranger.parent / "links", "uv", "1.0", script=f"#!/bin/sh\n{script}\n")
    (stranger / "tools" / "locks" / "uv.txt").write_text(line)


def set_up(stranger: Path, python: Path = Path(sys.executable), **more: str) -> str:
    """Call the script twice, the second time for nothing; what the first said."""
    command = [python, "tools/environment.py"]
    how = {"cwd": stranger, "capture_output": True, "text": True, "env": os.environ | more}
    first = subprocess.run(command, **how)
    assert first.returncode == 0, first.stdout + first.stderr
    second = subprocess.run(command, **how)
    assert (second.returncode, second.stdout, second.stderr) == (0, "", "")
    return first.stdout


def installed(stranger: Path) -> str:
    code = "import base, geokalman, helper, plugin; print(base.version)"
    return subprocess.run([stranger / ".venv/bin/python", "-c", code], capture_output=True, text=True).stdout.strip()


def test_pip_installs_the_lock_whatever_is_released_later(stranger: Path) -> None:
    old = [sys.executable, "-m", "pip", "install", "--no-user", "--target", str(stranger / "old"), "--require-hashes"]
    resolved = subprocess.run([*old, "-r", "environment.txt"], cwd=stranger, capture_output=True, text=True)
    numbers = tuple(int(n) for n in re.findall(r"\d+", version("pip"))[:2])
    if numbers < (23, 3):  # resolving, it meets the newer release first, which has no hash
        assert resolved.returncode and "base[more] from" in resolved.stderr and "base-2.0" in resolved.stderr
    else:
        assert resolved.returncode == 0, resolved.stderr
    said = set_up(stranger, PYTHONPATH=str(stranger / "old"))  # what stands there is not in the environment
    assert installed(stranger) == "1.0"
    assert "environment: uv cannot be had here; pip installs, which takes longer" in said


def test_uv_installs_the_lock_from_where_pip_is_told_to(stranger: Path) -> None:
    uv = shutil.which("uv", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    if uv is None:
        pytest.skip("uv cannot be had on this machine")
    offer_uv(stranger, f'exec {uv} "$@"')
    said = set_up(stranger)
    assert installed(stranger) == "1.0"
    assert "pip" not in said
    (installer,) = (stranger / ".venv").glob("lib/python*/site-packages/base-1.0.dist-info/INSTALLER")
    assert installer.read_text().strip() == "uv"


def test_where_uv_fails_pip_takes_over_even_in_an_activated_and_unfinished_environment(stranger: Path) -> None:
    offer_uv(stranger, "echo 'error: no route to host'; exit 2")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", stranger / ".venv"], check=True)
    (stranger / ".venv" / "half").touch()
    said = set_up(stranger, stranger / ".venv" / "bin" / "python")  # which is removed meanwhile
    assert not (stranger / ".venv" / "half").exists()
    assert "environment: uv failed (error: no route to host); pip installs, which takes longer" in said
    assert installed(stranger) == "1.0"


def test_pips_index_settings_are_told_to_uv_by_its_own_names(stranger: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Path(os.environ["PIP_CONFIG_FILE"]).write_text(
        "[global]\nindex-url = https://one.example/simple\ncert = /ca.pem\nfind-links = /never\n"
        "[install]\nextra-index-url =\n    https://two.example/a\n    https://two.example/b\n"
        "find-links =\n    /x\n    /y\n"
    )
    flags, settings = load().index_settings(Path(sys.executable))
    assert flags == []
    assert settings == {
        "UV_DEFAULT_INDEX": "https://one.example/simple",
        "UV_INDEX": "https://two.example/a https://two.example/b",
        "UV_FIND_LINKS": "/x,/y",
        "SSL_CERT_FILE": "/ca.pem",
        "UV_INDEX_STRATEGY": "unsafe-best-match",
    }
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", "/z")
    flags, settings = load().index_settings(Path(sys.executable))
    assert flags == ["--no-index"] and settings["UV_FIND_LINKS"] == "/z"


# --- killed midway, and twice at once

SLOW = """#!/bin/sh
# As `python -m venv` this makes an environment with itself as its Python; as an installer it waits to be told.
for last; do :; done
case "$*" in
*" venv "*)
    mkdir -p "$last/bin" && cp "$0" "$last/bin/python" && touch "$last/pyvenv.cfg" ;;
*environment.txt)
    echo begins >> "$FAKE/log"
    if [ -n "$SLOW" ]; then echo > "$FAKE/started"; read told < "$FAKE/go"; fi
    echo ends >> "$FAKE/log"
    echo whole > "$FAKE/clone/.venv/package" ;;
esac
"""


@pytest.fixture
def slow(tmp_path: Path):
    """A function that starts the script with a Python that installs nothing, slowly or at once."""
    clone = tmp_path / "clone"
    (clone / "tools" / "locks").mkdir(parents=True)
    shutil.copy(SCRIPT, clone / "tools")
    for name in ("environment.txt", "pyproject.toml"):
        (clone / name).write_text(name)
    for name in ("started", "go"):
        os.mkfifo(tmp_path / name)
    (tmp_path / "python").write_text(SLOW)
    (tmp_path / "python").chmod(0o755)
    code = (
        "import runpy, sys; sys._base_executable = sys.argv.pop(1); sys.argv.pop(0); "
        "runpy.run_path(sys.argv[0], run_name='__main__')"
    )
    command = [sys.executable, "-c", code, tmp_path / "python", clone / "tools" / "environment.py"]
    started = []

    def start(slowly: bool) -> subprocess.Popen:
        environment = os.environ | {"FAKE": str(tmp_path), "SLOW": "yes" if slowly else ""}
        started.append(subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.mark.parametrize("killed", [True, False], ids=["killed", "twice at once"])
def test_an_installer_at_work_is_waited_for(slow, tmp_path: Path, killed: bool) -> None:
    pipe = os.open(tmp_path / "started", os.O_RDONLY | os.O_NONBLOCK)
    first = slow(True)
    assert select.select([pipe], [], [], 120)[0], "the installer was never started"
    if killed:
        first.send_signal(signal.SIGKILL)
        first.wait()
    second = slow(False)
    assert second.stdout.readline() == "environment: another call is at work on .venv; waiting for it\n"
    assert (tmp_path / "log").read_text() == "begins\n" and second.poll() is None
    (tmp_path / "go").write_text("\n")
    said, _ = second.communicate()
    assert second.returncode == 0
    assert ("making .venv" in said) is killed  # the orphan left no stamp
    assert (tmp_path / "log").read_text() == "begins\nends\n" * (2 if killed else 1)
    assert sorted(path.name for path in (tmp_path / "clone" / ".venv").iterdir()) == [
        "bin", "installed.json", "package", "pyvenv.cfg",
    ]  # fmt: skip
    os.close(pipe)
