"""Do the tests notice a wrong estimator? `make mutants` changes its source, one place at a time, and runs the tests.

    python tools/mutants.py [--each 20] [--seed 1] [MODULE ...]

A mutant is *killed* when a test that executes the changed line fails. Each module gives a random sample of --each
mutants (0: all of them); survivors are printed with their line. Strings, and so the words of errors, are left alone,
and so are annotations and decorators. Compilation is off, and every mutant runs in a fork of a process that has already
imported the libraries.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import copy
import importlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import coverage
import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "src"
TESTS = {
    "geokalman/kalman": "tests/kalman",
    "geokalman/leastsquares.py": "tests/test_leastsquares.py",
    "execbook/claims.py": "tests/execbook/test_claims.py",
}
SLOW = 1.5  # CPU seconds of a test, compilation off, beyond which it takes no part
COMPARE = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
COMPARE |= {ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In}
ARITHMETIC = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult}
ARITHMETIC |= {ast.Pow: ast.Mult, ast.Mod: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd}
LOGIC = {ast.And: ast.Or, ast.Or: ast.And}


def _changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """The mutations of one node: what is done, and the node that takes its place."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARE:
        new = copy.deepcopy(node)
        new.ops[0] = COMPARE[type(node.ops[0])]()
        yield "comparison", new
    if isinstance(node, ast.BinOp | ast.AugAssign) and type(node.op) in ARITHMETIC:
        new = copy.deepcopy(node)
        new.op = ARITHMETIC[type(node.op)]()
        yield "operator", new
    if isinstance(node, ast.BoolOp):
        new = copy.deepcopy(node)
        new.op = LOGIC[type(node.op)]()
        yield "operator", new
    if isinstance(node, ast.UnaryOp):
        yield "operator", node.operand
    if isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield "constant", ast.Constant(not node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        for other in dict.fromkeys((node.value + 1, node.value - 1, 0)):
            if other != node.value:
                yield "constant", ast.Constant(other)
    if isinstance(node, ast.If | ast.IfExp | ast.While):
        new = copy.deepcopy(node)
        new.test = ast.UnaryOp(ast.Not(), node.test)
        yield "condition", new
    if isinstance(node, ast.Return) and node.value is not None and not _is_none(node.value):
        yield "return", ast.Return(ast.Constant(None))
    if isinstance(node, ast.Call) and len(node.args) > 1 and not any(isinstance(a, ast.Starred) for a in node.args):
        for k in range(len(node.args) - 1):
            new = copy.deepcopy(node)
            new.args[k], new.args[k + 1] = new.args[k + 1], new.args[k]
            yield "arguments", new
    deleted = isinstance(node, ast.AugAssign | ast.Raise | ast.Break | ast.Continue)
    deleted |= isinstance(node, ast.Expr) and not isinstance(node.value, ast.Constant)
    deleted |= isinstance(node, ast.Assign) and not isinstance(node.targets[0], ast.Name | ast.Tuple)
    if deleted:
        yield "deleted", ast.Pass()


def _is_none(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and node.value is None


def _places(node: ast.AST, line: int = 1) -> Iterator[tuple[ast.AST, str, int | None, int]]:
    """Where a node can be replaced below `node`: parent, field, index in a list, line of the statement around it."""
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "type_comment", "bases"):
            continue  # types are no arithmetic
        if name == "slice" and isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            continue  # a.shape[0] and a.shape[1] of a square matrix are the same
        items = enumerate(value) if isinstance(value, list) else [(None, value)]
        for k, child in items:
            if isinstance(child, ast.AST) and not isinstance(child, ast.JoinedStr):
                inner = child.lineno if isinstance(child, ast.stmt) else line
                yield node, name, k, inner
                yield from _places(child, inner)


def mutants(text: str) -> Iterator[tuple[int, str, str]]:
    """All mutants of a module's text: line of the statement, what was done there, and the text of the mutant."""
    tree = ast.parse(text)
    for parent, name, k, line in list(_places(tree)):
        slot = getattr(parent, name)
        old = slot if k is None else slot[k]
        for kind, new in _changes(old):
            new = ast.fix_missing_locations(ast.copy_location(new, old))
            _put(parent, name, k, new)
            before, after = (ast.unparse(node).splitlines()[0] for node in (old, new))
            yield line, f"{kind}: {before} -> {after}", ast.unparse(tree)
            _put(parent, name, k, old)


def _put(parent: ast.AST, name: str, k: int | None, node: ast.AST) -> None:
    if k is None:
        setattr(parent, name, node)
    else:
        getattr(parent, name)[k] = node


class Watch:
    """A pytest plugin: the CPU time of each test, and whether it failed."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self.began = sum(os.times()[:4])

    def pytest_runtest_logreport(self, report) -> None:
        self.seconds[report.nodeid] = sum(os.times()[:4]) - self.began
        if report.failed:
            self.failed.add(report.nodeid)


def baseline(package: Path, tests: list[str], scratch: Path) -> tuple[dict[str, dict[int, set[str]]], dict[str, float]]:
    """The tests that execute each line of each module, and the CPU seconds of a test; slow and failing ones left
    out."""
    store = scratch / "coverage"
    if _fork(lambda: _measure(package, tests, store)):
        sys.exit("The tests could not be run on the unchanged sources.")
    told = json.loads(store.with_suffix(".json").read_text())
    for name in told["imported"]:  # once, for all forks
        with contextlib.suppress(Exception):
            importlib.import_module(name)
    seconds = told["seconds"]
    data = coverage.CoverageData(str(store))
    data.read()
    by_line: dict[str, dict[int, set[str]]] = {}
    for path in data.measured_files():
        lines = by_line[os.path.relpath(path, package)] = {}
        for line, contexts in data.contexts_by_lineno(path).items():
            lines[line] = {c.partition("|")[0] for c in contexts if c} & seconds.keys()
            # What a fixture of a whole file executes, it executes in the setup of one test and for all of them.
            shared = {c.partition("::")[0] for c in contexts if c.endswith("|setup")}
            lines[line] |= {name for name in seconds if name.partition("::")[0] in shared}
        lines[0] = set().union(*lines.values())
    return by_line, seconds


def _measure(package: Path, tests: list[str], store: Path) -> int:
    watch = Watch()
    os.environ["COVERAGE_FILE"] = str(store)
    options = [f"--cov={package / 'geokalman'}", "--cov-context=test", "--cov-report=", "--tb=no"]
    code = pytest.main(["-q", "-p", "no:cacheprovider", *options, *tests], plugins=[watch])
    for name in sorted(watch.failed):
        print(f"fails on the unchanged sources, left out: {name}")
    seconds = {n: s for n, s in watch.seconds.items() if s < SLOW and n not in watch.failed}
    imported = [n for n in sys.modules if not n.startswith(("geokalman", "tests", "conftest", "__"))]
    store.with_suffix(".json").write_text(json.dumps({"seconds": seconds, "imported": imported}))
    return int(code not in (0, 1))


def killed(tests: set[str], seconds: dict[str, float]) -> bool:
    """Does one of these tests fail, in a fork? A mutant that runs for ever is stopped by its CPU time, and killed."""
    limit = 10 + int(5 * sum(seconds[name] for name in tests))
    quickest_first = sorted(tests, key=lambda name: (seconds[name], name))
    return (
        _fork(lambda: int(pytest.main(["-xq", "--tb=no", "-p", "no:cacheprovider", *quickest_first]) != 0), limit) != 0
    )


def _fork(work: Callable[[], int], limit: int | None = None) -> int:
    """Exit code of `work`, in a child of its own group that is silenced; not 0 where it was killed."""
    child = os.fork()
    if child == 0:
        os.setpgid(0, 0)
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
            sys.dont_write_bytecode = True  # of a mutant; that of the unchanged modules is there
            os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
            silence = os.open(os.devnull, os.O_WRONLY)
            os.dup2(silence, 1)
            os.dup2(silence, 2)
        code = 1
        with contextlib.suppress(BaseException):
            code = work()
        sys.stdout.flush()
        os._exit(code)
    status = os.waitpid(child, 0)[1]
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # what the child itself started
    return status


def modules(names: list[str]) -> list[str]:
    """Modules to change, relative to `src`: those named, else all that `TESTS` knows."""
    found = (p for name in names or TESTS for p in [SOURCE / name, *(SOURCE / name).glob("*.py")])
    return sorted(str(p.relative_to(SOURCE)) for p in found if p.is_file() and p.name != "__init__.py")


def main() -> None:
    parser = argparse.ArgumentParser(description="Do the tests notice a wrong estimator?")
    parser.add_argument("--each", type=int, default=20, help="mutants of each module, 0 for all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("modules", nargs="*", help="e.g. geokalman/kalman/linear.py")
    options = parser.parse_args()
    os.chdir(ROOT)
    names = modules(options.modules)
    tests = sorted({t for source, t in TESTS.items() for name in names if name.startswith(source)})
    with tempfile.TemporaryDirectory() as scratch:
        package = Path(scratch) / "src"
        shutil.copytree(SOURCE, package, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
        sys.path.insert(0, str(package))
        os.environ["PYTHONPATH"] = str(package)
        by_line, seconds = baseline(package, tests, Path(scratch))
        total = dead = 0
        for name in names:
            target = package / name
            text = target.read_text(encoding="utf-8")
            found = list(mutants(text))
            sample = random.Random(f"{options.seed} {name}").sample(found, min(options.each or len(found), len(found)))
            count = 0
            for line, what, mutant in sorted(sample, key=lambda m: m[0]):
                target.write_text(mutant, encoding="utf-8")
                lines = by_line[name]
                judges = lines.get(line) or lines[0]  # what is executed at import concerns every test
                if killed(judges, seconds):
                    count += 1
                else:
                    print(f"survived: {name}:{line}: {what}", flush=True)
            target.write_text(text, encoding="utf-8")
            print(f"{name}: {count} of {len(sample)} killed (of {len(found)} mutants there are)", flush=True)
            total, dead = total + len(sample), dead + count
    print(f"{dead} of {total} killed, {100 * dead / max(total, 1):.1f} %")


if __name__ == "__main__":
    os.environ.setdefault("NUMBA_DISABLE_JIT", "1")
    main()
