"""Figures of the airborne part: along lines, maps, and drawings of the system.

Every function takes plain arrays and returns a matplotlib Figure, drawn in the theme of `style.theme` that is in force.
"""

from geokalman.airborne.figures.drawings import BLOCKS, STEPS, chain, schematic, system
from geokalman.airborne.figures.lines import (
    Panel,
    consistency,
    downward,
    fir_scan,
    gains,
    gauss_markov,
    per_line,
    repeats,
    six_panels,
    spectra,
    starts,
    steady,
    table_one,
    timings,
)
from geokalman.airborne.figures.maps import along_lines, grids, tracks
from geokalman.airborne.figures.names import NAMES, STARTS, WORLDS, low_pass

__all__ = [
    "BLOCKS",
    "NAMES",
    "STARTS",
    "STEPS",
    "WORLDS",
    "Panel",
    "along_lines",
    "chain",
    "consistency",
    "downward",
    "fir_scan",
    "gains",
    "gauss_markov",
    "grids",
    "low_pass",
    "per_line",
    "repeats",
    "schematic",
    "six_panels",
    "spectra",
    "starts",
    "steady",
    "system",
    "table_one",
    "timings",
    "tracks",
]
