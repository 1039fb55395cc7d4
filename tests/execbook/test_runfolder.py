"""What a run or a comparison must not remove or be led to, and what it reads of a stranger's run."""

from __future__ import annotations

import io
import json
import os
import pickle
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from execbook import compare, execute, graph, runfolder
from execbook.errors import Misuse
from execbook.record import Notebook

NAME = "toy/01-line"


@pytest.fixture
def run(built, tmp_path) -> Path:
    """A copy of a finished run of the toy clone."""
    return shutil.copytree(graph.run_folder(built, NAME), tmp_path / "run")


def test_what_a_run_and_its_comparison_wrote_may_go(built, run):
    runfolder.refuse_foreign(run)
    page = compare.write_page(compare.compare(built, run, graph.run_folder(built, NAME)), run)
    assert page == run / "compare.html" and page.is_file()
    (run / ".DS_Store").touch()
    (run / "tables" / ".ipynb_checkpoints").mkdir()
    (run / "tables" / ".ipynb_checkpoints" / "x.csv").touch()
    runfolder.refuse_foreign(run)


@pytest.mark.parametrize(
    "name", ["notes.txt", "figures/line.svg", "figures/other.csv", "mine/deep/x", "compare/notes.txt", "link", "loop"]
)
def test_a_file_of_the_users_is_not_removed(built, run, geokalman, name):
    own = run / name
    own.parent.mkdir(parents=True, exist_ok=True)
    if name in ("link", "loop"):
        own.symlink_to("loop" if name == "loop" else built / "book")  # to a folder, and to nothing
    else:
        own.write_text("mine")
    done = geokalman(built, "run", NAME, "--quick", "--out", str(run))
    assert done.returncode == 2 and done.stderr == (
        f"geokalman: {run} holds {name}, which a new run would remove; move that elsewhere, or name another folder.\n"
    )
    assert os.path.lexists(own)


def test_a_run_is_replaced_but_not_one_that_got_a_file_meanwhile(toy):
    """The folder is looked at again when its turn has come, since another run into it may have ended before."""
    out = execute.run(toy, "toy/02-constant", out=toy / "out", page=False)
    execute.run(toy, "toy/02-constant", {"value": 6.0}, out=out, page=False)
    assert json.loads((out / "metrics.json").read_text())["quotient"]["value"] == 6.0
    (out / "notes.txt").touch()
    with pytest.raises(Misuse, match="out holds notes.txt"):
        execute.run(toy, "toy/02-constant", out=out, page=False)


def test_only_three_of_many_are_named(run):
    for k in range(5):
        (run / f"own{k}").touch()
    with pytest.raises(Misuse, match=r"run holds own0, own1, own2 and more, which a new run would remove"):
        runfolder.refuse_foreign(run)


@pytest.mark.parametrize("text", ["", "{", "[]", "[" * 100000, '{"figures": 3}', '{"tables": null}', "\udcff"])
def test_a_folder_whose_provenance_cannot_be_read_stays(run, text):
    (run / "provenance.json").write_bytes(os.fsencode(text))
    with pytest.raises(Misuse, match=r"run/provenance.json cannot be read, so what in that folder is of a run cannot"):
        runfolder.refuse_foreign(run)


def test_an_interactive_record_does_not_remove_files_either(toy):
    def finish() -> Path:
        namespace = {"value": 3.0, "divisor": 1}
        notebook = Notebook("toy/02-constant", namespace)
        notebook.record("quotient", 3.0)
        notebook.finish()
        return notebook.out

    out = finish()
    finish()
    (out / "notes.txt").touch()
    with pytest.raises(Misuse, match="interactive holds notes.txt"):
        finish()
    assert (out / "notes.txt").exists()


