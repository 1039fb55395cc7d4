"""The record of a notebook, made in this process as plain Jupyter would: no run folder was named, or one was."""

import csv
import json
import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

from execbook import Notebook, display, runfolder
from execbook.errors import Fault, Misuse

DEFAULTS = {"slope": 2.0, "n": 50, "table": ""}


@pytest.fixture
def book(toy, monkeypatch):
    monkeypatch.setenv("EXECBOOK_OUT", str(toy / "out"))
    return Notebook("toy/01-line", dict(DEFAULTS))


def draw(t, colour=None):
    figure, axes = plt.subplots(figsize=(3, 2))
    axes.plot(t, color=colour)
    return figure


def shown(capsys, monkeypatch, call):
    """The bundle that a call displays."""
    bundles = []
    monkeypatch.setattr(display, "show", bundles.append)
    call()
    return bundles[0]


def test_checks_parameters_and_puts_the_checked_ones_back(toy):
    namespace = DEFAULTS | {"slope": 3}
    nb = Notebook("toy/01-line", namespace)
    assert isinstance(namespace["slope"], float) and nb.params.slope == nb.params["slope"] == 3.0
    assert dict(nb.params) == {"slope": 3.0, "n": 50, "table": ""} and nb.mode == "custom"
    with pytest.raises(AttributeError, match="cannot be set here"):
        nb.params.slope = 1.0
    with pytest.raises(AttributeError, match="slant is no parameter; there are slope"):
        _ = nb.params.slant


@pytest.mark.parametrize(
    "change, sentence",
    [
        ({"slope": -1.0}, "slope=-1.0 is out of range"),
        ({"n": "many"}, "n='many' is not int"),
        ({"slope": float("nan")}, "slope=nan is not finite"),
        (
            {"In": ["", "x = 1", "# Parameters\nslop = 3.0\n"]},
            r"slop is no parameter of toy/01-line \(did you mean slope\?\)",
        ),
    ],
)
def test_wrong_parameters_however_the_notebook_was_started(toy, change, sentence):
    with pytest.raises(Misuse, match=sentence):
        Notebook("toy/01-line", DEFAULTS | change)


def test_parameters_cell_not_executed(toy):
    with pytest.raises(Fault, match="n, table of toy/01-line has no value yet"):
        Notebook("toy/01-line", {"slope": 2.0})


def test_unknown_notebook(toy):
    with pytest.raises(Misuse, match="'toy/01-lime' is no notebook .* did you mean toy/01-line"):
        Notebook("toy/01-lime", {})


def test_record_is_whole(book, toy, capsys):
    book.record("line.mean", np.float64(1.5), "m")
    book.record("count", 3)
    book.record("undefined", float("inf"), finite=False)
    book.array("line.y", [1.0, 2.0], "m")
    book.figure(
        "line",
        draw,
        [1.0, 2.0],
        caption="A line.",
        alt="A line.",
        data={"t_s": [0.0, 1 / 3], "word": ["a", "b"]},
        colour="C1",
    )
    book.table("numbers", ["what", "value"], [["a", 1 / 3], ["b", None]], "Numbers.")
    assert not (toy / "out").exists()
    book.finish()
    out = toy / "out"
    assert json.loads((out / "metrics.json").read_text()) == {
        "line.mean": {"value": 1.5, "unit": "m"}, "count": {"value": 3, "unit": ""},
        "undefined": {"value": None, "unit": ""},
    }  # fmt: skip
    assert np.load(out / "arrays.npz")["line.y"].tolist() == [1.0, 2.0]
    assert sorted(os.listdir(out / "figures")) == ["line.csv", "line.dark.png", "line.light.png"]
    rows = list(csv.reader((out / "figures" / "line.csv").open()))
    assert rows[0] == ["t_s", "word"] and float(rows[2][0]) == 1 / 3  # the digits read back the same
    told = json.loads((out / "provenance.json").read_text())
    assert (
        told["mode"] == "paper"
        and told["parameters"] == DEFAULTS
        and told["arrays"]["line.y"] == {"shape": [2], "unit": "m"}
    )
    assert (
        set(told["versions"]) == {"python", "execbook", "numpy", "scipy", "numba", "matplotlib"} and told["processor"]
    )
    assert os.uname().nodename not in json.dumps(told) and str(toy) not in json.dumps(told)
    assert sorted(p.name for p in toy.iterdir() if p.name.startswith(".")) == []
    with pytest.raises(Fault, match="is finished"):
        book.record("more", 1.0)


