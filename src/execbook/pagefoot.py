"""The foot of a notebook's page: how to rerun it, what can be downloaded, and how this very page was made."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from execbook import parameters, project
from execbook.display import markdown_table

_OFFERED = {
    "notebook.ipynb": "the executed notebook",
    "metrics.json": "every recorded number with its unit",
    "arrays.npz": "the recorded arrays",
    "provenance.json": "parameters, versions and data behind this page",
}
_LARGEST = 20e6  # bytes; a larger file is made by the rerun, not carried in the book
_FOOT = """## Rerun this page

From a clone of the project ([how](/practice/rerun.md)), with {which} changed:

```bash
{command} run {page} {example}
```

````{{dropdown}} Parameters
{table}
````

{offers}

{made}"""


def foot(root: Path, page: str, run: Path, files: Path) -> str:
    """Give the MyST text at the foot of `page`; what it offers is copied from the run folder into `files`."""
    shown = list(parameters.load(root, page).parameters.values())
    stem = page.rsplit("/", 1)[-1]
    offers = []
    for name, what in _OFFERED.items():
        if (run / name).is_file() and (run / name).stat().st_size <= _LARGEST:
            offered = f"{stem}.ipynb" if name == "notebook.ipynb" else f"{stem}.{name}"
            shutil.copyfile(run / name, files / offered)
            offers.append(f"- {{download}}`{offered} <{files.name}/{offered}>`: {what}")
    header = ["name", "default", "unit", "range", "what it is"]
    rows = [[f"`{p.name}`", _code(p.default), p.unit, _code(p.range), " ".join(p.help.split())] for p in shown]
    return _FOOT.format(
        which="any of the parameters below" if len(shown) > 1 else "its one parameter",
        command=project.read(root).command,
        page=page,
        example=_example(shown),
        table=markdown_table(header, rows),
        offers="\n".join(offers),
        made=_made(run),
    )


def _example(shown: list[parameters.Parameter]) -> str:
    """Change a parameter for the example: halve the first number whose range allows it, or shorten a list."""
    for p in shown:
        if p.kind in ("float", "int") and not p.many and p.default:
            half = p.default / 2 if p.kind == "float" else p.default // 2
            if p.interval is None or p.interval.holds(half):
                return f"{p.name}={half:g}"
    lists = (p for p in shown if p.many and len(p.default or ()) > 1)
    return next((f"{p.name}=[{','.join(map(str, p.default[:-1]))}]" for p in lists), "")


def _made(run: Path) -> str:
    told = json.loads((run / "provenance.json").read_text(encoding="utf-8"))
    commit = f"commit `{told['commit'][:10]}`" if told["commit"] else "sources outside git"
    if told["commit"] and told["uncommitted_changes"]:
        commit += " with uncommitted changes"
    versions = ", ".join(f"{name} {told['versions'][name]}" for name in ("python", "numpy", "scipy", "numba"))
    return f"Computed {told['finished']} in {told['seconds']:.1f} s from {commit} ({versions}; {told['processor']})."


def _code(value: object) -> str:
    return "" if value is None or value == "" else f"`{value}`"
