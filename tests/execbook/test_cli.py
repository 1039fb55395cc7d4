"""The command line: what it prints, one sentence per mistake, and what it loads."""

import json
import shutil
import subprocess
import sys

import pytest


def test_list(built, geokalman):
    done = geokalman(built, "list")
    assert done.stdout.splitlines() == ["toy/01-line      A straight line", "toy/02-constant  A constant"]


def test_listing_loads_no_heavy_library(built):
    """What makes the command answer within a second, told without a clock."""
    heavy = {"numpy", "matplotlib", "papermill", "numba", "jupytext"}
    code = (
        "import sys; from geokalman import cli\nsys.argv = ['geokalman', 'list']\n"
        f"try: cli.main()\nexcept SystemExit: pass\nprint(*{heavy} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=built, capture_output=True, text=True)
    assert done.stdout.splitlines()[1:] == ["toy/02-constant  A constant", ""], done.stderr


def test_params(built, geokalman):
    done = geokalman(built, "params", "toy/01-line")
    assert [line.split() for line in done.stdout.splitlines()[:4] if "---" not in line] == [
        ["name", "type", "default", "quick", "range", "unit", "help"],
        ["slope", "float", "2.0", "(0,", "10]", "m/s", "slope", "of", "the", "line"],
        ["n", "int", "50", "5", "[2,", "1000]", "number", "of", "points"],
    ]
    told = json.loads(geokalman(built, "params", "toy/01-line", "--json").stdout)
    assert told["quick"] == {"n": 5} and told["parameters"]["slope"]["unit"] == "m/s"


def test_claims(built, geokalman):
    done = geokalman(built, "claims", COLUMNS="40")
    assert done.stdout.splitlines() == [
        "The toy paper", "",
        "mean: reproduced", "    Table 1: the mean of the line", "    printed 49\u00a0m; ours 49.00\u00a0m",
        "    0.1 % from its threshold", "    accepted ±0.1 %",
        "steeper: reproduced", "    text: the line ends above the", "    constant", "    ours 49.00 m (line mean) > 10 ×", "    3.000 m (quotient)",
    ]  # fmt: skip
    told = json.loads(geokalman(built, "claims", "toy", "--json").stdout)
    assert [(c["id"], c["verdict"], c["expected"]) for c in told] == [
        ("mean", "reproduced", "reproduced"),
        ("steeper", "reproduced", "reproduced"),
    ]


@pytest.mark.parametrize("words", [["claims"], ["claims", "--near"], ["claims", "toy"]])
def test_claims_before_a_build_say_that_nothing_is_computed(toy, geokalman, words):
    done = geokalman(toy, *words)
    assert done.returncode == 0
    assert done.stderr == "Nothing has been computed yet; make book computes what is missing.\n"


def test_claims_after_half_a_build_say_how_many_are_missing(built, tmp_path, geokalman):
    root = shutil.copytree(built, tmp_path / "clone")
    (root / "book/_build/metrics/toy/02-constant.json").unlink()
    assert (
        geokalman(root, "claims").stderr == "1 of 2 claims are not computed yet; make book computes what is missing.\n"
    )
    assert geokalman(built, "claims").stderr == ""


@pytest.mark.parametrize("base, word", [(".", "book/toy/01-line.md"), ("book/toy", "01-line.md"), ("book", "toy/01-line.md"),
                                        ("book/toy", "book/toy/01-line.md")])  # fmt: skip
def test_a_path_of_a_notebook_is_as_good_as_its_name(built, geokalman, base, word):
    assert geokalman(built / base, "params", word).stdout == geokalman(built, "params", "toy/01-line").stdout
    for command in (["params", word], ["run", word, "slop=3"]):
        assert "is no notebook" not in (done := geokalman(built / base, *command)).stderr
    assert done.stderr.startswith("geokalman: slop is no parameter of toy/01-line ")


@pytest.mark.parametrize(
    "words, sentence",
    [
        (["run", "toy/01-lime"], "geokalman: 'toy/01-lime' is no notebook of the book in "),
        (
            ["run", "toy/01-line", "slop=3"],
            "geokalman: slop is no parameter of toy/01-line (did you mean slope?); the valid ones are slope, n, table.",
        ),
        (["run", "toy/01-line", "slope=3", "slope=4"], "geokalman: slope is given twice"),
        (["run", "toy/01-line", "slope"], "geokalman: 'slope' is no assignment; write name=value, as in days=5."),
        (["run", "toy/01-line", "--out", "README.md"], "README.md is a file; name a folder"),
        (["run"], "geokalman: Missing argument"),
        (["dance"], "geokalman: No such command 'dance'."),
        (["run", "toy/01-line", "--fast"], "geokalman: No such option: --fast"),
        (["claims", "boy"], "geokalman: 'boy' has no ledger"),
        (["compare", "nowhere"], "geokalman: nowhere is no folder of a run and no notebook"),
        (["params", "../toy/01-line"], "geokalman: '../toy/01-line' is no notebook"),
        (["run", "toy/../toy/01-line"], "geokalman: 'toy/../toy/01-line' is no notebook"),
        (["run", "../README"], "geokalman: '../README' is no notebook"),
        (["run", "toy/index"], "geokalman: 'toy/index' is no notebook"),
        (["run", "_build/01-line"], "geokalman: '_build/01-line' is no notebook"),
        (["run", "01-line"], "geokalman: '01-line' is no notebook"),
        (["run", "x" * 9000], "... is no notebook"),
        (["run", "a\nb"], r"geokalman: 'a\nb' is no notebook"),
        (["reference", "../README", "--reason", "x"], "geokalman: '../README' is no notebook"),
        (["compare", "../README"], "geokalman: ../README is no folder of a run and no notebook"),
        (["compare", "x" * 9000], "is no folder of a run and no notebook"),
        (["claims", "../book/toy"], "geokalman: '../book/toy' has no ledger"),
    ],
)
def test_wrong_use_is_one_sentence_and_code_two(built, geokalman, words, sentence):
    done = geokalman(built, *words)
    assert done.returncode == 2 and sentence in done.stderr and "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1 and done.stdout == ""


def test_outside_a_clone(tmp_path, geokalman):
    done = geokalman(tmp_path, "--root", str(tmp_path), "list")
    assert done.returncode == 1 and "is no clone of the project: it lacks book/execbook.toml" in done.stderr


def test_root(built, tmp_path, geokalman):
    assert geokalman(tmp_path, "--root", str(built), "list").stdout.startswith("toy/01-line")


def test_help(built, geokalman):
    done = geokalman(built)
    assert "Usage: geokalman" in done.stderr + done.stdout and "run" in done.stderr + done.stdout
    assert geokalman(built, "run", "--help").returncode == 0


def test_twins(toy, geokalman):
    done = geokalman(toy, "notebooks")
    assert done.stdout.splitlines() == [str(toy / "book" / "toy" / f"{n}.ipynb") for n in ("01-line", "02-constant")]
    twin = toy / "book" / "toy" / "01-line.ipynb"
    notebook = json.loads(twin.read_text())
    assert [c["id"] for c in notebook["cells"]][:2] == ["toy-01-line-00", "toy-01-line-01"]
    assert geokalman(toy, "notebooks").returncode == 0  # an unchanged twin is simply made again
    notebook["cells"][0]["source"] = ["mine"]
    twin.write_text(json.dumps(notebook))
    done = geokalman(toy, "notebooks")
    assert (
        done.returncode == 2
        and "book/toy/01-line.ipynb was edited; move it away, or overwrite it with --force." in done.stderr
    )
    assert "mine" in twin.read_text()
    assert geokalman(toy, "notebooks", "--force").returncode == 0 and '"mine"' not in twin.read_text()
