"""The build: only what changed, failures apart, two at once, killed and resumed, and the same twice."""

import hashlib
import json
import os
import random
import shutil
import signal
import time
from pathlib import Path

import pytest

from execbook import graph, sources
from execbook.errors import Fault


def contents(root: Path) -> dict[str, bytes]:
    """All results of a build but the one file that holds times."""
    made = root / "book" / "_build"
    return {
        p.relative_to(made).as_posix(): p.read_bytes()
        for p in sorted(made.rglob("*"))
        if p.is_file() and p.name != "provenance.json"
    }


@pytest.fixture
def copy(built, tmp_path):
    """A copy of the built clone, to be changed."""
    return shutil.copytree(built, tmp_path / "copy")


def test_build_leaves_metrics_where_scripts_look(built):
    found = json.loads((built / "book" / "_build" / "metrics" / "toy" / "01-line.json").read_text())
    assert found == {"line.mean": {"value": 49.0, "unit": "m"}}
    assert sorted(os.listdir(built / "book" / "_build" / "runs" / "toy")) == ["01-line", "02-constant"]


def test_nothing_changed_nothing_done(copy, geokalman):
    before = {p: p.stat().st_mtime_ns for p in (copy / "book" / "_build").rglob("*") if p.is_file()}
    done = geokalman(copy, "build", "--no-html")
    assert done.returncode == 0 and "0 executed, 2 up to date, 0 failed" in done.stderr
    assert {p: p.stat().st_mtime_ns for p in (copy / "book" / "_build").rglob("*") if p.is_file()} == before


HEAVY = """half = 0.5
from geokalman.leastsquares import NormalEquations
import numpy as np
rows = np.sin(np.arange(1200 * 400.0) ** 1.5).reshape(1200, 400)
normals = NormalEquations(400)
normals.add(rows, rows.sum(axis=1) + np.cos(np.arange(1200.0)))
for k, number in enumerate(nb.memo(NormalEquations.factor)(normals).estimate[:50, 0]):
    nb.record(f"estimate.{k}", number)"""


def test_numbers_of_a_build_do_not_depend_on_earlier_runs(toy, tmp_path_factory, geokalman):
    """A run with two threads keeps results that a build must not take: it equals a build alone, byte for byte."""
    path = toy / "book" / "toy" / "02-constant.md"
    path.write_text(path.read_text().replace("half = 0.5", HEAVY))
    (toy / "book" / "toy" / "01-line.md").unlink()
    declared = toy / "book" / "execbook.toml"
    declared.write_text(declared.read_text().replace('"execbook"', '"geokalman"'))
    alone = shutil.copytree(toy, tmp_path_factory.mktemp("alone") / "clone")
    assert geokalman(toy, "run", "toy/02-constant", "--threads", "2").returncode == 0
    for root in (toy, alone):
        done = geokalman(root, "build", "--no-html")
        assert done.returncode == 0, done.stderr
    assert contents(toy) == contents(alone)


def test_two_builds_differ_in_times_only(built, copy, geokalman):
    """What may differ is listed here: moments and durations in provenance.json."""
    shutil.rmtree(copy / "book" / "_build")
    shutil.rmtree(copy / ".cache")
    assert geokalman(copy, "build", "--no-html").returncode == 0
    assert contents(copy) == contents(built)
    for name in ("01-line", "02-constant"):
        one, two = (
            json.loads((r / "book/_build/runs/toy" / name / "provenance.json").read_text()) for r in (built, copy)
        )
        assert {k for k in one | two if one.get(k) != two.get(k)} <= {"finished", "seconds"}


KEYED = [
    ("book/toy/01-line.md", lambda t: t.replace("A straight line", "A line"), []),
    ("book/toy/01-line.md", lambda t: t.replace("slope = 2.0", "slope = 4.0"), ["toy/01-line"]),
    ("book/toy/claims.yml", lambda t: t.replace("1e-3", "1e-2"), ["toy/01-line"]),
    ("environment.txt", lambda t: "numpy==9", ["toy/01-line", "toy/02-constant"]),
    ("book/toy/index.md", lambda t: t + "more", []),
]


