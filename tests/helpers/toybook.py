"""A small book with everything that a page of the real one can hold, made without running a notebook."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import matplotlib.pyplot as plt
import nbformat
import numpy as np

from execbook import explore
from execbook.display import FIGURE_TYPE, TABLE_TYPE
from geokalman import style

PROJECT = Path(__file__).resolve().parents[2]
PAGE = "toy/01-wave"

_NOTEBOOK = """---
jupytext: {text_representation: {extension: .md, format_name: myst}}
kernelspec: {display_name: Python 3, language: python, name: python3}
---
# A wave

```{code-cell} ipython3
:tags: [parameters]
frequency = 2.0  # (0, 10] Hz: of the wave
shape = "sine"   # {sine, square}: of the wave
```

```{code-cell} ipython3
:tags: [quick]
quick = {"frequency": 1.0}
```
"""
_CLAIMS = """
- id: wave-rms
  where: Table 1
  source: Table 1, first row
  says: the rms of the wave
  printed: 0.7071
  unit: m
  metric: toy/01-wave:wave.rms
  accept: {rel: 0.01}
  verdict: reproduced
- id: wave-sound
  where: Fig. 2
  source: caption of Fig. 2
  says: the wave sounds good
  reason: no loudspeaker was at hand
  verdict: not-testable
"""
_INDEX = """# A toy book

The UKF and the geoid are named here so that the search finds them. See {numref}`wave`, {numref}`rms`, {eq}`toy-sum`,
and {cite:t}`sharifi2019`; inline $\\sigma_r$.

$$
x_{k+1} = \\Phi_k x_k
$$ (toy-sum)

<!-- verdict-summary -->
"""
_PAPER = """# The toy paper

<!-- verdicts: toy -->

| what | a long header | another long header | yet another long header | and one more | and the last one of all |
| --- | --- | --- | --- | --- | --- |
| a/very/long/path/without/any/place/to/break | 1.234567890123e-10 | 2 | 3 | 4 | 5 |

$$
a_1 + a_2 + a_3 + a_4 + a_5 + a_6 + a_7 + a_8 + a_9 + a_{10} + a_{11} + a_{12} + a_{13} + a_{14} + a_{15} + a_{16} = 0
$$

:::{note}
A note with `inline code` and a term.
:::

term
: its definition
"""
_RERUN = """# Rerun

```bash
geokalman run toy/01-wave frequency=2.0 amplitude=12345678901234567890 another_parameter=another_value
```