def test_finish_replaces_the_old_record_whole(book, toy):
    (toy / "out" / "figures").mkdir(parents=True)
    (toy / "out" / "figures" / "stale.png").touch()
    book.record("a", 1.0)
    book.finish()
    assert not (toy / "out" / "figures").exists()


def test_disk_full_leaves_the_old_record(book, toy, monkeypatch):
    (toy / "out").mkdir()
    (toy / "out" / "metrics.json").write_text("old")
    book.record("a", 1.0)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(Fault, match="Cannot write .*: the disk is full; free some space; nothing there was changed"):
        book.finish()
    assert (toy / "out" / "metrics.json").read_text() == "old"


def test_without_a_run_folder_the_record_is_interactive_and_cells_may_be_repeated(toy):
    nb = Notebook("toy/01-line", dict(DEFAULTS))
    nb.record("a", 1.0)
    nb.record("a", 2.0)
    nb.finish()
    found = toy / "runs" / "toy" / "01-line" / "interactive" / "metrics.json"
    assert json.loads(found.read_text())["a"]["value"] == 2.0


@pytest.mark.parametrize(
    "call, sentence",
    [
        (
            lambda nb: nb.record("a", float("nan")),
            r"a = nan is not finite: with these parameters .* \(in a notebook of your own, finite=False",
        ),
        (lambda nb: nb.record("a", "text"), "a = 'text' is no number"),
        (lambda nb: nb.record("a", np.ones(2)), "is no number; arrays are recorded with nb.array"),
        (lambda nb: nb.record("a b", 1.0), "'a b' cannot name a record"),
        (lambda nb: nb.record("a..b", 1.0), "cannot name a record"),
        (lambda nb: [nb.record("a", 1.0), nb.record("a", 1.0)], "'a' is recorded already"),
        (lambda nb: [nb.record("a", 1.0), nb.array("a", [1.0])], "'a' is recorded already"),
        (lambda nb: nb.array("a", [1.0, np.inf]), r"a is not finite at index \[1\]"),
        (lambda nb: nb.array("a", ["x"]), "a has items of type <U1"),
        (lambda nb: nb.figure("F", draw, [1], caption="x", alt="x"), "'F' cannot name a record; it must be lower case"),
        (lambda nb: nb.figure("f", draw, [1], caption=" ", alt="x"), "Figure f has an empty caption"),
        (lambda nb: nb.figure("f", draw, [1], caption="x", alt=""), "Figure f has an empty alt"),
        (
            lambda nb: nb.figure("f", len, [1], caption="x", alt="x"),
            "len gave int for figure f; it must return a matplotlib Figure",
        ),
        (
            lambda nb: nb.figure("f", draw, [1], caption="x", alt="x", data={"a": [[1]]}),
            r"Column a of figure f has shape \(1, 1\)",
        ),
        (
            lambda nb: nb.figure("f", draw, [1], caption="x", alt="x", data={"a": [1], "b": [1, 2]}),
            "different lengths, {'a': 1, 'b': 2}",
        ),
        (lambda nb: nb.table("t", ["a"], [[1, 2]], "x"), r"Table t has 1 columns, but a row \(or formats\) of 2"),
        (lambda nb: nb.table("t", ["a"], [[1]], ""), "Table t has an empty caption"),
    ],
)
def test_what_cannot_be_recorded(book, call, sentence):
    with pytest.raises(Fault, match=sentence):
        call(book)


def test_figure_bundle(book, capsys, monkeypatch):
    open_before = plt.get_fignums()
    bundle = shown(capsys, monkeypatch, lambda: book.figure("line", draw, [1, 2], caption="a < b", alt='say "x"'))
    assert '<img src="data:image/png;base64,' in bundle["text/html"] and "http" not in bundle["text/html"]
    assert "<figcaption>a &lt; b</figcaption>" in bundle["text/html"] and "say &quot;x&quot;" in bundle["text/html"]
    record = bundle[display.FIGURE_TYPE]
    assert record["files"] == {"light": "figures/line.light.png", "dark": "figures/line.dark.png"}
    assert (record["name"], record["caption"], record["alt"]) == ("line", "a < b", 'say "x"')
    assert plt.get_fignums() == open_before


def test_same_figure_same_bytes(book, toy):
    for name in ("one", "two"):
        book.figure(name, draw, [1, 2], caption="x", alt="x")
    book.finish()
    one, two, dark = (
        (toy / "out" / "figures" / f"{n}.png").read_bytes() for n in ("one.light", "two.light", "one.dark")
    )
    assert one == two and one != dark and b"tEXt" not in one  # no date, no program


