"""Keep `.venv` as the locks say: what the Makefile's targets call before anything else. Standard library only.

    python3 tools/environment.py [--venv DIR] [test] [lab]

installs environment.txt, the package itself (editable), and the named further locks: just what stands there, without
resolving anything. The uv that tools/locks/uv.txt pins does it; where uv cannot be had or fails, pip does. Nothing is
done where the locks, the interpreter and the place are those of the last time. Two at once wait for each other.
"""

# A Python as old as 3.6 must get far enough to be refused in one sentence: no `from __future__`, no later syntax.

import argparse
import ast
import hashlib
import importlib.util
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
PYTHONS = ((3, 11), (3, 13))
# What the locked wheels ask for: glibc 2.28 (numpy, scipy and others), macOS 14 (pyproj). `make lock` tries each.
WHEELS = {("Linux", "x86_64"): (2, 28), ("Linux", "aarch64"): (2, 28), ("Darwin", "arm64"): (14, 0)}
# pip's settings that decide where packages come from, and uv's names for them
_SETTINGS = {
    "index-url": "UV_DEFAULT_INDEX",
    "extra-index-url": "UV_INDEX",
    "find-links": "UV_FIND_LINKS",
    "trusted-host": "UV_INSECURE_HOST",
    "cert": "SSL_CERT_FILE",
}
_LOCKED = ("--require-hashes", "--only-binary", ":all:", "-r")
_STAMP = "installed.json"


def main() -> None:
    parser = argparse.ArgumentParser(description="Keep .venv as the locks say.")
    parser.add_argument("--venv", type=Path, default=ROOT / ".venv")
    parser.add_argument("extras", nargs="*", help="further locks: tools/locks/EXTRA.txt")
    options = parser.parse_args()
    refuse = unsupported(this_host())
    if refuse:
        sys.exit(refuse)
    unknown = [extra for extra in options.extras if not lock_file(extra).is_file()]
    if unknown:
        there = ", ".join(sorted(path.stem for path in (ROOT / "tools" / "locks").glob("*.txt")))
        sys.exit(f"There is no lock {unknown[0]!r}; the locks beside environment.txt are {there}.")
    folder = options.venv.resolve()
    with alone(folder):
        bring_up_to_date(folder, options.extras)


class Host(NamedTuple):
    """What decides whether the locked wheels fit."""

    python: tuple  # (major, minor)
    kind: str  # CPython, free-threaded CPython, PyPy
    system: str  # Linux, Darwin, Windows
    machine: str  # x86_64, aarch64, arm64; 32 bits for a Python of that size
    version: tuple  # (major, minor) of glibc or macOS; empty where there is neither
    ensurepip: bool  # Debian keeps it in a package of its own


def this_host() -> Host:
    """The machine and the Python that run this."""
    libc, version = platform.libc_ver()
    text = platform.mac_ver()[0] or (version if libc == "glibc" else "")
    free = "free-threaded " if sysconfig.get_config_var("Py_GIL_DISABLED") else ""
    return Host(
        python=tuple(sys.version_info[:2]),
        kind=free + platform.python_implementation(),
        system=platform.system(),
        machine=platform.machine() if sys.maxsize > 2**32 else "32 bits",
        version=tuple(int(number) for number in re.findall(r"\d+", text)[:2]),
        ensurepip=importlib.util.find_spec("ensurepip") is not None,
    )


