"""What the tests of notebooks hold a run to, on a toy run that is sound and on the same with one fault planted."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import toybook

from execbook import reference

METRICS = {"wave.rms": {"value": 0.70711, "unit": "m"}}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run folder with one figure."""
    folder = tmp_path / "runs" / toybook.PAGE
    toybook.run(folder)
    np.savez(folder / "arrays.npz")
    write_provenance(folder, ["wave"])
    return folder


def write_provenance(folder: Path, figures: list[str]) -> None:
    record = {"notebook": toybook.PAGE, "mode": "quick", "parameters": {}, "arrays": {}, "figures": figures}
    (folder / "provenance.json").write_text(json.dumps(record))


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda figures: shutil.copy(figures / "wave.light.png", figures / "wave.dark.png"), "wave is not drawn twice"),
        (lambda figures: (figures / "wave.light.png").write_bytes(b""), "wave is not drawn twice"),
        (lambda figures: (figures / "wave.csv").write_text("t_s,h_m\n"), "wave has no table"),
        (lambda figures: (figures / "wave.csv").write_text("t_s,h_m\n1,2\n3\n"), "wave has no table"),
        (lambda figures: write_provenance(figures.parent, []), "no figure"),
    ],
)
def test_a_figure_that_is_not_whole_is_seen(run: Path, assert_drawn, spoil, words: str) -> None:
    assert_drawn(run)
    spoil(run / "figures")
    with pytest.raises(AssertionError, match=words):
        assert_drawn(run)


def test_a_figure_without_data_is_seen_unless_it_needs_none(run: Path, assert_drawn) -> None:
    (run / "figures" / "wave.csv").unlink()
    assert_drawn(run, ["wave"])
    with pytest.raises(FileNotFoundError):
        assert_drawn(run)


def test_a_number_that_moved_is_seen(assert_held) -> None:
    anchors = [{"max": 0.8, "source": "section 1"}]
    assert_held(reference.hold("wave.rms", anchors, METRICS["wave.rms"]))
    with pytest.raises(AssertionError, match="wave.rms: 0.9, wanted None, beyond max 0.8"):
        assert_held(reference.hold("wave.rms", anchors, {"value": 0.9, "unit": "m"}))
    with pytest.raises(AssertionError, match="wave.rms: None, wanted None, not recorded"):
        assert_held(reference.hold("wave.rms", anchors, None))