def test_data_every_is_kept_in_the_record(book, capsys, monkeypatch, toy):
    t = np.arange(10.0)
    bundle = shown(
        capsys, monkeypatch, lambda: book.figure("f", draw, t, caption="x", alt="x", data={"t": t}, data_every=4)
    )
    assert bundle[display.FIGURE_TYPE]["data_every"] == 4
    book.finish()
    assert (toy / "out" / "figures" / "f.csv").read_text().split() == ["t", "0.0", "4.0", "8.0"]


def test_an_interactive_figure_keeps_its_curves_in_both_themes(book, capsys, monkeypatch, toy):
    t = np.arange(5000.0)

    def two_panels():
        figure, (upper, lower) = plt.subplots(2, 1, sharex=True)
        upper.plot(t, t + 1, "--", color=plt.rcParams["text.color"], label="rising")
        upper.fill_between(t[:4], t[:4] - 1, t[:4] + 1, color="#0072b2", alpha=0.5)
        upper.axhline(3.0)
        upper.axvline(4.0)
        upper.set(ylabel="height [m]", title=r"of $\lambda_q$")
        lower.semilogy([3.0, 2.0, 1.0], [1.0, -1.0, 0.1], "o", linestyle="none")
        lower.set_xlabel("time [s]")
        return figure

    call = lambda: book.figure("two", two_panels, caption="x", alt="x", interactive=True)
    assert shown(capsys, monkeypatch, call)[display.FIGURE_TYPE]["files"]["js"] == "figures/two.js"
    book.finish()
    text = (toy / "out" / "figures" / "two.js").read_text(encoding="utf-8")
    head, _, body = text.partition(" = ")
    assert head == '(window.exploreData ??= {})["two"]' and body.endswith(";")
    data = json.loads(body[:-1])
    upper, lower = data["panels"]
    assert (
        upper["title"] == "of λ_q" and upper["xlabel"] == lower["xlabel"] == "time [s]" and upper["log"] == [False] * 2
    )
    edge, _, curve = upper["curves"]
    assert edge["label"] == "" and "curve" not in edge and curve["label"] == "rising" and curve["dash"] == [6, 4]
    assert curve["colour"][0] != curve["colour"][1] and set(data["look"]) == {"ink", "paper", "grid"}
    assert upper["tables"][0] == [[0, 1, 2, 3], [-1, 0, 1, 2], [1, 2, 3, 4]]
    assert upper["thinned"] == 3 and upper["tables"][1][1] == [1 + v for v in range(0, 5000, 3)]
    assert [(level["axis"], level["at"]) for level in upper["levels"]] == [("y", 3.0), ("x", 4.0)]
    assert lower["tables"] == [[[1, 2, 3], [0.1, None, 1]]] and lower["log"] == [False, True]  # no logarithm below zero
    assert lower["curves"][0]["dash"] is None
    runfolder.refuse_foreign(toy / "out")  # a new run may replace it


def test_a_script_of_its_own_is_given_its_data(book, toy):
    data = {"script": "own.js", "x": np.array([[1.0, np.nan]]), "deep": {"n": np.int64(3), "pair": (0.1, None)}}
    book.figure("own", draw, [1, 2], caption="x", alt="x", interactive=data)
    book.finish()
    text = (toy / "out" / "figures" / "own.js").read_text()
    assert json.loads(text.partition(" = ")[2][:-1]) == {
        "script": "own.js",
        "x": [[1.0, None]],
        "deep": {"n": 3, "pair": [0.1, None]},
    }


@pytest.mark.parametrize("curve, sentence", [([], "no curves to explore"), ([[0, 2, 1], [0, 0, 0]], "back and forth")])
def test_what_cannot_be_explored(book, curve, sentence):
    def draw_it():
        figure, axes = plt.subplots()
        if curve:
            axes.plot(*curve)
        return figure

    with pytest.raises(Fault, match=sentence):
        book.figure("f", draw_it, caption="x", alt="x", interactive=True)


def test_table_bundle(book, capsys, monkeypatch, toy):
    rows = [["a|b", -1.23456789e-9, 3, None], ["c", 0.5, True, "x"]]

    def call():
        book.table("t", ["what", "value", "n", "note"], rows, "Numbers.", formats=[None, ".2e", None, None])

    bundle = shown(capsys, monkeypatch, call)
    assert "<p>Numbers.</p>" in bundle["text/html"] and ">a|b" in bundle["text/html"]
    record = bundle[display.TABLE_TYPE]
    assert record["rows"] == [["a|b", "−1.23\u00a0×\u00a010⁻⁹", "3", "–"], ["c", "5.00\u00a0×\u00a010⁻¹", "yes", "x"]]
    book.finish()
    assert "-1.23456789e-09" in (toy / "out" / "tables" / "t.csv").read_text()


