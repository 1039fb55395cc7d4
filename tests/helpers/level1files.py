"""Level-1 files with sound columns, written and edited."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geokalman.attitude import write
from geokalman.attitude.header import END
from geokalman.attitude.model import EPOCH_2019
from geokalman.attitude.products import GRACE_FO, KEYS

DATE = "2019-01-01"
FIXTURES = Path(__file__).parents[1] / "attitude" / "fixtures"


def columns_of(product, n=200, seed=0):
    """Sound columns of any product, times increasing by a second."""
    rng = np.random.default_rng(seed)
    out = {}
    for column in GRACE_FO[product]:
        if column.name in (KEYS.get(product) or ("",))[:1]:
            out[column.name] = EPOCH_2019 + np.arange(n)
        elif column.name == "GRACEFO_id":
            out[column.name] = np.full(n, "C")
        elif column.name == "coord_ref":
            out[column.name] = np.full(n, "I")
        elif column.name in ("gyro_id", "sca_id"):
            out[column.name] = 1 + np.arange(n) % 3
        elif column.kind == "float" and np.isfinite(column.high):
            out[column.name] = rng.uniform(column.low, column.high, n)
        elif column.kind == "int":
            out[column.name] = rng.integers(0, 1000, n)
        elif column.kind == "float":
            out[column.name] = rng.standard_normal(n) * 10.0 ** rng.integers(-12, 6, n)
        elif column.kind == "flags":
            out[column.name] = np.full(n, "00000000")
        else:
            out[column.name] = np.full(n, "S")
    if "quatangle" in out:
        q = rng.standard_normal((n, 4))
        q /= np.linalg.norm(q, axis=1, keepdims=True)
        for name, values in zip(("quatangle", "quaticoeff", "quatjcoeff", "quatkcoeff"), q.T, strict=True):
            out[name] = values
    return out


def written(folder, product="SCA1B", n=200, satellite="C"):
    return write.write(folder, product, satellite, DATE, columns_of(product, n))


def edit(path, change):
    """Apply change(lines) to the lines after the header and write them back."""
    text = path.read_text().splitlines(keepends=True)
    k = next(i for i, line in enumerate(text) if line.strip() == END) + 1
    body = change(text[k:])
    path.write_text("".join(text[:k] + (text[k:] if body is None else body)))
    return k