def test_the_books_own_folders_are_replaced_whatever_stands_there(built, tmp_path, geokalman):
    root = shutil.copytree(built, tmp_path / "clone")
    folder = graph.run_folder(root, NAME)
    (folder / "provenance.json").unlink()
    done = geokalman(root, "build", "--no-html")
    assert done.returncode == 0 and "1 executed, 1 up to date" in done.stderr, done.stderr
    assert (folder / "provenance.json").is_file()


@pytest.fixture(scope="module")
def linked(built, tmp_path_factory) -> Path:
    """A built clone with a link into its book and one to itself."""
    root = shutil.copytree(built, tmp_path_factory.mktemp("linked") / "clone")
    for name, target in (("link", "book"), ("loop", "loop")):
        (root / name).symlink_to(target)
    return root


@pytest.mark.parametrize(
    "out, sentence",
    [
        ("book/toy/run", "is inside {root}/book, which is the project's own"),
        ("book/_build/runs/toy/01-line", "is inside {root}/book, which"),
        ("src", "is inside {root}/src, which"),
        ("data/x", "is inside {root}/data, which"),
        (".cache/x", "is inside {root}/.cache, which"),
        ("link/x", "is inside {root}/book, which"),
        ("loop/x", "loop/x cannot be reached ("),
        (".", "is where you stand and would be replaced"),
        ("..", "is where you stand and would be replaced"),
        ("/", "is where you stand and would be replaced"),
        ("a\nb", "has a control character"),
        ("a\x1b[31mb", "has a control character"),
        (os.fsdecode(b"a\xffb"), "has a control character or bytes that are no UTF-8"),
        ("README.md", "README.md is a file"),
        ("x" * 600, "... cannot be reached (File name too long)"),
    ],
)
@pytest.mark.parametrize("words", [["run", NAME, "--quick"], ["compare", NAME]], ids=["run", "compare"])
def test_a_folder_that_must_not_be_replaced(linked, geokalman, words, out, sentence):
    done = geokalman(linked, *words, "--out", out)
    assert done.returncode in (1, 2) and "Traceback" not in done.stderr
    last = done.stderr.splitlines()[-1]
    assert last.startswith("geokalman: ") and sentence.format(root=linked) in last
    assert (linked / "README.md").is_file() and not list(linked.glob(".*.old-*"))


def test_a_folder_of_others_is_not_replaced(linked, geokalman):
    done = geokalman(linked, "run", NAME, "--quick", "--out", "/usr")
    assert done.returncode == 2 and "/usr holds " in done.stderr and "which a new run would remove" in done.stderr


def test_a_link_to_an_empty_folder_stays_a_link(toy, geokalman):
    (toy / "real").mkdir()
    (toy / "link").symlink_to("real")
    done = geokalman(toy, "run", "toy/02-constant", "--out", "link")
    assert done.returncode == 0 and done.stdout.strip() == str(toy / "real")
    assert (toy / "link").is_symlink() and (toy / "link" / "metrics.json").is_file()


def test_a_comparison_does_not_remove_files(built, run):
    thesis = run.parent / "thesis"
    thesis.mkdir()
    (thesis / "thesis.tex").touch()
    compare.write_page(compare.compare(built, run, graph.run_folder(built, NAME)), thesis)
    assert sorted(os.listdir(thesis)) == ["compare.html", "thesis.tex"]


def edit(name: str, change: Callable[[dict], None]) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        content = json.loads((folder / name).read_text())
        change(content)
        (folder / name).write_text(json.dumps(content))

    return damage


def put(name: str, content: bytes) -> Callable[[Path], None]:
    return lambda folder: (folder / name).write_bytes(content)


def arrays(**found: object) -> Callable[[Path], None]:
    return lambda folder: np.savez(folder / "arrays.npz", **found)


def claim_a_shape(folder: Path) -> None:
    """An archive whose array says that it has 10^15 values and carries none."""
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (10**15,)})
    with zipfile.ZipFile(folder / "arrays.npz", "w") as archive:
        archive.writestr("line.y.npy", head.getvalue())