@pytest.mark.parametrize(
    "value, text",
    [(5.26357e-7, "5.264\u00a0×\u00a010⁻⁷"), (0.0123456, "0.01235"), (-2.5, "−2.500"), (220076.057, "220076"),
     (1.5e9, "1.500\u00a0×\u00a010⁹"), (0, "0"),
     (9.99996, "10.00"), (7, "7"), (-np.inf, "−∞"), (np.nan, "not a number")],
)  # fmt: skip
def test_numbers_for_readers(value, text):
    assert display.number(value) == text


def test_a_damaged_memo_is_noted_beside_the_notebook_not_in_it(book, toy, capsys):
    from execbook import atomic

    kept = book.memo(atomic.sweep)
    kept(toy / "nothing")
    [entry] = (toy / ".cache" / "memo").glob("*.pickle")
    entry.write_bytes(b"x")
    kept(toy / "nothing")
    book.finish()
    told = json.loads((toy / "out" / "provenance.json").read_text())
    assert told["notes"] == ["A kept result was damaged (its checksum does not hold); it is computed again."]
    assert capsys.readouterr().err == ""


def test_verdicts_only_at_the_papers_scale(book, toy, capsys, monkeypatch):
    book.record("line.mean", 49.01, "m")
    record = shown(capsys, monkeypatch, book.verdicts)[display.TABLE_TYPE]
    assert record["name"] == "verdicts-01-line"
    assert record["rows"] == [["Table 1: the mean of the line", "49\u00a0m", "49.01\u00a0m", "yes", "accepted ±0.1 %"]]
    other = Notebook("toy/01-line", DEFAULTS | {"slope": 3.0})
    other.record("line.mean", 73.5, "m")
    record = shown(capsys, monkeypatch, other.verdicts)[display.TABLE_TYPE]
    assert "Holds here" not in record["header"] and "nothing is judged" in record["caption"]


READINGS = """
- id: slope
  asks: how steep is the line?
  passage: section 2, not given
  default: 2.0
  range: [1.5, 2.5]
- id: sign
  asks: which way does it go?
  passage: section 2, not given
  default: up
  options:
  - {id: up, says: upwards}
  - {id: down, says: downwards}
"""


def line_of(world):
    return {"toy/01-line:line.mean": 24.5 * world["slope"] * (1 if world["sign"] == "up" else -1)}


def test_claims_are_judged_in_worlds_of_the_readings(toy, book, capsys, monkeypatch):
    (toy / "book" / "toy" / "readings.yml").write_text(READINGS)
    ledger = toy / "book" / "toy" / "claims.yml"
    ledger.write_text(ledger.read_text().replace("rel: 1e-3", "rel: 0.1"))
    monkeypatch.setattr(book, "memo", lambda function: function)
    bundles = []
    monkeypatch.setattr(display, "show", bundles.append)
    book.multiverse((line_of, 200), seed=1)
    numbers = {key: entry["value"] for key, entry in book._metrics.items()}
    assert numbers["worlds"] == numbers["count.mean"] == 200 and "share.steeper" not in numbers  # of another page too
    assert numbers["part.sign.down.mean"] == 0.0
    assert numbers["share.mean"] == pytest.approx(0.2, abs=3 * 0.028)  # half the signs, four tenths of the slopes
    choices, shares = (b[display.TABLE_TYPE] for b in bundles[:2])
    assert choices["name"] == "choices-toy" and choices["rows"][0][2] == "1.500 to 2.500, here 2.000"
    assert choices["rows"][1][2] == "up (here): upwards; down: downwards"
    assert shares["rows"][0][:1] + shares["rows"][0][2:4] == ["mean", "200", "sign"]
    assert bundles[2][display.FIGURE_TYPE]["name"] == "shares-figure-toy"
    with pytest.raises(Fault, match="recorded once"):
        book.multiverse((line_of, 4), seed=1)


def test_what_repeats_is_told(monkeypatch, book):
    monkeypatch.setattr(book, "params", {"slope": 2.0, "steps": [1.0, 2.0, 1.0000001], "words": ["a", "b"]})
    book.record("a", 1.0)
    with pytest.raises(Fault, match=r"recorded once. steps = \[1.0, 2.0, 1.0000001\] has a value twice.$"):
        book.record("a", 1.0)


@pytest.mark.parametrize(
    "unit, text", [("m/s^2", "m/s²"), ("us", "µs"), ("rad/s", "rad/s"), ("urad", "µrad"), ("s^-2", "s⁻²"), ("", "")]
)
def test_units_for_readers(unit, text):
    assert display.unit_text(unit) == text
