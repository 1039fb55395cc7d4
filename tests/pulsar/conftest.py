"""One short flight for all tests of the orbiter: a day, in J2 and in the real field; and a writer of FITS files."""

from types import SimpleNamespace

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest

from geokalman.physics import mars
from geokalman.pulsar import simulate
from geokalman.pulsar.dynamics import j2_force
from geokalman.pulsar.model import Mission, preset


@pytest.fixture(scope="session")
def day():
    """Mission of 60 epochs with its truths, the J2 force, and observations of preset B, seed 0."""
    mission, gravity = Mission(days=60 * 500 / 86400), mars.gravity()
    flight, rich = simulate.fly(mission, gravity), simulate.fly(mission, gravity, 1.0)
    data = simulate.observe(flight, mission, preset("B").world, np.random.default_rng(0))
    return SimpleNamespace(
        mission=mission, gravity=gravity, flight=flight, rich=rich, force=j2_force(gravity), data=data
    )


def card(key, value):
    """One card of a header; bytes are written as they are."""
    if isinstance(value, bytes):
        return f"{key:<8}= {value.decode()}".ljust(80)
    text = "'" + value.replace("'", "''") + "'" if isinstance(value, str) else str(value)
    text = text[0] if isinstance(value, bool) else text
    return f"{key:<8}= {text:>20}".ljust(80)


def blocks(cards):
    text = "".join(card(k, v) for k, v in cards.items() if v is not None) + "END".ljust(80)
    return text.ljust(-(-len(text) // 2880) * 2880).encode("latin-1")


def extension(header, columns):
    """Bytes of one binary table; columns are (name, format, big-endian array, unit if any); None leaves a card out."""
    raw = [np.asarray(c[2]) for c in columns]
    rows = [b"".join(a[i : i + 1].tobytes() for a in raw) for i in range(len(raw[0]) if raw else 0)]
    width = len(rows[0]) if rows else sum(a.dtype.itemsize * int(np.prod(a.shape[1:])) for a in raw)
    cards = {"XTENSION": "BINTABLE", "BITPIX": 8, "NAXIS": 2, "NAXIS1": width, "NAXIS2": len(rows), "PCOUNT": 0,
             "GCOUNT": 1, "TFIELDS": len(columns)}  # fmt: skip
    for k, (name, form, _, *unit) in enumerate(columns, 1):
        cards |= {f"TTYPE{k}": name, f"TFORM{k}": form} | ({f"TUNIT{k}": unit[0]} if unit else {})
    data = b"".join(rows)
    return blocks(cards | header) + data.ljust(-(-len(data) // 2880) * 2880, b"\0")


@pytest.fixture
def fits_bytes():
    """Writer of a FITS file: tables as (header, columns), cards of its first header; returns bytes."""

    def write(*tables, primary=None):
        head = blocks({"SIMPLE": True, "BITPIX": 8, "NAXIS": 0} | (primary or {}))
        return head + b"".join(extension(*table) for table in tables)

    return write


@pytest.fixture
def fits_file(fits_bytes, tmp_path):
    """The same, written to a file; returns its path."""

    def write(*tables, primary=None):
        path = tmp_path / "given.fits"
        path.write_bytes(fits_bytes(*tables, primary=primary))
        return path

    return write
