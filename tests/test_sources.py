"""The hash of a piece of code and all it stands on; and the compilation cache that is keyed by it."""

import ast
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from geokalman import sources

KERNEL = """
from numba import njit


@njit(cache=True)
def inner(x):
    return x + {}.0
"""
LOOP = """
import numpy as np
from numba import njit

from geokalman.kernel_module import inner


@njit(cache=True)
def outer(n):
    total = 0.0
    for _ in range(n):
        total += inner(1.0)
    return total
"""
CALL = """
from geokalman.loop_module import outer
print(outer(10), sum(outer.stats.cache_hits.values()) if hasattr(outer, "stats") else "interpreted")
"""


def test_imports_of_every_form():
    text = """
    import geokalman.files
    from geokalman import constants as c, __version__
    from geokalman.reproduce.errors import Fault
    from .sibling import x
    from .. import sources
    import numpy.geokalman
    def late():
        from geokalman import style
    """
    found = sources.imported_modules(textwrap.dedent(text), package="geokalman.reproduce")
    assert found >= {
        "geokalman",
        "geokalman.files",
        "geokalman.constants",
        "geokalman.sources",
        "geokalman.style",
        "geokalman.reproduce.errors",
    }
    assert "geokalman.__version__" not in found and "geokalman.reproduce.sibling" not in found


@pytest.mark.parametrize("path", sorted(sources.PACKAGE_DIR.rglob("*.py")), ids=lambda path: path.stem)
def test_imports_are_those_of_the_whole_syntax_tree(path):
    named = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            named |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            named |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    ours = {name for name in named if name.partition(".")[0] == "geokalman" and sources.module_path(name)}
    assert sources.imported_modules(path.read_text(encoding="utf-8")) == ours


@pytest.mark.parametrize(
    "text",
    [
        "import numpy; from geokalman import style",
        "x = 1; import geokalman.style",
        "if x: import geokalman.style",
        "from geokalman import constants, \\\n    style",
        "from geokalman import (constants,  # (of nature)\n    style)",
        '"""An essay\nimport of goods"""\nimport geokalman.style',
    ],
)
def test_no_import_is_missed_however_it_is_written(text):
    assert "geokalman.style" in sources.imported_modules(text)


def test_closure_holds_packages_on_the_way_and_itself():
    found = sources.closure({"geokalman.reproduce.atomic"})
    wanted = {
        "geokalman",
        "geokalman.sources",
        "geokalman.reproduce",
        "geokalman.reproduce.atomic",
        "geokalman.reproduce.errors",
    }
    assert wanted <= found
    assert not any(name.startswith("geokalman.grace") for name in found)


def test_unknown_module_has_no_path():
    assert sources.module_path("geokalman.nothing") is None
    assert sources.module_path("geokalman.files").name == "files.py"
    assert sources.module_path("geokalman").name == "__init__.py"


def test_nothing_edited_since_it_was_read():
    assert sources.edited({"geokalman.files"}) == set()


def in_copy(package: Path, code: str, **environment: str) -> list[str]:
    env = {k: v for k, v in os.environ.items() if not k.startswith(("GEOKALMAN", "NUMBA_CACHE"))}
    env |= {"PYTHONPATH": str(package), **environment}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_hash_moves_with_a_callee_and_with_nothing_else(package_copy):
    code = "from geokalman import sources; print(sources.code_hash({'geokalman.reproduce.atomic'}))"
    package = package_copy / "geokalman"
    before = in_copy(package_copy, code)
    (package / "constants.py").write_text("x = 1\n")
    assert in_copy(package_copy, code) == before
    (package / "reproduce" / "errors.py").write_text((package / "reproduce" / "errors.py").read_text() + "\n# more\n")
    assert in_copy(package_copy, code) != before


def test_edited_since_import(package_copy):
    code = """
import geokalman.files
from geokalman import sources
path = sources.module_path("geokalman.files")
path.write_text(path.read_text() + "\\n# edited\\n")
print(*sources.edited({"geokalman.files"}))
"""
    assert in_copy(package_copy, code) == ["geokalman.files"]


