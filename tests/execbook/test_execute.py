"""One notebook: run with other parameters, failing, interrupted; its run folder appears whole or not at all."""

import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nbformat
import numpy as np
import pytest

from execbook import atomic, execute, notebooks, progress
from execbook.errors import Fault, Misuse


def hidden(folder):
    return sorted(p.name for p in folder.iterdir() if p.name.startswith("."))


@pytest.fixture(scope="module")
def ran(tmp_path_factory, geokalman, new_toy):
    """A finished `geokalman run` with a parameter of its own: clone, folder and what was printed."""
    root = new_toy(tmp_path_factory.mktemp("ran"))
    done = geokalman(root, "run", "toy/01-line", "slope=3", "--quick", "--out", "mine")
    assert done.returncode == 0, done.stderr
    return root, root / "mine", done


def test_run_folder(ran):
    root, folder, done = ran
    assert done.stdout.splitlines()[-1] == str(folder)
    inside = sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    assert inside == [
        "arrays.npz", "figures/line.csv", "figures/line.dark.png", "figures/line.light.png",
        "metrics.json", "notebook.ipynb", "page.html",
        "provenance.json", "tables/numbers.csv", "tables/verdicts-01-line.csv",
    ]  # fmt: skip
    assert json.loads((folder / "metrics.json").read_text()) == {"line.mean": {"value": 6.0, "unit": "m"}}
    assert np.load(folder / "arrays.npz")["line.y"].tolist() == [0.0, 3.0, 6.0, 9.0, 12.0]
    told = json.loads((folder / "provenance.json").read_text())
    assert told["parameters"] == {"slope": 3.0, "n": 5, "table": ""} and told["mode"] == "custom"
    assert hidden(root) == [".cache"]


def test_executed_notebook(ran):
    _, folder, _ = ran
    notebook = nbformat.read(folder / "notebook.ipynb", as_version=4)
    nbformat.validate(notebook)
    own = [f"toy-01-line-{k:02d}" for k in range(len(notebook.cells) - 1)]
    assert [c["id"] for c in notebook.cells] == ["changed", *own]  # other parameters: a warning stands above
    text = (folder / "notebook.ipynb").read_text()
    assert (
        str(folder.parent) not in text
        and "papermill" not in notebook.metadata
        and notebook.metadata.kernelspec.name == "python3"
    )
    assert "its mean is 6.00\u00a0m:" in notebook.cells[1].source  # a number of this run stands in its sentence
    assert "its mean is 6.00\u00a0m:" in (folder / "page.html").read_text()
    outputs = [o for c in notebook.cells for o in c.get("outputs", [])]
    assert any("application/vnd.execbook.figure+json" in o.get("data", {}) for o in outputs)
    injected = [c.source for c in notebook.cells if "injected-parameters" in c.metadata.get("tags", [])]
    assert len(injected) == 1 and "slope = 3.0" in injected[0] and "n = 5" in injected[0]


def brought_from_elsewhere(page):
    """What a page loads or links that it does not carry itself, its own scripts' words aside."""
    markup = re.sub(r"<script>.*?</script>", "", page, flags=re.S)
    return re.findall(r"""(?:(?:src|href)=["']|url\(|@import +)(?!data:|#)[^"' )]+""", markup)


def test_what_a_page_does_not_carry_is_seen():
    own = '<img src="data:image/png;base64,AA"><a href="#x">x</a><script>a.src="b.js"</script>'
    assert not brought_from_elsewhere(own)
    for planted in (
        '<img src="a.png">',
        "<a href='https://a.org'>",
        "@import a.css",
        "url(a.woff)",
        '<script src="a">',
    ):
        assert len(brought_from_elsewhere(own + planted)) == 1, planted


