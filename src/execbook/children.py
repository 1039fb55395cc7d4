"""Child processes (kernels, Sphinx): each ends, with what it started, when we end."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

T = TypeVar("T")
_GUARD = 'read _; kill -s KILL -- "-$0"'  # waits until the pipe from us breaks
_PATIENCE = 60.0  # s
_groups: set[int] = set()
_blocks: set[object] = set()
_stopping = threading.Event()


@contextmanager
def guarded(group: int) -> Iterator[None]:
    """Kill the process group after the block, and when we are killed: a shell waits for it."""
    command = ["/bin/sh", "-c", _GUARD, str(group)]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    guard = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True, **quiet)
    _groups.add(group)
    try:
        check()
        yield
    finally:
        _kill(group)
        _groups.discard(group)
        with guard:
            guard.kill()


@contextmanager
def started(command: list[str], **options: Any) -> Iterator[subprocess.Popen]:
    """Start a guarded child process, which Ctrl-C at the terminal does not reach."""
    check()
    with subprocess.Popen(command, start_new_session=True, **options) as process, guarded(process.pid):
        yield process


@contextmanager
def busy() -> Iterator[None]:
    """Mark a block for whose end `stop` waits; errors then are a KeyboardInterrupt."""
    check()
    token = object()
    _blocks.add(token)
    try:
        yield
    except Exception:
        check()
        raise
    finally:
        _blocks.discard(token)


def check() -> None:
    """Raise KeyboardInterrupt where `stop` waits, for loops that are busy without a child."""
    if _stopping.is_set():
        raise KeyboardInterrupt


def any_busy() -> bool:
    """Tell whether a block of `busy` is running, in any thread."""
    return bool(_blocks)


def stop(ended: Callable[[], bool] | None = None) -> None:
    """Kill the children, let none start, and wait a minute until all busy blocks `ended`."""
    ended = ended or (lambda: not _blocks)
    end = time.monotonic() + _PATIENCE
    outermost = not _stopping.is_set()
    _stopping.set()
    try:
        while not ended() and time.monotonic() < end:
            for group in list(_groups):
                _kill(group)
            time.sleep(0.02)
    finally:
        if outermost:
            _stopping.clear()


def in_parallel(workers: int, action: Callable[[T], None], items: Iterable[T]) -> None:
    """Call action(item), `workers` at a time; the first error, as Ctrl-C, ends them all."""
    pool = ThreadPoolExecutor(workers)
    try:
        for task in [pool.submit(action, item) for item in items]:
            task.result()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        stop()
        raise
    finally:
        pool.shutdown()


def _kill(group: int) -> None:
    with suppress(ProcessLookupError, PermissionError):  # macOS says the latter of a group of zombies
        os.killpg(group, signal.SIGKILL)
