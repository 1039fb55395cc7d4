"""The record of a notebook: parameters in; named numbers, arrays, figures and tables out."""

from __future__ import annotations

import ast
import atexit
import csv
import io
import math
import numbers
import os
import re
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from execbook import (
    atomic, claims, display, explore, multiverse, parameters, progress, project, provenance, runfolder, verdicts,
)  # fmt: skip
from execbook.errors import Fault
from execbook.memo import Memo

T = TypeVar("T")
OUT = "EXECBOOK_OUT"
"""Environment variable: folder of the run; without it the record goes to `runs/<paper>/<notebook>/interactive`."""
DPI = 180
_KEY = re.compile(r"[A-Za-z0-9_+-]+(\.[A-Za-z0-9_+-]+)*")
_NAME = re.compile(r"[a-z0-9][a-z0-9_-]*")


class Params(dict):
    """The values of the parameters, by key or by attribute, not to be changed."""

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"{name} is no parameter; there are {', '.join(self)}.") from None

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(
            f"{name} cannot be set here: parameters are given in the parameters cell or on the command line."
        )

    __setitem__ = __setattr__


class Notebook:
    """The record of one run of the notebook `<paper>/<name>`, whose namespace is `globals()`.

    It checks every parameter found in the namespace, however the notebook was started, and puts the checked value
    back. The run folder is empty before `finish`. Raises Misuse for an unknown parameter or a wrong value.
    """

    def __init__(self, name: str, namespace: dict[str, Any]) -> None:
        self._started = time.perf_counter()
        self._root = project.root()
        declared = project.read(self._root)
        self.name = name
        self.specification = parameters.load(self._root, name)
        for word in _injected(namespace):
            self.specification.known(word)
        missing = [p for p in self.specification.parameters if p not in namespace]
        if missing:
            raise Fault(f"{', '.join(missing)} of {name} has no value yet; execute its parameters cell first.")
        self.params = Params(self.specification.check({p: namespace[p] for p in self.specification.parameters}))
        namespace.update(self.params)
        self.mode = self.specification.mode(self.params)
        """`paper` for the defaults, `quick` for the quick values, else `custom`."""
        told = os.environ.get(OUT)
        self._interactive = not told
        self.out = Path(told).resolve() if told else self._root / "runs" / name / "interactive"
        self._staging = self.out.with_name(f".{self.out.name}.partial-{os.getpid()}")
        shutil.rmtree(self._staging, ignore_errors=True)  # of an earlier execution in this Jupyter kernel
        atexit.register(shutil.rmtree, self._staging, ignore_errors=True)
        self._reporter = progress.Reporter()
        if declared.progress:
            project.named(declared.progress)(self._reporter)
        self._notes: list[str] = []
        self._memo = Memo(self._root / ".cache" / "memo", declared.package, note=self._notes.append)
        self._metrics: dict[str, dict[str, Any]] = {}
        self._arrays: dict[str, np.ndarray] = {}
        self._units: dict[str, str] = {}
        self._shown: dict[str, str] = {}
        self._finished = False

    def expect(self, seconds: float) -> None:
        """Say beforehand that the notebook may take so long, where that is more than a minute."""
        if seconds > 60.0:
            words = f"may take {progress.duration(seconds)}, less where results of earlier runs are kept"
            self._reporter.expect(words)
            if self._interactive:
                print(f"This {words}.")

    def track(self, items: Iterable[T], what: str) -> Iterator[T]:
        """Give the items one by one, while the display shows the share of the loop that is done."""
        items = list(items)
        self._reporter(what, 0.0)
        for done, item in enumerate(items, 1):
            yield item
            self._reporter(what, done / len(items))

    def memo(self, function: Callable[..., T], ignore: Iterable[str] = ()) -> Callable[..., T]:
        """Give the function with its results kept on disk; see `memo.Memo`."""
        return self._memo(function, ignore)

    def record(self, key: str, value: float, unit: str = "", finite: bool = True) -> None:
        """Record a number under a dotted name, in SI unless the name says otherwise.

        Raises Fault for a name that is malformed or taken, for a value that is no number, and for one that is not
        finite where `finite` holds (else it is recorded as null).
        """
        self._claim(key, self._metrics, _KEY, "a dotted name such as table1.ukf.std")
        if hasattr(value, "item") and np.ndim(value) == 0:
            value = np.asarray(value).item()
        if not isinstance(value, numbers.Real):
            raise Fault(f"{key} = {value!r} is no number; arrays are recorded with nb.array.")
        if not math.isfinite(value) and finite:
            raise Fault(
                f"{key} = {value} is not finite: with these parameters there is nothing to compute it from "
                "(in a notebook of your own, finite=False records it as null)."
            )
        self._metrics[key] = {"value": value if math.isfinite(value) else None, "unit": unit}

    def array(self, key: str, values: ArrayLike, unit: str = "", finite: bool = True) -> None:
        """Record an array of numbers under a dotted name; raises Fault as `record` does."""
        self._claim(key, self._arrays, _KEY, "a dotted name such as residual.ukf")
        array = np.asarray(values)
        if array.dtype.kind not in "fiubc":
            raise Fault(f"{key} has items of type {array.dtype}; an array of numbers can be recorded.")
        if finite and not np.isfinite(array).all():
            bad = np.argwhere(~np.isfinite(array))[0].tolist()
            raise Fault(f"{key} is not finite at index {bad}; say finite=False where that is meant.")
        self._arrays[key], self._units[key] = array, unit

    def figure(
        self, name: str, draw: Callable[..., Any], *args: Any, caption: str, alt: str,
        data: Mapping[str, ArrayLike] | None = None, data_every: int = 1, interactive: bool | Mapping[str, Any] = False,
        **kwargs: Any,
    ) -> None:  # fmt: skip
        """Draw a figure light and dark, keep both images and its data as CSV, and display it.

        name        file name and, in the book, the label for {numref}
        draw        function of `args` and `kwargs` that gives a matplotlib Figure
        caption     one or two sentences below it;  alt: what it shows, for who cannot see it
        data        column name (with unit, `range_rate_m_s`) -> 1-D column; all of one length
        data_every  keep every so many rows of the columns; stated in the record
        interactive  keep the curves for the browser too, where a button below the figure opens them as a plot to zoom
                     into; or the data of a script of its own in `book/_static`, which the key `script` names
        """
        self._claim_shown("figure", name, caption=caption, alt=alt)
        drawn = [self._draw(name, theme, draw, args, kwargs, interactive is True) for theme in ("light", "dark")]
        images, width, seen = zip(*drawn, strict=True)
        paths = {theme: f"figures/{name}.{theme}.png" for theme in ("light", "dark")}
        for path, image in zip(paths.values(), images, strict=True):
            self._write(path, image)
        record = {"name": name, "caption": caption, "alt": alt, "width": width[0], "files": paths}
        if data is not None:
            paths["csv"] = f"figures/{name}.csv"
            self._write(paths["csv"], _columns(name, data, data_every))
            record["data_every"] = data_every
        if interactive:
            paths["js"] = f"figures/{name}.js"
            given = interactive if isinstance(interactive, Mapping) else explore.both(*seen)
            self._write(paths["js"], explore.script(name, given).encode())
        self._shown[name] = "figures"
        display.show(display.figure_bundle(record, images[0]))

    def _draw(
        self, name: str, theme: str, draw: Callable[..., Any], args: Any, kwargs: Any, interactive: bool
    ) -> tuple[bytes, int, dict[str, Any]]:
        with project.theme(self._root, theme):
            figure = draw(*args, **kwargs)
            if not hasattr(figure, "savefig"):
                given, kind = getattr(draw, "__name__", draw), type(figure).__name__
                raise Fault(f"{given} gave {kind} for figure {name}; it must return a matplotlib Figure.")
            seen = explore.read(figure) if interactive else {}
            return display.as_png(figure, DPI), round(float(figure.get_size_inches()[0]) * 100), seen

    def table(
        self, name: str, header: Sequence[str], rows: Iterable[Sequence[Any]], caption: str,
        formats: Sequence[str | None] | None = None,
    ) -> None:  # fmt: skip
        """Keep a table as CSV with full digits, and display it with four or by the `formats`.

        header: (k,) names with units; rows: each (k,) of numbers, texts or None; formats: (k,) such as ".3e" or None.
        """
        self._claim_shown("table", name, caption=caption)
        rows = [list(row) for row in rows]
        for row in [*rows, *([formats] if formats else [])]:
            if len(row) != len(header):
                raise Fault(f"Table {name} has {len(header)} columns, but a row (or formats) of {len(row)}: {row}.")
        forms = formats or [None] * len(header)
        numeric = [any(isinstance(r[k], numbers.Real) for r in rows) for k in range(len(header))]
        record: dict[str, Any] = {
            "name": name,
            "caption": caption,
            "header": [str(h) for h in header],
            "rows": [[display.cell(v, f) for v, f in zip(r, forms, strict=True)] for r in rows],
            "align": ["right" if n else "left" for n in numeric],
            "files": {"csv": f"tables/{name}.csv"},
        }
        self._write(record["files"]["csv"], _csv([list(header), *rows]))
        self._shown[name] = "tables"
        display.show(display.table_bundle(record))

    def claims(self) -> list[claims.Claim]:
        """List the claims of the paper's ledger that this notebook's numbers decide."""
        return claims.decided_by(self._root, self.name)

    def printed(self, claim: str) -> float:
        """Give the number that the paper prints, as we read it; raises Fault where there is none."""
        paper = self.name.partition("/")[0]
        for entry in claims.ledger(self._root, paper):
            if entry.id == claim and entry.reference is not None:
                return entry.reference
        raise Fault(f"{claim} is no claim with a printed number in the ledger of {paper}.")

    def verdicts(self) -> None:
        """Show the claims that this notebook decides; only the paper's own parameters are judged."""
        judged = self.mode == "paper"
        header, rows, caption = verdicts.of_notebook(self._root, self.name, self._metrics, judged)
        if rows:
            self.table(f"verdicts-{self.name.rpartition('/')[2].lower()}", header, rows, caption)

    def multiverse(self, *runs: tuple[Callable[[multiverse.World], Mapping[str, float]], int], seed: int) -> None:
        """Judge the paper's claims in worlds of its readings; record and show in which part of them each holds.

        runs : pairs of a function of a world that gives `paper/notebook:key` -> number, and how many worlds it runs;
        each world's result is kept. Raises Fault where two functions decide one claim.
        """
        paper = self.name.partition("/")[0]
        declared, entries = multiverse.choices(self._root, paper), claims.ledger(self._root, paper)
        shares: dict[str, multiverse.Share] = {}
        for place, (function, size) in enumerate(runs):
            worlds, kept = multiverse.draw(declared, size, seed + place), self.memo(function)
            results = [kept(world) for world in self.track(worlds, f"worlds of {function.__name__}")]
            held = multiverse.survived(lambda claim, table: claims.judge(claim, table).holds, entries, results)
            numbers = multiverse.count(declared, worlds, held)
            for key, value in numbers.items():
                name = key.replace("most.", f"most.{place + 1}.") if len(runs) > 1 else key
                self.record(name, value)
            recorded = {key: {"value": value} for key, value in numbers.items()}
            shares |= {claim: multiverse.share_of(claim, recorded) for claim in held}
        self.record("worlds", max(size for _, size in runs))
        self.table(f"choices-{paper}", *multiverse.choices_table(declared))
        self.table(f"shares-{paper}", *multiverse.shares_table(entries, shares))
        listed = multiverse.sorted_shares(entries, shares)
        self.figure(
            f"shares-figure-{paper}", multiverse.draw_shares, listed, data=multiverse.columns(listed),
            **multiverse.SHARES_WORDS,
        )  # fmt: skip

    def finish(self) -> None:
        """Write the record whole into the folder `out`; raises Fault, leaving what stood there."""
        self._open()
        if self._interactive:
            runfolder.refuse_foreign(self.out)
        described = {
            "notebook": self.name,
            "mode": self.mode,
            "parameters": dict(self.params),
            "seed": self.params.get("seed"),
            **provenance.describe(self._root),
            "arrays": {k: {"shape": list(a.shape), "unit": self._units[k]} for k, a in self._arrays.items()},
            **{kind: [name for name, k in self._shown.items() if k == kind] for kind in ("figures", "tables")},
            "notes": self._notes,
            "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "seconds": round(time.perf_counter() - self._started, 3),
        }
        buffer = io.BytesIO()
        np.savez(buffer, **self._arrays)
        self._write("arrays.npz", buffer.getvalue())
        self._write("metrics.json", atomic.as_json(self._metrics).encode())
        self._write("provenance.json", atomic.as_json(described).encode())
        atomic.swap_folder(self._staging, self.out)
        self._finished = True
        figures, tables = len(described["figures"]), len(described["tables"])
        counts = f"{len(self._metrics)} numbers, {len(self._arrays)} arrays, {figures} figures and {tables} tables"
        print(f"Recorded {counts}.")

    def _open(self) -> None:
        if self._finished:
            raise Fault(f"{self.name} is finished; make a new Notebook to record again.")

    def _claim(self, key: str, taken: Mapping[str, Any], pattern: re.Pattern[str], wanted: str) -> None:
        self._open()
        if not pattern.fullmatch(key):
            raise Fault(f"{key!r} cannot name a record; it must be {wanted}.")
        others = self._arrays if taken is self._metrics else self._metrics if taken is self._arrays else {}
        if key in others or (key in taken and not self._interactive):  # a cell may be executed again in Jupyter
            twice = [f" {name} = {value} has a value twice." for name, value in self.params.items() if _repeats(value)]
            raise Fault(f"{key!r} is recorded already; a name is recorded once.{''.join(twice)}")

    def _claim_shown(self, kind: str, name: str, **words: str) -> None:
        """Claim the name of a figure or table, which needs all of the words."""
        self._claim(name, self._shown, _NAME, "lower case letters, digits, - and _")
        for word, text in words.items():
            if not str(text).strip():
                raise Fault(f"{kind.capitalize()} {name} has an empty {word}; every {kind} needs one.")

    def _write(self, path: str, content: bytes) -> None:
        target = self._staging / path
        with atomic.explained(self.out / path):
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)