def test_page_carries_everything_with_it(ran):
    _, folder, _ = ran
    text = (folder / "page.html").read_text()
    body = text[text.index("<body>") :]
    warning = (
        "This run differs from the paper's set-up: <code>slope=3.0, n=5</code>. "
        "The words around the numbers describe the paper's run."
    )
    assert warning in body and warning in nbformat.read(folder / "notebook.ipynb", 4).cells[0].source
    assert "A straight line" in body and '<img alt="A rising line." src="data:image/png;base64,' in body
    assert (
        "see Figure 1" in re.sub(r"<[^>]+>", "", body).replace("\n", " ")
        and "{numref}" not in body
        and "$$" not in body
    )
    plain = " ".join(re.sub(r"<[^>]+>", "", body).replace("¶", "").split())
    assert '<span class="eqno">(1)' in body and "Figure 1 A line, \\(y = s t\\)." in plain
    assert not brought_from_elsewhere(text)
    assert "<script src" not in text and "cdn.jsdelivr" not in text and "window.MathJax" in text


def test_failure_names_notebook_cell_line_and_error(toy, break_constant):
    out = toy / "good"
    execute.run(toy, "toy/02-constant", out=out, page=False)
    before = {p.name: p.read_bytes() for p in out.iterdir()}
    with pytest.raises(Fault) as caught:
        execute.run(toy, "toy/02-constant", {"divisor": 0}, out=out)
    message = str(caught.value).splitlines()
    assert message[0] == "FAILED toy/02-constant: cell [4]: ZeroDivisionError: float division by zero"
    assert message[1].strip() == "line 2: quotient = value / divisor"
    failed = toy / "good.failed.ipynb"
    assert message[2].strip() == f"traceback: {failed}"
    errors = [o for c in nbformat.read(failed, 4).cells for o in c.get("outputs", []) if o.output_type == "error"]
    assert errors[0].ename == "ZeroDivisionError"
    assert {p.name: p.read_bytes() for p in out.iterdir()} == before and hidden(toy) == [".cache"]
    execute.run(toy, "toy/02-constant", {"divisor": 2}, out=out, page=False)
    assert not failed.exists() and json.loads((out / "metrics.json").read_text())["quotient"]["value"] == 1.5


def test_a_notebook_that_does_not_finish(toy):
    path = toy / "book" / "toy" / "02-constant.md"
    path.write_text(path.read_text().replace("nb.finish()", "pass"))
    with pytest.raises(Fault, match="FAILED toy/02-constant: it ended without nb.finish"):
        execute.run(toy, "toy/02-constant", out=toy / "out")
    assert not (toy / "out").exists()


def test_a_kernel_that_dies(toy):
    path = toy / "book" / "toy" / "02-constant.md"
    path.write_text(path.read_text().replace("half = 0.5", "import os; os._exit(1)"))
    with pytest.raises(Fault, match="FAILED toy/02-constant: the kernel stopped"):
        execute.run(toy, "toy/02-constant", out=toy / "out")
    assert hidden(toy) == [".cache"]