@pytest.mark.parametrize("path, edit, stale", KEYED, ids=["prose", "default", "claim", "lock", "page"])
def test_what_a_run_depends_on(copy, path, edit, stale):
    (copy / path).write_text(edit((copy / path).read_text() if (copy / path).exists() else ""))
    names = ["toy/01-line", "toy/02-constant"]
    assert [n for n in names if not graph.is_fresh(graph.run_folder(copy, n), graph.key(copy, n))] == stale


def test_an_edited_module_makes_stale_what_imports_it(copy, tmp_path, monkeypatch):
    """Of the two notebooks one imports a module of the package; the module's own import is edited."""
    package = tmp_path / "made"
    (package / "toys").mkdir(parents=True)
    monkeypatch.syspath_prepend(package)
    declared, line = copy / "book" / "execbook.toml", copy / "book" / "toy" / "01-line.md"
    declared.write_text(declared.read_text().replace('"execbook"', '"toys"'))
    line.write_text(line.read_text().replace("import numpy as np", "import numpy as np\nfrom toys import user"))
    (package / "toys" / "__init__.py").touch()
    (package / "toys" / "user.py").write_text("from toys import used\n")

    def keys(value: int) -> list[str]:
        (package / "toys" / "used.py").write_text(f"x = {value}\n")
        for kept in (sources._read, sources._direct, sources._folders):  # as a new process has them
            kept.cache_clear()
        return [graph.key(copy, name) for name in ("toy/01-line", "toy/02-constant")]

    before, after = keys(1), keys(2)
    assert before[0] != after[0] and before[1] == after[1]


@pytest.fixture
def vendored(toy):
    """A toy clone with one vendored file."""
    (toy / "data" / "table.txt").write_text("1 2 3\n")
    digest = hashlib.sha256(b"1 2 3\n").hexdigest()
    (toy / "data" / "registry.json").write_text(json.dumps({"table.txt": {"sha256": digest, "script": "make.py"}}))
    return toy


@pytest.mark.parametrize(
    "damage, sentence",
    [
        (lambda d: (d / "table.txt").write_text("1 2 4\n"), "table.txt has SHA-256 .*; restore it with: git checkout -- data/table.txt"),
        (lambda d: (d / "table.txt").write_text(""), "table.txt has SHA-256 .*; restore it with: git checkout"),
        (lambda d: (d / "table.txt").unlink(), "table.txt is missing; restore it with: git checkout -- data/table.txt"),
        (lambda d: (d / "registry.json").write_text("{"), "registry.json is damaged: .*restore it with: git checkout"),
        (lambda d: (d / "registry.json").write_text('{"table.txt": {}}'), "registry.json is damaged"),
        (lambda d: (d / "registry.json").write_text('["table.txt"]'), "registry.json is damaged"),
    ],
)  # fmt: skip
def test_damaged_data_stop_a_build_once_before_any_notebook(vendored, damage, sentence, capsys):
    damage(vendored / "data")
    with pytest.raises(Fault, match=f"^{vendored}/data/{sentence}"):
        graph.build(vendored)
    assert capsys.readouterr().err == "" and not (vendored / "book" / "_build").exists()


def test_sound_data_let_it_begin(vendored):
    assert len(graph.shared_inputs(vendored)) == 64


def test_a_build_clears_what_killed_runs_left(copy, geokalman):
    left = copy / "runs" / "toy" / "01-line" / ".paper.partial-abcd1234"
    left.mkdir(parents=True)
    assert geokalman(copy, "build", "--no-html").returncode == 0 and not left.exists()


def test_the_vendored_data_count(vendored):
    before = graph.shared_inputs(vendored)
    table, registry = vendored / "data" / "table.txt", vendored / "data" / "registry.json"
    table.write_text("1 2 4\n")
    registry.write_text(json.dumps({"table.txt": {"sha256": hashlib.sha256(b"1 2 4\n").hexdigest()}}))
    assert graph.shared_inputs(vendored) != before


