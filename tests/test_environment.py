"""tools/environment.py: the locks and nothing else, on machines that they are for, whole or not at all."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest
from environmenttool import ROOT, SCRIPT, load


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
