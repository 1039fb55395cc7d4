"""What a stranger meets first: a clone, locks, licences, the wheel and the targets of make."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import geokalman

ROOT = Path(__file__).resolve().parents[1]
LOCKS = ["environment", "environment-test", "environment-lab"]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def chosen(name: str) -> dict[str, Requirement]:
    """What a file `.in` asks for, by name."""
    lines = (line.partition(" #")[0].strip() for line in (ROOT / f"{name}.in").read_text().splitlines())
    found = [Requirement(line) for line in lines if line and line[0] != "#"]
    return {canonicalize_name(r.name): r for r in found}


def locked(name: str) -> dict[str, set[str]]:
    """Package -> versions of a lock."""
    found: dict[str, set[str]] = {}
    for package, version in re.findall(r"^([A-Za-z0-9._-]+)==(\S+)", (ROOT / f"{name}.txt").read_text(), re.M):
        found.setdefault(canonicalize_name(package), set()).add(version)
    return found


@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_is_hashed_complete_and_names_no_host(name: str) -> None:
    text = (ROOT / f"{name}.txt").read_text()
    assert "://" not in text and "--index-url" not in text and "--find-links" not in text
    entries = re.split(r"\n(?=[a-z0-9])", text)[1:]
    assert len(entries) > 30
    assert [entry.split()[0] for entry in entries if "--hash=sha256:" not in entry] == []
    versions = locked(name)
    for package, requirement in chosen(name).items():
        (version,) = versions[package]  # one for all Pythons
        assert requirement.specifier.contains(version), package


def test_the_installer_is_pinned_by_hash() -> None:
    (pinned,) = locked("tools/uv").items()
    assert pinned[0] == "uv" and len(pinned[1]) == 1
    assert (ROOT / "tools" / "uv.txt").read_text().count("--hash=sha256:") > 10  # one for each platform


@pytest.mark.parametrize("name", LOCKS[1:])
def test_the_further_locks_agree_with_the_first(name: str) -> None:
    first = locked("environment")
    assert {p: v for p, v in locked(name).items() if p in first and v != first[p]} == {}


def test_what_the_package_declares_is_locked_and_satisfied() -> None:
    versions = locked("environment")
    declared = PROJECT["dependencies"] + PROJECT["optional-dependencies"]["book"]
    for text in declared:
        requirement = Requirement(text)
        (version,) = versions[canonicalize_name(requirement.name)]
        assert requirement.specifier.contains(version), text
        assert canonicalize_name(requirement.name) in chosen("environment"), text


def test_one_version_everywhere() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert PROJECT["version"] == geokalman.__version__ == citation["version"]
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["license"] == PROJECT["license"] == "BSD-3-Clause"
    assert (ROOT / "LICENSE").read_text().startswith("BSD 3-Clause License")
    assert "SPDX-License-Identifier: CC-BY-4.0" in (ROOT / "LICENSE-TEXT").read_text()
    assert "## [Unreleased]" in (ROOT / "CHANGELOG.md").read_text()


def test_the_wheel_carries_the_algorithms_alone(tmp_path: Path) -> None:
    clone = tmp_path / "clone"
    shutil.copytree(ROOT / "src", clone / "src", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, clone / name)
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--wheel-dir",
        str(tmp_path),
        ".",
    ]
    subprocess.run(command, cwd=clone, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert {"geokalman/py.typed", "geokalman/files.py", "geokalman/kalman/__init__.py"} <= set(names)
    assert [n for n in names if not n.startswith(("geokalman/", "geokalman-"))] == []
    away = tmp_path / "away"
    away.mkdir()
    zipfile.ZipFile(wheel).extractall(away)
    code = "from geokalman import files; files.data_path('egm96.npz')"
    environment = {k: v for k, v in os.environ.items() if not k.startswith("GEOKALMAN")} | {
        "PYTHONPATH": str(away),
        "XDG_CACHE_HOME": str(away),
    }
    done = subprocess.run([sys.executable, "-c", code], cwd=away, env=environment, capture_output=True, text=True)
    assert done.returncode == 1
    assert "the installed package carries the algorithms alone" in done.stderr


def test_make_has_the_targets_that_others_script_against() -> None:
    text = (ROOT / "Makefile").read_text()
    wanted = "env book test check reference run notebooks lab bench clean".split()
    assert [t for t in wanted if not re.search(rf"^{t}:.*## ", text, re.M)] == []


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_make_lists_its_targets_by_what_posix_has(tmp_path: Path) -> None:
    for name in ("grep", "sed", "expand", "column"):  # options of theirs that only GNU has
        (tmp_path / name).write_text("#!/bin/sh\nexit 1\n")
        (tmp_path / name).chmod(0o755)
    environment = os.environ | {"PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(["make", "-s"], cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    wanted = re.findall(r"^([a-z]+):.*## (.*)", (ROOT / "Makefile").read_text(), re.M)
    assert [tuple(line.split(maxsplit=1)) for line in done.stdout.splitlines()] == wanted


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_make_gives_every_numerical_library_one_thread(tmp_path: Path) -> None:
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\nenv\n")
    python.chmod(0o755)
    variables = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
    environment = {name: value for name, value in os.environ.items() if name not in variables}
    command = ["make", "-s", f"PYTHON={python}", "env"]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    assert {f"{name}=1" for name in variables} <= set(done.stdout.splitlines())


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a clone")
def test_a_clone_is_byte_exact_whatever_git_does_to_line_ends(tmp_path: Path) -> None:
    clone = tmp_path / "clone"
    command = ["git", "clone", "-q", "--depth", "1", "-c", "core.autocrlf=true", ROOT.as_uri(), str(clone)]
    subprocess.run(command, check=True, capture_output=True)
    registry = json.loads((clone / "data" / "registry.json").read_text())
    digests = {name: hashlib.sha256((clone / "data" / name).read_bytes()).hexdigest() for name in registry}
    assert digests == {name: entry["sha256"] for name, entry in registry.items()}
    for name in [*(f"{lock}.txt" for lock in LOCKS), "tools/uv.txt", "tools/lock.sh", ".ci/run", "Makefile"]:
        assert b"\r" not in (clone / name).read_bytes(), name


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_make_run_wants_a_notebook(tmp_path: Path) -> None:
    venv = tmp_path / "venv"
    (venv / "bin").mkdir(parents=True)
    (venv / "bin/geokalman").write_text("#!/bin/sh\necho called: $@\n")
    (venv / "bin/geokalman").chmod(0o755)

    def make(*words: str) -> subprocess.CompletedProcess:
        return subprocess.run(
            ["make", "-s", f"VENV={venv}", "PYTHON=true", *words], cwd=ROOT, capture_output=True, text=True
        )

    refused = make("run")
    assert refused.returncode == 2 and "Name a notebook, as in: make run NB=" in refused.stdout
    assert make("run", "NB=grace-fusion/04-ukf", "P=days=5 mu=3", "QUICK=1", "OUT=/tmp/a b").stdout == (
        "called: run grace-fusion/04-ukf days=5 mu=3 --quick --out /tmp/a b\n"
    )


def test_the_gate_is_a_sound_script_that_others_call() -> None:
    script = ROOT / ".ci" / "run"
    assert os.access(script, os.X_OK)
    subprocess.run(["bash", "-n", str(script)], check=True)
    text = script.read_text()
    assert text.index("make test") < text.index("make book") < text.index("make check")
    steps = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())["jobs"]["all"]["steps"]
    assert "bash .ci/run" in [step.get("run") for step in steps]
