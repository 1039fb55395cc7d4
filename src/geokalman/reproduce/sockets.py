"""Where a kernel is talked to: sockets in a folder of this user's own, so that no network is needed, nor its loopback
interface, and no other user of the machine can listen."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from geokalman.reproduce.atomic import explained, lives
from geokalman.reproduce.errors import Fault

_NAME = "geokalman-kernel-"  # then the number of our process
_LONGEST = 100  # bytes of a socket's path; systems take 104 to 108


@contextlib.contextmanager
def folder() -> Iterator[Path]:
    """A fresh folder among the temporary files, where paths are short, for the sockets of one kernel; removed at the
    end.

    Those of killed processes of this user are removed first. Raises Fault where no folder can be made, or its path is
    too long for a socket.
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
