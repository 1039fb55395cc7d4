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
from collections.abc import Iterable
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import geokalman

ROOT = Path(__file__).resolve().parents[1]
LOCKS = ["environment", "tools/locks/test", "tools/locks/lab"]


def chosen(root: Path, name: str) -> dict[str, Requirement]:
    """What a file `.in` asks for, by name."""
    lines = (line.partition(" #")[0].strip() for line in (root / f"{name}.in").read_text().splitlines())
    found = [Requirement(line) for line in lines if line and line[0] != "#"]
    return {canonicalize_name(r.name): r for r in found}


def locked(root: Path, name: str) -> dict[str, set[str]]:
    """Package -> versions of a lock."""
    found: dict[str, set[str]] = {}
    for package, version in re.findall(r"^([A-Za-z0-9._-]+)==(\S+)", (root / f"{name}.txt").read_text(), re.M):
        found.setdefault(canonicalize_name(package), set()).add(version)
    return found


def unmet(requirements: Iterable[Requirement], versions: dict[str, set[str]]) -> list[str]:
    """Requirements that the one locked version (one for all Pythons) does not satisfy."""
    there = [(r, versions.get(canonicalize_name(r.name), set())) for r in requirements]
    return [str(r) for r, found in there if len(found) != 1 or not r.specifier.contains(min(found))]


def faults_of_lock(root: Path, name: str) -> list[str]:
    """Hosts that a lock names, packages without a hash, choices that it does not hold, versions unlike the first's."""
    text, versions, first = (root / f"{name}.txt").read_text(), locked(root, name), locked(root, "environment")
    return [
        *(word for word in ("://", "--index-url", "--find-links") if word in text),
        *(e.split()[0] for e in re.split(r"\n(?=[a-z0-9])", text)[1:] if "--hash=sha256:" not in e),
        *unmet(chosen(root, name).values(), versions),
        *(package for package, found in versions.items() if found != first.get(package, found)),
    ]


def faults_of_package(root: Path) -> list[str]:
    """Dependencies that pyproject.toml declares and the lock does not hold or was not asked for; versions that differ."""
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    declared = [Requirement(r) for r in project["dependencies"] + project["optional-dependencies"]["book"]]
    citation = yaml.safe_load((root / "CITATION.cff").read_text())
    return [
        *unmet(declared, locked(root, "environment")),
        *(r.name for r in declared if canonicalize_name(r.name) not in chosen(root, "environment")),
        *(v for v in (project["version"], citation["version"]) if v != geokalman.__version__),
        *({"cff-version", "message", "title", "authors"} - set(citation)),
        *(x for x in (citation["license"], project["license"]) if x != "BSD-3-Clause"),
        *(
            f"{name} lacks {words!r}"
            for name, words in {
                "LICENSE": "BSD 3-Clause License",
                "LICENSE-TEXT": "SPDX-License-Identifier: CC-BY-4.0",
                "CHANGELOG.md": "## [Unreleased]",
            }.items()
            if words not in (root / name).read_text()
        ),
    ]


def faults_of_targets(root: Path) -> list[str]:
    """Targets that others script against and the Makefile lacks, or does not explain."""
    text = (root / "Makefile").read_text()
    wanted = ["env", "book", "test", "check", "reference", "run", "notebooks", "lab", "bench", "clean"]
    return [t for t in wanted if not re.search(rf"^{t}:.*## ", text, re.M)]


def faults_of_gate(root: Path) -> list[str]:
    """What is wrong with the script of the gate: its rights, its grammar, its order, and whether the CI calls it."""
    script = root / ".ci" / "run"
    stages = re.findall(r"make (\w+)$", script.read_text(), re.M)
    steps = yaml.safe_load((root / ".github/workflows/ci.yml").read_text())["jobs"]["all"]["steps"]
    faults = {
        "cannot be executed": not os.access(script, os.X_OK),
        "is no bash": subprocess.run(["bash", "-n", str(script)], capture_output=True).returncode != 0,
        "runs other stages": stages != ["env", "test", "book", "check"],
        "is not called": "bash .ci/run" not in [step.get("run") for step in steps],
    }
    return [words for words, wrong in faults.items() if wrong]


@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_is_hashed_complete_and_names_no_host(name: str) -> None:
    assert len(locked(ROOT, name)) > 30
    assert not faults_of_lock(ROOT, name)


def test_the_package_agrees_with_its_lock_and_its_papers() -> None:
    assert not faults_of_package(ROOT)


def test_the_installer_is_pinned_by_hash() -> None:
    (pinned,) = locked(ROOT, "tools/locks/uv").items()
    assert pinned[0] == "uv" and len(pinned[1]) == 1
    assert (ROOT / "tools/locks/uv.txt").read_text().count("--hash=sha256:") > 10  # one for each platform