@pytest.mark.parametrize("damage", ["metrics.json", "figures/line.csv", "provenance.json", "notebook.ipynb"])
def test_a_damaged_result_is_not_fresh(copy, damage):
    folder = graph.run_folder(copy, "toy/01-line")
    assert graph.is_fresh(folder, graph.key(copy, "toy/01-line"))
    content = (folder / damage).read_bytes()
    (folder / damage).write_bytes(content[: len(content) // 2])
    assert not graph.is_fresh(folder, graph.key(copy, "toy/01-line"))


def test_a_failing_notebook_leaves_the_others_and_its_last_good_run(copy, geokalman, break_constant):
    break_constant(copy)
    line = copy / "book" / "toy" / "01-line.md"
    line.write_text(line.read_text().replace("slope = 2.0", "slope = 4.0"))
    good = (copy / "book/_build/runs/toy/02-constant/metrics.json").read_bytes()
    (copy / "book" / "_build" / "html").mkdir()
    (copy / "book" / "_build" / "html" / "index.html").write_text("the last good book")
    done = geokalman(copy, "build")
    assert done.returncode == 1
    told = done.stderr.splitlines()
    assert "1 executed, 0 up to date, 1 failed" in done.stderr
    assert told[-3] == "FAILED toy/02-constant: cell [3]: ZeroDivisionError: float division by zero"
    assert told[-2] == "  line 2: quotient = value / divisor"
    assert told[-1].endswith("book/_build/runs/toy/02-constant.failed.ipynb")
    assert json.loads((copy / "book/_build/metrics/toy/01-line.json").read_text())["line.mean"]["value"] == 98.0
    assert (copy / "book/_build/runs/toy/02-constant/metrics.json").read_bytes() == good
    assert (copy / "book" / "_build" / "html" / "index.html").read_text() == "the last good book"


def test_outputs_of_a_deleted_notebook_go(copy, geokalman):
    (copy / "book" / "toy" / "02-constant.md").unlink()
    assert "0 executed, 1 up to date" in geokalman(copy, "build", "--no-html").stderr
    made = copy / "book" / "_build"
    assert os.listdir(made / "runs" / "toy") == ["01-line"] and os.listdir(made / "metrics" / "toy") == ["01-line.json"]


def test_two_builds_at_once_execute_each_notebook_once(toy, geokalman, built):
    processes = [geokalman(toy, "build", "--no-html", wait=False) for _ in range(2)]
    told = [p.communicate()[1] for p in processes]
    assert [p.returncode for p in processes] == [0, 0], told
    assert sorted("2 executed, 0 up to date" in t for t in told) == [False, True]
    assert sorted("0 executed, 2 up to date" in t for t in told) == [False, True]
    assert any("Another build runs in this clone; waiting for it." in t for t in told)
    assert contents(toy) == contents(built)


@pytest.mark.parametrize("moment", [pytest.param(k, marks=pytest.mark.slow if k > 1 else ()) for k in range(2)])
def test_killed_at_any_moment_and_resumed(toy, geokalman, built, moment):
    """kill -9, then a build that completes and equals the undisturbed one."""
    process = geokalman(toy, "build", "--no-html", wait=False)
    time.sleep(random.Random(moment).uniform(0.3, 5.0))
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    done = geokalman(toy, "build", "--no-html")
    assert done.returncode == 0, done.stderr
    assert contents(toy) == contents(built)
    assert not [p for p in (toy / "book").rglob(".*") if p.name != ".gitkeep"]


def test_interrupted_build_is_one_sentence(toy, geokalman, wait_for):
    path = toy / "book" / "toy" / "02-constant.md"
    path.write_text(
        path.read_text().replace("half = 0.5", "import time; open('../../started', 'w').close(); time.sleep(3600)")
    )
    process = geokalman(toy, "build", "--no-html", wait=False)
    wait_for((toy / "started").exists, process)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate()
    assert process.returncode == 130 and "geokalman: interrupted; what was finished stays." in told.splitlines()
    assert "Traceback" not in told


def test_no_notebooks(toy, geokalman):
    shutil.rmtree(toy / "book" / "toy")
    done = geokalman(toy, "build")
    assert done.returncode == 1 and "has no notebooks; write MyST files book/<paper>/NN-title.md" in done.stderr