class Evil:
    """Leaves a file where it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self):
        return (Path.touch, (self.path,))


def pickled(folder: Path) -> None:
    np.savez(folder / "arrays.npz", **{"line.y": np.array([Evil(folder / "executed")], dtype=object)})


def truncated(folder: Path) -> None:
    content = (folder / "arrays.npz").read_bytes()
    (folder / "arrays.npz").write_bytes(content[: len(content) // 2])


def flipped(folder: Path) -> None:
    content = bytearray((folder / "arrays.npz").read_bytes())
    content[len(content) // 3] ^= 0xFF
    (folder / "arrays.npz").write_bytes(content)


def metric(value: object) -> Callable[[Path], None]:
    return put("metrics.json", json.dumps({"line.mean": value}).encode())


DAMAGES = {
    "provenance empty": (put("provenance.json", b""), "provenance.json is damaged (no whole JSON)"),
    "provenance list": (put("provenance.json", b"[]"), "provenance.json is damaged (Input should be"),
    "provenance deep": (put("provenance.json", b"[" * 100000), "provenance.json is damaged (no whole JSON)"),
    "provenance binary": (put("provenance.json", b"\xff\xfe\x00"), "provenance.json is damaged (no whole JSON)"),
    "no notebook": (edit("provenance.json", lambda told: told.pop("notebook")), "(notebook: Field required)"),
    "no mode": (edit("provenance.json", lambda told: told.update(mode="x")), "(mode: Input should be 'paper'"),
    "elsewhere": (edit("provenance.json", lambda told: told.update(notebook="../../x")), "'../../x' is no notebook"),
    "parameters": (edit("provenance.json", lambda told: told.update(parameters=[1])), "(parameters: Input should be"),
    "escape": (edit("provenance.json", lambda told: told["parameters"].update({"\x1b]0;x": 1})), r"\x1b]0;x"),
    "arrays": (edit("provenance.json", lambda told: told.update(arrays=None)), "(arrays: Input should be"),
    "shape": (edit("provenance.json", lambda told: told["arrays"]["line.y"].update(shape=[7])), "its arrays are not"),
    "unit": (edit("provenance.json", lambda told: told["arrays"]["line.y"].update(unit=3)), "unit: Input should be"),
    "metrics cut": (put("metrics.json", b'{"line.mean": {"val'), "metrics.json is damaged (no whole JSON)"),
    "metrics list": (put("metrics.json", b"[]"), "metrics.json is damaged (Input should be"),
    "number alone": (metric(3), "(line.mean: Input should be"),
    "text": (metric({"value": "3", "unit": ""}), "(line.mean.value: Input should be a valid number)"),
    "NaN": (put("metrics.json", b'{"a": {"value": NaN, "unit": ""}}'), "(a.value: Input should be a finite number)"),
    "huge": (put("metrics.json", b'{"a": {"value": 1' + b"0" * 400 + b', "unit": ""}}'), "metrics.json is damaged"),
    "longer": (put("metrics.json", b'{"a": {"value": 1' + b"0" * 9000 + b', "unit": ""}}'), "metrics.json is damaged"),
    "no unit": (metric({"value": 3}), "(line.mean.unit: Field required)"),
    "unit escape": (metric({"value": 3, "unit": "\x1b[31m"}), "(line.mean.unit: String should match"),
    "npz empty": (put("arrays.npz", b""), "arrays.npz is damaged (no whole archive)"),
    "npz cut": (truncated, "arrays.npz is damaged (no whole archive)"),
    "npz flipped": (flipped, "arrays.npz is damaged"),
    "npz text": (put("arrays.npz", b"PK\x03\x04 not really"), "arrays.npz is damaged (no whole archive)"),
    "npz pickle": (pickled, "arrays.npz is damaged (pickled objects in it, which may run code, are not read)"),
    "npz pickle bare": (put("arrays.npz", pickle.dumps({})), "arrays.npz is damaged (pickled objects in it"),
    "npz words": (
        arrays(**{"line.y": np.array(["a"] * 50)}),
        "its arrays are not those that provenance.json describes",
    ),
    "npz other": (arrays(other=np.zeros(50)), "its arrays are not those"),
    "npz claims": (claim_a_shape, "arrays.npz is damaged (no whole archive)"),
    "no metrics": (lambda folder: (folder / "metrics.json").unlink(), "is no folder of a run"),
    "no arrays": (lambda folder: (folder / "arrays.npz").unlink(), "is no folder of a run"),
}


@pytest.mark.parametrize("damage, sentence", DAMAGES.values(), ids=DAMAGES)
def test_a_malformed_record_is_one_sentence(built, run, damage, sentence):
    damage(run)
    with pytest.raises(Misuse) as caught:
        compare.compare(built, compare.resolve(built, str(run), run), None)
    text = str(caught.value)
    assert sentence in text and text.isprintable() and len(text) < 500
    with pytest.raises(Misuse):
        compare.compare(built, graph.run_folder(built, NAME), run)
    assert not (run / "executed").exists()


def test_a_malformed_record_on_the_command_line(built, run, geokalman):
    pickled(run)
    done = geokalman(built, "compare", str(run))
    assert (
        done.returncode == 2
        and done.stdout == ""
        and done.stderr
        == (
            f"geokalman: {run / 'arrays.npz'} is damaged (pickled objects in it, which may run code, are not read); "
            "run the notebook again.\n"
        )
    )


@pytest.mark.parametrize(
    "content, why",
    [
        (b"", "is damaged: it is no table of columns of one length"),
        (b"t_s,y_m\n1\n2,3\n", "is damaged: it is no table"),
        (b"t_s,y_m\n1,2,3\n", "is damaged: it is no table"),
        (b"\xff\xfe\x00", "is damaged: it is no table"),
        (b't_s,y_m\n"' + b"x" * 200000 + b'",1\n', "is damaged: it is no table"),
        (b"t_s,y_m\nx,y\n", "fewer than two columns"),
        (b"t_s,y_m\n", "fewer than two columns"),
    ],
)
def test_a_malformed_figure_is_named_on_the_page(built, run, content, why):
    (run / "figures" / "line.csv").write_bytes(content)
    page = compare.write_page(compare.compare(built, run, graph.run_folder(built, NAME)), run)
    assert "<p>Not drawn: " in page.read_text() and why in page.read_text()


def test_names_of_figures_are_no_markup(built, run):
    other = shutil.copytree(run, run.parent / "other")
    for folder in (run, other):
        shutil.copy(folder / "figures" / "line.csv", folder / "figures" / '"><script>x<.csv')
    page = compare.write_page(compare.compare(built, run, other), run).read_text()
    assert "<script" not in page and "&lt;script&gt;x" in page


def test_arrays_of_flags_counts_and_nothing_are_compared(built, run):
    """Differences of flags and of unsigned counts are those of numbers."""
    other = shutil.copytree(run, run.parent / "other")
    for folder, step in ((run, 0), (other, 1)):
        found = {
            "flags": np.array([False, step == 1]), "counts": np.array([3, 5 + step], dtype=np.uint8),
            "nothing": np.full(2, np.nan), "empty": np.zeros(0), "turns": np.array([1j, step]),
        }  # fmt: skip
        np.savez(folder / "arrays.npz", **found)
        described = {key: {"shape": list(a.shape), "unit": ""} for key, a in found.items()}
        edit("provenance.json", lambda told, described=described: told.update(arrays=described))(folder)
    rows = {row.key.partition(" ")[0]: row for row in compare.compare(built, run, other).rows}
    assert (rows["flags"].difference, rows["counts"].difference, rows["turns"].difference) == (1.0, 1.0, 1.0)
    assert np.isnan(rows["nothing"].left) and "empty" not in rows
