"""Kernels: interpreters that execute one notebook each.

The first kernel of this process starts alone. A server then imports the libraries that the project names once, and
further kernels are forked from it (`multiprocessing`'s forkserver). A kernel with other environment variables starts
alone too: libraries read them when they are imported.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import sys
import threading
import types
from collections.abc import Iterator, Mapping, Sequence
from multiprocessing import forkserver
from typing import Any

from jupyter_client.kernelspec import KernelSpec
from jupyter_client.manager import AsyncKernelManager
from jupyter_client.provisioning.local_provisioner import LocalProvisioner

from execbook import children

_COMMAND = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}", "--HistoryManager.enabled=False"]
_lock = threading.Lock()
_served: dict[str, str] | None = None  # variables of the server
_started = 0  # kernels of this process


class Kernel(AsyncKernelManager):
    """The interpreter that runs us, whatever kernels are installed; it ends with the stack `ended`.

    shared : environment variables that all kernels of its kind have;  own : those of this one alone;  preload : modules
    """

    kernel_spec = KernelSpec(argv=_COMMAND, display_name="Python 3", language="python", name="python3")

    def __init__(
        self, shared: Mapping[str, str], own: Mapping[str, str], preload: Sequence[str], ended: contextlib.ExitStack,
        **options: Any,
    ) -> None:  # fmt: skip
        super().__init__(**options)
        self._shared, self._own, self._preload, self._ended = shared, own, preload, ended

    async def start_kernel(self, **kwargs: Any) -> None:
        """Start, in a fork where the server has the same variables; they go in here: $NAME in a command is replaced."""
        if _serves(self._shared, self._preload):
            self.provisioner = _Forking(kernel_id="forked", kernel_spec=self.kernel_spec, parent=self)
        await super().start_kernel(env={**os.environ, **self._shared, **self._own}, **kwargs)
        self._ended.enter_context(children.guarded(self.provisioner.pid))


class _Forking(LocalProvisioner):
    """Launches a kernel as a fork of the server."""

    async def launch_kernel(self, cmd: list[str], **kwargs: Any) -> Any:
        self.process = _Forked(cmd[cmd.index("-f") :], kwargs["env"], kwargs["cwd"])
        self.pid, self.cwd = self.process.pid, kwargs["cwd"]
        return self.connection_info


class _Forked:
    """What a manager of kernels asks of a process, for a forked one."""

    stdin = stdout = stderr = None

    def __init__(self, arguments: list[str], environment: dict[str, str], folder: str) -> None:
        process = multiprocessing.get_context("forkserver").Process(
            target=_serve, args=(arguments, environment, folder)
        )
        with _lock, _without_main():
            process.start()
        self.pid, self.poll, self._process = process.pid, lambda: process.exitcode, process
        self.kill, self.terminate = process.kill, process.terminate

    def wait(self) -> int | None:
        self._process.join()
        return self._process.exitcode

    def send_signal(self, number: int) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, number)


def _serve(arguments: list[str], environment: dict[str, str], folder: str) -> None:
    """Be a kernel, in the forked process: leader of a group of its own, with variables and folder of its own."""
    from ipykernel.kernelapp import launch_new_instance

    os.setsid()
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    multiprocessing.set_start_method(None, force=True)  # notebooks have the system's own, as a kernel alone
    launch_new_instance(argv=[*arguments, f"--IPKernelApp.parent_handle={os.getppid()}"])  # ends without the server


def _serves(shared: Mapping[str, str], preload: Sequence[str]) -> bool:
    """Tell whether the server is there for these variables; the second kernel of this process starts it."""
    global _served, _started
    wanted = {name: value for name, value in {**os.environ, **shared}.items() if name != "PYTEST_CURRENT_TEST"}
    with _lock:
        _started += 1
        if _served is None and _started > 1 and preload:
            with _environment(shared):
                multiprocessing.get_context("forkserver").set_forkserver_preload(list(preload))
                forkserver.ensure_running()
            _served = wanted
        return _served == wanted


@contextlib.contextmanager
def _without_main() -> Iterator[None]:
    """Hide the script that runs us for the block: multiprocessing would execute it once more in the fork."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


@contextlib.contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables of this process for the block."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