```{bibliography}
```
"""
_PROVENANCE = {
    "notebook": PAGE, "mode": "paper", "parameters": {"frequency": 2.0, "shape": "sine"}, "commit": "0" * 40,
    "uncommitted_changes": True, "finished": "2026-11-22T01:00:00Z", "seconds": 1.5, "processor": "a processor",
    "versions": {"python": "3.11.7", "numpy": "2.4.6", "scipy": "1.17.1", "numba": "0.68.1"},
}  # fmt: skip


def make(root: Path) -> Path:
    """Write a clone-like folder with the project's own configuration, extensions and styles around a toy book."""
    book, real = root / "book", PROJECT / "book"
    (book / "toy").mkdir(parents=True)
    (book / "practice").mkdir()
    for folder in ("_ext", "_static"):
        shutil.copytree(real / folder, book / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("_config.yml", "execbook.toml", "references.bib"):
        shutil.copyfile(real / name, book / name)
    (root / "data").mkdir()
    (root / "data" / "registry.json").write_text("{}")
    (book / "_toc.yml").write_text(
        "format: jb-book\nroot: index\nparts:\n- caption: Toys\n  chapters:\n  - file: toy/index\n"
        "    sections:\n    - file: toy/01-wave\n  - file: practice/rerun\n"
    )
    texts = {"index": _INDEX, "toy/index": _PAPER, PAGE: _NOTEBOOK, "practice/rerun": _RERUN}
    for name, text in texts.items():
        (book / f"{name}.md").write_text(text)
    (book / "toy" / "claims.yml").write_text(_CLAIMS)
    run(book / "_build" / "runs" / PAGE)
    return root


def run(folder: Path) -> None:
    """Write a run folder as `nb.finish()` leaves it."""
    for name in ("figures", "tables"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    x = np.linspace(0.0, 10.0, 50)
    seen = []
    for theme in ("light", "dark"):
        with style.theme(theme):
            figure, axes = plt.subplots()
            axes.fill_between(x, np.sin(x) - 0.1, np.sin(x) + 0.1, color=style.METHODS["ukf"].colour, alpha=0.25)
            for name, shift in (("ukf", 0.0), ("ekf", 0.3)):
                look = style.METHODS[name]
                axes.plot(x, np.sin(x + shift), color=look.colour, linestyle=look.line, label=look.label)
            axes.axhline(0.5, color=style.ink(), linestyle=":")
            axes.set(xlabel="time / s", ylabel="height / m")
            seen.append(explore.read(figure))
            figure.savefig(folder / "figures" / f"wave.{theme}.png")
            style.close(figure)
    (folder / "figures" / "wave.js").write_text(explore.script("wave", explore.both(*seen)), encoding="utf-8")
    np.savetxt(folder / "figures" / "wave.csv", np.column_stack([x, np.sin(x)]), delimiter=",", header="t_s,h_m")
    (folder / "tables" / "rms.csv").write_text("method,rms / m\nUKF,0.7\nEKF,0.8\n")
    (folder / "tables" / "verdicts-01-wave.csv").write_text("claim,verdict\na,calibrated\n")
    metrics = folder.parents[2] / "metrics" / f"{PAGE}.json"
    metrics.parent.mkdir(parents=True, exist_ok=True)
    for path in (folder / "metrics.json", metrics):
        path.write_text(json.dumps({"wave.rms": {"value": 0.70711, "unit": "m"}}))
    (folder / "provenance.json").write_text(json.dumps(_PROVENANCE))
    nbformat.write(notebook(), folder / "notebook.ipynb")


def notebook() -> nbformat.NotebookNode:
    """The executed notebook of the toy page."""
    new = nbformat.v4
    figure = {
        "name": "wave", "caption": "A wave of height $h$.", "alt": 'A "sine": 100 % of #1 [five] periods', "width": 720,
        "files": {"light": "figures/wave.light.png", "dark": "figures/wave.dark.png", "csv": "figures/wave.csv",
                  "js": "figures/wave.js"},
        "data_every": 2,
    }  # fmt: skip
    table = {
        "name": "rms", "caption": "Two methods.", "header": ["method", "rms / m"], "align": ["left", "right"],
        "rows": [["UKF", "0.7"], ["EKF", "0.8 | 9.0\u00a0×\u00a010⁻¹"]], "files": {"csv": "tables/rms.csv"},
    }  # fmt: skip
    verdicts = {
        "name": "verdicts-01-wave", "caption": "Claims.", "header": ["The paper says", "Ours", "Verdict", "Why"],
        "align": ["left"] * 4, "files": {"csv": "tables/verdicts-01-wave.csv"},
        "rows": [["Fig. 1: a", "1.2\u00a0×\u00a010⁻³", "calibrated", "a was tuned"]],
    }  # fmt: skip

    def code(source: str, *data: dict, tags: tuple[str, ...] = ()) -> nbformat.NotebookNode:
        outputs = [new.new_output("display_data", data={"text/plain": "...", **d}) for d in data]
        return new.new_code_cell(source, outputs=outputs, metadata={"tags": list(tags)}, execution_count=1)

    cells = [
        new.new_markdown_cell("# A wave\n\nSome words on the wave, $h = a \\sin \\omega t$."),
        code("frequency = 2.0  # (0, 10] Hz: of the wave", tags=("parameters",)),
        code('quick = {"frequency": 1.0}', tags=("quick",)),
        code('nb = Notebook("toy/01-wave", globals())'),
        code("nb.figure('wave', draw)", {FIGURE_TYPE: figure, "text/html": "<figure>"}),
        new.new_markdown_cell("## Numbers"),
        code("nb.table('rms', rows)", {TABLE_TYPE: table, "text/html": "<table>"}),
        code("print('x' * 200)"),
        code("nb.verdicts()", {TABLE_TYPE: verdicts}),
        code("print('the end')\nnb.finish()"),
    ]
    cells[-3].outputs = [new.new_output("stream", name="stdout", text="x" * 200 + "\n")]
    cells[-1].outputs = [new.new_output("stream", name="stdout", text="the end\nRecorded 1 numbers.\n")]
    for number, cell in enumerate(cells):
        cell["id"] = f"toy-{number}"
    metadata = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    return new.new_notebook(cells=cells, metadata=metadata)
