"""A small ICGEM file with changes."""

import gzip

HEADER = {
    "product_type": "gravity_field",
    "modelname": "TOY",
    "earth_gravity_constant": "0.3986004415E+15",
    "radius": "0.6378136300E+07",
    "max_degree": "2",
    "errors": "no",
    "norm": "fully_normalized",
    "tide_system": "tide_free",
}
ROWS = ["gfc 0 0 1.0 0.0", "gfc 2 0 -4.8e-4 0.0", "gfc 2 1 -1.8e-10 1.2e-9", "gfc 2 2 2.4e-6 -1.4e-6"]


def gfc(folder, rows=ROWS, name="toy.gfc", end=True, before="some words\n", **header):
    lines = [f"{key}   {value}" for key, value in {**HEADER, **header}.items() if value is not None]
    text = before + "\n".join([*lines, *(["end_of_head ======"] if end else []), *rows]) + "\n"
    path = folder / name
    path.write_bytes(gzip.compress(text.encode()) if name.endswith(".gz") else text.encode())
    return path
