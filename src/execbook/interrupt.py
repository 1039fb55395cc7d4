"""Ctrl-C, SIGTERM and SIGHUP: children end, what was begun is cleared, we say so."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from types import FrameType
from typing import NoReturn, TypeVar

from execbook import children

T = TypeVar("T")
_SHOW_CURSOR = "\x1b[?25h\n"  # a progress bar hides it


def attended(command: Callable[[], T], name: str) -> T:
    """Run `command` in a thread while the main thread, which calls this, attends to signals.

    Libraries in C and callbacks of the import system swallow a KeyboardInterrupt. Here none is raised: where nothing is
    half done (`children.busy`) the process ends at once, else as soon as the command's own thread has cleared it. The
    exit code is 128 + signal.
    """
    outcome: Future[T] = Future()

    def work() -> None:
        try:
            outcome.set_result(command())
        except BaseException as error:
            outcome.set_exception(error)

    def leave(number: int, _: FrameType | None) -> NoReturn:
        for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(each, signal.SIG_IGN)
        if children.any_busy():
            children.stop(ended=outcome.done)
        terminal = os.isatty(2) and os.environ.get("TERM") != "dumb"
        with suppress(OSError):  # of a terminal that went away
            os.write(2, f"{_SHOW_CURSOR if terminal else ''}{name}: interrupted; what was finished stays.\n".encode())
        os._exit(128 + number)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # What the shell told us to ignore (Ctrl-C in the background) we do, but by a function: kernels inherit SIG_IGN.
        ignored = signal.getsignal(number) is signal.SIG_IGN
        signal.signal(number, (lambda *_: None) if ignored else leave)
    # The system may give a signal to any thread. A byte in this pipe wakes the main one, whose part it is to handle it.
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    outcome.add_done_callback(lambda _: os.write(writing, b"\0"))
    threading.Thread(target=work, name="command", daemon=True).start()
    while not outcome.done():
        os.read(reading, 1)
    return outcome.result()
