"""tools/environment.py at work: real installers, real wheels, and waiting."""

from __future__ import annotations

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
from environmenttool import SCRIPT, load


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
