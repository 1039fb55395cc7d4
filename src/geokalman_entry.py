"""The command `geokalman`: until the package is imported, which takes a moment, an interrupt is one sentence here.

It stands outside the package and does without `signal`, which imports some more modules before it can do the same as
the built-in one.
"""

import _signal  # pyrefly: ignore[missing-import]
import os


def _leave(number: int, _: object) -> None:
    os.write(2, b"geokalman: interrupted; what was finished stays.\n")
    os._exit(128 + number)


def main() -> None:
    """Entry point: `geokalman.cli.main`, which attends to the signals itself from then on."""
    for number in (_signal.SIGINT, _signal.SIGTERM, _signal.SIGHUP):
        if _signal.getsignal(number) != _signal.SIG_IGN:
            _signal.signal(number, _leave)
    from geokalman import cli

    cli.main()


if __name__ == "__main__":
    main()
