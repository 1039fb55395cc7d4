"""What a stranger meets first: locks, licences, the wheel, the targets of make, and the script that keeps .venv."""

from __future__ import annotations

import importlib.util
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
LOCKS = ["environment", "environment-test", "environment-lab"]


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
    wanted = "env book test check reference run notebooks lab bench clean".split()
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


def test_make_has_the_targets_that_others_script_against() -> None:
    assert not faults_of_targets(ROOT)


def test_the_gate_is_a_sound_script_that_others_call() -> None:
    assert not faults_of_gate(ROOT)


@pytest.mark.parametrize(
    ("path", "old", "new", "faults", "words"),
    [
        ("environment-lab.txt", "jinja2==", "--index-url https://a.org\njinja2==", faults_of_lock, "://"),
        ("environment-lab.txt", r"jinja2==(\S+) .*(\n +--hash.*)+", r"jinja2==\1", faults_of_lock, "jinja2=="),
        ("environment-lab.txt", "jinja2==", "jinja2==0.", faults_of_lock, "jinja2"),
        ("environment-lab.in", r"\Z", "\nnowhere>=2\n", faults_of_lock, "nowhere>=2"),
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
    names = [f"{lock}.{kind}" for lock in ("environment", "environment-lab") for kind in ("in", "txt")]
    names += "pyproject.toml CITATION.cff LICENSE LICENSE-TEXT CHANGELOG.md Makefile .ci/run".split()
    for name in [*names, ".github/workflows/ci.yml"]:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    arguments = (tmp_path, "environment-lab") if faults is faults_of_lock else (tmp_path,)
    assert not faults(*arguments)
    text, count = re.subn(old, new, (tmp_path / path).read_text(), count=1)
    assert count == 1
    (tmp_path / path).write_text(text)
    found = faults(*arguments)
    assert any(words in fault for fault in found), found


def beside_the_package(names: list[str]) -> list[str]:
    """Files of a wheel that are neither the package's nor its metadata's."""
    return [name for name in names if not name.startswith(("geokalman/", "geokalman-"))]


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
    assert not beside_the_package(names)
    assert beside_the_package([*names, "book/index.md"]) == ["book/index.md"]
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


@pytest.fixture
def tool(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """tools/environment.py on a copy of the project's locks, with pip and venv replaced by a diary."""
    spec = importlib.util.spec_from_file_location("environment_tool", ROOT / "tools" / "environment.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for name in ("environment.txt", "environment-test.txt", "pyproject.toml"):
        (tmp_path / name).write_text(name)
    module.diary = []

    def create(folder: Path, **_: object) -> None:
        module.diary.append("new")
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()

    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(module.venv, "create", create)
    monkeypatch.setattr(
        module, "pip", lambda python, *words: module.diary.append(Path(words[-1]).name if "-r" in words else "package")
    )
    return module


def entries(tool, folder: Path, *extras: str) -> list[str]:
    tool.diary.clear()
    tool.bring_up_to_date(folder, list(extras))
    return list(tool.diary)


def test_the_environment_follows_its_locks(tool, tmp_path: Path) -> None:
    folder = tmp_path / "venv"
    assert entries(tool, folder) == ["new", "environment.txt", "package"]
    assert entries(tool, folder) == []
    assert entries(tool, folder, "test") == ["environment-test.txt"]
    assert entries(tool, folder, "test") == []
    (tmp_path / "pyproject.toml").write_text("changed")
    assert entries(tool, folder) == ["package"]
    (tmp_path / "environment.txt").write_text("changed")
    assert entries(tool, folder, "test") == ["environment.txt", "environment-test.txt", "package"]


def test_an_interrupted_installation_starts_anew(tool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "venv"
    entries(tool, folder)
    (tmp_path / "environment.txt").write_text("changed")
    with monkeypatch.context() as patch:
        patch.setattr(tool, "pip", lambda *_: sys.exit("killed"))
        with pytest.raises(SystemExit):
            tool.bring_up_to_date(folder, [])
    assert entries(tool, folder) == ["new", "environment.txt", "package"]


def test_an_environment_that_was_moved_is_made_anew(tool, tmp_path: Path) -> None:
    entries(tool, tmp_path / "venv")
    (tmp_path / "venv").rename(tmp_path / "moved")
    assert entries(tool, tmp_path / "moved")[0] == "new"


def test_only_the_locked_pythons_are_taken(tool) -> None:
    assert [tool.unsupported(version) for version in ((3, 11), (3, 12), (3, 13))] == [None] * 3
    assert tool.unsupported((3, 10)) == (
        "python3 is 3.10; the locked packages are for 3.11 to 3.13. "
        "Name one of these, as in: make env PYTHON=python3.13"
    )
    assert "python3 is 3.14" in tool.unsupported((3, 14))
