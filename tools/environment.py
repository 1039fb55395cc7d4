"""Keep `.venv` as the locks say: what the Makefile's targets call before anything else. Standard library only.

    python3 tools/environment.py [--venv DIR] [test] [lab]

installs environment.txt, the package itself (editable), and the named further locks. Nothing is done where the locks,
the interpreter and the place are those of the last time. Two at once wait for each other.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import venv
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SUPPORTED = ((3, 11), (3, 13))
_STAMP = "installed.json"


def main() -> None:
    parser = argparse.ArgumentParser(description="Keep .venv as the locks say.")
    parser.add_argument("--venv", type=Path, default=ROOT / ".venv")
    parser.add_argument("extras", nargs="*", help="further locks: environment-EXTRA.txt")
    options = parser.parse_args()
    refuse = unsupported(sys.version_info[:2])
    if refuse:
        sys.exit(refuse)
    unknown = [extra for extra in options.extras if not lock_file(extra).is_file()]
    if unknown:
        there = ", ".join(sorted(path.name for path in ROOT.glob("environment*.txt")))
        sys.exit(f"There is no {lock_file(unknown[0]).name}; the locks are {there}.")
    with alone(options.venv):
        bring_up_to_date(options.venv.resolve(), options.extras)


def unsupported(found: tuple[int, int]) -> str | None:
    """What is wrong with this Python, in one sentence, or None."""
    low, high = SUPPORTED
    if low <= found <= high:
        return None
    return (
        f"python3 is {found[0]}.{found[1]}; the locked packages are for {low[0]}.{low[1]} to {high[0]}.{high[1]}. "
        f"Name one of these, as in: make env PYTHON=python{high[0]}.{high[1]}"
    )


def lock_file(name: str) -> Path:
    """Path of the lock `name`; the empty name is the reader's."""
    return ROOT / (f"environment-{name}.txt" if name else "environment.txt")


@contextmanager
def alone(folder: Path):
    """Hold a lock beside `folder`; a second process waits."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with open(folder.with_name(f"{folder.name}.lock"), "w") as stream:
        if os.name == "posix":
            import fcntl

            fcntl.flock(stream, fcntl.LOCK_EX)
        yield


def bring_up_to_date(folder: Path, extras: list[str]) -> None:
    """Install what the stamp in the environment says is missing or out of date."""
    place = {"python": sys.version, "folder": str(folder)}
    stamp = read_stamp(folder)
    if {key: stamp.get(key) for key in place} != place:  # none, moved, interrupted, or of another Python
        say(f"making {folder.name} with Python {sys.version.split()[0]}")
        venv.create(folder, clear=True, with_pip=True, symlinks=os.name == "posix")
        stamp = dict(place)
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    for name in ("", *extras):
        key = digest(lock_file(name))
        if stamp.get(f"lock {name}") != key:
            (folder / _STAMP).unlink(missing_ok=True)  # an interrupted installation starts anew
            say(f"installing {lock_file(name).name} (the first time takes a minute or two)")
            pip(python, "--require-hashes", "--only-binary", ":all:", "-r", str(lock_file(name)))
            if not name:  # a renewed base may have moved what the others stand on
                stamp = dict(place)
            stamp[f"lock {name}"] = key
    package = digest(ROOT / "pyproject.toml")
    if stamp.get("package") != package:
        pip(python, "--no-deps", "--no-build-isolation", "-e", str(ROOT))
        stamp["package"] = package
    write_stamp(folder, stamp)


def pip(python: Path, *words: str) -> None:
    """Run `pip install`, quietly; its errors are shown, and end this program."""
    command = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-input", *words]
    if subprocess.run(command, cwd=ROOT).returncode:
        sys.exit("pip could not install that; its words stand above. Call make again to resume.")


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def read_stamp(folder: Path) -> dict[str, str]:
    """What was installed the last time; empty where nothing was, or not to the end."""
    try:
        return json.loads((folder / _STAMP).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def write_stamp(folder: Path, stamp: dict[str, str]) -> None:
    new = folder / f"{_STAMP}.new"
    new.write_text(json.dumps(stamp, indent=1) + "\n", encoding="utf-8")
    os.replace(new, folder / _STAMP)


def say(text: str) -> None:
    print(f"environment: {text}", flush=True)


if __name__ == "__main__":
    main()
