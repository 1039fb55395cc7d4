"""Fixtures that several parts use."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture
def package_copy(tmp_path: Path) -> Path:
    """Folder with a copy of the package to be edited; put it on PYTHONPATH of a process of its own."""
    source = Path(__file__).resolve().parents[1] / "src" / "geokalman"
    shutil.copytree(source, tmp_path / "copy" / "geokalman", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "copy"


@pytest.fixture(params=["light", "dark"])
def theme(request) -> Iterator[dict[str, str]]:
    """Colours of the theme in force, and its name; all figures are closed after."""
    import matplotlib.pyplot as plt  # not for the tests that draw nothing

    from geokalman import style

    with style.theme(request.param) as colours:
        yield {**colours, "name": request.param}
    plt.close("all")
