"""Fixtures that several parts use."""

import importlib.util
import shutil
import sys
from pathlib import Path

import pytest

_spec = importlib.util.spec_from_file_location("environmenttool", Path(__file__).with_name("environmenttool.py"))
environmenttool = importlib.util.module_from_spec(_spec)
sys.modules["environmenttool"] = environmenttool
_spec.loader.exec_module(environmenttool)


@pytest.fixture
def package_copy(tmp_path: Path) -> Path:
    """Folder with a copy of the package to be edited; put it on PYTHONPATH of a process of its own."""
    source = Path(__file__).resolve().parents[1] / "src" / "geokalman"
    shutil.copytree(source, tmp_path / "copy" / "geokalman", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "copy"
