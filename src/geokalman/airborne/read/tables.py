"""Survey files as tables of columns: CSV, Geosoft XYZ, fixed width with a DFN, and the packed vendored file.

A table is a dict of column name -> (n,) float array (NaN where the file has a null); names are upper case with
underscores, however the file writes them. Compression and format are recognised by the first bytes.
"""

from __future__ import annotations

import json
import lzma
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path

import numpy as np

from geokalman import reading
from geokalman.airborne.model import Array
from geokalman.airborne.read.columns import WHAT, Table
from geokalman.airborne.read.delimited import is_data, read_delimited
from geokalman.airborne.read.gdf import read_fixed_width
from geokalman.reading import Place

_PACKED = '{"packed": 1'
_COMPRESSED = (".gz", ".xz", ".bz2")


def read_table(path: Path | str, definition: Path | str | None = None) -> Table:
    """Read a survey file of any known format; `definition` is the .DFN of a fixed-width .DAT (default: the one beside
    it).

    Raises InputError, naming the row, for what cannot be read; FileNotFoundError and its like as `reading` does.
    """
    path = Path(path)
    with closing(reading.lines(path, WHAT)) as rows:
        head = next((text for _, text in rows), "")
    if head.startswith(_PACKED):
        return read_packed(path)
    if head.lstrip().upper().startswith("DEFN"):
        raise Place(path).error("this defines the columns of a fixed-width file; give the .DAT beside it.")
    definition = definition or _beside(path)
    if definition is None and _bare(path).suffix.lower() == ".dat" and is_data(head):
        raise Place(path).error(f"this needs the file {_bare(path).stem}.DFN beside it, which says where columns are.")
    return read_fixed_width(path, definition) if definition else read_delimited(path)


def pack(table: Mapping[str, Array], decimals: Mapping[str, int], predicted: Mapping[str, tuple[str, str]]) -> bytes:
    """Pack columns without loss: integers of 10^-decimals, second differences, byte planes, xz.

    predicted : column -> (a, b) where a - b nearly gives it, so that only the rest is kept. Raises ValueError for a
    null.
    """
    whole: dict[str, np.ndarray] = {}
    for name, places in decimals.items():
        values = np.asarray(table[name], dtype=float)
        if not np.isfinite(values).all():
            raise ValueError(f"Column {name} has a null; the packed file has none.")
        whole[name] = np.round(values * 10**places).astype(np.int64)
    head = json.dumps({"packed": 1, "rows": len(values), "decimals": dict(decimals), "predicted": dict(predicted)})
    parts = [head.encode() + b"\n"]
    for name, values in whole.items():
        if name in predicted:
            a, b = predicted[name]
            values = values - (whole[a] - whole[b])
        rest = np.diff(values, 2, prepend=[0, 0])
        parts.append(np.ascontiguousarray(rest.astype("<i8").view(np.uint8).reshape(-1, 8).T).tobytes())
    return lzma.compress(b"".join(parts), preset=9 | lzma.PRESET_EXTREME)


def read_packed(path: Path | str) -> Table:
    """Read a file made by `pack`. Raises InputError where its header is not one, or promises what does not follow."""
    path = Path(path)
    head, _, body = reading.read_bytes(path, WHAT).partition(b"\n")
    try:
        described = json.loads(head)
        rows, decimals, predicted = int(described["rows"]), dict(described["decimals"]), dict(described["predicted"])
        scale = {name: 10.0 ** int(places) for name, places in decimals.items()}
        if not {*predicted, *(name for pair in predicted.values() for name in pair)} <= scale.keys():
            raise KeyError
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        raise Place(path, 1).error("this is no header of a packed survey; fetch the file again.") from None
    if rows < 0 or 8 * rows * len(scale) != len(body):
        raise Place(path, 1).error(
            f"this promises {rows} rows of {len(scale)} columns, and {len(body)} bytes follow; fetch the file again."
        )
    whole = {}
    for k, name in enumerate(scale):
        plane = np.frombuffer(body, np.uint8, 8 * rows, 8 * rows * k).reshape(8, rows)
        rest = np.ascontiguousarray(plane.T).view("<i8")[:, 0]
        whole[name] = np.cumsum(np.cumsum(rest))
    for name, (a, b) in predicted.items():
        whole[name] = whole[name] + whole[a] - whole[b]
    return Table({name: whole[name] / scale[name] for name in scale}, path)


def _beside(path: Path) -> Path | None:
    """The definition of a fixed-width file: SURVEY.DFN beside SURVEY.DAT, whatever their case and compression."""
    bare = _bare(path)
    if bare.suffix.lower() in (".csv", ".xyz"):
        return None
    wanted = {f"{bare.stem}.dfn{end}".lower() for end in ("", *_COMPRESSED)}
    found = [one for one in path.parent.iterdir() if one.name.lower() in wanted]
    return min(found, key=lambda path: (not path.name.startswith(bare.stem), path.name), default=None)


def _bare(path: Path) -> Path:
    return path.with_suffix("") if path.suffix.lower() in _COMPRESSED else path