def test_an_edited_kernel_never_runs_from_a_stale_cache(package_copy, tmp_path):
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    kernel = package_copy / "geokalman" / "kernel_module.py"
    kernel.write_text(KERNEL.format(1))
    (package_copy / "geokalman" / "loop_module.py").write_text(LOOP)
    first = in_copy(package_copy, CALL, **cache)
    again = in_copy(package_copy, CALL, **cache)
    assert first[0] == again[0] == "20.0"
    if again[1] != "interpreted":
        assert (first[1], again[1]) == ("0", "1")  # the cache works at all
    stat = kernel.stat()
    kernel.write_text(KERNEL.format(2))
    os.utime(
        kernel, ns=(stat.st_atime_ns, stat.st_mtime_ns)
    )  # numba itself looks at time and size only: both as before
    assert kernel.stat().st_size == stat.st_size
    assert in_copy(package_copy, CALL, **cache)[0] == "30.0"
    kernel.write_text(KERNEL.format(1))
    assert in_copy(package_copy, CALL, **cache)[0] == "20.0"


def test_a_child_process_keeps_its_parents_home_of_the_cache(package_copy, tmp_path):
    code = """
import os, subprocess, sys, geokalman
child = "import os, geokalman; print(os.environ['NUMBA_CACHE_DIR'])"
done = subprocess.run([sys.executable, "-c", child], capture_output=True, text=True)
print(os.environ["NUMBA_CACHE_DIR"], done.stdout)
"""
    mine, childs = in_copy(package_copy, code, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert mine == childs and Path(mine).parent == tmp_path / "cache"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_home_of_the_cache_falls_back(package_copy, tmp_path):
    (tmp_path / "cache").mkdir(mode=0o500)
    code = "import os, geokalman; print(os.environ['NUMBA_CACHE_DIR'])"
    [folder] = in_copy(package_copy, code, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert not folder.startswith(str(tmp_path)) and os.access(folder, os.W_OK)


OWN = "from pathlib import Path; import tempfile; own = Path(tempfile.gettempdir(), f'geokalman-{os.getuid()}')"
FORBIDDEN = {
    "ours": ("own.mkdir(0o700)", True),
    "new": ("", True),
    "readable": ("own.mkdir(0o755)", False),
    "writable": ("own.mkdir(); own.chmod(0o777)", False),
    "link": ("Path(own.parent, 'x').mkdir(0o700); own.symlink_to('x')", False),
    "dangling": ("own.symlink_to('nowhere')", False),
    "file": ("own.touch()", False),
    "another's": ("owner = os.getuid(); os.getuid = lambda: owner + 1; own = own.with_name(f'geokalman-{owner + 1}'); own.mkdir(0o700)", False),
}  # fmt: skip


@pytest.mark.parametrize("prepare, taken", FORBIDDEN.values(), ids=FORBIDDEN)
def test_the_temporary_home_of_the_cache_is_private(package_copy, tmp_path, prepare, taken):
    """Machine code that another user put there would be executed; a fresh folder is made, and goes with the process."""
    (tmp_path / "temporary").mkdir()
    (tmp_path / "no folder").touch()
    code = f"import os\n{OWN}\n{prepare}\nimport geokalman; home = Path(os.environ['NUMBA_CACHE_DIR']).parent\n"
    code += "print(home == own, oct(home.stat().st_mode)[-3:], home.is_symlink(), home)"
    asked = {"NUMBA_CACHE_DIR": str(tmp_path / "no folder" / "cache"), "TMPDIR": str(tmp_path / "temporary")}
    own, mode, link, home = in_copy(package_copy, code, **asked)
    assert (own, mode, link) == (str(taken), "700", "False")
    assert Path(home).parent == tmp_path / "temporary" and Path(home).exists() == taken
