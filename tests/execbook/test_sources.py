"""The hash of a piece of code and of all that it stands on."""

import ast
import textwrap

import pytest

from execbook import sources

PACKAGES = {"geokalman", "execbook"}


def test_imports_of_every_form():
    text = """
    import geokalman.data
    from geokalman import constants as c, __version__
    from execbook.errors import Fault
    from .sibling import x
    from .. import geokalman
    import numpy.geokalman
    def late():
        from geokalman import style
    """
    found = sources.imported_modules(textwrap.dedent(text), PACKAGES, "execbook.part")
    assert found == {
        "geokalman", "geokalman.data", "geokalman.constants", "geokalman.style", "execbook", "execbook.errors",
    }  # fmt: skip


@pytest.mark.parametrize("text", [
    "import numpy; from geokalman import style", "x = 1; import geokalman.style", "if x: import geokalman.style",
    "from geokalman import constants, \\\n    style", "from geokalman import (constants,  # (of nature)\n    style)",
])  # fmt: skip
def test_no_import_is_missed_however_it_is_written(text):
    assert "geokalman.style" in sources.imported_modules(text, PACKAGES)


def test_other_packages_are_not_followed():
    assert sources.imported_modules("import geokalman.style, numpy", {"execbook"}) == set()
    assert not any(name.startswith("geokalman") for name in sources.closure({"execbook.execute"}))


@pytest.mark.parametrize("name", ["geokalman.reading", "geokalman.kalman.linear", "execbook.execute"])
def test_the_closure_is_closed(name):
    package = name.partition(".")[0]
    found = sources.closure({name})
    assert {name, package} <= found
    for part in found:
        tree = ast.parse(sources.module_path(part).read_text())
        named = {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.level == 0}
        assert {n for n in named if n.partition(".")[0] == package} <= found


def test_unknown_module_has_no_path():
    assert sources.module_path("geokalman.nothing") is None and sources.module_path("no_such_package") is None
    assert sources.module_path("geokalman.data").name == "data.py"
    assert sources.module_path("geokalman").name == "__init__.py"


@pytest.fixture
def toys(tmp_path, monkeypatch):
    """A package of three modules, of which the first imports the second; what is read of it is forgotten at last."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "toys").mkdir()
    for name, text in {"__init__": "", "user": "from . import used\n", "used": "", "other": ""}.items():
        (tmp_path / "toys" / f"{name}.py").write_text(text)
    yield tmp_path / "toys"
    forget()


def forget():
    for kept in (sources._read, sources._direct, sources._folders):
        kept.cache_clear()


def test_the_hash_moves_with_a_callee_and_with_nothing_else(toys):
    def hashed():
        forget()
        return sources.code_hash({"toys.user"})

    before = hashed()
    (toys / "other.py").write_text("x = 1\n")
    assert hashed() == before
    (toys / "used.py").write_text("x = 1\n")
    assert hashed() != before


def test_edited_since_it_was_read(toys):
    assert sources.edited({"toys.user"}) == set()
    (toys / "used.py").write_text("x = 1\n")
    assert sources.edited({"toys.user"}) == {"toys.used"}
    (toys / "used.py").unlink()
    assert sources.edited({"toys.user"}) == {"toys.used"}
