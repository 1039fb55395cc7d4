"""The foot of a notebook's page: how to rerun it, what can be downloaded, and how this very page was made."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from geokalman.reproduce import parameters

_OFFERED = {
    "notebook.ipynb": "the executed notebook",
    "metrics.json": "every recorded number with its unit",
    "arrays.npz": "the recorded arrays",
    "provenance.json": "parameters, versions and data behind this page",
}
_LARGEST = 20e6  # bytes; a larger file is made by the rerun, not carried in the book


def foot(root: Path, page: str, run: Path, files: Path) -> str:
    """MyST text of the block at the foot of `page`; what it offers is copied from the run folder into `files`."""
    specification = parameters.load(root, page)
    shown = list(specification.parameters.values())
    lines = [
        "## Rerun this page",
        "",
        f"From a clone of the project ([how](/practice/rerun.md)), with {_these(len(shown))} changed:",
        "",
        "```bash",
        f"geokalman run {page} {_example(shown)}".rstrip(),
        "```",
        "",
        "````{dropdown} Parameters",
        "| name | default | unit | range | what it is |",
        "| --- | --- | --- | --- | --- |",
        *(f"| `{p.name}` | {_code(p.default)} | {p.unit} | {_code(p.range)} | {_cell(p.help)} |" for p in shown),
        "````",
        "",
    ]
    stem = page.rsplit("/", 1)[-1]
    for name, what in _OFFERED.items():
        if (run / name).is_file() and (run / name).stat().st_size <= _LARGEST:
            offered = f"{stem}.ipynb" if name == "notebook.ipynb" else f"{stem}.{name}"
            shutil.copyfile(run / name, files / offered)
            lines.append(f"- {{download}}`{offered} <{files.name}/{offered}>`: {what}")
    return "\n".join([*lines, "", _made(run)])


def _these(count: int) -> str:
    return "any of the parameters below" if count > 1 else "its one parameter"


def _example(shown: list[parameters.Parameter]) -> str:
    """A changed parameter for the example line: the first number, halved where its range allows, or a shorter list."""
    for p in shown:
        if p.kind in ("float", "int") and not p.many and p.default:
            half = p.default / 2 if p.kind == "float" else p.default // 2
            if p.interval is None or half in p.interval:
                return f"{p.name}={half:g}"
    for p in shown:
        if p.many and len(p.default or ()) > 1:
            return f"{p.name}=[{','.join(map(str, p.default[:-1]))}]"
    return ""


def _made(run: Path) -> str:
    told = json.loads((run / "provenance.json").read_text(encoding="utf-8"))
    commit = f"commit `{told['commit'][:10]}`" if told["commit"] else "sources outside git"
    if told["commit"] and told["uncommitted_changes"]:
        commit += " with uncommitted changes"
    versions = ", ".join(f"{name} {told['versions'][name]}" for name in ("python", "numpy", "scipy", "numba"))
    return f"Computed {told['finished']} in {told['seconds']:.1f} s from {commit} ({versions}; {told['processor']})."


def _code(value: object) -> str:
    text = "" if value is None or value == "" else str(value)
    return f"`{_cell(text)}`" if text else ""


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