def unsupported(host: Host) -> str | None:
    """Why the locks cannot be installed on this machine or with this Python, in one sentence, or None."""
    low, high = PYTHONS
    if host.kind != "CPython" or not low <= host.python <= high:
        return (
            f"python3 is {host.kind} {dotted(host.python)}; the locked packages are for CPython {dotted(low)} to "
            f"{dotted(high)}. Name one of these, as in: make env PYTHON=python{dotted(high)}"
        )
    needed = WHEELS.get((host.system, host.machine))
    if host.system == "Darwin" and needed is None:
        return (
            f"This is a Python for {host.machine} on macOS; llvmlite and satkit have wheels for arm64 only. On Apple "
            f"silicon name an arm64 Python, as in: make env PYTHON=/opt/homebrew/bin/python{dotted(high)}"
        )
    if needed is None:
        return (
            f"This is {host.system} on {host.machine}; the locked packages have wheels for Linux on x86_64 and "
            "aarch64 and for macOS on arm64 (on Windows, use WSL)."
        )
    if not host.version and host.system == "Linux":
        return f"This Linux has a C library other than glibc; numba and llvmlite need glibc {dotted(needed)} or later."
    if host.version < needed:
        what, packages = ("macOS", "pyproj") if host.system == "Darwin" else ("glibc", "NumPy, SciPy and others")
        found, wanted = dotted(host.version), dotted(needed)
        return f"This machine has {what} {found}; the locked wheels of {packages} need {wanted} or later."
    if not host.ensurepip:
        return "This Python cannot make a virtual environment, for it has no ensurepip: apt install python3-venv"
    return None


def dotted(version: tuple) -> str:
    return ".".join(str(number) for number in version)


def lock_file(name: str) -> Path:
    """Path of the lock `name`; the empty name is the reader's."""
    return ROOT / (f"tools/locks/{name}.txt" if name else "environment.txt")


@contextmanager
def alone(folder: Path):
    """Hold a lock beside `folder`; a second process waits.

    Every process that `failure` starts inherits it: an installer that outlives this program (kill -9) still holds it.
    """
    import fcntl  # after the refusal: not on Windows

    path = folder.with_name(f"{folder.name}.lock")
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w") as stream:
        os.set_inheritable(stream.fileno(), True)
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say(f"another call is at work on {folder.name}; waiting for it")
            fcntl.flock(stream, fcntl.LOCK_EX)
        yield


def failure(command: list, **how) -> str | None:
    """Run a program that inherits the lock of `alone`; its words where it fails, or None."""
    try:
        done = subprocess.run(
            [str(word) for word in command],
            cwd=str(ROOT),
            close_fds=False,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            errors="replace",
            **how,
        )
    except OSError as error:  # of another machine, or on a disk from which nothing may be executed
        return f"{command[0]}: {error.strerror}"
    return done.stdout.strip() if done.returncode else None


def bring_up_to_date(folder: Path, extras: list) -> None:
    """Install what the stamp in the environment says is missing or out of date."""
    place = {"python": sys.version, "base": sys.base_prefix, "folder": str(folder)}
    known = read_stamp(folder)
    stamp = dict(known)
    if {key: stamp.get(key) for key in place} != place:  # none, moved, interrupted, or of another Python
        make_anew(folder)
        stamp = dict(place)
    python = folder / "bin" / "python"
    wanted = {name: digest(lock_file(name)) for name in ("", *extras)}
    pending = [name for name, key in wanted.items() if stamp.get(f"lock {name}") != key]
    if "" in pending:  # a renewed base may have moved what the others stand on
        pending, stamp = list(wanted), dict(place)
    if pending:
        (folder / _STAMP).unlink(missing_ok=True)  # an interrupted installation starts anew
        if failure(pip(python, *_LOCKED, lock_file("uv"))) is not None:
            say("uv cannot be had here; pip installs, which takes longer")
    for name in pending:
        say(f"installing {lock_file(name).name} (the first time takes a minute or two)")
        install(python, *_LOCKED, lock_file(name))
        stamp[f"lock {name}"] = wanted[name]
    package = digest(ROOT / "pyproject.toml")
    if stamp.get("package") != package:
        install(python, "--no-build-isolation", "-e", ROOT)
        failure(
            [python, "-m", "compileall", "-q", ROOT / "src"]
        )  # what cannot be written, as on a read-only disk, may go
        stamp["package"] = package
    if stamp != known:
        check(python)
        write_stamp(folder, stamp)