def test_disk_full(toy, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(Fault, match=f"^Cannot write {toy}/out/notebook.ipynb: the disk is full"):
        execute.run(toy, "toy/02-constant", out=toy / "out")
    assert not (toy / "out").exists() and hidden(toy) == [".cache"]


def test_disk_full_in_the_kernel(toy):
    path = toy / "book" / "toy" / "02-constant.md"
    full = "import pathlib\n" + (
        "def full(*_):\n    raise OSError(28, 'No space left on device')\npathlib.Path.write_bytes = full\nnb.finish()"
    )
    path.write_text(path.read_text().replace("nb.finish()", full))
    with pytest.raises(Fault, match=f"Cannot write {toy}/out/arrays.npz: the disk is full") as caught:
        execute.run(toy, "toy/02-constant", out=toy / "out")
    assert "partial" not in str(caught.value)


def test_folders_that_are_not_ours_are_not_replaced(toy):
    (toy / "mine").mkdir()
    (toy / "mine" / "thesis.tex").touch()
    with pytest.raises(Misuse, match=r"mine holds thesis.tex, which a new run would remove; move that elsewhere"):
        execute.run(toy, "toy/02-constant", out=toy / "mine")
    with pytest.raises(Misuse, match="README.md is a file"):
        execute.run(toy, "toy/02-constant", out=toy / "README.md")
    with pytest.raises(Fault, match="a file stands where a folder is needed"):
        execute.run(toy, "toy/02-constant", out=toy / "README.md" / "run")
    assert (toy / "mine" / "thesis.tex").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_no_write_permission(toy):
    (toy / "locked").mkdir(mode=0o500)
    with pytest.raises(Fault, match="permission denied; choose a folder that you may write to"):
        execute.run(toy, "toy/02-constant", out=toy / "locked" / "run")


@pytest.mark.parametrize(
    "asked, words",
    [(({}, False), "paper"), (({}, True), "quick"), (({"b": 2, "a": [1, 2]}, True), "quick+a=-1,-2-+b=2-")],
)
def test_default_folder_says_what_was_asked(toy, asked, words):
    assert execute.default_out(toy, "toy/01-line", *asked).name.startswith(words)
    one, two = (execute.default_out(toy, "toy/01-line", {"f": f}, False) for f in ("/a/b", "/a-b"))
    assert one != two


ODD = "a{b} {slope} 'c\" [d]*? %s#$HOME ~é"  # " #" begins a comment: values are YAML
TEXT = """'"\\ \\" \\n {x} $HOME %s #é\U0001f600\"; raise SystemExit #"""


def test_odd_letters_in_paths_and_values(tmp_path, new_toy, geokalman):
    """Braces, quotes, dollars, blanks: in the path of the clone, of the run and of a file, and in a text."""
    root = new_toy(tmp_path / ODD)
    path = root / "book" / "toy" / "02-constant.md"
    path.write_text(path.read_text().replace("divisor = 1 ", 'text = ""  #: any\nfile = ""  # path: any\ndivisor = 1 '))
    (root / ODD).touch()
    out = tmp_path / f"out {ODD}"
    words = ["run", "toy/02-constant", f"text={TEXT}", f"file={ODD}", "--out", str(out)]
    done = geokalman(root, *words)
    assert done.returncode == 0 and done.stdout == f"{out}\n", done.stderr
    told = json.loads((out / "provenance.json").read_text())["parameters"]
    assert told["text"] == TEXT and told["file"] == str(root / ODD)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([ODD, out.name])
    assert geokalman(root, "compare", str(out), str(out)).returncode == 0
    break_it = geokalman(root, "run", "toy/02-constant", "divisor=0", "--out", f"{ODD}-0")
    assert break_it.stderr.splitlines()[-1] == f"  traceback: {root / f'{ODD}-0'}.failed.ipynb"


def test_a_clone_whose_path_is_of_several_lines(tmp_path, new_toy, geokalman):
    done = geokalman(new_toy(tmp_path / "a\nb"), "list")
    assert done.returncode == 1 and done.stderr.count("\n") == 1 and "rename the folder" in done.stderr


def test_interrupt_leaves_nothing_half_done(toy, geokalman, wait_for):
    path = toy / "book" / "toy" / "02-constant.md"
    path.write_text(
        path.read_text().replace(
            "half = 0.5", "import os, time; open('../../pid', 'w').write(str(os.getpid())); time.sleep(3600)"
        )
    )
    process = geokalman(toy, "run", "toy/02-constant", wait=False)
    wait_for(lambda: (toy / "pid").exists() and (toy / "pid").read_text(), process)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate()
    assert process.returncode == 130 and "Traceback" not in told
    assert re.fullmatch(
        r"toy/02-constant starts\n(\.\.\. .*\n)*toy/02-constant failed after .* s\ngeokalman: interrupted; .*\n", told
    )
    assert not list((toy / "runs" / "toy" / "02-constant").glob(".*"))
    wait_for(lambda: not is_alive(int((toy / "pid").read_text())))  # the kernel is gone too


def is_alive(pid: int) -> bool:
    """Does the process run, other than as a zombie that nobody has waited for?"""
    done = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True)
    return bool(done.stdout.strip()) and not done.stdout.strip().startswith("Z")


