"""Fixtures that several parts use."""

import shutil
from pathlib import Path

import pytest


@pytest.fixture
def package_copy(tmp_path: Path) -> Path:
    """Folder with a copy of the package to be edited; put it on PYTHONPATH of a process of its own."""
    source = Path(__file__).resolve().parents[1] / "src" / "geokalman"
    shutil.copytree(source, tmp_path / "copy" / "geokalman", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "copy"
