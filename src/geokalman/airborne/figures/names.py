"""What readers call the methods of the airborne part: one name for each, in every figure, table and text."""

from __future__ import annotations

from collections.abc import Mapping

from geokalman.style import METHODS

NAMES: Mapping[str, str] = {
    **{key: METHODS[key].label for key in ("forward", "fb", "contractor", "grid", "joint")},
    "reference": "simulated reference",
    "ground": "ground gravity, continued upward",
    "coloured": "smoother with coloured heights",
    "weighted": "joint estimate, noisy lines weighted down",
    "paper": "forward-backward smoother",
    "paper_lag": "smoother with the second-order lag",
    "rts": "Rauch-Tung-Striebel pass",
    "two_filter": "two-filter pass",
}
"""Key of a method in the code -> its name."""
STARTS: Mapping[str, str] = {
    "information": "no information",
    "literal": "zero covariance",
    "wide": "wide prior",
    "prior": "forward prior",
    "forward-certain": "forward end, certain",
    "forward": "forward end",
}
"""Key of a start of the backward pass -> its name."""
WORLDS: Mapping[str, str] = {"paper_like": "paper-like", "rough": "rough", "matched": "matched"}
"""Key of a preset of the simulation -> its name."""


def low_pass(name: str) -> str:
    """Name a low-pass filter by its key: `fir100`, `fircut100` (clean ends) or `butter100`, the cutoff in seconds."""
    kind = "Butterworth low-pass" if name.startswith("butter") else "FIR low-pass"
    return f"{kind} {name.lstrip('firbutec')} s{', clean ends' if name.startswith('fircut') else ''}"