def test_what_killed_runs_left_is_cleared_and_what_a_living_one_writes_is_not(toy):
    folder = toy / "runs" / "toy" / "01-line"
    for name in (".paper.partial-abcd1234", ".quick.partial-abcd1234", f".interactive.partial-{os.getpid()}"):
        (folder / name).mkdir(parents=True)
    (folder / ".quick.old-abcd1234").mkdir()
    (toy / "elsewhere").mkdir()
    (toy / "elsewhere" / ".theirs.partial-1").mkdir()
    with atomic.locked(execute._lock_of(toy, folder / "paper")):
        execute.run(toy, "toy/02-constant", out=toy / "elsewhere" / "mine", page=False)
        assert sorted(p.name for p in folder.iterdir()) == [
            f".interactive.partial-{os.getpid()}", ".paper.partial-abcd1234", "quick",
        ]  # fmt: skip
    assert (toy / "elsewhere" / ".theirs.partial-1").exists()  # no folder of ours
    execute.sweep_runs(toy)
    assert sorted(p.name for p in folder.iterdir()) == [f".interactive.partial-{os.getpid()}", "quick"]


def edit_constant(root, code):
    """Let the second toy notebook do something of its own."""
    path = root / "book" / "toy" / "02-constant.md"
    path.write_text(path.read_text().replace("half = 0.5", code))


def test_a_kernel_is_talked_to_over_sockets_that_are_ours_alone(toy):
    """Over files, so that it needs no loopback interface, and nobody else on the machine can listen."""
    edit_constant(
        toy,
        "import json, os\nfrom ipykernel import get_connection_info\ntalk = get_connection_info(unpack=True)\n"
        "folder = os.stat(os.path.dirname(talk['ip']))\nnb.record('mode', folder.st_mode & 0o777)\n"
        "nb.record('ours', folder.st_uid == os.getuid())\nnb.record('files', talk['transport'] == 'ipc')",
    )
    execute.run(toy, "toy/02-constant", out=toy / "out", page=False)
    told = json.loads((toy / "out" / "metrics.json").read_text())
    assert [told[key]["value"] for key in ("mode", "ours", "files")] == [0o700, True, True]


def test_a_long_loop_tells_its_share_while_it_runs(toy):
    edit_constant(toy, "import time, pathlib\nfrom geokalman import progress\nnb.expect(600.0)\n"
                       "for k in progress.track(range(4), 'orbits'):\n"
                       "    while k == 1 and not pathlib.Path('../../seen').exists():\n        time.sleep(0.05)")  # fmt: skip
    reported: list[Path] = []
    with ThreadPoolExecutor(1) as pool:
        task = pool.submit(
            execute.run,
            toy,
            "toy/02-constant",
            out=toy / "out",
            progress=lambda cell, cells, path: reported.append(path),
        )
        report: dict = {}
        try:
            while report.get("share") != 0.25 and not task.done():
                report = progress.read(reported[-1]) if reported else {}
                time.sleep(0.05)
        finally:
            (toy / "seen").touch()
        task.result()
    assert (report["what"], report["share"], report["left"] > 0) == ("orbits", 0.25, True)
    assert report["expected"] == "may take about 10 min, less where results of earlier runs are kept"
    assert "expect" not in json.dumps(json.loads((toy / "out" / "provenance.json").read_text())["notes"])


@pytest.mark.parametrize("code, why", [
    ("raise MemoryError", "cell [3]: memory ran out; give smaller sizes."),
    ("import numpy as np; np.zeros(2**55)", "cell [3]: memory ran out (Unable to allocate "),
])  # fmt: skip
def test_memory_that_runs_out_is_one_sentence(toy, code, why):
    edit_constant(toy, code)
    with pytest.raises(Fault) as caught:
        execute.run(toy, "toy/02-constant", out=toy / "out", page=False)
    assert str(caught.value).splitlines()[0].startswith(f"FAILED toy/02-constant: {why}")


