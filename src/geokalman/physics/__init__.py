"""Models of the world that the applications share: orbits, fields, frames, time."""

from geokalman import compilation as _compilation  # noqa: F401  first: it is where compiled functions are kept
