"""Folders of runs: what is read of anybody's, and what a new run must not remove."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from execbook.errors import Misuse, explain, is_plain, shown

_PROVENANCE = "provenance.json"
PAGE = "compare.html"
_PARTS = {_PROVENANCE, "arrays.npz", "metrics.json", "notebook.ipynb", "page.html", PAGE}
_LITTER = {".DS_Store", ".ipynb_checkpoints"}  # of file managers and Jupyter: nobody's work
_PROJECT = {"book", "data", "src", "tests", "tools"}
_Key = Annotated[str, Field(pattern=r"^[A-Za-z0-9_+.-]+$")]
_Unit = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]
_Scalar = bool | int | float | str | None


class _Strict(BaseModel):
    model_config = ConfigDict(strict=True, allow_inf_nan=False)


class _Number(_Strict):
    value: float | None
    unit: _Unit


class _Array(_Strict):
    shape: list[int]
    unit: _Unit


class _Provenance(_Strict):
    notebook: str
    mode: Literal["paper", "quick", "custom"]
    parameters: dict[_Key, _Scalar | list[_Scalar]]
    arrays: dict[_Key, _Array]


def run_folder(root: Path, name: str) -> Path:
    """Give the run folder of a notebook in the book."""
    return root / "book" / "_build" / "runs" / name


def provenance(folder: Path) -> dict[str, Any] | None:
    """Read what a run of our own tells of itself, or give None where there is none."""
    path = folder / _PROVENANCE
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None


def read(folder: Path) -> tuple[dict[str, Any], dict[str, dict[str, Any]], dict[str, np.ndarray]]:
    """Read provenance, numbers and arrays of a run folder; nothing in the files can run code.

    Raises Misuse where the folder is none of a run or a file of it is damaged.
    """
    told = _read_json(folder, _PROVENANCE, _Provenance)
    metrics = _read_json(folder, "metrics.json", dict[_Key, _Number])
    path = folder / "arrays.npz"
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {key: stored[key] for key in stored.files}
    except FileNotFoundError as error:
        raise _no_run(folder, error) from error
    except Exception as error:  # a damaged archive raises of many kinds
        pickled = "pickled objects in it, which may run code, are not read"
        raise _damaged(path, pickled if "pickle" in str(error) else "no whole archive") from error
    found = {key: (list(array.shape), array.dtype.kind in "fiubc") for key, array in arrays.items()}
    if found != {key: (array["shape"], True) for key, array in told["arrays"].items()}:
        raise _damaged(path, f"its arrays are not those that {_PROVENANCE} describes")
    return told, metrics, arrays


def _read_json(folder: Path, name: str, form: Any) -> Any:
    try:
        value = json.loads((folder / name).read_text(encoding="utf-8"))
        TypeAdapter(form).validate_python(value)
        return value
    except OSError as error:
        raise _no_run(folder, error) from error
    except ValidationError as error:
        raise _damaged(folder / name, shown(explain(error), 200)) from error
    except (ValueError, RecursionError) as error:
        raise _damaged(folder / name, "no whole JSON") from error


def _no_run(folder: Path, error: OSError) -> Misuse:
    return Misuse(f"{folder} is no folder of a run ({error}); the command run prints the name of one last.")


def _damaged(path: Path, why: str) -> Misuse:
    return Misuse(f"{path} is damaged ({why}); run the notebook again.")


def refuse_foreign(folder: Path) -> None:
    """Raise Misuse where a new run in `folder` would remove anything but a run."""
    if folder.exists() and not folder.is_dir():
        raise Misuse(f"{folder} is a file; a run is written into a folder: name a new one.")
    known, inside = _LITTER, sorted(os.listdir(folder)) if folder.is_dir() else []
    if _PROVENANCE in inside:
        known, inside = _run_files(folder), sorted(_files(folder))
    if foreign := [name for name in inside if name not in known]:
        words = ", ".join(map(shown, foreign[:3])) + (" and more" if len(foreign) > 3 else "")
        raise Misuse(
            f"{folder} holds {words}, which a new run would remove; move that elsewhere, or name another folder."
        )


def _run_files(folder: Path) -> set[str]:
    """Name all that may be in a run folder, by its own provenance."""
    try:
        told = provenance(folder)
        figures, tables = ([str(name) for name in told.get(kind, ())] for kind in ("figures", "tables"))
    except (OSError, ValueError, AttributeError, TypeError, RecursionError):
        raise Misuse(
            f"{folder / _PROVENANCE} cannot be read, so what in that folder is of a run cannot be told; "
            "name another folder, or remove this one."
        ) from None
    drawn = {f"figures/{name}.{kind}" for name in figures for kind in ("light.png", "dark.png", "csv", "js")}
    return _PARTS | drawn | {f"tables/{name}.csv" for name in tables}


def _files(folder: Path) -> Iterator[str]:
    """Name the files and links below a folder, relative to it."""
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name not in _LITTER]
        links = [name for name in folders if os.path.islink(os.path.join(place, name))]
        for name in [*names, *links]:
            if name not in _LITTER:
                yield os.path.relpath(os.path.join(place, name), folder)


def chosen(out: Path, root: Path) -> Path:
    """Give a user's folder, absolute; raises Misuse for one that must not be written."""
    try:
        folder = out.resolve()
        with suppress(FileNotFoundError, NotADirectoryError):
            folder.stat()
    except (OSError, RuntimeError) as error:  # RuntimeError: a loop of links
        why = getattr(error, "strerror", None) or "a link that leads to itself"
        raise Misuse(f"{shown(str(out))} cannot be reached ({why}); name another folder.") from error
    if not is_plain(str(folder)):
        raise Misuse(f"{str(folder)!r} has a control character or bytes that are no UTF-8; name another folder.")
    if folder.is_file():
        raise Misuse(f"{folder} is a file; name a folder.")
    if Path.cwd().is_relative_to(folder):
        raise Misuse(f"{folder} is where you stand and would be replaced; name a folder inside it.")
    inside = folder.relative_to(root).parts if folder.is_relative_to(root) else ()
    if inside and (inside[0] in _PROJECT or inside[0].startswith(".")):
        raise Misuse(f"{folder} is inside {root / inside[0]}, which is the project's own; name another folder.")
    return folder
