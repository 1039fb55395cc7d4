"""Kernels forked from a server: as those that start alone, and gone when we are."""

import json
import os
import signal
import subprocess
import sys

import pytest

from execbook import atomic

# Follows the front matter of a notebook.
WHERE = """
# Where it runs

```{code-cell} ipython3
:tags: [parameters]

pause = 0.0      # [0, 1000] s: how long it waits
```

```{code-cell} ipython3
import os
import time
from pathlib import Path

from execbook import Notebook

nb = Notebook("toy/03-where", globals())
nb.record("parent", os.getppid())
nb.record("leads", os.getpgid(0) == os.getpid())
nb.record("at_home", Path.cwd().name == "toy")
nb.record("mark", float(os.environ.get("MARK", "0")))
if pause:
    Path("kernels.txt").write_text(f"{os.getppid()} {os.getpid()}")
time.sleep(pause)
nb.finish()
```
"""
# No `if __name__ == "__main__"`: multiprocessing would execute this once more in each process that it makes.
SCRIPT = """
import os
import sys
from pathlib import Path

from execbook import execute

with open("starts.txt", "a") as file:
    file.write("started\\n")
for k, words in enumerate(sys.argv[1:]):
    mark, _, pause = words.partition(",")
    os.environ["MARK"] = mark
    execute.run(Path.cwd(), "toy/03-where", {"pause": float(pause or 0)}, out=Path(f"out{k}"))
"""


@pytest.fixture
def clone(toy):
    """A toy clone that names a module to import beforehand, with a script that runs notebooks."""
    declared = toy / "book" / "execbook.toml"
    declared.write_text(declared.read_text() + 'preload = ["json", "ipykernel.kernelapp"]\n')
    front = (toy / "book" / "toy" / "02-constant.md").read_text().partition("# A constant")[0]
    (toy / "book" / "toy" / "03-where.md").write_text(front + WHERE)
    (toy / "script.py").write_text(SCRIPT)
    return toy


def started(clone, *words):
    return subprocess.Popen([sys.executable, "script.py", *words], cwd=clone, stderr=subprocess.PIPE, text=True)


def test_later_kernels_are_forked_and_else_alike(clone):
    process = started(clone, "1", "1", "1", "2")
    _, err = process.communicate(timeout=900)
    assert process.returncode == 0 and "To exit" not in err, err
    runs = [json.loads((clone / f"out{k}" / "metrics.json").read_text()) for k in range(4)]
    parents = [run["parent"]["value"] for run in runs]
    assert parents[0] == parents[3] == process.pid  # the first, and one with another variable, start alone
    assert parents[1] == parents[2] != process.pid
    assert [run["mark"]["value"] for run in runs] == [1.0, 1.0, 1.0, 2.0]
    assert all(run["leads"]["value"] and run["at_home"]["value"] for run in runs)
    assert (clone / "starts.txt").read_text() == "started\n"


def test_a_forked_kernel_and_its_server_end_when_we_are_killed(clone, wait_for):
    process, noted = started(clone, "1", "1,1000"), clone / "book" / "toy" / "kernels.txt"
    wait_for(lambda: noted.is_file() and noted.read_text().count(" "), process)
    server, kernel = noted.read_text().split()
    assert atomic.lives(server) and atomic.lives(kernel) and int(server) != process.pid
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    wait_for(lambda: not atomic.lives(server) and not atomic.lives(kernel))
