"""Spherical harmonics of the Earth's gravity field: the field itself, its spectrum, its geoid."""

from __future__ import annotations

import os
import zipfile

import numpy as np

from geokalman import files
from geokalman.physics.field import GravityField
from geokalman.physics.icgem import read_gfc

__all__ = ["GravityField", "load_field"]

VENDORED = {"EGM96": "egm96.npz", "JGM3": "jgm3.npz"}


def load_field(name_or_path: str | os.PathLike = "EGM96", n_max: int | None = None) -> GravityField:
    """A vendored gravity field by name (`EGM96`, `JGM3`; empty is `EGM96`) or any ICGEM `.gfc` file by its path.

    Parameters
    ----------
    name_or_path : name of a vendored field, in any case, or path of a `.gfc` (`.gfc.gz`) file.
    n_max : degree and order to which the field is wanted; None for all of it.

    Returns
    -------
    GravityField

    Raises
    ------
    ValueError
        n_max below 2 or above the field's degree; GfcError (a ValueError) where the file is damaged.
    FileNotFoundError
        Neither a name nor a file.
    geokalman.files.CorruptedData
        A vendored field that fails its checksum.
    """
    text = os.fspath(name_or_path) or "EGM96"
    vendored = VENDORED.get(text.upper())
    if vendored is not None:
        field = _read_npz(files.data_path(vendored))
    elif not os.path.isfile(text):
        raise FileNotFoundError(f"No gravity field '{text}': it is neither {' nor '.join(VENDORED)} nor an ICGEM file.")
    else:
        field = read_gfc(text)
    return field if n_max is None else field.truncate(n_max)


def _read_npz(path: os.PathLike) -> GravityField:
    """A field in the compact form of `data/scripts/make_egm96.py`: lower triangles, row by row."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            rows, columns = np.tril_indices(int(stored["n_max"]) + 1)
            arrays = {}
            for key in ("C", "S", "sigma_C", "sigma_S"):
                if key in stored:
                    arrays[key] = np.zeros((rows[-1] + 1, rows[-1] + 1))
                    arrays[key][rows, columns] = stored[key]
            return GravityField(
                name=str(stored["name"]),
                gm=float(stored["gm"]),
                radius=float(stored["radius"]),
                tide_system=str(stored["tide_system"]),
                **arrays,
            )
    except (zipfile.BadZipFile, KeyError) as error:
        raise files.CorruptedData(f"{path} is no field made by data/scripts/make_egm96.py: {error}") from None
