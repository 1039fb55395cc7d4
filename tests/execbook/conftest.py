"""A toy clone of the project: two quick notebooks, one ledger, no physics."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
import pytest

from execbook import cli

HEADER = """---
jupytext:
  text_representation: {extension: .md, format_name: myst}
kernelspec: {display_name: Python 3, language: python, name: python3}
---
"""
LINE = (
    HEADER
    + r"""
# A straight line

With slope $s$, see {numref}`line`; its mean is [[toy/01-line:line.mean]]:

$$
y = s t
$$ (slope)

```{code-cell} ipython3
:tags: [parameters]

slope = 2.0      # (0, 10] m/s: slope of the line
n = 50           # [2, 1000]: number of points
table = ""       # path: a file to read
```

```{code-cell} ipython3
:tags: [quick]

quick = {"n": 5}
```

```{code-cell} ipython3
import numpy as np

from execbook import Notebook

nb = Notebook("toy/01-line", globals())
```

```{code-cell} ipython3
def draw(t, y):
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots()
    axes.plot(t, y)
    axes.set(xlabel="t", ylabel="y")
    return figure


t = np.arange(nb.params.n, dtype=float)
nb.array("line.y", slope * t, "m")
nb.record("line.mean", (slope * t).mean(), "m")
data = {"t_s": t, "y_m": slope * t}
nb.figure("line", draw, t, slope * t, caption="A line, $y = s t$.", alt="A rising line.", data=data)
nb.table("numbers", ["what", "value [m]"], [["mean", (slope * t).mean()]], caption="Its numbers.")
```

```{code-cell} ipython3
nb.verdicts()
nb.finish()
```
"""
)
CONSTANT = (
    HEADER
    + """
# A constant

```{code-cell} ipython3
:tags: [parameters]

value = 3.0      # (-inf, inf): the constant
divisor = 1      # (-inf, inf): what it is divided by
```

```{code-cell} ipython3
from execbook import Notebook

nb = Notebook("toy/02-constant", globals())
```

```{code-cell} ipython3
half = 0.5
quotient = value / divisor
nb.record("quotient", quotient)
```

```{code-cell} ipython3
nb.finish()
```
"""
)
DECLARED = """command = "toys"
package = "execbook"
data = "geokalman.data:verified"
progress = "geokalman.progress:listen"
"""
CLAIMS = """
- id: mean
  where: Table 1
  source: Table 1, first row
  says: the mean of the line
  printed: 49
  unit: m
  metric: toy/01-line:line.mean
  accept: {rel: 1e-3}
  verdict: reproduced
- id: steeper
  where: text
  source: section 2, last sentence
  says: the line ends above the constant
  compare: {left: "toy/01-line:line.mean", op: ">", right: "toy/02-constant:quotient", factor: 10}
  verdict: reproduced
"""


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A fresh toy clone, which is also the working directory."""
    make_toy(tmp_path)
    monkeypatch.delenv("EXECBOOK_ROOT", raising=False)
    monkeypatch.delenv("EXECBOOK_OUT", raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A toy clone whose notebooks were built once, by the command line; read only."""
    root = make_toy(tmp_path_factory.mktemp("built"))
    done = command(root, "build", "--no-html")
    assert done.returncode == 0, done.stderr
    return root


def make_toy(root: Path) -> Path:
    (root / "book" / "toy").mkdir(parents=True)
    (root / "data").mkdir()
    (root / "book" / "_config.yml").write_text("title: toy\n")
    (root / "book" / "execbook.toml").write_text(DECLARED)
    (root / "data" / "registry.json").write_text(json.dumps({}))
    (root / "book" / "toy" / "01-line.md").write_text(LINE)
    (root / "book" / "toy" / "02-constant.md").write_text(CONSTANT)
    (root / "book" / "toy" / "claims.yml").write_text(CLAIMS)
    (root / "book" / "toy" / "index.md").write_text("# The toy paper\n")
    (root / "README.md").write_text("# Toy\n\n<!-- verdicts -->\n\n<!-- /verdicts -->\n")
    return root


def command(root: Path, *words: str, wait: bool = True, preexec_fn=None, **environment: str):
    """Run the command in the clone, as a user would: in this process, or in one of its own to signal or limit it."""
    env = {k: v for k, v in os.environ.items() if not k.startswith("EXECBOOK")} | environment
    if wait and preexec_fn is None:
        return _here(root, words, env)
    start = [sys.executable, "-m", "geokalman.cli", *words]
    if not wait:
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        return subprocess.Popen(start, cwd=root, env=env, text=True, preexec_fn=_heeding_interrupts, **pipes)
    return subprocess.run(start, cwd=root, env=env, capture_output=True, text=True, timeout=900, preexec_fn=preexec_fn)


def _here(root: Path, words: tuple[str, ...], env: dict[str, str]) -> subprocess.CompletedProcess:
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.chdir(root)
        patch.setattr(sys, "argv", ["geokalman", *words])
        for name in set(os.environ) - set(env):
            patch.delenv(name)
        for name, value in env.items():
            patch.setenv(name, value)
        patch.setenv("EXECBOOK_ROOT", "")
        message, code = cli._outcome("geokalman")
    if message:
        err.write(f"{message if message.startswith('Usage') else f'geokalman: {message}'}\n")
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())


def _heeding_interrupts() -> None:
    """A child of a background job inherits that SIGINT is ignored; a user's terminal starts it otherwise."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.fixture(scope="session")
def wait_for():
    """Function that waits for an event, however slow the machine; fails where the process that makes it ended."""

    def wait(happened: Callable[[], object], process: subprocess.Popen | None = None) -> None:
        end = time.monotonic() + 900  # something hangs
        while not happened():
            assert process is None or process.poll() is None, process.communicate()
            assert time.monotonic() < end
            time.sleep(0.05)

    return wait


@pytest.fixture(scope="session")
def new_run():
    """Function that makes a run folder of a notebook without running one, with an array `x`."""
    return make_run


def make_run(folder, metrics, arrays=None, mode="paper"):
    """A run folder as a notebook leaves it, without running one."""
    arrays = {"x": np.linspace(0.0, 1.0, 1001)} if arrays is None else arrays
    folder.mkdir(parents=True, exist_ok=True)
    described = {k: {"shape": list(a.shape), "unit": "m"} for k, a in arrays.items()}
    (folder / "provenance.json").write_text(
        json.dumps({"notebook": "toy/01-line", "mode": mode, "parameters": {}, "arrays": described})
    )
    (folder / "metrics.json").write_text(json.dumps(metrics))
    np.savez(folder / "arrays.npz", **arrays)
    return folder


@pytest.fixture(scope="session")
def new_toy():
    """Function that makes a toy clone in a folder."""
    return make_toy


@pytest.fixture(scope="session")
def geokalman():
    """The command, as a function of the clone and its words."""
    return command


@pytest.fixture
def break_constant():
    """Make the second notebook divide by zero."""

    def break_it(root: Path) -> None:
        path = root / "book" / "toy" / "02-constant.md"
        path.write_text(path.read_text().replace("divisor = 1 ", "divisor = 0 "))

    return break_it
