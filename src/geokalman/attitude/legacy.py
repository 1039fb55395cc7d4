"""Reader of GRACE Level-1B files in ASCII: lines "KEY : value" up to END OF HEADER, then records."""

from __future__ import annotations

import re
from pathlib import Path

from geokalman import reading
from geokalman.attitude.header import Level1Error, parts_of, promised, same_epoch, within_day
from geokalman.attitude.level1 import Table, records
from geokalman.attitude.products import GRACE

END = "END OF HEADER"


def read_grace(path: Path | str, product: str | None = None) -> Table:
    """Read one GRACE file, `PPPPP_YYYY-MM-DD_S_VV.asc` (S is A, B, or X for both).

    product : what is expected; another one is refused. Records are checked as `level1.read` checks them.
    Raises Level1Error, naming the file and the line; FileNotFoundError.
    """
    path = Path(path)
    parts = parts_of(path, GRACE, product)
    header: dict[str, str] = {}
    stream = reading.lines(path, "Level-1 file", Level1Error, keep_ends=True)
    for place, line in stream:
        if line.strip().upper() == END:
            break
        key, colon, value = line.partition(":")
        if not colon:
            raise place.error(f"{line.strip()[:40]!r} is no header line `KEY : value`, and no {END!r} came before it.")
        if key.startswith("TIME EPOCH"):
            same_epoch(path, value)
            if re.search(r"\b(UTC|UT1?|TAI|TT)\b", key):
                raise place.error(f"{key.strip()}: times in GPS are needed (TIME EPOCH (GPS TIME)).")
        header.setdefault(key.strip(), value.strip())
    else:
        raise Level1Error(f"{path}: no line {END!r}; this is not a GRACE Level-1B file in ASCII, or it is cut short.")
    named = Path(header.get("FILENAME", path.name)).name
    if named[:18] != path.name[:18]:  # product, date and satellite
        raise Level1Error(f"{path}: the header belongs to {named}.")
    name = re.fullmatch(r"GRACE ([AB])", header.get("SATELLITE NAME", ""))
    if name and parts["satellite"] in "AB" and name[1] != parts["satellite"]:
        raise Level1Error(
            f"{path}: the header's satellite is GRACE {name[1]}, the file name says {parts['satellite']}."
        )
    count = promised(path, header, "NUMBER OF DATA RECORDS")
    schema = within_day(GRACE[parts["product"]], parts["product"], parts["date"])
    return records(path, parts, stream, place.line + 1, schema, count, header)