def make_anew(folder: Path) -> None:
    """Make an empty environment in place of what is there; a folder that is no environment is left alone."""
    if folder.exists() and any(folder.iterdir()) and not (folder / "pyvenv.cfg").is_file():
        sys.exit(f"{folder} is not empty and is no virtual environment: remove it, or name another folder as VENV.")
    say(f"making {folder.name} with Python {platform.python_version()}")
    old = folder.with_name(f"{folder.name}.discarded")
    shutil.rmtree(str(old), ignore_errors=True)
    if folder.exists():
        folder.rename(old)  # whole, so that none is ever half removed
        shutil.rmtree(str(old))
    folder.mkdir()
    (folder / "pyvenv.cfg").touch()  # ours from the first moment on: interrupted, it is known again
    # not sys.executable, which may be the one just removed, of an activated .venv
    words = failure([sys._base_executable, "-I", "-m", "venv", folder])
    if words is not None:
        sys.exit(f"{words}\nPython could not make {folder}; its words stand above.")


def install(python: Path, *what) -> None:
    """Install `what` and nothing else, with uv or, where that fails, with pip."""
    uv = python.with_name("uv")
    if uv.is_file():
        flags, settings = index_settings(python)
        # as pip does: where PYTHONDONTWRITEBYTECODE is set, every process would parse all of SciPy again
        flags = [*flags, "--quiet", "--no-deps", "--compile-bytecode", "--python", python]
        command = [uv, "pip", "install", *flags, *what]
        words = failure(command, env={**settings, **os.environ})
        if words is None:
            return
        say(f"uv failed ({' '.join(words.split())[:300]}); pip installs, which takes longer")
    words = failure(pip(python, *what))
    if words is not None:
        last = "\n".join(words.splitlines()[-20:])
        sys.exit(f"{last}\npip could not install that; its words stand above. Call make again to try once more.")


def pip(python: Path, *what) -> list:
    """The words of a `pip install` that resolves nothing.

    The locks are complete, and pip before 23.3 looks for the newest release of a package that is required with an
    extra, which has no hash. -I keeps PYTHONPATH out, --no-user a `user = true` in pip's settings.
    """
    flags = ["--quiet", "--disable-pip-version-check", "--no-input", "--no-user", "--no-deps"]
    return [python, "-I", "-m", "pip", "install", *flags, *what]


def index_settings(python: Path) -> tuple:
    """Where pip's files and variables say that packages come from, as (flags, variables) of uv, which reads neither."""
    command = [str(python), "-I", "-m", "pip", "config", "list"]
    known = {**os.environ, "PIP_USER": "0"}  # else `user = true` makes it list the user's own settings alone
    done = subprocess.run(command, env=known, stdout=subprocess.PIPE, encoding="utf-8")
    found = {}
    for section in ("global.", "install.", ":env:."):  # a later one wins, as in pip
        for line in done.stdout.splitlines():
            name, _, value = line.partition("=")
            if name.startswith(section):
                found[name[len(section) :]] = ast.literal_eval(value).split()
    flags = ["--no-index"] if found.get("no-index", ["no"])[0].lower() in ("1", "true", "yes", "on") else []
    settings = {"UV_INDEX_STRATEGY": "unsafe-best-match"}  # any index will do: the lock names each file by its hash
    for name, variable in _SETTINGS.items():
        if name in found:
            settings[variable] = ("," if name == "find-links" else " ").join(found[name])
    return flags, settings


def check(python: Path) -> None:
    """End this program where what is installed lacks something that it requires."""
    words = failure([python, "-I", "-m", "pip", "check"])
    if words is not None:
        sys.exit(
            f"What is installed does not fit together: {'; '.join(words.splitlines())}. "
            "If you added it yourself, call make again: it builds the environment anew, without your addition."
        )


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def read_stamp(folder: Path) -> dict:
    """What was installed the last time; empty where nothing was, or not to the end."""
    try:
        return json.loads((folder / _STAMP).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def write_stamp(folder: Path, stamp: dict) -> None:
    new = folder / f"{_STAMP}.new"
    new.write_text(json.dumps(stamp, indent=1) + "\n", encoding="utf-8")
    os.replace(new, folder / _STAMP)


def say(text: str) -> None:
    print(f"environment: {text}", flush=True)


if __name__ == "__main__":
    try:
        main()
    except OSError as error:
        sys.exit(f"{error.filename}: {error.strerror}." if error.filename else str(error))
    except KeyboardInterrupt:
        sys.exit("Interrupted; call make again to resume.")