def _injected(namespace: Mapping[str, Any]) -> set[str]:
    """Give the names that papermill's cell assigns, from IPython's list of executed cells."""
    cells = [c for c in namespace.get("In", ()) if isinstance(c, str) and c.startswith("# Parameters\n")]
    nodes = [node for cell in cells for node in ast.parse(cell).body if isinstance(node, ast.Assign)]
    return {target.id for node in nodes for target in node.targets if isinstance(target, ast.Name)}


def _columns(name: str, data: Mapping[str, ArrayLike], every: int) -> bytes:
    columns = {column: np.asarray(values) for column, values in data.items()}
    for column, values in columns.items():
        if values.ndim != 1:
            raise Fault(f"Column {column} of figure {name} has shape {values.shape}; give one dimension (ravel a map).")
    lengths = {column: len(values) for column, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise Fault(f"The columns of figure {name} have different lengths, {lengths}; fill the shorter ones with nan.")
    return _csv([list(columns), *zip(*(values[::every].tolist() for values in columns.values()), strict=True)])


def _csv(rows: Iterable[Sequence[Any]]) -> bytes:
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(rows)  # floats as repr: the shortest text that reads back
    return buffer.getvalue().encode()


def _repeats(value: Any) -> bool:
    """Tell whether two items of a list look the same in a recorded name."""
    words = [f"{item:g}" if isinstance(item, float) else str(item) for item in value] if isinstance(value, list) else []
    return len(set(words)) < len(words)