def test_a_kernel_that_the_system_kills_says_what_it_may_be(toy):
    edit_constant(toy, "import os, signal; os.kill(os.getpid(), signal.SIGKILL)")
    with pytest.raises(Fault, match="the kernel stopped .*; if nobody stopped it, memory ran out"):
        execute.run(toy, "toy/02-constant", out=toy / "out", page=False)


def test_locks_that_cannot_be_made_are_one_sentence(toy, geokalman):
    (toy / ".cache").write_text("")
    for words, lock in ((["run", "toy/02-constant"], "locks"), (["build"], "build.lock")):
        done = geokalman(toy, *words)
        assert done.returncode == 1 and "Traceback" not in done.stderr
        assert done.stderr.splitlines()[-1].startswith(f"geokalman: Cannot write {toy}/.cache/{lock}")
        assert "a file stands where a folder is needed" in done.stderr


def test_a_disk_without_a_byte_left_is_one_sentence(toy, geokalman):
    """Every write of the command and of its kernel is refused, not one that is mocked."""

    def full():
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

    for words in (["run", "toy/02-constant"], ["build"]):
        done = geokalman(toy, *words, preexec_fn=full)
        assert done.returncode == 1 and "Traceback" not in done.stderr, done.stderr
        assert "Cannot write" in done.stderr.splitlines()[-1]
        assert not list(toy.rglob("*.partial-*"))


def test_through_papermill_directly(toy):
    """The twin of a notebook, run by papermill alone: an unknown parameter is refused there too."""
    [line, _] = notebooks.write_twins(toy)
    kernel = toy / "kernels" / "kernels" / "toykernel"
    kernel.mkdir(parents=True)
    argv = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    (kernel / "kernel.json").write_text(json.dumps({"argv": argv, "display_name": "toy", "language": "python"}))
    env = os.environ | {"JUPYTER_PATH": str(toy / "kernels"), "EXECBOOK_ROOT": str(toy)}

    def papermill(*words):
        command = [
            sys.executable,
            "-m",
            "papermill",
            str(line),
            str(toy / "out.ipynb"),
            "-k",
            "toykernel",
            "--no-progress-bar",
            *words,
        ]
        return subprocess.run(command, env=env, cwd=toy, capture_output=True, text=True)

    done = papermill("-p", "slope", "4")
    assert done.returncode == 0, done.stderr
    record = toy / "runs" / "toy" / "01-line" / "interactive" / "metrics.json"
    assert json.loads(record.read_text())["line.mean"]["value"] == 98.0
    done = papermill("-p", "slop", "4")
    assert done.returncode != 0 and "slop is no parameter of toy/01-line (did you mean slope?)" in done.stderr


def test_a_run_as_the_paper_has_it_needs_no_warning(toy):
    execute.run(toy, "toy/02-constant", {"value": 3.0}, out=toy / "out")
    assert "differs from the paper" not in (toy / "out" / "page.html").read_text()


def test_prose_of_a_page(toy):
    (toy / "book" / "references.bib").write_text(
        "@article{k60, author={Kalman, R. E.}, title={A}, year={1960}, journal={J}}\n"
    )
    prose = (
        "\n:::{note}\nSee {eq}`slope`, {cite:p}`k60`, {cite:t}`k60`, [there](/practice/rerun.md), {doc}`01-line`, "
        "{doc}`/toy/02-constant.md`, {doc}`a <../b/c>`.\n:::\n\n```{code-cell} ipython3\nimport numpy"
    )
    path = toy / "book" / "toy" / "01-line.md"
    path.write_text(path.read_text().replace("```{code-cell} ipython3\nimport numpy", prose, 1))
    found = (execute.run(toy, "toy/01-line", out=toy / "out") / "page.html").read_text()
    plain = " ".join(re.sub(r"<[^>]+>", "", found[found.index("<body>") :]).split())
    assert "See Eq. 1, [Kalman, 1960], Kalman [1960], there, A straight line, A constant, a." in plain
    assert ":::" not in plain and "R. E. Kalman" in plain and not brought_from_elsewhere(found)
