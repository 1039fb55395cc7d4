"""Sockets to talk to a kernel: files, without a network and with nobody listening."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from execbook.atomic import explained, lives
from execbook.errors import Fault

_NAME = "execbook-kernel-"  # then the number of this process
_LONGEST = 100  # bytes of a socket's path; systems take 104 to 108


@contextlib.contextmanager
def folder() -> Iterator[Path]:
    """Make a temporary folder for the sockets of a kernel; those of killed processes go.

    Raises Fault where no folder can be made, or its path is too long for a socket.
    """
    with explained(Path(os.environ.get("TMPDIR", "/tmp")), "let TMPDIR name a folder that you may write to"):
        home = Path(tempfile.gettempdir())
        for old in home.glob(f"{_NAME}*"):
            with contextlib.suppress(OSError):
                maker = old.name.removeprefix(_NAME).partition("-")[0]
                if maker.isdigit() and not lives(maker) and old.lstat().st_uid == os.getuid():
                    shutil.rmtree(old)
        made = Path(tempfile.mkdtemp(prefix=f"{_NAME}{os.getpid()}-", dir=home))
    try:
        if len(os.fsencode(made / "s-5")) > _LONGEST:
            raise Fault(f"The path {home} is too long for sockets; let TMPDIR name a shorter one, such as /tmp.")
        yield made
    finally:
        shutil.rmtree(made, ignore_errors=True)
