"""Reader of the older GRACE Level-1B files in ASCII: header lines "KEY : value" up to END OF HEADER, then the
records.
"""

from __future__ import annotations

import re
from pathlib import Path

from geokalman.attitude.level1 import Level1Error, Table, records, split_name
from geokalman.attitude.products import GRACE

END = "END OF HEADER"


def read_grace(path: Path | str, product: str | None = None) -> Table:
    """Read one GRACE file, `PPPPP_YYYY-MM-DD_S_VV.asc` (S is A, B, or X for both).

    product : what is expected; another one is refused. Records are checked as `level1.read` checks them.
    Raises Level1Error, naming the file and the line; FileNotFoundError.
    """
    path = Path(path)
    parts = split_name(path)
    if product is not None and parts["product"] != product:
        raise Level1Error(f"{path}: product {parts['product']} in the file name, {product} was expected.")
    if parts["product"] not in GRACE:
        raise Level1Error(f"{path}: product {parts['product']} is unknown; known are {', '.join(GRACE)}.")
    header: dict[str, str] = {}
    with open(path, encoding="utf-8", errors="replace") as stream:
        number = 0
        for number, line in enumerate(stream, 1):
            if line.strip() == END:
                break
            key, colon, value = line.partition(":")
            if not colon:
                raise Level1Error(
                    (
                        f"{path}, line {number}: {line.strip()[:40]!r} is no header line `KEY : value`, and no line "
                        f"{END!r} came before it."
                    )
                )
            header.setdefault(key.strip(), value.strip())
        else:
            raise Level1Error(
                f"{path}: no line {END!r}; this is not a GRACE Level-1B file in ASCII, or it is cut short."
            )
        named = Path(header.get("FILENAME", path.name)).name
        if named != path.name and _stem(named) != _stem(path.name):
            raise Level1Error(f"{path}: the header belongs to {named}.")
        promised = header.get("NUMBER OF DATA RECORDS")
        if promised is not None and not re.fullmatch(r"\d{1,12}", promised):
            raise Level1Error(f"{path}: NUMBER OF DATA RECORDS is {promised[:30]!r}, it must be a number of records.")
        return records(
            path,
            parts,
            stream,
            number + 1,
            GRACE[parts["product"]],
            None if promised is None else int(promised),
            header,
        )


def _stem(name: str) -> str:
    """Product, date and satellite of a file name."""
    return name[:18]
