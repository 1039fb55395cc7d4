"""One world of the readings of the paper: what the page of the real orbits would record in it."""

from __future__ import annotations

from collections.abc import Mapping

from geokalman.radioastron import outcome

PAGE = "radioastron-orbit/11-real-orbits"
_IMPULSE = {"unloaded": 5e-3, "quiet": 0.0}
_BANDWIDTH = {"wide-16": 16e6, "wide-32": 32e6}


def reading(world: Mapping[str, str | float]) -> outcome.Reading:
    """The reading of a world: choice -> option, or number, as in `book/radioastron-orbit/readings.yml`.

    Raises KeyError for a choice that is missing and an option that is unknown.
    """
    return outcome.Reading(
        orbit=str(world["orbit"]),
        angle=float(world["source"]),
        prior=str(world["prior"]),
        weights=str(world["weights"]),
        bias=str(world["bias"]),
        impulse=_IMPULSE[world["impulse"]],
        bandwidth=_BANDWIDTH[world["bandwidth"]],
        band=str(world["band"]).upper(),
        stage=str(world["stage"]),
    )


def metrics(world: Mapping[str, str | float]) -> dict[str, float]:
    """Run a world at the page's own scale: `notebook:key` -> number, in the units that the page records.

    The draws of a world have its place as their seed, counted so that the default world has the page's.
    """
    found = outcome.numbers(reading(world), seed=1 + int(world.get("world", 0)))
    return {f"{PAGE}:{key}": value for key, (value, _) in found.items()}
