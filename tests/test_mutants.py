"""tools/mutants.py: which changes it makes to a source, and that a test that notices one is told from one that does not."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def tool():
    spec = importlib.util.spec_from_file_location("mutants_tool", ROOT / "tools" / "mutants.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("y = a < b", {"y = a <= b"}),
        ("y = a - b", {"y = a + b"}),
        ("y = -a", {"y = a"}),
        ("y = a and b", {"y = a or b"}),
        ("y = 2", {"y = 3", "y = 1", "y = 0"}),
        ("y = True", {"y = False"}),
        ("y = f(a, b, c)", {"y = f(b, a, c)", "y = f(a, c, b)"}),
        ("y += a", {"y -= a", "pass"}),
        ("y[i] = a", {"pass"}),
        ("f(a)", {"pass"}),
        ("if a:\n    b", {"if not a:\n    b", "if a:\n    pass"}),
        ("def f(a: 3 = b) -> 4:\n    return a", {"def f(a: 3=b) -> 4:\n    return None"}),
        ("raise E('words', f'{1 + 1} words')", {"pass", "raise E(f'{1 + 1} words', 'words')"}),
        ("y = A.shape[1]", set()),
    ],
)
def test_the_changes_of_a_source(tool, text, wanted):
    assert {mutant for _, _, mutant in tool.mutants(text)} == wanted


def test_a_mutant_is_killed_by_a_test_that_notices_it(tool, tmp_path, monkeypatch):
    """Two tests of one function: one sees its value, one does not; and a mutant that never ends is stopped."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "test_twice.py").write_text(
        "from pathlib import Path\ndef twice(a):\n    exec(Path('source.py').read_text(), s := {})\n    return"
        " s['f'](a)\ndef test_value():\n    assert twice(3) == 6\ndef test_type():\n    assert isinstance(twice(3),"
        " int)\n"
    )
    seconds = {"test_twice.py::test_value": 0.1, "test_twice.py::test_type": 0.1}
    for source, by_value, by_type in (
        ("def f(a): return 2 * a", False, False),
        ("def f(a): return 3 * a", True, False),
        ("def f(a): return None", True, True),
    ):
        (tmp_path / "source.py").write_text(source)
        assert tool.killed({"test_twice.py::test_value"}, seconds) == by_value
        assert tool.killed({"test_twice.py::test_type"}, seconds) == by_type
