"""The command `geokalman`: until the package is imported, which takes a moment, an interrupt is one sentence here.

Outside the package, because importing anything of it hashes its sources first.
"""

import os
import signal
from types import FrameType
from typing import NoReturn


def _leave(number: int, _: FrameType | None) -> NoReturn:
    os.write(2, b"geokalman: interrupted; what was finished stays.\n")
    os._exit(128 + number)


def main() -> None:
    """Entry point: `geokalman.reproduce.cli.main`, which attends to the signals itself from then on."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _leave)
    from geokalman.reproduce import cli

    cli.main()


if __name__ == "__main__":
    main()