def test_make_has_the_targets_that_others_script_against() -> None:
    assert not faults_of_targets(ROOT)


def test_the_gate_is_a_sound_script_that_others_call() -> None:
    assert not faults_of_gate(ROOT)


@pytest.mark.parametrize(
    ("path", "old", "new", "faults", "words"),
    [
        ("tools/locks/lab.txt", "jinja2==", "--index-url https://a.org\njinja2==", faults_of_lock, "://"),
        ("tools/locks/lab.txt", r"jinja2==(\S+) .*(\n +--hash.*)+", r"jinja2==\1", faults_of_lock, "jinja2=="),
        ("tools/locks/lab.txt", "jinja2==", "jinja2==0.", faults_of_lock, "jinja2"),
        ("tools/locks/lab.in", r"\Z", "\nnowhere>=2\n", faults_of_lock, "nowhere>=2"),
        ("environment.txt", "numba==", "numba==0.0.", faults_of_package, "numba"),
        ("environment.in", r"(?m)^scipy.*\n", "", faults_of_package, "scipy"),
        ("pyproject.toml", 'version = "', 'version = "9.', faults_of_package, "9."),
        ("CITATION.cff", "(?m)^title:", "name:", faults_of_package, "title"),
        ("CITATION.cff", "BSD-3-Clause", "MIT", faults_of_package, "MIT"),
        ("LICENSE", "BSD 3-Clause", "MIT", faults_of_package, "LICENSE lacks"),
        ("LICENSE-TEXT", "CC-BY-4.0", "none", faults_of_package, "LICENSE-TEXT lacks"),
        ("CHANGELOG.md", r"\[Unreleased\]", "0.9", faults_of_package, "CHANGELOG.md lacks"),
        ("Makefile", "(?m)^reference:.*##", "reference:", faults_of_targets, "reference"),
        (".ci/run", "stage test make test", "stage test make tests", faults_of_gate, "runs other stages"),
        (".ci/run", r"stage\(\) \{", "stage() {{", faults_of_gate, "is no bash"),
        (".github/workflows/ci.yml", "bash .ci/run", "true", faults_of_gate, "is not called"),
    ],
)
def test_a_planted_fault_is_seen(tmp_path: Path, path: str, old: str, new: str, faults, words: str) -> None:
    names = [f"{lock}.{kind}" for lock in ("environment", "tools/locks/lab") for kind in ("in", "txt")]
    names += ["pyproject.toml", "CITATION.cff", "LICENSE", "LICENSE-TEXT", "CHANGELOG.md", "Makefile", ".ci/run"]
    for name in [*names, ".github/workflows/ci.yml"]:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    arguments = (tmp_path, "tools/locks/lab") if faults is faults_of_lock else (tmp_path,)
    assert not faults(*arguments)
    text, count = re.subn(old, new, (tmp_path / path).read_text(), count=1)
    assert count == 1
    (tmp_path / path).write_text(text)
    found = faults(*arguments)
    assert any(words in fault for fault in found), found


def beside_the_package(names: list[str]) -> list[str]:
    """Files of a wheel that are neither of the two packages, nor the entry point, nor metadata."""
    return [
        name for name in names if not name.startswith(("geokalman/", "execbook/", "geokalman_entry.py", "geokalman-"))
    ]


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
    assert {"geokalman/py.typed", "geokalman/data.py", "execbook/cli.py", "geokalman/kalman/__init__.py"} <= set(names)
    assert not beside_the_package(names)
    assert beside_the_package([*names, "book/index.md"]) == ["book/index.md"]
    away = tmp_path / "away"
    away.mkdir()
    zipfile.ZipFile(wheel).extractall(away)
    code = "from geokalman import data; data.data_path('egm96.npz')"
    environment = {k: v for k, v in os.environ.items() if not k.startswith("GEOKALMAN")} | {
        "PYTHONPATH": str(away),
        "XDG_CACHE_HOME": str(away),
    }
    done = subprocess.run([sys.executable, "-c", code], cwd=away, env=environment, capture_output=True, text=True)
    assert done.returncode == 1
    assert "the installed package carries the algorithms alone" in done.stderr


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
    for name in [*(f"{lock}.txt" for lock in LOCKS), "tools/locks/uv.txt", "tools/lock.sh", ".ci/run", "Makefile"]:
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
    told = "Name one of these notebooks, as in: make run NB="
    assert refused.returncode == 2 and refused.stdout.splitlines()[-1].startswith(told)
    assert (
        make("run", "NB=grace-fusion/04-ukf", "P=days=5 mu=3", "QUICK=1", "OUT=/tmp/a b").stdout
        == "called: run grace-fusion/04-ukf days=5 mu=3 --quick --out /tmp/a b\n"
    )
